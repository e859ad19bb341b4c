/* X with A X = B for symmetric positive definite A (N x N) and M right-hand sides, by Cholesky.
   Column-major in and out; the right-hand sides are held by rows, so that the inner loops run over
   contiguous memory. A pivot that is not positive makes X NaN. */
casadi_real L[N * N], d[N], Y[N * M];
casadi_int i, j, k;
for (j = 0; j < N; ++j) for (i = j; i < N; ++i) L[i * N + j] = A[j * N + i];
for (j = 0; j < N; ++j) {
  casadi_real s = L[j * N + j];
  for (k = 0; k < j; ++k) s -= L[j * N + k] * L[j * N + k];
  d[j] = 1 / sqrt(s);
  for (i = j + 1; i < N; ++i) {
    casadi_real r = L[i * N + j];
    for (k = 0; k < j; ++k) r -= L[i * N + k] * L[j * N + k];
    L[i * N + j] = r * d[j];
  }
}
for (j = 0; j < M; ++j) for (i = 0; i < N; ++i) Y[i * M + j] = B[j * N + i];
for (i = 0; i < N; ++i) {
  for (k = 0; k < i; ++k) {
    casadi_real l = L[i * N + k];
    for (j = 0; j < M; ++j) Y[i * M + j] -= l * Y[k * M + j];
  }
  for (j = 0; j < M; ++j) Y[i * M + j] *= d[i];
}
for (i = N; i-- > 0;) {
  for (k = i + 1; k < N; ++k) {
    casadi_real l = L[k * N + i];
    for (j = 0; j < M; ++j) Y[i * M + j] -= l * Y[k * M + j];
  }
  for (j = 0; j < M; ++j) Y[i * M + j] *= d[i];
}
for (j = 0; j < M; ++j) for (i = 0; i < N; ++i) X[j * N + i] = Y[i * M + j];
