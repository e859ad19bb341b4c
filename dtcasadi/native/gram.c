/* P = Q + A A^T, symmetric to the last bit: A is N x M, P and Q N x N, column-major. Four columns at
   a time keep the inner loops, which run over contiguous memory, busy. */
casadi_int i, j, k;
for (j = 0; j < N; ++j) {
  casadi_real *p = P + N * j;
  for (i = j; i < N; ++i) p[i] = Q[N * j + i];
  for (k = 0; k + 4 <= M; k += 4) {
    const casadi_real *a = A + N * k;
    const casadi_real e0 = a[j], e1 = a[N + j], e2 = a[2 * N + j], e3 = a[3 * N + j];
    for (i = j; i < N; ++i)
      p[i] += e0 * a[i] + e1 * a[N + i] + e2 * a[2 * N + i] + e3 * a[3 * N + i];
  }
  for (; k < M; ++k) for (i = j; i < N; ++i) p[i] += A[N * k + j] * A[N * k + i];
  for (i = j + 1; i < N; ++i) P[N * i + j] = p[i];
}
