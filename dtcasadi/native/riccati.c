/* min sum over k of 1/2 [x; u; 1]^T [Q S^T q; S R r; . . .] [x; u; 1] + 1/2 x_N^T Q_N x_N + q_N^T x_N,
   x_(k+1) = A_k x_k + B_k u_k + c_k, by the Riccati recursion. A (X x X N), B (X x U N), CK (X x N),
   QQ (X x X (N + 1)), SS (U x X N), RR (U x U N), QL (X x (N + 1)), RL (U x N) hold a block for each k
   side by side. u_k = KK_k x_k + KL_k, XX and UU are the solution from X0; BACK 0, or 1 where
   R + B^T P B is not positive definite. */
casadi_real P[X * X], p[X], Y[X * X], Z[X * U], t[X], F[U * U], h[U * (X + 1)];
casadi_int c, i, j, k, l;
BACK[0] = 0;
for (i = 0; i < X * X; ++i) P[i] = QQ[X * X * N + i];
for (i = 0; i < X; ++i) p[i] = QL[X * N + i];
for (k = N; k-- > 0;) {
  const casadi_real *a = A + X * X * k, *b = B + X * U * k, *s = SS + U * X * k;
  /* Y = P A, Z = P B, t = P c + p, columns four at a time. */
  for (c = 0; c < X + U; ++c) {
    const casadi_real *f = c < X ? a + X * c : b + X * (c - X);
    casadi_real *y = c < X ? Y + X * c : Z + X * (c - X);
    for (i = 0; i < X; ++i) y[i] = 0;
    for (l = 0; l + 4 <= X; l += 4) {
      const casadi_real *g = P + X * l;
      const casadi_real e0 = f[l], e1 = f[l + 1], e2 = f[l + 2], e3 = f[l + 3];
      for (i = 0; i < X; ++i)
        y[i] += e0 * g[i] + e1 * g[X + i] + e2 * g[2 * X + i] + e3 * g[3 * X + i];
    }
    for (; l < X; ++l) for (i = 0; i < X; ++i) y[i] += f[l] * P[X * l + i];
  }
  for (i = 0; i < X; ++i) t[i] = p[i];
  for (l = 0; l < X; ++l) for (i = 0; i < X; ++i) t[i] += CK[X * k + l] * P[X * l + i];
  /* F F^T = R + B^T P B; h = -(S + B^T P A | r + B^T t), then F^-T F^-1 h. */
  for (j = 0; j < U; ++j) {
    for (c = 0; c <= X; ++c) {
      const casadi_real *y = c < X ? Y + X * c : t;
      casadi_real v = c < X ? s[U * c + j] : RL[U * k + j];
      for (l = 0; l < X; ++l) v += b[X * j + l] * y[l];
      h[U * c + j] = -v;
    }
    for (i = 0; i <= j; ++i) {
      casadi_real v = RR[U * U * k + U * i + j];
      for (l = 0; l < X; ++l) v += b[X * j + l] * Z[X * i + l];
      for (l = 0; l < i; ++l) v -= F[U * j + l] * F[U * i + l];
      if (i < j) {
        F[U * j + i] = v / F[U * i + i];
      } else {
        if (!(v > 0)) BACK[0] = 1;
        F[U * j + j] = sqrt(v > 0 ? v : 1);
      }
    }
  }
  for (c = 0; c <= X; ++c) {
    casadi_real *v = h + U * c;
    for (j = 0; j < U; ++j) {
      for (l = 0; l < j; ++l) v[j] -= F[U * j + l] * v[l];
      v[j] /= F[U * j + j];
    }
  }
  /* P = Q + A^T P A - (F^-1 h)^T (F^-1 h), its lower half mirrored; p likewise. */
  for (c = 0; c < X; ++c) {
    casadi_real v = QL[X * k + c];
    for (l = 0; l < X; ++l) v += a[X * c + l] * t[l];
    for (j = 0; j < U; ++j) v -= h[U * c + j] * h[U * X + j];
    p[c] = v;
  }
  for (c = 0; c < X; ++c) {
    const casadi_real *y = Y + X * c;
    for (i = c; i + 4 <= X; i += 4) {
      const casadi_real *f = a + X * i;
      casadi_real e0 = 0, e1 = 0, e2 = 0, e3 = 0;
      for (l = 0; l < X; ++l) {
        const casadi_real v = y[l];
        e0 += v * f[l];
        e1 += v * f[X + l];
        e2 += v * f[2 * X + l];
        e3 += v * f[3 * X + l];
      }
      P[X * c + i] = e0;
      P[X * c + i + 1] = e1;
      P[X * c + i + 2] = e2;
      P[X * c + i + 3] = e3;
    }
    for (; i < X; ++i) {
      casadi_real v = 0;
      for (l = 0; l < X; ++l) v += y[l] * a[X * i + l];
      P[X * c + i] = v;
    }
    for (i = c; i < X; ++i) {
      casadi_real v = P[X * c + i] + QQ[X * X * k + X * c + i];
      for (j = 0; j < U; ++j) v -= h[U * c + j] * h[U * i + j];
      P[X * c + i] = P[X * i + c] = v;
    }
  }
  for (c = 0; c <= X; ++c) {
    casadi_real *v = h + U * c;
    for (j = U; j-- > 0;) {
      for (l = j + 1; l < U; ++l) v[j] -= F[U * l + j] * v[l];
      v[j] /= F[U * j + j];
    }
  }
  for (i = 0; i < U * X; ++i) KK[U * X * k + i] = h[i];
  for (j = 0; j < U; ++j) KL[U * k + j] = h[U * X + j];
}
for (i = 0; i < X; ++i) XX[i] = X0[i];
for (k = 0; k < N; ++k) {
  const casadi_real *x = XX + X * k;
  casadi_real *u = UU + U * k, *next = XX + X * (k + 1);
  for (j = 0; j < U; ++j) u[j] = KL[U * k + j];
  for (l = 0; l < X; ++l) for (j = 0; j < U; ++j) u[j] += KK[U * X * k + U * l + j] * x[l];
  for (i = 0; i < X; ++i) next[i] = CK[X * k + i];
  for (l = 0; l < X; ++l) for (i = 0; i < X; ++i) next[i] += x[l] * A[X * X * k + X * l + i];
  for (l = 0; l < U; ++l) for (i = 0; i < X; ++i) next[i] += u[l] * B[X * U * k + X * l + i];
}
