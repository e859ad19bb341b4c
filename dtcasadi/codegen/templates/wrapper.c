/* @maker@: what stands between @name@.h and the generated @name@_core.c. */
#include "@name@.h"

#ifdef __cplusplus
extern "C" {
#endif

@raw@

typedef struct {
  char first;
  @name@_work work;
} @name@_aligned;

/* Bits of a number that are all set when it is infinite or not a number. The comparison is made on
 * integers because -ffast-math assumes that no such number exists. */
typedef unsigned @bits@ @name@_bits;
static const @name@_bits exponent_ = @exponent@;

static int overlap_(const @name@_real *a, size_t n_a, const @name@_real *b, size_t n_b) {
  const size_t start_a = (size_t)a, start_b = (size_t)b;
  if (a == NULL || b == NULL || !n_a || !n_b) return 0;
  return start_a < start_b + n_b * sizeof *b && start_b < start_a + n_a * sizeof *a;
}

static @name@_status check_work_(const void *work, size_t bytes, size_t needed) {
  if (work == NULL) return @NAME@_NULL_POINTER;
  if (bytes < needed) return @NAME@_WORK_TOO_SMALL;
  if ((size_t)work % (sizeof(@name@_aligned) - sizeof(@name@_work))) return @NAME@_WORK_MISALIGNED;
  return @NAME@_OK;
}

static @name@_status check_ports_(const @name@_real *const *in, const size_t *n_in, size_t ins,
                        @name@_real *const *out, const size_t *n_out, size_t outs) {
  size_t i, k, wanted = 0;
  for (i = 0; i < ins; ++i) if (n_in[i] && in[i] == NULL) return @NAME@_NULL_POINTER;
  for (k = 0; k < outs; ++k) {
    if (out[k] == NULL) continue;
    ++wanted;
    for (i = 0; i < ins; ++i)
      if (overlap_(in[i], n_in[i], out[k], n_out[k])) return @NAME@_OVERLAP;
    for (i = 0; i < k; ++i)
      if (overlap_(out[i], n_out[i], out[k], n_out[k])) return @NAME@_OVERLAP;
  }
  return wanted ? @NAME@_OK : @NAME@_NULL_POINTER;
}

static @name@_status check_results_(@name@_real *const *out, const size_t *n_out, size_t outs) {
  size_t k, i;
  int wrong = 0;
  for (k = 0; k < outs; ++k) {
    for (i = 0; out[k] && i < n_out[k]; ++i) {
      @name@_bits bits;
      memcpy(&bits, out[k] + i, sizeof bits);
      wrong |= (bits & exponent_) == exponent_;
    }
  }
  return wrong ? @NAME@_NOT_FINITE : @NAME@_OK;
}

const char *@name@_status_text(@name@_status status) {
  switch (status) {
    case @NAME@_OK: return "good";
    case @NAME@_NULL_POINTER: return "the work space, an argument or every result is NULL";
    case @NAME@_WORK_TOO_SMALL: return "the work space is smaller than the function needs";
    case @NAME@_WORK_MISALIGNED: return "the work space is not aligned for its type";
    case @NAME@_OVERLAP: return "a result overlaps an argument or another result";
    case @NAME@_FAILED: return "the evaluation failed";
    case @NAME@_NOT_FINITE: return "a result is infinite or not a number";
    case @NAME@_NOT_CONVERGED: return "the function did not reach a solution";
  }
  return "unknown status";
}

@parameters@
@functions@
#ifdef __cplusplus
}
#endif
