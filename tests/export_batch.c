/* Calls the exported arm for N robots at once and one by one; prints the largest difference. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "arm_batch.h"

enum { N = 19 };

static double *numbers(size_t count) { return (double *)malloc((count ? count : 1) * sizeof(double)); }

static int expect(const char *what, int status, int wanted) {
  if (status != wanted) printf("%s: %d instead of %d\n", what, status, wanted);
  return status != wanted;
}

int main(void) {
  static arm_work one;
  size_t n, i, k;
  double worst = 0, single_x[ARM_STEP_SIZE_x], single_u[ARM_STEP_SIZE_u], next[ARM_STEP_SIZE_x];
  int wrong = 0;
  /* Blocks of exactly the size needed, so that an address sanitizer sees every step beyond. */
  size_t bytes = arm_step_batch_bytes();
  void *work = malloc(bytes);
  for (n = 1; n <= N; ++n) {
    double *x = numbers(ARM_STEP_SIZE_x * n), *u = numbers(ARM_STEP_SIZE_u * n), *status = numbers(n);
    double *theta = numbers(ARM_STEP_SIZE_theta), *moved = numbers(ARM_STEP_SIZE_x * n);
    for (k = 0; k < ARM_STEP_SIZE_theta; ++k) theta[k] = 1.0 + 0.5 * (double)k;
    for (k = 0; k < ARM_STEP_SIZE_x; ++k)
      for (i = 0; i < n; ++i) x[k * n + i] = 0.3 * sin(1.0 + 3.0 * (double)k + (double)i);
    for (k = 0; k < ARM_STEP_SIZE_u; ++k) for (i = 0; i < n; ++i) u[k * n + i] = (double)i;
    wrong += expect("step", arm_step_batch(work, bytes, n, x, n, u, n, theta, 0, moved, n, status, n),
                    ARM_OK);
    for (i = 0; i < n; ++i) {
      for (k = 0; k < ARM_STEP_SIZE_x; ++k) single_x[k] = x[k * n + i];
      for (k = 0; k < ARM_STEP_SIZE_u; ++k) single_u[k] = u[k * n + i];
      wrong += expect("one step", arm_step(&one, sizeof one, single_x, single_u, theta, next), ARM_OK);
      for (k = 0; k < ARM_STEP_SIZE_x; ++k) worst = fmax(worst, fabs(moved[k * n + i] - next[k]));
      worst = fmax(worst, fabs(status[i]));
    }
    /* A result in the place of an argument. */
    wrong += expect("in place", arm_step_batch(work, bytes, n, x, n, u, n, theta, 0, x, n, status, n),
                    ARM_OK);
    for (k = 0; k < ARM_STEP_SIZE_x * n; ++k) worst = fmax(worst, fabs(x[k] - moved[k]));
    if (n == N) {
      wrong += expect("no work", arm_step_batch(NULL, bytes, n, x, n, u, n, theta, 0, x, n, status, n),
                      ARM_NULL_POINTER);
      wrong += expect("no state", arm_step_batch(work, bytes, n, NULL, n, u, n, theta, 0, x, n,
                                                 status, n), ARM_NULL_POINTER);
      wrong += expect("no result", arm_step_batch(work, bytes, n, x, n, u, n, theta, 0, NULL, n,
                                                  status, n), ARM_NULL_POINTER);
      wrong += expect("small", arm_step_batch(work, bytes - 1, n, x, n, u, n, theta, 0, x, n, status,
                                              n), ARM_WORK_TOO_SMALL);
      wrong += expect("rows", arm_step_batch(work, bytes, n, x, n, u, n, theta, 0, x, n - 1, status,
                                             n), ARM_OVERLAP);
      wrong += expect("none", arm_step_batch(work, bytes, 0, x, 0, u, 0, theta, 0, x, 0, status, 0),
                      ARM_OK);
      x[1] = HUGE_VAL;
      wrong += expect("infinite", arm_step_batch(work, bytes, n, x, n, u, n, theta, 0, moved, n,
                                                 status, n), ARM_NOT_FINITE);
      wrong += expect("its status", (int)status[1], 1);
      wrong += expect("another's status", (int)status[0], 0);
    }
    free(x); free(u); free(status); free(theta); free(moved);
  }
  free(work);
  printf("%.3e\n", worst);
  return wrong;
}
