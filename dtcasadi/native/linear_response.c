/* dx_(k+1) = A_k dx_k + B_k du_k + c_k from dx_0: A (X x X N) and B (X x U N) hold a block for each
   k side by side, DU is U x N, CK X x N, DX X x (N + 1). */
casadi_int i, k, l;
for (i = 0; i < X; ++i) DX[i] = D0[i];
for (k = 0; k < N; ++k) {
  const casadi_real *a = A + X * X * k, *b = B + X * U * k, *d = DX + X * k, *u = DU + U * k;
  casadi_real *t = DX + X * (k + 1);
  for (i = 0; i < X; ++i) t[i] = CK[X * k + i];
  for (l = 0; l + 4 <= X; l += 4) {
    const casadi_real *f = a + X * l;
    const casadi_real p = d[l], q = d[l + 1], r = d[l + 2], o = d[l + 3];
    for (i = 0; i < X; ++i) t[i] += p * f[i] + q * f[X + i] + r * f[2 * X + i] + o * f[3 * X + i];
  }
  for (; l < X; ++l) for (i = 0; i < X; ++i) t[i] += d[l] * a[X * l + i];
  for (l = 0; l < U; ++l) for (i = 0; i < X; ++i) t[i] += u[l] * b[X * l + i];
}
