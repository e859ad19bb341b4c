/* Search for an equilibrium; `dtcasadi/statics/search.py` holds its twin and explains the method.

   BALANCE(q, s, pressure, tau, theta, d_pressure, d_tau, d_theta) -> residual, load, K, M, D, slope,
   NEWTON(residual, K, M, slope, shift, ground, normal, weight) -> dq, ds and, with centres,
   ABSORB(q, frames) -> frames are the generated functions, N the number of coordinates. The caller
   owns every buffer, w and iw with the sizes of the function that asks for most. */
#include <math.h>

enum { FOUND = 0, MOST = 1, STUCK = 2, NOT_FINITE = 3 };
enum { NEAREST = 0, SETTLE = 1 };

typedef struct {
  double rtol, floor, reach, limit; /* tolerances; longest step and charts' limit [rad] */
  double s, weight;                 /* the parameter, and its part in the constraint */
  double shift, ground, residual, load;
  casadi_int mode, most, n_centres;
  casadi_int iterations, evaluations, recentrings;
} dtc_search;

typedef struct {
  const double *pressure, *tau, *d_pressure, *d_tau, *d_theta, *normal;
  double *q, *theta, *F, *K, *M, *D, *slope;
  const casadi_int* centres; /* of each segment that re-centres: its place in q and in theta */
  const double** arg;
  double** res;
  casadi_int* iw;
  double* w;
} dtc_pointers;

static double find_largest(const double* x, casadi_int n, casadi_int stride) {
  double best = 0;
  casadi_int i;
  for (i = 0; i < n; ++i) {
    double a = fabs(x[i * stride]);
    if (!(a <= best)) best = a; /* NaN stays */
  }
  return best;
}

static double find_dot(const double* a, const double* b) {
  double sum = 0;
  casadi_int i;
  for (i = 0; i < N; ++i) sum += a[i] * b[i];
  return sum;
}

static void find_evaluate(dtc_search* s, dtc_pointers* p, const double* q, double at) {
  const double* in[] = {q,        &at,           p->pressure, p->tau,
                        p->theta, p->d_pressure, p->d_tau,    p->d_theta};
  double* out[] = {p->F, &s->load, p->K, p->M, p->D, p->slope};
  casadi_int i;
  for (i = 0; i < 8; ++i) p->arg[i] = in[i];
  for (i = 0; i < 6; ++i) p->res[i] = out[i];
  BALANCE(p->arg, p->res, p->iw, p->w, 0);
  s->residual = find_largest(p->F, N, 1);
  ++s->evaluations;
}

static void find_newton(dtc_search* s, dtc_pointers* p, double* dq, double* ds) {
  const double* in[] = {p->F,      p->K,       p->M,      p->slope,
                        &s->shift, &s->ground, p->normal, &s->weight};
  casadi_int i;
  for (i = 0; i < 8; ++i) p->arg[i] = in[i];
  p->res[0] = dq;
  p->res[1] = ds;
  NEWTON(p->arg, p->res, p->iw, p->w, 0);
}

/* Charts that have left 45 degrees absorb their pose; returns how many. */
static casadi_int find_recentre(dtc_search* s, dtc_pointers* p) {
  casadi_int i, j, count = 0;
  for (i = 0; i < s->n_centres; ++i) {
    double *q = p->q + p->centres[2 * i], *frames = p->theta + p->centres[2 * i + 1], next[18];
    if (!(fabs(q[1]) > s->limit || fabs(q[3]) > s->limit)) continue;
    p->arg[0] = q;
    p->arg[1] = frames;
    p->res[0] = next;
    ABSORB(p->arg, p->res, p->iw, p->w, 0);
    for (j = 0; j < 18; ++j) frames[j] = next[j];
    for (j = 0; j < 5; ++j) q[j] = 0;
    ++count;
  }
  s->recentrings += count;
  return count;
}

