/* @maker@: @name@, @title@
 *
 * C99 and C++. No function allocates memory or keeps state: calls with different work spaces may
 * run at the same time. Matrices are column-major. Units are SI, angles in rad.
 *
 *   static @name@_work work;                   large enough for every function
 *   @name@_status status = @name@_@first@(&work, sizeof work, ...);
 *
 * A call refuses a work space that is too small, a NULL pointer to an argument (an empty one may be
 * NULL), and a result that overlaps an argument or another result. A result that is NULL is not
 * written; one must be given. Graph @graph@ */
#ifndef @NAME@_H
#define @NAME@_H

#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef @real@ @name@_real;
typedef @int@ @name@_int;

typedef enum {
  @NAME@_OK = 0,
  @NAME@_NULL_POINTER = 1,    /* no work space, an argument is NULL, or every result */
  @NAME@_WORK_TOO_SMALL = 2,  /* fewer bytes than the function needs */
  @NAME@_WORK_MISALIGNED = 3, /* its address is not that of a @name@_work */
  @NAME@_OVERLAP = 4,         /* a result overlaps an argument or another result */
  @NAME@_FAILED = 5,          /* the evaluation itself failed */
  @NAME@_NOT_FINITE = 6,      /* a result is infinite or not a number; all were written */
  @NAME@_NOT_CONVERGED = 7    /* the function reports that it did not reach a solution */
} @name@_status;

/* A sentence for people. */
const char *@name@_status_text(@name@_status status);

/* ---- Sizes ---- */

@sizes@

@enums@
@parameters@
/* ---- Functions: number of entries of each port, work space, prototype ---- */

@functions@
/* A work space that serves every function, one call at a time. */
typedef union {
@spaces@
} @name@_work;
#ifdef __cplusplus
}
#endif

#endif
