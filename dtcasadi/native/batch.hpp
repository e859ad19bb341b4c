/* n robots through one function, DTC_LANES at a time; follows lanes.hpp and CasADi's code, in which
   casadi_real is dtc_lanes. Entry k of robot i of a port is at [k * ld + i] of its array; an
   argument with ld = 0 is the same for all robots, entry k at [k]. A result may take the place of
   an argument with the same ld. */
namespace {

enum { DTC_OK = 0, DTC_NULL = 1, DTC_SMALL = 2, DTC_OVERLAP = 4, DTC_FAILED = 5, DTC_INFINITE = 6 };

typedef int (*dtc_call)(const casadi_real **, casadi_real **, casadi_int *, casadi_real *, int);

struct dtc_function {
  dtc_call call;
  size_t n_in, n_out, sz_arg, sz_res, sz_iw, sz_w;
  const size_t *rows; /* entries of each argument, then of each result */

  size_t entries() const {
    size_t sum = 0;
    for (size_t p = 0; p < n_in + n_out; ++p) sum += rows[p];
    return sum;
  }
  size_t bytes() const {
    return sizeof(dtc_lanes) * (entries() + sz_w + 1) + sizeof(void *) * (sz_arg + sz_res) +
           sizeof(casadi_int) * sz_iw;
  }
};

/* The robots from the i-th on; lanes beyond the last robot repeat it. */
DTC_INLINE void dtc_load(dtc_lanes *to, const double *from, size_t i, size_t n) {
  if (i + DTC_LANES <= n) {
    memcpy(to, from + i, sizeof *to);
  } else {
    DTC_EACH(lane) to->v[lane] = from[i + lane < n ? i + lane : n - 1];
  }
}

/* Returns the lanes that are infinite or not a number, by their bits: -ffast-math knows neither. */
DTC_INLINE dtc_mask dtc_store(double *to, dtc_lanes from, size_t i, size_t n) {
  if (i + DTC_LANES <= n) {
    memcpy(to + i, &from, sizeof from);
  } else {
    for (size_t lane = 0; i + lane < n; ++lane) to[i + lane] = from.v[lane];
  }
  return ((dtc_mask)from.v & 0x7ff0000000000000) == 0x7ff0000000000000;
}

int dtc_batch(const dtc_function &f, size_t n, const double *const *in, const size_t *ld_in,
              double *const *out, const size_t *ld_out, void *work, size_t bytes) {
  if (work == NULL) return DTC_NULL;
  if (bytes < f.bytes()) return DTC_SMALL;
  for (size_t p = 0; p < f.n_in; ++p) if (f.rows[p] && in[p] == NULL) return DTC_NULL;
  for (size_t p = 0; p < f.n_out; ++p) {
    if (f.rows[f.n_in + p] && out[p] == NULL) return DTC_NULL;
    if (f.rows[f.n_in + p] && ld_out[p] < n) return DTC_OVERLAP;
  }
  const size_t start = ((size_t)work + sizeof(dtc_lanes) - 1) / sizeof(dtc_lanes);
  dtc_lanes *const first = (dtc_lanes *)(start * sizeof(dtc_lanes));
  dtc_lanes *const w = first + f.entries();
  const casadi_real **const arg = (const casadi_real **)(w + f.sz_w);
  casadi_real **const res = (casadi_real **)(arg + f.sz_arg);
  casadi_int *const iw = (casadi_int *)(res + f.sz_res);

  dtc_lanes *at = first;
  for (size_t p = 0; p < f.n_in; at += f.rows[p++])
    for (size_t k = 0; k < f.rows[p] && !ld_in[p]; ++k) at[k] = in[p][k];
  dtc_mask wrong = {};
  for (size_t i = 0; i < n; i += DTC_LANES) {
    at = first;
    for (size_t p = 0; p < f.n_in; at += f.rows[p++]) {
      arg[p] = at; /* again for each block: the function may have written over it */
      for (size_t k = 0; k < f.rows[p] && ld_in[p]; ++k)
        dtc_load(at + k, in[p] + k * ld_in[p], i, n);
    }
    for (size_t p = 0; p < f.n_out; at += f.rows[f.n_in + p++]) res[p] = at;
    if (f.call(arg, res, iw, w, 0)) return DTC_FAILED;
    for (size_t p = f.n_out; p-- > 0;) {
      at -= f.rows[f.n_in + p];
      for (size_t k = 0; k < f.rows[f.n_in + p]; ++k)
        wrong |= dtc_store(out[p] + k * ld_out[p], at[k], i, n);
    }
  }
  return dtc_any(wrong) ? DTC_INFINITE : DTC_OK;
}

}  // namespace
