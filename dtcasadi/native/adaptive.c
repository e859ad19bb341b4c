/* Integration loop around one generated step; `dtcasadi/integrators/loop.py` holds its twin.

   STEP(x, u, du, h, theta) -> x_next, error, slack is the generated function, N and NU the sizes of
   x and u. The caller owns every buffer, w and iw with the sizes the step asks for. Stops at t_end,
   when the output is full, when a watched state leaves its limit, or when a step fails. */
#include <math.h>

enum { AT_END = 0, FULL = 1, GUARD = 2, TOO_SMALL = 3, NOT_FINITE = 4, NEWTON = 5 };

typedef struct {
  double t, h, previous; /* time, next step, last accepted error */
  double t_end, rtol, atol, h_max, order, slack_max, limit;
  double t_command; /* when u holds; u + du (t - t_command) later */
  casadi_int adaptive, capacity, n_guard;
  casadi_int stored, accepted, rejected, broken; /* results; broken: rejected as not finite */
} dtc_loop;

casadi_int dtc_integrate(dtc_loop* s, const double* u, const double* du, const double* theta,
                         const casadi_int* guard, double* x, double* t_out, double* x_out,
                         const double** arg, double** res, casadi_int* iw, double* w) {
  double next[N], error[N], slack, command[NU + 1], h_step;
  const double shrink = 0.2, grow = 5.0, safety = 0.9;
  casadi_int i, last, after_reject = 0, why = TOO_SMALL;
  s->stored = 0;
  while (s->t < s->t_end) {
    double size = 0, sum = 0, h = s->h < s->h_max ? s->h : s->h_max;
    if (s->stored == s->capacity) return FULL;
    last = s->t + 1.0000001 * h >= s->t_end;
    if (last) h = s->t_end - s->t;
    if (!last && h < 1e-14 * (fabs(s->t) + fabs(s->t_end))) return why;
    for (i = 0; i < NU; ++i) command[i] = u[i] + du[i] * (s->t - s->t_command);
    h_step = h;
    arg[0] = x; arg[1] = command; arg[2] = du; arg[3] = &h_step; arg[4] = theta;
    res[0] = next; res[1] = error; res[2] = &slack;
    STEP(arg, res, iw, w, 0);
    for (i = 0; i < N; ++i) {
      double a = fabs(x[i]), b = fabs(next[i]);
      double e = error[i] / (s->atol + s->rtol * (a > b ? a : b));
      size += e * e;
      sum += next[i];
    }
    size = sqrt(size / N);
    if (!isfinite(sum) || !isfinite(size) || !(slack <= s->slack_max)) {
      why = isfinite(sum) && isfinite(size) ? NEWTON : NOT_FINITE;
      if (!s->adaptive) return why;
      s->h = 0.25 * h;
      ++s->rejected; ++s->broken;
      after_reject = 1;
      continue;
    }
    if (s->adaptive && size > 1) {
      double factor = safety * pow(size, -1 / s->order);
      s->h = h * (factor > shrink ? factor : shrink);
      ++s->rejected;
      after_reject = 1;
      why = TOO_SMALL;
      continue;
    }
    if (s->adaptive) {
      double bounded = size > 1e-10 ? size : 1e-10;
      double factor = safety * pow(bounded, -0.7 / s->order) * pow(s->previous, 0.4 / s->order);
      if (factor < shrink) factor = shrink;
      if (factor > grow) factor = grow;
      if (after_reject && factor > 1) factor = 1;
      /* A step cut short by the end says nothing about the size of the next one. */
      if (!last || h * factor < s->h) s->h = h * factor;
      s->previous = size > 1e-4 ? size : 1e-4;
    }
    after_reject = 0;
    s->t = last ? s->t_end : s->t + h;
    for (i = 0; i < N; ++i) x[i] = x_out[s->stored * N + i] = next[i];
    t_out[s->stored] = s->t;
    ++s->stored; ++s->accepted;
    for (i = 0; i < s->n_guard; ++i) if (fabs(x[guard[i]]) > s->limit) return GUARD;
  }
  return AT_END;
}
