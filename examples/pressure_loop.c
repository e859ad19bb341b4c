/* Plant, extended Kalman filter and pressure controller in one program, from the C that
 * pressure_loop.py exports. No memory is allocated; every array has its size from loop.h.
 *
 *   ./pressure_loop [STEPS]
 *
 * prints, for each step: command, height read, its reference, outcome and action (the numbers of
 * ocp.ControlStatus and ocp.Action), largest error of the estimate, time of the controller [us]. */
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "loop.h"

enum {
  N_X = LOOP_PLANT_SIZE_x,
  N_Y = LOOP_TIP_SIZE_y,
  N_REFERENCE = LOOP_CONTROL_SIZE_reference,
  N_MEMORY = LOOP_CONTROL_SIZE_memory
};

static loop_work work;
static double x[N_X], x_next[N_X], guess[N_X], P[N_X * N_X], moved[N_X], P_moved[N_X * N_X];
static double memory[N_MEMORY], memory_next[N_MEMORY], reference[N_REFERENCE];
static const double theta[1]; /* the robot has no free parameters */

/* The same numbers on every machine, between -0.5 and 0.5. */
static double noise(void) {
  static unsigned long state = 1;
  state = (1664525UL * state + 1013904223UL) & 0xffffffffUL;
  return (double)state / 4294967296.0 - 0.5;
}

static double microseconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

static void check(loop_status status, const char *what) {
  if (status == LOOP_OK) return;
  fprintf(stderr, "%s: %s\n", what, loop_status_text(status));
  exit(1);
}

int main(int argc, char **argv) {
  const int steps = argc > 1 ? atoi(argv[1]) : 200;
  double u[1] = {5.0}, y[N_Y], outcome, action, used, start;
  int i, k;
  for (i = 0; i < N_X; ++i) P[i * N_X + i] = 1e-4;
  check(loop_control_start(&work, sizeof work, u, memory), "control_start");
  for (k = 0; k < steps; ++k) {
    double error = 0;
    const double wish = k / 60 % 2 ? 2.45 : 2.75;
    /* Read the tip, the last reading of every fifty lost, and correct the estimate. */
    check(loop_tip(&work, sizeof work, x, u, theta, y), "tip");
    for (i = 0; i < N_Y; ++i) y[i] += 0.01 * noise();
    if (k % 50 == 49) y[N_Y - 1] = nan("");
    check(loop_update_tip(&work, sizeof work, guess, P, u, theta, y, moved, P_moved, NULL, NULL,
                          &used, NULL), "update");
    memcpy(guess, moved, sizeof guess);
    memcpy(P, P_moved, sizeof P);
    for (i = 0; i < N_X; ++i) error = fmax(error, fabs(guess[i] - x[i]));
    for (i = 0; i < N_REFERENCE; ++i) reference[i] = wish;
    start = microseconds();
    check(loop_control(&work, sizeof work, guess, theta, reference, memory, u, NULL, NULL, &outcome,
                       &action, NULL, NULL, memory_next), "control");
    start = microseconds() - start;
    memcpy(memory, memory_next, sizeof memory);
    printf("%.17g %.17g %g %g %g %.3g %.1f\n", u[0], y[1], wish, outcome, action, error, start);
    /* The plant and the filter move on. */
    check(loop_plant(&work, sizeof work, x, u, theta, x_next), "plant");
    memcpy(x, x_next, sizeof x);
    check(loop_predict(&work, sizeof work, guess, P, u, theta, moved, P_moved), "predict");
    memcpy(guess, moved, sizeof guess);
    memcpy(P, P_moved, sizeof P);
  }
  return 0;
}
