/* L U of A (N x N, column-major) with partial pivoting: LU by rows, pivot rows in P. On SIMD lanes
   (native/lanes.hpp) each robot has its own pivots. */
casadi_int i, j, k;
for (j = 0; j < N; ++j) for (i = 0; i < N; ++i) LU[i * N + j] = A[j * N + i];
for (k = 0; k < N; ++k) {
  casadi_real r;
#ifdef DTC_LANES
  casadi_real best = k, largest = fabs(LU[k * N + k]);
  for (i = k + 1; i < N; ++i) {
    casadi_real size = fabs(LU[i * N + k]);
    best = dtc_choose(size > largest, i, best);
    largest = dtc_choose(size > largest, size, largest);
  }
  P[k] = best;
  for (i = k + 1; i < N && dtc_any(best != k); ++i)
    if (dtc_any(best == i))
      for (j = 0; j < N; ++j) dtc_swap(best == i, &LU[k * N + j], &LU[i * N + j]);
#else
  casadi_int best = k;
  for (i = k + 1; i < N; ++i) if (fabs(LU[i * N + k]) > fabs(LU[best * N + k])) best = i;
  P[k] = (casadi_real) best;
  if (best != k) {
    for (j = 0; j < N; ++j) {
      r = LU[k * N + j];
      LU[k * N + j] = LU[best * N + j];
      LU[best * N + j] = r;
    }
  }
#endif
  r = 1 / LU[k * N + k];
  for (i = k + 1; i < N; ++i) {
    casadi_real l = LU[i * N + k] * r;
    LU[i * N + k] = l;
    for (j = k + 1; j < N; ++j) LU[i * N + j] -= l * LU[k * N + j];
  }
}
