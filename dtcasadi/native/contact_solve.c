/* Impulses P (3 M) of M contacts with Coulomb friction, and DX = W^-1 (J^T; 0) P: u = G P + B with
   G = SHARE J W^-1 (J^T; 0), and for each contact
   0 <= u_n  _|_  P_n >= 0, and P_t in the disc of radius MU P_n opposing u_t (or u_t = 0).
   LU and PIVOT: factors of W (lu_factor.c). WHO: 0 where there is no contact. ROWS: 3, or 1 for
   normal impulses alone. Gauss-Seidel sweeps, then semismooth Newton steps on the natural map
   (Alart and Curnier 1991) with a line search, or a jump into the cone where that leads nowhere;
   then, until it is solved or ROUNDS are spent, the same from proximal points: solutions with
   G + eps I and B - eps P for the last such P, eps halved each time. All on arrays of the n
   contacts there are.
   RES: largest defect of the natural map over the largest impulse. */
casadi_real G[ROWS * M * ROWS * M], Y[NW * ROWS * M], T[NV * ROWS * M], b[ROWS * M], p[ROWS * M];
casadi_real u[ROWS * M], F[ROWS * M], trial[ROWS * M], step[ROWS * M], best[ROWS * M], point[ROWS * M];
casadi_real found[ROWS * M], A[ROWS * M * ROWS * M], rho[2 * M], stiff[2 * M], mu[M];
casadi_real least = 1e300, defect, scale = 0, top = 0, ridge, eps;
casadi_int index[ROWS * M], kind[M], of[M], i, j, k, s, round, sweep, count = 0, n = 0, size;
for (i = 0; i < 3 * M; ++i) P[i] = 0;
for (i = 0; i < NW; ++i) DX[i] = 0;
RES[0] = 0;
for (s = 0; s < M; ++s) {
  if (!(WHO[s] > 0)) continue;
  if (B[3 * s] < 0) count = 1;
  of[n] = s;
  mu[n++] = ROWS > 1 ? MU[s] : 0;
}
size = ROWS * n;
if (count) {
for (s = 0; s < n; ++s) {
  for (k = 0; k < ROWS; ++k) {
    const casadi_int row = 3 * of[s] + k, at = ROWS * s + k;
    b[at] = B[row];
    p[at] = point[at] = found[at] = best[at] = 0;
    for (i = 0; i < NV; ++i) Y[i * size + at] = T[i * size + at] = J[i * 3 * M + row];
    for (i = NV; i < NW; ++i) Y[i * size + at] = 0;
  }
}
for (k = 0; k < NW; ++k) {
  const casadi_int other = (casadi_int) PIVOT[k];
  if (other == k) continue;
  for (j = 0; j < size; ++j) {
    const casadi_real r = Y[k * size + j];
    Y[k * size + j] = Y[other * size + j];
    Y[other * size + j] = r;
  }
}
for (i = 1; i < NW; ++i)
  for (k = 0; k < i; ++k)
    for (j = 0; j < size; ++j) Y[i * size + j] -= LU[i * NW + k] * Y[k * size + j];
for (i = NW; i-- > 0;) {
  const casadi_real r = 1 / LU[i * NW + i];
  for (k = i + 1; k < NW; ++k)
    for (j = 0; j < size; ++j) Y[i * size + j] -= LU[i * NW + k] * Y[k * size + j];
  for (j = 0; j < size; ++j) Y[i * size + j] *= r;
}
for (j = 0; j < size; ++j) {
  casadi_real *g = G + j * size;
  for (i = 0; i < size; ++i) g[i] = 0;
  for (k = 0; k < NV; ++k) {
    const casadi_real y = SHARE[0] * Y[k * size + j];
    for (i = 0; i < size; ++i) g[i] += T[k * size + i] * y;
  }
  top = fmax(top, g[j]);
}
ridge = 1e-9 * top;
for (s = 0; s < n; ++s) {
  const casadi_int at = ROWS * s;
  const casadi_real *g = G + at * size + at;
  rho[2 * s] = rho[2 * s + 1] = 1 / (g[0] + ridge + 1e-300);
  if (ROWS > 1) {
    const casadi_real across = fmax(g[size + 1], g[2 * size + 2]) + fabs(g[size + 2]);
    rho[2 * s + 1] = 1 / (across + ridge + 1e-300);
  }
  kind[s] = g[0] > ridge;
  if (kind[s] && b[at] < 0)
    for (k = 0; k < ROWS; ++k) scale = fmax(scale, fabs(b[at + k]) * rho[2 * s]);
}
for (s = 0; s < 2 * n; ++s) stiff[s] = 1 / rho[s];
for (round = 0, eps = top; round < 2 * ROUNDS - 1 && scale > 0; ++round) {
  /* Odd rounds find the proximal point that the next one starts from. */
  const casadi_int prox = round % 2;
  casadi_real here = 1e300;
  casadi_int newton;
  if (prox) {
    eps /= 2;
    for (i = 0; i < size; ++i) {
      G[i * size + i] += eps;
      b[i] -= eps * point[i];
    }
  }
  for (s = 0; s < 2 * n; ++s) rho[s] = 1 / (stiff[s] + (prox ? eps : 0));
  for (i = 0; i < size; ++i) p[i] = point[i];
  for (i = 0; i < size; ++i) u[i] = b[i];
  for (j = 0; j < size; ++j)
    if (p[j] != 0) for (i = 0; i < size; ++i) u[i] += G[j * size + i] * p[j];
  for (sweep = 0; sweep < SWEEPS; ++sweep) {
    for (s = 0; s < n; ++s) {
      const casadi_int at = ROWS * s;
      casadi_real change[3], old[3], length;
      if (!kind[s]) continue;
      for (k = 0; k < ROWS; ++k) old[k] = p[at + k];
      p[at] = fmax(old[0] - rho[2 * s] * u[at], 0);
      change[0] = p[at] - old[0];
      if (ROWS > 1) {
        for (k = 1; k < 3; ++k) {
          const casadi_real now = u[at + k] + G[at * size + at + k] * change[0];
          p[at + k] = old[k] - rho[2 * s + 1] * now;
        }
        length = sqrt(p[at + 1] * p[at + 1] + p[at + 2] * p[at + 2]);
        if (length > mu[s] * p[at]) for (k = 1; k < 3; ++k) p[at + k] *= mu[s] * p[at] / length;
      }
      for (k = 0; k < ROWS; ++k) {
        change[k] = p[at + k] - old[k];
        if (change[k] != 0)
          for (i = 0; i < size; ++i) u[i] += G[(at + k) * size + i] * change[k];
      }
    }
  }
  for (i = 0; i < size; ++i) trial[i] = p[i];
  defect = 1e300;
  for (newton = 0; newton < NEWTON; ++newton) {
    casadi_real share = 1;
    casadi_int halving;
    for (halving = 0; halving <= HALVINGS; ++halving) {
      casadi_real now = 0;
      if (halving == HALVINGS) share = 1;
      if (newton > 0) for (i = 0; i < size; ++i) trial[i] = p[i] + share * step[i];
      if (halving == HALVINGS) {
        for (s = 0; s < n; ++s) {
          casadi_real *t = trial + ROWS * s, length;
          if (!kind[s]) continue;
          t[0] = fmax(t[0], 0);
          if (ROWS > 1) {
            length = sqrt(t[1] * t[1] + t[2] * t[2]);
            if (length > mu[s] * t[0]) for (k = 1; k < 3; ++k) t[k] *= mu[s] * t[0] / length;
          }
        }
      }
      for (i = 0; i < size; ++i) u[i] = b[i];
      for (j = 0; j < size; ++j)
        if (trial[j] != 0) for (i = 0; i < size; ++i) u[i] += G[j * size + i] * trial[j];
      for (s = 0; s < n; ++s) {
        const casadi_real *t = trial + ROWS * s, *v = u + ROWS * s;
        casadi_real *f = F + ROWS * s, tau[3], length, radius;
        for (k = 0; k < ROWS; ++k) f[k] = 0;
        if (!kind[s]) continue;
        for (k = 0; k < ROWS; ++k) tau[k] = t[k] - rho[2 * s + (k > 0)] * v[k];
        f[0] = t[0] - fmax(tau[0], 0);
        if (ROWS > 1) {
          radius = mu[s] * fmax(tau[0], 0);
          length = sqrt(tau[1] * tau[1] + tau[2] * tau[2]);
          for (k = 1; k < 3; ++k)
            f[k] = t[k] - (length > radius ? tau[k] * radius / length : tau[k]);
        }
        for (k = 0; k < ROWS; ++k) now = fmax(now, fabs(f[k]));
      }
      if (newton == 0 || halving == HALVINGS || now < (1 - 0.1 * share) * defect) {
        defect = now;
        break;
      }
      share /= 2;
    }
    for (i = 0; i < size; ++i) p[i] = trial[i];
    if (defect < here) {
      here = defect;
      for (i = 0; i < size; ++i) found[i] = p[i];
    }
    if (defect <= 1e-12 * scale) break;
    /* Rows of the natural map's derivative for contacts that push or slide. */
    count = 0;
    for (s = 0; s < n; ++s) {
      const casadi_int at = ROWS * s;
      const casadi_int on = kind[s] && p[at] - rho[2 * s] * u[at] > 0;
      for (k = 0; k < ROWS; ++k) {
        step[at + k] = on ? -F[at + k] : -p[at + k];
        if (on) index[count++] = at + k;
      }
    }
    for (i = 0; i < count; i += ROWS) {
      const casadi_int at = index[i], c = at / ROWS;
      const casadi_real pn = rho[2 * c], pt = rho[2 * c + 1];
      casadi_real s1 = 0, s2 = 0, a11 = 0, a12 = 0, a22 = 0;
      if (ROWS > 1) {
        const casadi_real t1 = p[at + 1] - pt * u[at + 1], t2 = p[at + 2] - pt * u[at + 2];
        const casadi_real radius = mu[c] * (p[at] - pn * u[at]), length = sqrt(t1 * t1 + t2 * t2);
        const casadi_int slides = length > radius;
        const casadi_real q = slides ? radius / length : 1;
        s1 = slides ? t1 / length : 0;
        s2 = slides ? t2 / length : 0;
        a11 = q * (1 - s1 * s1);
        a12 = -q * s1 * s2;
        a22 = q * (1 - s2 * s2);
      }
      for (j = 0; j < count; ++j) {
        const casadi_int to = index[j];
        const casadi_real d0 = at == to, *g = G + to * size + at;
        const casadi_real n0 = d0 - pn * (g[0] + ridge * d0);
        A[i * count + j] = d0 - n0;
        if (ROWS > 1) {
          const casadi_real d1 = at + 1 == to, d2 = at + 2 == to;
          const casadi_real n1 = d1 - pt * (g[1] + ridge * d1), n2 = d2 - pt * (g[2] + ridge * d2);
          A[(i + 1) * count + j] = d1 - a11 * n1 - a12 * n2 - s1 * mu[c] * n0;
          A[(i + 2) * count + j] = d2 - a12 * n1 - a22 * n2 - s2 * mu[c] * n0;
        }
      }
      /* Contacts that let go change those that stay. */
      for (s = 0; s < n; ++s) {
        const casadi_int gone = ROWS * s;
        if (!kind[s] || p[gone] - rho[2 * s] * u[gone] > 0) continue;
        for (k = 0; k < ROWS; ++k) {
          const casadi_real *g = G + (gone + k) * size + at, d = step[gone + k];
          if (d == 0) continue;
          step[at] -= pn * g[0] * d;
          if (ROWS > 1) {
            step[at + 1] -= (a11 * pt * g[1] + a12 * pt * g[2] + s1 * mu[c] * pn * g[0]) * d;
            step[at + 2] -= (a12 * pt * g[1] + a22 * pt * g[2] + s2 * mu[c] * pn * g[0]) * d;
          }
        }
      }
    }
    for (i = 0; i < count; ++i) trial[i] = step[index[i]];
    for (k = 0; k < count; ++k) {
      casadi_int most = k;
      casadi_real pivot;
      for (i = k + 1; i < count; ++i)
        if (fabs(A[i * count + k]) > fabs(A[most * count + k])) most = i;
      if (most != k) {
        for (j = k; j < count; ++j) {
          pivot = A[k * count + j];
          A[k * count + j] = A[most * count + j];
          A[most * count + j] = pivot;
        }
        pivot = trial[k];
        trial[k] = trial[most];
        trial[most] = pivot;
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
  /* The best of them, into the cone exactly. */
  for (s = 0; s < n; ++s) {
    casadi_real *t = found + ROWS * s, length;
    t[0] = fmax(t[0], 0);
    if (ROWS > 1) {
      length = sqrt(t[1] * t[1] + t[2] * t[2]);
      if (length > mu[s] * t[0]) for (k = 1; k < 3; ++k) t[k] *= mu[s] * t[0] / length;
    }
  }
  if (prox) {
    for (i = 0; i < size; ++i) {
      G[i * size + i] -= eps;
      b[i] += eps * point[i];
    }
    for (i = 0; i < size; ++i) point[i] = found[i];
    continue;
  }
  if (here < least) {
    least = here;
    for (i = 0; i < size; ++i) scale = fmax(scale, best[i] = found[i]);
  }
  RES[0] = least / scale;
  if (least <= 1e-11 * scale) break;
}
for (s = 0; s < n; ++s) for (k = 0; k < ROWS; ++k) P[3 * of[s] + k] = best[ROWS * s + k];
for (i = 0; i < NW; ++i) for (j = 0; j < size; ++j) DX[i] += Y[i * size + j] * best[j];
}
