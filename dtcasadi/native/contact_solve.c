/* Impulses P (3 M) of M contacts with Coulomb friction, and DX = W^-1 (J^T; 0) P: u = G P + B with
   G = SHARE J W^-1 (J^T; 0), and for each contact
   0 <= u_n  _|_  P_n >= 0, and P_t in the disc of radius MU P_n opposing u_t (or u_t = 0).
   Gauss-Seidel sweeps, then semismooth Newton steps on the natural map (Alart and Curnier 1991)
   with a line search, or a jump into the cone where that leads nowhere, over and over until it is
   solved or ROUNDS are spent. WHO: 0 where there is
   no contact. RES: largest defect of the natural map over the largest impulse. */
casadi_real G[9 * M * M], X[3 * M * NW], LU[NW * NW], u[3 * M], F[3 * M], trial[3 * M], step[3 * M], best[3 * M], least = 1e300, A[9 * M * M], rho[2 * M];
casadi_real defect, scale = 0, top = 0, ridge;
casadi_int index[3 * M], kind[M];
casadi_int i, j, k, s, round, sweep, count;
count = 0;
for (s = 0; s < M; ++s) {
  if (WHO[s] > 0 && B[3 * s] < 0) count = 1;
  for (k = 0; k < 3; ++k) P[3 * s + k] = best[3 * s + k] = 0;
}
RES[0] = 0;
for (i = 0; i < NW; ++i) DX[i] = 0;
if (count) {
for (j = 0; j < 3 * M; ++j) for (i = 0; i < NW; ++i) X[j * NW + i] = i < NV ? J[i * 3 * M + j] : 0;
for (i = 0; i < NW * NW; ++i) LU[i] = W[i];
for (k = 0; k < NW; ++k) {
  casadi_int most = k;
  casadi_real r;
  for (i = k + 1; i < NW; ++i) if (fabs(LU[k * NW + i]) > fabs(LU[k * NW + most])) most = i;
  if (most != k) {
    for (j = 0; j < NW; ++j) {
      r = LU[j * NW + k];
      LU[j * NW + k] = LU[j * NW + most];
      LU[j * NW + most] = r;
    }
    for (j = 0; j < 3 * M; ++j) {
      r = X[j * NW + k];
      X[j * NW + k] = X[j * NW + most];
      X[j * NW + most] = r;
    }
  }
  for (i = k + 1; i < NW; ++i) LU[k * NW + i] /= LU[k * NW + k];
  for (j = k + 1; j < NW; ++j)
    for (i = k + 1; i < NW; ++i) LU[j * NW + i] -= LU[k * NW + i] * LU[j * NW + k];
}
for (j = 0; j < 3 * M; ++j) {
  casadi_real *x = X + j * NW;
  if (!(WHO[j / 3] > 0)) continue;
  for (k = 0; k < NW; ++k) for (i = k + 1; i < NW; ++i) x[i] -= LU[k * NW + i] * x[k];
  for (k = NW; k-- > 0;) {
    x[k] /= LU[k * NW + k];
    for (i = 0; i < k; ++i) x[i] -= LU[k * NW + i] * x[k];
  }
}
for (j = 0; j < 3 * M; ++j) {
  for (i = 0; i < 3 * M; ++i) {
    casadi_real sum = 0;
    if (WHO[j / 3] > 0 && WHO[i / 3] > 0)
      for (k = 0; k < NV; ++k) sum += J[k * 3 * M + i] * X[j * NW + k];
    G[j * 3 * M + i] = SHARE[0] * sum;
  }
  top = fmax(top, G[j * 3 * M + j]);
}
ridge = 1e-9 * top;
for (s = 0; s < M; ++s) {
  const casadi_real *g = G + 3 * s * 3 * M + 3 * s;
  const casadi_real across = fmax(g[3 * M + 1], g[6 * M + 2]) + fabs(g[3 * M + 2]);
  rho[2 * s] = 1 / (g[0] + ridge + 1e-300);
  rho[2 * s + 1] = 1 / (across + ridge + 1e-300);
  kind[s] = WHO[s] > 0 && g[0] > ridge;
  if (kind[s] && B[3 * s] < 0)
    for (k = 0; k < 3; ++k) scale = fmax(scale, fabs(B[3 * s + k]) * rho[2 * s]);
}
defect = 1e300;
for (round = 0; round < ROUNDS && scale > 0; ++round) {
  casadi_int newton;
  for (i = 0; i < 3 * M; ++i) {
    u[i] = B[i];
    for (j = 0; j < 3 * M; ++j) u[i] += G[j * 3 * M + i] * P[j];
  }
  for (sweep = 0; sweep < SWEEPS; ++sweep) {
    for (s = 0; s < M; ++s) {
      casadi_real change[3], old[3], length;
      if (!kind[s]) continue;
      for (k = 0; k < 3; ++k) old[k] = P[3 * s + k];
      P[3 * s] = fmax(old[0] - rho[2 * s] * u[3 * s], 0);
      change[0] = P[3 * s] - old[0];
      for (k = 1; k < 3; ++k) {
        const casadi_real now = u[3 * s + k] + G[3 * s * 3 * M + 3 * s + k] * change[0];
        P[3 * s + k] = old[k] - rho[2 * s + 1] * now;
      }
      length = sqrt(P[3 * s + 1] * P[3 * s + 1] + P[3 * s + 2] * P[3 * s + 2]);
      if (length > MU[s] * P[3 * s])
        for (k = 1; k < 3; ++k) P[3 * s + k] *= MU[s] * P[3 * s] / length;
      for (k = 0; k < 3; ++k) {
        change[k] = P[3 * s + k] - old[k];
        if (change[k] != 0)
          for (i = 0; i < 3 * M; ++i) u[i] += G[(3 * s + k) * 3 * M + i] * change[k];
      }
    }
  }
  for (i = 0; i < 3 * M; ++i) trial[i] = P[i];
  defect = 1e300;
  for (newton = 0; newton < NEWTON; ++newton) {
    casadi_real share = 1;
    casadi_int halving;
    for (halving = 0; halving <= HALVINGS; ++halving) {
      casadi_real now = 0;
      if (halving == HALVINGS) share = 1;
      if (newton > 0) for (i = 0; i < 3 * M; ++i) trial[i] = P[i] + share * step[i];
      for (s = 0; s < M; ++s) {
        casadi_real length;
        if (!kind[s]) { for (k = 0; k < 3; ++k) F[3 * s + k] = 0; continue; }
        if (halving == HALVINGS) {
          casadi_real *t = trial + 3 * s;
          t[0] = fmax(t[0], 0);
          length = sqrt(t[1] * t[1] + t[2] * t[2]);
          if (length > MU[s] * t[0]) for (k = 1; k < 3; ++k) t[k] *= MU[s] * t[0] / length;
        }
      }
      for (s = 0; s < M; ++s) {
        casadi_real tau[3], length, radius;
        if (!kind[s]) continue;
        for (k = 0; k < 3; ++k) {
          casadi_real sum = B[3 * s + k];
          for (j = 0; j < 3 * M; ++j) sum += G[j * 3 * M + 3 * s + k] * trial[j];
          u[3 * s + k] = sum;
          tau[k] = trial[3 * s + k] - rho[2 * s + (k > 0)] * sum;
        }
        F[3 * s] = trial[3 * s] - fmax(tau[0], 0);
        radius = MU[s] * fmax(tau[0], 0);
        length = sqrt(tau[1] * tau[1] + tau[2] * tau[2]);
        for (k = 1; k < 3; ++k)
          F[3 * s + k] = trial[3 * s + k] - (length > radius ? tau[k] * radius / length : tau[k]);
        for (k = 0; k < 3; ++k) now = fmax(now, fabs(F[3 * s + k]));
      }
      if (newton == 0 || halving == HALVINGS || now < (1 - 0.1 * share) * defect) {
        defect = now;
        break;
      }
      share /= 2;
    }
    for (i = 0; i < 3 * M; ++i) P[i] = trial[i];
    if (defect < least) {
      least = defect;
      for (i = 0; i < 3 * M; ++i) best[i] = P[i];
    }
    if (defect <= 1e-15 * scale) break;
    /* Rows of the natural map's derivative for contacts that push or slide. */
    count = 0;
    for (s = 0; s < M; ++s)
      if (kind[s] && P[3 * s] - rho[2 * s] * u[3 * s] > 0)
        for (k = 0; k < 3; ++k) index[count++] = 3 * s + k;
    for (i = 0; i < 3 * M; ++i) step[i] = -F[i];
    for (s = 0; s < M; ++s)
      if (!(kind[s] && P[3 * s] - rho[2 * s] * u[3 * s] > 0))
        for (k = 0; k < 3; ++k) step[3 * s + k] = -P[3 * s + k];
    for (i = 0; i < count; i += 3) {
      const casadi_int at = index[i];
      const casadi_real pn = rho[2 * (at / 3)], pt = rho[2 * (at / 3) + 1], mu = MU[at / 3];
      const casadi_real t1 = P[at + 1] - pt * u[at + 1], t2 = P[at + 2] - pt * u[at + 2];
      const casadi_real radius = mu * (P[at] - pn * u[at]), length = sqrt(t1 * t1 + t2 * t2);
      const casadi_int slides = length > radius;
      const casadi_real s1 = slides ? t1 / length : 0, s2 = slides ? t2 / length : 0;
      const casadi_real q = slides ? radius / length : 1;
      const casadi_real a11 = q * (1 - s1 * s1), a12 = -q * s1 * s2, a22 = q * (1 - s2 * s2);
      for (j = 0; j < count; ++j) {
        const casadi_int of = index[j];
        const casadi_real d0 = at == of, d1 = at + 1 == of, d2 = at + 2 == of;
        const casadi_real *g = G + of * 3 * M + at;
        const casadi_real n0 = d0 - pn * (g[0] + ridge * d0);
        const casadi_real n1 = d1 - pt * (g[1] + ridge * d1), n2 = d2 - pt * (g[2] + ridge * d2);
        A[(i + 0) * count + j] = d0 - n0;
        A[(i + 1) * count + j] = d1 - a11 * n1 - a12 * n2 - s1 * mu * n0;
        A[(i + 2) * count + j] = d2 - a12 * n1 - a22 * n2 - s2 * mu * n0;
      }
      /* Contacts that let go change those that stay. */
      for (s = 0; s < M; ++s) {
        casadi_int gone = 3 * s;
        if (!kind[s] || P[gone] - rho[2 * s] * u[gone] > 0) continue;
        for (k = 0; k < 3; ++k) {
          const casadi_real *g = G + (gone + k) * 3 * M + at, d = step[gone + k];
          if (d == 0) continue;
          step[at] -= pn * g[0] * d;
          step[at + 1] -= (a11 * pt * g[1] + a12 * pt * g[2] + s1 * mu * pn * g[0]) * d;
          step[at + 2] -= (a12 * pt * g[1] + a22 * pt * g[2] + s2 * mu * pn * g[0]) * d;
        }
      }
    }
    for (i = 0; i < count; ++i) trial[i] = step[index[i]];
    for (k = 0; k < count; ++k) {
      casadi_int best = k;
      casadi_real pivot;
      for (i = k + 1; i < count; ++i)
        if (fabs(A[i * count + k]) > fabs(A[best * count + k])) best = i;
      if (best != k) {
        for (j = k; j < count; ++j) {
          pivot = A[k * count + j];
          A[k * count + j] = A[best * count + j];
          A[best * count + j] = pivot;
        }
        pivot = trial[k];
        trial[k] = trial[best];
        trial[best] = pivot;
      }
      pivot = A[k * count + k];
      if (pivot == 0) pivot = A[k * count + k] = 1;
      for (i = k + 1; i < count; ++i) {
        const casadi_real l = A[i * count + k] / pivot;
        if (l == 0) continue;
        for (j = k + 1; j < count; ++j) A[i * count + j] -= l * A[k * count + j];
        trial[i] -= l * trial[k];
      }
    }
    for (k = count; k-- > 0;) {
      for (j = k + 1; j < count; ++j) trial[k] -= A[k * count + j] * trial[j];
      trial[k] /= A[k * count + k];
    }
    for (i = 0; i < count; ++i) step[index[i]] = trial[i];
  }
  for (i = 0; i < 3 * M; ++i) P[i] = best[i];
  /* Into the cone, exactly. */
  for (s = 0; s < M; ++s) {
    casadi_real length;
    P[3 * s] = fmax(P[3 * s], 0);
    length = sqrt(P[3 * s + 1] * P[3 * s + 1] + P[3 * s + 2] * P[3 * s + 2]);
    if (length > MU[s] * P[3 * s])
      for (k = 1; k < 3; ++k) P[3 * s + k] *= MU[s] * P[3 * s] / length;
  }
  for (i = 0; i < 3 * M; ++i) scale = fmax(scale, P[i]);
  RES[0] = least / scale;
  if (least <= 1e-11 * scale) break;
}
for (j = 0; j < 3 * M; ++j)
  if (P[j] != 0) for (i = 0; i < NW; ++i) DX[i] += X[j * NW + i] * P[j];
}
