/* X with A X = B from the factors of lu_factor.c; M right-hand sides, held by rows meanwhile. */
casadi_real Y[N * M];
casadi_int i, j, k;
for (j = 0; j < M; ++j) for (i = 0; i < N; ++i) Y[i * M + j] = B[j * N + i];
#ifdef DTC_LANES
for (k = 0; k < N; ++k)
  for (i = k + 1; i < N && dtc_any(P[k] != k); ++i)
    if (dtc_any(P[k] == i))
      for (j = 0; j < M; ++j) dtc_swap(P[k] == i, &Y[k * M + j], &Y[i * M + j]);
#else
for (k = 0; k < N; ++k) {
  casadi_int other = (casadi_int) P[k];
  if (other != k) {
    for (j = 0; j < M; ++j) {
      casadi_real r = Y[k * M + j];
      Y[k * M + j] = Y[other * M + j];
      Y[other * M + j] = r;
    }
  }
}
#endif
for (i = 1; i < N; ++i) {
  for (k = 0; k < i; ++k) {
    casadi_real l = LU[i * N + k];
    for (j = 0; j < M; ++j) Y[i * M + j] -= l * Y[k * M + j];
  }
}
for (i = N; i-- > 0;) {
  casadi_real r = 1 / LU[i * N + i];
  for (k = i + 1; k < N; ++k) {
    casadi_real l = LU[i * N + k];
    for (j = 0; j < M; ++j) Y[i * M + j] -= l * Y[k * M + j];
  }
  for (j = 0; j < M; ++j) Y[i * M + j] *= r;
}
for (j = 0; j < M; ++j) for (i = 0; i < N; ++i) X[j * N + i] = Y[i * M + j];
