/* min 1/2 z^T H z + g^T z, LO <= z <= UP, BL <= C z <= BU, by a dual active-set method (Goldfarb and
   Idnani 1983) whose multipliers may also be priced: a row with a finite price PL gives way by s at
   the cost PL s + 1/2 PQ s^2, so its multiplier follows PL + PQ s beyond PL. H (V x V) is positive
   definite, CT holds the M rows of C, V each, contiguous; beyond 1e30 a bound or price is none.
   CODE: for each bound and row 0: not active, 1: held at its bound, 2: beyond it; negative: the lower
   one; WARM is a guess of the same. LAMBDA: multipliers with the same sign. BACK: 0 solved, 1 out of
   ITS iterations, 2 no point keeps to the bounds, 3 H not positive definite or not finite; the number
   of iterations; largest violation left, rows scaled to a sum of magnitudes of 1. */
casadi_real L[V * V], inv[V], start[V], y[V], m[K * V], Q[K * K], T[K * K], d[K], base[K], lam[K], at[K];
casadi_real scale[M + 1], tiny = sizeof(casadi_real) == 4 ? 1e-5 : 1e-12, worst = 1e30;
const casadi_real none = 1e30, least = sizeof(casadi_real) == 4 ? 1e-6 : 1e-14;
const casadi_real fair = sizeof(casadi_real) == 4 ? 1e-4 : 1e-9;
const casadi_real broken = sizeof(casadi_real) == 4 ? 1e-2 : 1e-6;
casadi_int row[K], side[K], zone[K], guess[V + M], state = 0, n = 0, from = 0, its = 0, next = 0;
casadi_int i, j, l;
for (i = 0; i < V + M; ++i) {
  guess[i] = WARM[i] > 1.5 ? 2 : WARM[i] > 0.5 ? 1 : WARM[i] < -1.5 ? -2 : WARM[i] < -0.5 ? -1 : 0;
  CODE[i] = 0;
  LAMBDA[i] = 0;
}
for (i = 0; i < M; ++i) {
  casadi_real s = 0;
  for (l = 0; l < V; ++l) s += fabs(CT[V * i + l]);
  scale[i] = s;
}
for (i = 0; i < V; ++i) {
  for (j = 0; j <= i; ++j) {
    casadi_real s = HH[V * j + i];
    for (l = 0; l < j; ++l) s -= L[V * i + l] * L[V * j + l];
    if (j < i) {
      L[V * i + j] = s * inv[j];
    } else {
      if (!(s > 0 && s < none * none)) state = 3;
      L[V * i + i] = sqrt(s > 0 ? s : 1);
      inv[i] = 1 / L[V * i + i];
    }
  }
}
for (i = 0; i < V; ++i) {
  casadi_real s = -GG[i];
  for (l = 0; l < i; ++l) s -= L[V * i + l] * start[l];
  start[i] = s * inv[i];
  if (start[i] - start[i] != 0) state = 3;
}
while (state == 0) {
  casadi_int add = -1, upper = 0, kind = 1, hit = -1;
  /* Rows of the guess come in first, one by one; after them the most violated row. */
  for (; next < V + M && add < 0; ++next) {
    casadi_real b;
    if (guess[next] == 0 || n == K) continue;
    upper = guess[next] > 0;
    b = next < V ? (upper ? UP[next] : -LO[next]) : (upper ? BU[next - V] : -BL[next - V]);
    if (!(b < none) || (next >= V && !(scale[next - V] > 0))) continue;
    add = next;
    kind = guess[next] * guess[next] > 1 && next >= V && PL[next - V] < none ? 2 : 1;
  }
  if (add < 0) {
    casadi_real alpha = 1;
    /* What is left at the end of the budget may be no more than round-off. */
    if (its >= ITS) {
      state = worst > fair;
      break;
    }
    ++its;
    for (i = 0; i < n; ++i) {
      casadi_real s = base[i];
      if (zone[i] == 2) s += PL[row[i] - V] / PQ[row[i] - V];
      for (l = 0; l < i; ++l) s -= T[K * i + l] * at[l];
      at[i] = s;
    }
    for (i = n; i-- > 0;) {
      casadi_real s = at[i] / d[i];
      for (l = i + 1; l < n; ++l) s -= T[K * l + i] * at[l];
      at[i] = s;
    }
    /* As far towards the multipliers of these rows as all keep to their zones. */
    for (i = 0; i < n; ++i) {
      const casadi_real price = row[i] < V ? none : PL[row[i] - V];
      const casadi_real low = zone[i] == 2 ? price : 0, step = at[i] - lam[i];
      casadi_real end = 1;
      if (at[i] < low) end = (low - lam[i]) / step;
      else if (zone[i] == 1 && price < none && at[i] > price) end = (price - lam[i]) / step;
      if (end < alpha) {
        alpha = end > 0 ? end : 0;
        hit = i;
      }
    }
    for (i = 0; i < n; ++i) lam[i] += alpha * (at[i] - lam[i]);
    for (l = 0; l < V; ++l) y[l] = start[l];
    for (i = 0; i < n; ++i) for (l = 0; l < V; ++l) y[l] -= lam[i] * m[V * i + l];
    for (i = V; i-- > 0;) {
      const casadi_real s = Z[i] = y[i] * inv[i];
      for (l = 0; l < i; ++l) y[l] -= L[V * i + l] * s;
    }
    if (hit >= 0) {
      const casadi_real price = row[hit] < V ? none : PL[row[hit] - V];
      if (zone[hit] == 2 || at[hit] > price) {
        lam[hit] = price;
        zone[hit] = 3 - zone[hit];
      } else {
        --n;
        for (i = hit; i < n; ++i) {
          row[i] = row[i + 1];
          side[i] = side[i + 1];
          zone[i] = zone[i + 1];
          lam[i] = lam[i + 1];
          base[i] = base[i + 1];
          for (l = 0; l < V; ++l) m[V * i + l] = m[V * (i + 1) + l];
          for (l = 0; l <= i; ++l) Q[K * i + l] = Q[K * (i + 1) + (l < hit ? l : l + 1)];
        }
      }
      from = hit;
    } else {
      /* The worst row comes in; one held that cannot keep to its bound tells that none can. */
      for (i = 0; i < n; ++i) CODE[row[i]] = zone[i];
      worst = 0;
      for (i = 0; i < V + M; ++i) {
        casadi_real s = 0, up, low;
        const casadi_real held = CODE[i];
        CODE[i] = 0;
        if (held == 2 || (i >= V && !(scale[i - V] > 0))) continue;
        if (i < V) {
          s = Z[i];
          up = s - UP[i];
          low = LO[i] - s;
        } else {
          for (l = 0; l < V; ++l) s += CT[V * (i - V) + l] * Z[l];
          up = (s - BU[i - V]) / scale[i - V];
          low = (BL[i - V] - s) / scale[i - V];
        }
        s = up > low ? up : low;
        if (held == 1) {
          if (s > broken) state = 2;
        } else if (s > worst) {
          worst = s;
          upper = up > low;
          add = i;
        }
      }
      if (state != 0 || !(worst > least)) break;
      if (n == K) {
        state = 1;
        break;
      }
    }
  }
  if (add >= 0) {
    casadi_real *r = m + V * n, sign = upper ? 1 : -1, s;
    for (i = 0; i < V; ++i) {
      s = add < V ? (i == add ? sign : 0) : sign * CT[V * (add - V) + i];
      for (l = 0; l < i; ++l) s -= L[V * i + l] * r[l];
      r[i] = s * inv[i];
    }
    s = add < V ? -(upper ? UP[add] : -LO[add]) : -(upper ? BU[add - V] : -BL[add - V]);
    for (l = 0; l < V; ++l) s += r[l] * start[l];
    base[n] = s;
    row[n] = add;
    side[n] = upper;
    zone[n] = kind;
    lam[n] = kind == 2 ? PL[add - V] : 0;
    for (i = 0; i <= n; ++i) {
      s = 0;
      for (l = 0; l < V; ++l) s += m[V * i + l] * r[l];
      Q[K * n + i] = s;
    }
    from = n++;
  }
  /* Rows from `from` on of Q + 1/PQ of those beyond their price = T diag(d) T^T. A row that depends
     on the others gets a pivot so small that the next step runs along the set's start direction. */
  for (i = from; i < n; ++i) {
    casadi_real s = Q[K * i + i];
    const casadi_real small = tiny * s;
    if (zone[i] == 2) s += 1 / PQ[row[i] - V];
    for (j = 0; j < i; ++j) {
      casadi_real r = Q[K * i + j];
      for (l = 0; l < j; ++l) r -= at[l] * T[K * j + l];
      at[j] = r;
      T[K * i + j] = r / d[j];
      s -= r * T[K * i + j];
    }
    d[i] = s > small ? s : small;
  }
}
for (i = 0; i < n; ++i) {
  CODE[row[i]] = side[i] ? zone[i] : -zone[i];
  LAMBDA[row[i]] = side[i] ? lam[i] : -lam[i];
  if (row[i] < V && state == 0) Z[row[i]] = side[i] ? UP[row[i]] : LO[row[i]];
}
for (i = 0; i < V; ++i) {
  if (state == 3) Z[i] = 0;
  Z[i] = Z[i] < LO[i] ? LO[i] : Z[i] > UP[i] ? UP[i] : Z[i];
}
BACK[0] = (casadi_real) state;
BACK[1] = (casadi_real) its;
BACK[2] = worst;
