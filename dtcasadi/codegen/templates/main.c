/* @maker@: simulates @name@ and prints where the last disc's centre of mass is.
 *
 * @title@
 * Fixed steps of @NAME@_STEP_S seconds, the command held over each of them. */
#include <stdio.h>
#include <string.h>

#include "@name@.h"

enum { STEPS = @steps@, SHOWN = @shown@, BREAKS = @breaks@, ROWS = @commands@ };

static const @name@_real x0[@NAME@_N_X] = {
@initial@
};

/* The command: value and slope from each break on; before the first one, its value. */
static const double break_s[BREAKS] = {
@break_s@
};
static const double value[BREAKS][ROWS] = {
@value@
};
static const double slope[BREAKS][ROWS] = {
@slope@
};
static const @name@_real centre[3] = {@centre@}; /* of mass, in the last disc's frame */

static void command(double t, @name@_real *u) {
  int i, k = 0;
  double elapsed;
  while (k + 1 < BREAKS && break_s[k + 1] <= t) ++k;
  elapsed = t > break_s[k] ? t - break_s[k] : 0;
  for (i = 0; i < @NAME@_N_U; ++i) u[i] = (@name@_real)(value[k][i] + elapsed * slope[k][i]);
}

static int failed(const char *what, double t, @name@_status status) {
  if (status == @NAME@_OK) return 0;
  fprintf(stderr, "%s at t = %g s: %s\n", what, t, @name@_status_text(status));
  return 1;
}

int main(void) {
  static @name@_work work;
  @name@_real x[@NAME@_N_X], next[@NAME@_N_X], u[ROWS], theta[@n_theta@];
  @name@_real R[@NAME@_POSES_SIZE_R], r[@NAME@_POSES_SIZE_r];
@declare@
  int step, i, k;
  memcpy(x, x0, sizeof x);
  memcpy(theta, @name@_theta0, sizeof theta);
  printf("     t [s]      x [m]      y [m]      z [m]\n");
  for (step = 0; step <= STEPS; ++step) {
    const double t = step * @NAME@_STEP_S;
    if (step % SHOWN == 0 || step == STEPS) {
      const @name@_real *R_last = R + 9 * (@NAME@_N_DISCS - 1), *tip = r + 3 * (@NAME@_N_DISCS - 1);
      if (failed("poses", t, @name@_poses(&work, sizeof work, x, theta, R, r))) return 1;
      printf("%10.4f", t);
      for (i = 0; i < 3; ++i) {
        double place = tip[i];
        for (k = 0; k < 3; ++k) place += (double)(R_last[3 * k + i] * centre[k]);
        printf(" %10.6f", place);
      }
      printf("\n");
    }
    if (step == STEPS) break;
    command(t, u);
    if (failed("step", t, @name@_step(&work, sizeof work, x, u, theta, next))) return 1;
    memcpy(x, next, sizeof x);
@recentre@
  }
  return 0;
}
