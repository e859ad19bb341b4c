/* Integration loop around one generated step; `dtcasadi/integrators/loop.py` holds its twin.

   STEP(x, u, du, h, theta) -> x_next, error, slack is the generated function, N and NU the sizes of
   x and u. The caller owns every buffer, w and iw with the sizes the step asks for. Stops at t_end,
   when the output is full, when a watched state leaves its limit or comes near a singularity, when
   a guard function changes sign, or when a step fails. */
#include <math.h>

enum {
  AT_END = 0, FULL = 1, GUARD = 2, TOO_SMALL = 3, NOT_FINITE = 4, NEWTON = 5, SINGULAR = 6, EVENT = 7
};
enum { LIMITED = 0, SINE = 1, COSINE = 2 }; /* what is watched of a state */

typedef struct {
  double t, h, previous; /* time, next step, last accepted error */
  double t_end, rtol, atol, h_max, order, slack_max, limit, near;
  double t_command; /* when u holds; u + du (t - t_command) later */
  casadi_int adaptive, capacity, n_guard, n_events;
  casadi_int stored, accepted, rejected, broken; /* results; broken: rejected as not finite */
  casadi_int event; /* result: which guard function changed sign */
} dtc_loop;

/* Guard functions g(t, x), n_events of them; not zero where one of them failed. */
typedef int (*dtc_guards)(double t, const double* x, double* g);

typedef struct {
  const double *u, *du, *theta;
  const double** arg;
  double** res;
  casadi_int* iw;
  double* w;
} dtc_step;

static void dtc_take(const dtc_loop* s, const dtc_step* p, const double* x, double h, double* next,
                     double* error, double* slack) {
  double command[NU + 1];
  casadi_int i;
  for (i = 0; i < NU; ++i) command[i] = p->u[i] + p->du[i] * (s->t - s->t_command);
  p->arg[0] = x; p->arg[1] = command; p->arg[2] = p->du; p->arg[3] = &h; p->arg[4] = p->theta;
  p->res[0] = next; p->res[1] = error; p->res[2] = slack;
  STEP(p->arg, p->res, p->iw, p->w, 0);
}

static int dtc_passed(double before, double after, casadi_int direction) {
  return (direction >= 0 && before < 0 && after >= 0) ||
         (direction <= 0 && before > 0 && after <= 0);
}

/* Shortens the step h from x to end just behind the first sign change of a guard function: the step
   itself is repeated with other sizes (Illinois method, Dahlquist, Bjoerck, section 6.2.2).
   Returns the new step, negative where a repeated step or a guard function failed. */
static double dtc_locate(dtc_loop* s, const dtc_step* p, dtc_guards guards,
                         const casadi_int* direction, const double* x, double h, double* next,
                         const double* g, double* g_next) {
  double trial[N], error[N], slack, found = h;
  casadi_int i, k, n = s->n_events;
  for (i = 0; i < n; ++i) {
    double low = 0, high = found, f_low = g[i], f_high = g_next[i];
    int side = 0;
    if (!dtc_passed(f_low, f_high, direction[i])) continue;
    s->event = i;
    for (k = 0; k < 100 && f_high != 0 && high - low > 1e-15 * (fabs(s->t) + h); ++k) {
      double h_try = low + (high - low) * f_low / (f_low - f_high);
      if (!(h_try > low && h_try < high)) h_try = 0.5 * (low + high);
      dtc_take(s, p, x, h_try, trial, error, &slack);
      if (guards(s->t + h_try, trial, g_next + n)) return -1;
      if (!isfinite(g_next[n + i])) return -1;
      if (dtc_passed(g[i], g_next[n + i], direction[i])) {
        high = h_try; f_high = g_next[n + i];
        if (side > 0) f_low *= 0.5;
        side = 1;
      } else {
        low = h_try; f_low = g_next[n + i];
        if (side < 0) f_high *= 0.5;
        side = -1;
      }
    }
    found = high;
    dtc_take(s, p, x, found, next, error, &slack);
    if (guards(s->t + found, next, g_next)) return -1;
  }
  return found;
}

casadi_int dtc_integrate(dtc_loop* s, const double* u, const double* du, const double* theta,
                         const casadi_int* guard, dtc_guards guards, const casadi_int* direction,
                         double* g, double* x, double* t_out, double* x_out, const double** arg,
                         double** res, casadi_int* iw, double* w) {
  double next[N], error[N], slack;
  const double shrink = 0.2, grow = 5.0, safety = 0.9;
  const dtc_step p = {u, du, theta, arg, res, iw, w};
  double* g_next = g + s->n_events;
  casadi_int i, last, after_reject = 0, why = TOO_SMALL;
  s->stored = 0;
  s->event = -1;
  if (s->n_events && guards(s->t, x, g)) return NOT_FINITE;
  while (s->t < s->t_end) {
    double size = 0, sum = 0, h = s->h < s->h_max ? s->h : s->h_max;
    if (s->stored == s->capacity) return FULL;
    last = s->t + 1.0000001 * h >= s->t_end;
    if (last) h = s->t_end - s->t;
    if (!last && h < 1e-14 * (fabs(s->t) + fabs(s->t_end))) return why;
    dtc_take(s, &p, x, h, next, error, &slack);
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
    if (s->n_events) {
      double shorter;
      if (guards(s->t + h, next, g_next)) return NOT_FINITE;
      shorter = dtc_locate(s, &p, guards, direction, x, h, next, g, g_next);
      if (shorter < 0) return NOT_FINITE;
      if (s->event >= 0) { h = shorter; last = last && s->t + h >= s->t_end; }
      for (i = 0; i < s->n_events; ++i) g[i] = g_next[i];
    }
    s->t = last ? s->t_end : s->t + h;
    for (i = 0; i < N; ++i) x[i] = x_out[s->stored * N + i] = next[i];
    t_out[s->stored] = s->t;
    ++s->stored; ++s->accepted;
    if (s->event >= 0) return EVENT;
    for (i = 0; i < s->n_guard; ++i) {
      const double value = x[guard[2 * i]];
      const casadi_int kind = guard[2 * i + 1];
      if (kind == LIMITED && fabs(value) > s->limit) return GUARD;
      if (kind == SINE && fabs(sin(value)) < s->near) return SINGULAR;
      if (kind == COSINE && fabs(cos(value)) < s->near) return SINGULAR;
    }
  }
  return AT_END;
}
