/* The M rim points that come nearest to what they may touch within a step, their gaps and the rows
   of the contact Jacobian along (normal, two tangents).
   R (3 x 3 N) and r (3 x N): poses; S (6 N x NV): angular over linear velocity of each disc along
   its own axes for unit rates; V: rates; H: step. Candidates: POINT (3 x C) on the disc TAB[0], kind
   TAB[1] of what it may touch (0 half-space, 1 sphere, 2 capsule, 3 box, 4 plate of a disc), number
   TAB[2] of the shape in SHAPE (16 each) or of the disc, whose PLATE has centre, radius and half its
   thickness; FRICTION (C). Out of reach is what neither comes near nor could be driven there.
   With GIVEN, the gaps of the candidates LIST (M, from 1; 0: none) and nothing else: what the other
   ports hold does not matter. */
casadi_real normal[3 * C], gaps[C], reach[C], spin[6 * N], margin = 0, fastest = 0;
casadi_int taken[C];
casadi_int c, e, i, j, k, s, near = 0;
if (!GIVEN) for (i = 0; i < 6 * N; ++i) {
  casadi_real sum = 0;
  for (j = 0; j < NV; ++j) sum += S[j * 6 * N + i] * V[j];
  spin[i] = sum;
}
if (GIVEN) for (s = 0; s < M; ++s) GAP[s] = 1e30;
for (e = 0; e < (GIVEN ? M : C); ++e) {
  if (GIVEN && !(LIST[e] > 0)) continue;
  c = GIVEN ? (casadi_int) LIST[e] - 1 : e;
  const casadi_int a = (casadi_int) TAB[3 * c], kind = (casadi_int) TAB[3 * c + 1];
  const casadi_real *P = POINT + 3 * c, *Ra = R + 9 * a, *shape = SHAPE;
  casadi_real x[3], n[3] = {0, 0, 0}, d[3], u[3], gap = 0, size = 0, speed = 0;
  shape += 16 * (casadi_int) TAB[3 * c + 2];
  for (k = 0; k < 3; ++k) x[k] = r[3 * a + k] + Ra[k] * P[0] + Ra[3 + k] * P[1] + Ra[6 + k] * P[2];
  for (k = 0; k < 3; ++k) d[k] = x[k] - shape[k];
  if (kind == 0) {
    for (k = 0; k < 3; ++k) n[k] = shape[3 + k];
    gap = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
  } else if (kind == 1 || kind == 2) {
    if (kind == 2) {
      casadi_real share = 0, square = 0;
      for (k = 0; k < 3; ++k) {
        const casadi_real axis = shape[3 + k] - shape[k];
        share += d[k] * axis;
        square += axis * axis;
      }
      share = fmin(fmax(share / square, 0), 1);
      for (k = 0; k < 3; ++k) d[k] -= share * (shape[3 + k] - shape[k]);
    }
    size = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + 1e-30);
    for (k = 0; k < 3; ++k) n[k] = d[k] / size;
    gap = size - shape[kind == 1 ? 3 : 6];
  } else if (kind == 3) {
    casadi_real e[3], most = -1e30;
    casadi_int face = 0;
    for (k = 0; k < 3; ++k) {
      const casadi_real *axis = shape + 7 + k;
      const casadi_real y = axis[0] * d[0] + axis[3] * d[1] + axis[6] * d[2];
      const casadi_real beyond = fabs(y) - shape[3 + k];
      if (beyond > most) { most = beyond; face = k; }
      u[k] = y < 0 ? -1 : 1;
      e[k] = fmax(beyond, 0);
    }
    size = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    for (k = 0; k < 3; ++k) e[k] = size > 0 ? u[k] * e[k] / size : (k == face ? u[k] : 0);
    for (k = 0; k < 3; ++k)
      n[k] = shape[7 + 3 * k] * e[0] + shape[8 + 3 * k] * e[1] + shape[9 + 3 * k] * e[2];
    gap = (size > 0 ? size : most) - shape[6];
  } else {
    const casadi_int b = (casadi_int) TAB[3 * c + 2];
    const casadi_real *Rb = R + 9 * b, *plate = PLATE + 5 * b;
    casadi_real y[3], side;
    for (k = 0; k < 3; ++k) d[k] = x[k] - r[3 * b + k];
    for (k = 0; k < 3; ++k) y[k] = Rb[3 * k] * d[0] + Rb[3 * k + 1] * d[1] + Rb[3 * k + 2] * d[2];
    size = sqrt((y[0] - plate[0]) * (y[0] - plate[0]) + (y[1] - plate[1]) * (y[1] - plate[1]));
    side = y[2] < plate[2] ? -1 : 1;
    for (k = 0; k < 3; ++k) n[k] = side * Rb[6 + k];
    gap = fabs(y[2] - plate[2]) - plate[4];
    if (size > plate[3]) gap = 1e30;
  }
  if (GIVEN) {
    GAP[e] = gap;
    continue;
  }
  for (i = 0; i < 2; ++i) {
    const casadi_int disc = i == 0 ? a : (casadi_int) TAB[3 * c + 2];
    const casadi_real *q = R + 9 * disc, *w = spin + 6 * disc;
    casadi_real p[3], m[3], v[3];
    if (i == 1 && kind != 4) break;
    for (k = 0; k < 3; ++k) {
      p[k] = m[k] = 0;
      for (j = 0; j < 3; ++j) {
        p[k] += q[3 * k + j] * (x[j] - r[3 * disc + j]);
        m[k] += q[3 * k + j] * n[j];
      }
    }
    v[0] = w[3] + w[1] * p[2] - w[2] * p[1];
    v[1] = w[4] + w[2] * p[0] - w[0] * p[2];
    v[2] = w[5] + w[0] * p[1] - w[1] * p[0];
    speed += (i == 0 ? 1 : -1) * (m[0] * v[0] + m[1] * v[1] + m[2] * v[2]);
  }
  gaps[c] = gap;
  reach[c] = gap + H[0] * speed;
  fastest = fmax(fastest, fabs(speed));
  for (k = 0; k < 3; ++k) normal[3 * c + k] = n[k];
}
for (i = 0; i < N; ++i) margin = fmax(margin, 1e-3 * PLATE[5 * i + 3]);
margin += 4 * H[0] * fastest;
for (c = 0; c < (GIVEN ? 0 : C); ++c) if (reach[c] < margin) taken[near++] = c;
if (!GIVEN) {
  for (i = 0; i < 3 * M * NV; ++i) JAC[i] = 0;
  for (i = 0; i < 3 * M; ++i) PLACE[i] = 0;
  for (i = 0; i < 9 * M; ++i) FRAME[i] = 0;
  for (s = 0; s < M; ++s) {
    GAP[s] = 1e30;
    WHO[s] = MU[s] = 0;
  }
}
for (s = 0; s < (GIVEN ? 0 : M) && s < near; ++s) {
  casadi_int first = s, best;
  for (i = s + 1; i < near; ++i) if (reach[taken[i]] < reach[taken[first]]) first = i;
  best = taken[first];
  for (i = first; i > s; --i) taken[i] = taken[i - 1];  /* in order, for equals */
  WHO[s] = (casadi_real) (best + 1);
  GAP[s] = gaps[best];
  MU[s] = FRICTION[best];
  {
    const casadi_int a = (casadi_int) TAB[3 * best], kind = (casadi_int) TAB[3 * best + 1];
    const casadi_real *P = POINT + 3 * best, *n = normal + 3 * best;
    casadi_real *f = FRAME + 9 * s, size = 0;
    casadi_int small = 0;
    for (k = 1; k < 3; ++k) if (fabs(n[k]) < fabs(n[small])) small = k;
    for (k = 0; k < 3; ++k) {
      f[k] = n[k];
      PLACE[3 * s + k] = r[3 * a + k];
      for (j = 0; j < 3; ++j) PLACE[3 * s + k] += R[9 * a + 3 * j + k] * P[j];
      f[3 + k] = (k == small ? 1 : 0) - n[small] * n[k];
      size += f[3 + k] * f[3 + k];
    }
    size = sqrt(size);
    for (k = 0; k < 3; ++k) f[3 + k] /= size;
    f[6] = f[1] * f[5] - f[2] * f[4];
    f[7] = f[2] * f[3] - f[0] * f[5];
    f[8] = f[0] * f[4] - f[1] * f[3];
    for (i = 0; i < 2; ++i) {
      const casadi_int disc = i == 0 ? a : (casadi_int) TAB[3 * best + 2];
      const casadi_real *q = R + 9 * disc, sign = i == 0 ? 1 : -1;
      casadi_real p[3];
      if (i == 1 && kind != 4) break;
      for (k = 0; k < 3; ++k) {
        p[k] = 0;
        for (j = 0; j < 3; ++j) p[k] += q[3 * k + j] * (PLACE[3 * s + j] - r[3 * disc + j]);
      }
      for (c = 0; c < 3; ++c) {
        casadi_real m[3], t[3];
        for (k = 0; k < 3; ++k) m[k] = q[3 * k] * f[3 * c] + q[3 * k + 1] * f[3 * c + 1] + q[3 * k + 2] * f[3 * c + 2];
        t[0] = p[1] * m[2] - p[2] * m[1];
        t[1] = p[2] * m[0] - p[0] * m[2];
        t[2] = p[0] * m[1] - p[1] * m[0];
        for (j = 0; j < NV; ++j) {
          const casadi_real *w = S + j * 6 * N + 6 * disc;
          JAC[j * 3 * M + 3 * s + c] += sign * (t[0] * w[0] + t[1] * w[1] + t[2] * w[2] + m[0] * w[3] + m[1] * w[4] + m[2] * w[5]);
        }
      }
    }
  }
}
