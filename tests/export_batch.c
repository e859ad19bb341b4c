/* Calls the exported arm for N robots at once and one by one; prints the largest difference. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "arm_batch.h"

enum { N = 19, N_X = ARM_STEP_SIZE_x, N_U = ARM_STEP_SIZE_u, N_THETA = ARM_STEP_SIZE_theta };

/* Blocks of exactly the size needed, so that an address sanitizer sees every step beyond. */
static double *numbers(size_t count) {
  return (double *)malloc((count ? count : 1) * sizeof(double));
}

static int wrong;

static void expect(const char *what, int status, int wanted) {
  if (status == wanted) return;
  printf("%s: %d instead of %d\n", what, status, wanted);
  ++wrong;
}

int main(void) {
  static arm_work one;
  size_t n, i, k;
  double worst = 0, single_x[N_X], single_u[N_U], next[N_X];
  const size_t bytes = arm_step_batch_bytes();
  char *block = (char *)malloc(bytes + 8);
  void *work = block + 8; /* at no address that vectors like */
  for (n = 1; n <= N; ++n) {
    double *x = numbers(N_X * n), *u = numbers(N_U * n), *status = numbers(n);
    double *theta = numbers(N_THETA), *moved = numbers(N_X * n);
#define STEP(work, bytes, n, x, result, ld) \
  arm_step_batch(work, bytes, n, x, n, u, n, theta, 0, result, ld, status, n)
    for (k = 0; k < N_THETA; ++k) theta[k] = 1.0 + 0.5 * (double)k;
    for (k = 0; k < N_X; ++k)
      for (i = 0; i < n; ++i) x[k * n + i] = 0.3 * sin(1.0 + 3.0 * (double)k + (double)i);
    for (k = 0; k < N_U; ++k)
      for (i = 0; i < n; ++i) u[k * n + i] = (double)i;
    expect("step", STEP(work, bytes, n, x, moved, n), ARM_OK);
    for (i = 0; i < n; ++i) {
      for (k = 0; k < N_X; ++k) single_x[k] = x[k * n + i];
      for (k = 0; k < N_U; ++k) single_u[k] = u[k * n + i];
      expect("one", arm_step(&one, sizeof one, single_x, single_u, theta, next), ARM_OK);
      for (k = 0; k < N_X; ++k) worst = fmax(worst, fabs(moved[k * n + i] - next[k]));
      worst = fmax(worst, fabs(status[i]));
    }
    expect("in place", STEP(work, bytes, n, x, x, n), ARM_OK);
    for (k = 0; k < N_X * n; ++k) worst = fmax(worst, fabs(x[k] - moved[k]));
    if (n == N) {
      expect("no work", STEP(NULL, bytes, n, x, x, n), ARM_NULL_POINTER);
      expect("no state", STEP(work, bytes, n, NULL, x, n), ARM_NULL_POINTER);
      expect("no result", STEP(work, bytes, n, x, NULL, n), ARM_NULL_POINTER);
      expect("small", STEP(work, bytes - 1, n, x, x, n), ARM_WORK_TOO_SMALL);
      expect("rows", STEP(work, bytes, n, x, x, n - 1), ARM_OVERLAP);
      expect("nobody", STEP(work, bytes, 0, x, x, 0), ARM_OK);
      x[1] = HUGE_VAL;
      expect("infinite", STEP(work, bytes, n, x, moved, n), ARM_NOT_FINITE);
      expect("its status", (int)status[1], 1);
      expect("another's status", (int)status[0], 0);
    }
    free(x);
    free(u);
    free(status);
    free(theta);
    free(moved);
  }
  free(block);
  printf("%.3e\n", worst);
  return wrong;
}
