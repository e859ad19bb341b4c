/* Kalman's update by K readings whose images ROWS (K x (2 M + 1)) of the points along a root L
   (N x M) `cloud.c` gave: the first M columns D are linear in the root's, the rest is noise like
   R. With S = D D^T + rest rest^T + R and W = L D^T S^-1, Z (N) = W E, and ROOT (N x (M + K)) holds
   L - W D and W times the Cholesky factor of rest rest^T + R: Joseph's form, ROOT ROOT^T is the
   covariance that is left. FIT (K): D D^T S^-1 E, how far the readings go with Z if they are linear.
   BACK: E^T S^-1 E, not a number where a pivot is not positive. */
casadi_real F[2 * K * K], t[K], X[N * K], V[N * K];
casadi_int c, i, j, l, half;
for (half = 0; half < 2; ++half) {
  casadi_real *f = F + K * K * half;
  for (i = 0; i < K * K; ++i) f[i] = half ? F[i] : R[i];
  for (c = half ? 0 : M; c < (half ? M : 2 * M + 1); ++c)
    for (j = 0; j < K; ++j)
      for (i = j; i < K; ++i) f[K * j + i] += ROWS[K * c + j] * ROWS[K * c + i];
}
/* Lower factors, column by column. */
for (half = 0; half < 2; ++half) {
  casadi_real *f = F + K * K * half;
  for (j = 0; j < K; ++j) {
    for (l = 0; l < j; ++l) for (i = j; i < K; ++i) f[K * j + i] -= f[K * l + j] * f[K * l + i];
    f[K * j + j] = sqrt(f[K * j + j]);
    for (i = j + 1; i < K; ++i) f[K * j + i] /= f[K * j + j];
  }
}
{
  const casadi_real *g = F + K * K;
  casadi_real nis = 0;
  for (i = 0; i < N * K; ++i) X[i] = 0;
  for (c = 0; c < M; ++c)
    for (j = 0; j < K; ++j)
      for (i = 0; i < N; ++i) X[N * j + i] += ROWS[K * c + j] * L[N * c + i];
  for (i = 0; i < N; ++i) Z[i] = 0;
  for (j = 0; j < K; ++j) {
    casadi_real s = E[j];
    for (l = 0; l < j; ++l) {
      s -= g[K * l + j] * t[l];
      for (i = 0; i < N; ++i) X[N * j + i] -= g[K * l + j] * X[N * l + i];
    }
    t[j] = s / g[K * j + j];
    nis += t[j] * t[j];
    for (i = 0; i < N; ++i) X[N * j + i] /= g[K * j + j];
    for (i = 0; i < N; ++i) Z[i] += t[j] * X[N * j + i];
  }
  BACK[0] = nis;
  for (j = K; j-- > 0;) {
    for (l = j + 1; l < K; ++l) t[j] -= g[K * j + l] * t[l];
    t[j] /= g[K * j + j];
  }
  for (j = 0; j < K; ++j) FIT[j] = 0;
  for (c = 0; c < M; ++c) {
    casadi_real along = 0;
    for (j = 0; j < K; ++j) along += ROWS[K * c + j] * t[j];
    for (j = 0; j < K; ++j) FIT[j] += ROWS[K * c + j] * along;
  }
  for (j = K; j-- > 0;) {
    for (i = 0; i < N; ++i) V[N * j + i] = X[N * j + i];
    for (l = j + 1; l < K; ++l)
      for (i = 0; i < N; ++i) V[N * j + i] -= g[K * j + l] * V[N * l + i];
    for (i = 0; i < N; ++i) V[N * j + i] /= g[K * j + j];
  }
}
for (c = 0; c < M; ++c) {
  for (i = 0; i < N; ++i) ROOT[N * c + i] = L[N * c + i];
  for (j = 0; j < K; ++j)
    for (i = 0; i < N; ++i) ROOT[N * c + i] -= ROWS[K * c + j] * V[N * j + i];
}
for (l = 0; l < K; ++l) {
  casadi_real *r = ROOT + N * (M + l);
  for (i = 0; i < N; ++i) r[i] = 0;
  for (j = l; j < K; ++j) for (i = 0; i < N; ++i) r[i] += F[K * l + j] * V[N * j + i];
}
