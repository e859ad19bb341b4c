/* Measurement update of z (N) and P (N x N) by M readings: e = y - h, H (M x N), R (M x M).
   Square-root form: P = L L^T, readings made independent by the Cholesky factor of R, and taken one
   by one (Carlson 1973), so that P stays positive definite. A reading that is not a finite number
   counts for nothing. LIMITS[m] is the largest e^T S^-1 e for which m readings are believed; beyond
   it z and P stay. BACK: gives e^T S^-1 e, the number of finite readings, 1 if believed. */
casadi_real L[N * N], U[M * M], V[M * N], d[M], f[N], g[N], z[N], a[N + 1], b[N], c[N];
casadi_real nis = 0;
casadi_int used[M];
casadi_int i, j, k, m, count = 0;
for (m = 0; m < M; ++m) {
  used[m] = E[m] - E[m] == 0;
  count += used[m];
}
/* U: rows of the factor of R; whitened readings d, V (a row for each, contiguous). */
for (m = 0; m < M; ++m) {
  casadi_real e = used[m] ? E[m] : 0;
  for (j = 0; j < N; ++j) V[N * m + j] = used[m] ? H[M * j + m] : 0;
  for (k = 0; k < m; ++k) {
    casadi_real s = used[m] && used[k] ? R[M * k + m] : 0;
    for (j = 0; j < k; ++j) s -= U[M * m + j] * U[M * k + j];
    s /= U[M * k + k];
    U[M * m + k] = s;
    if (s == 0) continue;
    e -= s * d[k];
    for (j = 0; j < N; ++j) V[N * m + j] -= s * V[N * k + j];
  }
  {
    casadi_real s = used[m] ? R[M * m + m] : 1, r;
    for (j = 0; j < m; ++j) s -= U[M * m + j] * U[M * m + j];
    U[M * m + m] = sqrt(s);
    r = 1 / U[M * m + m];
    d[m] = e * r;
    for (j = 0; j < N; ++j) V[N * m + j] *= r;
  }
}
/* P = L L^T; a pivot lost to round-off is raised to it, as process noise would. */
for (j = 0; j < N; ++j) {
  casadi_real s, r, least = P[N * j + j] * (sizeof(casadi_real) == 4 ? 1e-6 : 1e-15);
  for (i = j; i < N; ++i) g[i] = P[N * j + i];
  for (k = 0; k < j; ++k) {
    const casadi_real l = L[N * k + j];
    for (i = j; i < N; ++i) g[i] -= l * L[N * k + i];
  }
  s = g[j] > least ? g[j] : least;
  r = s > 0 ? 1 / sqrt(s) : 0;
  L[N * j + j] = s > 0 ? sqrt(s) : 0;
  for (i = j + 1; i < N; ++i) L[N * j + i] = g[i] * r;
}
for (i = 0; i < N; ++i) z[i] = 0;
for (m = 0; m < M; ++m) {
  const casadi_real *v = V + N * m;
  casadi_real e = d[m];
  if (!used[m]) continue;
  for (j = 0; j < N; ++j) {
    casadi_real s = 0;
    for (i = j; i < N; ++i) s += L[N * j + i] * v[i];
    f[j] = s;
    g[j] = 0;
    e -= v[j] * z[j];
  }
  a[N] = 1;
  for (j = N; j-- > 0;) a[j] = a[j + 1] + f[j] * f[j];
  for (j = 0; j < N; ++j) {
    b[j] = sqrt(a[j + 1] / a[j]);
    c[j] = f[j] / (b[j] * a[j]);
  }
  for (j = N; j-- > 0;) {
    casadi_real *l = L + N * j;
    const casadi_real bj = b[j], cj = c[j], fj = f[j];
    for (i = j; i < N; ++i) {
      const casadi_real old = l[i];
      l[i] = bj * old - cj * g[i];
      g[i] += fj * old;
    }
  }
  nis += e * e / a[0];
  for (i = 0; i < N; ++i) z[i] += g[i] * (e / a[0]);
}
BACK[0] = nis;
BACK[1] = (casadi_real) count;
BACK[2] = nis <= LIMITS[count];
if (nis <= LIMITS[count]) {
  for (i = 0; i < N; ++i) ZN[i] = Z[i] + z[i];
  for (j = 0; j < N; ++j) {
    for (i = j; i < N; ++i) g[i] = 0;
    for (k = 0; k <= j; ++k) {
      const casadi_real l = L[N * k + j];
      for (i = j; i < N; ++i) g[i] += l * L[N * k + i];
    }
    for (i = j; i < N; ++i) PN[N * j + i] = PN[N * i + j] = g[i];
  }
} else {
  for (i = 0; i < N; ++i) ZN[i] = Z[i];
  for (i = 0; i < N * N; ++i) PN[i] = P[i];
}
