/* C = A B, A N x K, B K x M, all column-major. Four columns of A at a time keep the inner loop, which
   runs over contiguous memory, busy. */
casadi_int i, j, k;
for (j = 0; j < M; ++j) {
  casadi_real *c = C + N * j;
  for (i = 0; i < N; ++i) c[i] = 0;
  for (k = 0; k + 4 <= K; k += 4) {
    const casadi_real *a = A + N * k, *b = B + K * j + k;
    const casadi_real p = b[0], q = b[1], r = b[2], s = b[3];
    for (i = 0; i < N; ++i) c[i] += p * a[i] + q * a[N + i] + r * a[2 * N + i] + s * a[3 * N + i];
  }
  for (; k < K; ++k) for (i = 0; i < N; ++i) c[i] += B[K * j + k] * A[N * k + i];
}
