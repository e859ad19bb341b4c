/* PN = [F; 0 I] P [F; 0 I]^T + G G^T in the first X rows and columns + Q, symmetric to the last bit.
   F is X x N, G X x W, P, Q and PN N x N, column-major; the last N - X states stay as they are.
   Four columns at a time keep the inner loops, which run over contiguous memory, busy. */
casadi_real T[X * N], S[X];
casadi_int i, j, k;
for (j = 0; j < N; ++j) {
  casadi_real *t = T + X * j;
  const casadi_real *p = P + N * j;
  for (i = 0; i < X; ++i) t[i] = 0;
  for (k = 0; k + 4 <= N; k += 4) {
    const casadi_real *f = F + X * k;
    const casadi_real a = p[k], b = p[k + 1], c = p[k + 2], d = p[k + 3];
    for (i = 0; i < X; ++i)
      t[i] += a * f[i] + b * f[X + i] + c * f[2 * X + i] + d * f[3 * X + i];
  }
  for (; k < N; ++k) for (i = 0; i < X; ++i) t[i] += p[k] * F[X * k + i];
}
for (j = 0; j < X; ++j) {
  for (i = j; i < X; ++i) S[i] = 0;
  for (k = 0; k + 4 <= N; k += 4) {
    const casadi_real *t = T + X * k, *f = F + X * k + j;
    const casadi_real a = f[0], b = f[X], c = f[2 * X], d = f[3 * X];
    for (i = j; i < X; ++i)
      S[i] += a * t[i] + b * t[X + i] + c * t[2 * X + i] + d * t[3 * X + i];
  }
  for (; k < N; ++k) for (i = j; i < X; ++i) S[i] += F[X * k + j] * T[X * k + i];
  for (k = 0; k < W; ++k) for (i = j; i < X; ++i) S[i] += G[X * k + j] * G[X * k + i];
  for (i = j; i < X; ++i) PN[N * j + i] = PN[N * i + j] = S[i] + Q[N * j + i];
}
for (j = X; j < N; ++j) {
  for (i = 0; i < X; ++i) PN[N * j + i] = PN[N * i + j] = T[X * j + i] + Q[N * j + i];
  for (i = X; i < N; ++i) PN[N * j + i] = P[N * j + i] + Q[N * j + i];
}
