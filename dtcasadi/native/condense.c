/* Condensing: dx_(k+1) = A_k dx_k + B_k v_b(k), states eliminated from a quadratic program.
   A (X x X N), B (X x U N), D (R x X N) and E (G x X N) hold a block for each k side by side, D and E
   of the states k = 1 ... N; WEIGHT (R x N), P (X + U square), BLOCK[k] the block of commands of
   interval k, V = U times their number. With S_k = d x_k/d v,
   HH = sum over k of (D_k S_k)^T W_k (D_k S_k) + [S_N; last]^T P [S_N; last],
   and JT, CT (a row D_k S_k, E_k S_k contiguous, V each), S = S_N. */
casadi_real Y[(X + U) * V], t[X];
casadi_int c, i, j, k, l, m, n = 0;
for (i = 0; i < X * V; ++i) S[i] = 0;
for (i = 0; i < V * V; ++i) HH[i] = 0;
for (i = 0; i < V * R * N; ++i) JT[i] = 0;
for (i = 0; i < V * G * N; ++i) CT[i] = 0;
for (k = 0; k < N; ++k) {
  const casadi_real *a = A + X * X * k, *b = B + X * U * k;
  const casadi_int first = U * (casadi_int) BLOCK[k];
  for (c = 0; c < n; ++c) {
    casadi_real *s = S + X * c;
    for (i = 0; i < X; ++i) t[i] = 0;
    for (l = 0; l + 4 <= X; l += 4) {
      const casadi_real *f = a + X * l;
      const casadi_real p = s[l], q = s[l + 1], r = s[l + 2], o = s[l + 3];
      for (i = 0; i < X; ++i) t[i] += p * f[i] + q * f[X + i] + r * f[2 * X + i] + o * f[3 * X + i];
    }
    for (; l < X; ++l) for (i = 0; i < X; ++i) t[i] += s[l] * a[X * l + i];
    for (i = 0; i < X; ++i) s[i] = t[i];
  }
  n = first + U;
  for (j = 0; j < U; ++j) for (i = 0; i < X; ++i) S[X * (first + j) + i] += b[X * j + i];
  for (m = 0; m < R + G; ++m) {
    const casadi_real *d = m < R ? D + R * X * k + m : E + G * X * k + (m - R);
    const casadi_int gap = m < R ? R : G;
    casadi_real *row = m < R ? JT + V * (R * k + m) : CT + V * (G * k + (m - R));
    for (c = 0; c + 4 <= n; c += 4) {
      const casadi_real *s = S + X * c;
      casadi_real p = 0, q = 0, r = 0, o = 0;
      for (l = 0; l < X; ++l) {
        const casadi_real e = d[gap * l];
        p += e * s[l];
        q += e * s[X + l];
        r += e * s[2 * X + l];
        o += e * s[3 * X + l];
      }
      row[c] = p;
      row[c + 1] = q;
      row[c + 2] = r;
      row[c + 3] = o;
    }
    for (; c < n; ++c) {
      casadi_real p = 0;
      for (l = 0; l < X; ++l) p += d[gap * l] * S[X * c + l];
      row[c] = p;
    }
    if (m >= R) continue;
    for (j = 0; j < n; ++j) {
      const casadi_real e = WEIGHT[R * k + m] * row[j];
      for (c = j; c < n; ++c) HH[V * j + c] += e * row[c];
    }
  }
}
/* Y = P [S; last], H += [S; last]^T Y; nothing to do without a terminal cost. */
for (i = 0; i < (X + U) * (X + U) && P[i] == 0; ++i) continue;
for (c = 0; c < V && i < (X + U) * (X + U); ++c) {
  casadi_real *y = Y + (X + U) * c;
  const casadi_real *s = S + X * c;
  for (j = 0; j < X + U; ++j) y[j] = c >= V - U ? P[(X + U) * (X + c - V + U) + j] : 0;
  for (l = 0; l < X; ++l) for (j = 0; j < X + U; ++j) y[j] += s[l] * P[(X + U) * l + j];
  for (j = 0; j <= c; ++j) {
    casadi_real p = j >= V - U ? y[X + j - V + U] : 0;
    for (l = 0; l < X; ++l) p += S[X * j + l] * y[l];
    HH[V * j + c] += p;
  }
}
for (j = 0; j < V; ++j) for (c = j + 1; c < V; ++c) HH[V * c + j] = HH[V * j + c];