/* Newton step dq, ds; `shift` grows until it is one to follow. The work of the forces along dq. */
static double find_direction(dtc_search* s, dtc_pointers* p, double ratio, double* dq, double* ds) {
  casadi_int k;
  for (k = 0; k < 60; ++k) {
    double length, work;
    find_newton(s, p, dq, ds);
    length = find_largest(dq, N, 1);
    work = -find_dot(p->F, dq);
    if (isfinite(length) && isfinite(*ds) && length < 1e3 * s->reach &&
        (s->mode == NEAREST || work > 0.01 * sqrt(find_dot(p->F, p->F) * find_dot(dq, dq))))
      return work;
    s->shift = fmax(4 * s->shift, 1e-3 * ratio);
  }
  return NAN;
}

/* Goes along dq, ds as far as is good; returns 0 if no step is. */
static int find_advance(dtc_search* s, dtc_pointers* p, const double* dq, double ds, double work) {
  double next[N], t = fmin(1, s->reach / find_largest(dq, N, 1)), size = find_dot(p->F, p->F);
  casadi_int i, k;
  for (k = 0; k < 30; ++k) {
    double after, factor = 0.5;
    int good;
    for (i = 0; i < N; ++i) next[i] = p->q[i] + t * dq[i];
    find_evaluate(s, p, next, s->s + t * ds);
    if (s->mode == SETTLE) {
      after = -find_dot(p->F, dq);
      good = after >= -0.5 * work; /* false for NaN, as below */
      if (isfinite(after)) factor = fmax(0.1, work / (work - after));
    } else {
      after = find_dot(p->F, p->F);
      good = after <= (1 - 1e-4 * t) * size;
    }
    if (good) {
      for (i = 0; i < N; ++i) p->q[i] = next[i];
      s->s += t * ds;
      return 1;
    }
    t *= factor;
  }
  return 0;
}

/* One more Newton step, kept unless it makes the residual worse. */
static void find_polish(dtc_search* s, dtc_pointers* p, double* dq) {
  double ds, sign = 1, before = s->residual;
  casadi_int i, k;
  find_newton(s, p, dq, &ds);
  if (!(find_largest(dq, N, 1) < 1e-3) || !isfinite(ds)) return;
  for (k = 0; k < 2; ++k, sign = -1) {
    for (i = 0; i < N; ++i) p->q[i] += sign * dq[i];
    s->s += sign * ds;
    find_evaluate(s, p, p->q, s->s);
    if (s->residual <= 2 * before) return;
  }
}

casadi_int dtc_find(dtc_search* s, const double* pressure, const double* tau,
                       const double* d_pressure, const double* d_tau, const double* d_theta,
                       const double* normal, double* q, double* theta, double* F, double* K,
                       double* M, double* D, double* slope, const casadi_int* centres,
                       const double** arg, double** res, casadi_int* iw, double* w) {
  dtc_pointers p = {pressure, tau, d_pressure, d_tau, d_theta, normal, q,   theta, F,
                    K,        M,   D,          slope, centres, arg,    res, iw,    w};
  double dq[N], ds;
  find_evaluate(s, &p, q, s->s);
  for (;; ++s->iterations) {
    double stiffness = find_largest(K, N * N, 1), inertia = find_largest(M, N, N + 1), work;
    double ratio = stiffness > 0 && inertia > 0 ? stiffness / inertia : 1;
    if (!isfinite(s->residual) || !isfinite(stiffness)) return NOT_FINITE;
    s->ground = GROUND * stiffness;
    if (s->residual <= s->rtol * s->load + s->floor * stiffness) {
      s->shift = 0;
      find_polish(s, &p, dq);
      return FOUND;
    }
    if (s->iterations >= s->most) return MOST;
    work = find_direction(s, &p, ratio, dq, &ds);
    if (isnan(work) || !find_advance(s, &p, dq, ds, work)) return STUCK;
    s->shift *= 0.1;
    if (find_recentre(s, &p)) find_evaluate(s, &p, q, s->s);
  }
}
