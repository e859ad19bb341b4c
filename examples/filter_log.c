/* Filters a log with an exported EKF: reads the CSV that `dtcasadi estimate --save-log` writes from
 * standard input and prints time, first coordinate and contact force along y, row by row.
 *
 * `filter.h`, `filter.c`, `filter_core.c` and `start.h` are written by examples/filter_log.py. All
 * memory is static; the same text serves double and single precision. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "filter.h"
#include "start.h" /* sizes, the estimate at the start, which sensor has which columns */

static filter_work work;
static filter_real x_new[N_X], P_new[N_Z * N_Z], theta_new[N_THETA], y[MOST_READINGS];
static char line[4096];

typedef filter_status (*update)(void *, size_t, const filter_real *, const filter_real *,
                                const filter_real *, const filter_real *, const filter_real *,
                                filter_real *, filter_real *, filter_real *, filter_real *,
                                filter_real *, filter_real *);
static const update updates[N_SENSORS] = UPDATES;

/* The next number of the line; an empty cell is a reading that is not there. */
static int next_number(char **at, filter_real *value) {
  char *end = *at + strcspn(*at, ",\r\n");
  int present = end > *at;
  *value = present ? (filter_real)strtod(*at, NULL) : 0;
  *at = *end == ',' ? end + 1 : end;
  return present;
}

static int failed(const char *what, double t, filter_status status) {
  if (status == FILTER_OK) return 0;
  fprintf(stderr, "%s at %g s: %s\n", what, t, filter_status_text(status));
  return 1;
}

int main(void) {
  filter_real t = 0, nis, used, believed;
  int k, i, rows = 0;
  if (!fgets(line, sizeof line, stdin)) return 1; /* the header */
  while (fgets(line, sizeof line, stdin)) {
    char *at = line;
    if (rows++ && failed("predict", (double)t,
                         filter_predict(&work, sizeof work, x, P, u, theta, x_new, P_new)))
      return 1;
    if (rows > 1) {
      memcpy(x, x_new, sizeof x);
      memcpy(P, P_new, sizeof P);
    }
    next_number(&at, &t);
    for (i = 0; i < N_U; ++i) next_number(&at, &u[i]);
    for (k = 0; k < N_SENSORS; ++k) {
      int present = 0;
      for (i = 0; i < readings[k]; ++i) present += next_number(&at, &y[i]);
      if (present < readings[k]) continue;
      if (failed("update", (double)t,
                 updates[k](&work, sizeof work, x, P, u, theta, y, x_new, P_new, theta_new, &nis,
                            &used, &believed)))
        return 1;
      memcpy(x, x_new, sizeof x);
      memcpy(P, P_new, sizeof P);
      memcpy(theta, theta_new, sizeof theta);
    }
    printf("%.4f %.12g %.12g\n", (double)t, (double)x[0], (double)theta[FORCE_Y]);
  }
  return 0;
}
