/* Calls every wrapper of functions.inc on numbers from standard input and writes the results.
 *
 * functions.inc: headers, a function `static int call_<name>(void *, size_t, double **)` for each,
 * and `entries`. Every buffer is allocated with its exact size, so that a sanitizer or valgrind
 * sees what is beside it. With -DTHREADS=n as many threads repeat all calls at the same time and
 * must get the same bytes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef THREADS
#include <pthread.h>
#endif

typedef struct {
  const char *name;
  int (*call)(void *work, size_t bytes, double **ports);
  size_t work, ins, outs, sizes[16];
} entry;

#include "functions.inc"

enum { ENTRIES = sizeof entries / sizeof *entries };

static double *taken, *given;
static size_t n_taken, n_given;

static void fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  exit(1);
}

static void *exact(size_t bytes) {
  void *memory = malloc(bytes ? bytes : 1);
  if (!memory) fail("no memory");
  return memory;
}

static void evaluate(double *results) {
  const double *input = taken;
  size_t i, k;
  for (i = 0; i < ENTRIES; ++i) {
    const entry *e = entries + i;
    double *ports[16];
    void *work = exact(e->work);
    for (k = 0; k < e->ins + e->outs; ++k) {
      ports[k] = (double *)exact(e->sizes[k] * sizeof(double));
      if (k >= e->ins) continue;
      memcpy(ports[k], input, e->sizes[k] * sizeof(double));
      input += e->sizes[k];
    }
    if (e->call(work, e->work, ports)) fail(e->name);
    for (k = 0; k < e->ins + e->outs; ++k) {
      if (k >= e->ins) {
        memcpy(results, ports[k], e->sizes[k] * sizeof(double));
        results += e->sizes[k];
      }
      free(ports[k]);
    }
    free(work);
  }
}

#ifdef THREADS
static void *thread(void *results) {
  int k;
  for (k = 0; k < 50; ++k) evaluate((double *)results);
  return results;
}

static void in_threads(void) {
  pthread_t threads[THREADS];
  double *results[THREADS];
  int k;
  for (k = 0; k < THREADS; ++k) {
    results[k] = (double *)exact(n_given * sizeof(double));
    if (pthread_create(threads + k, NULL, thread, results[k])) fail("no thread");
  }
  for (k = 0; k < THREADS; ++k) {
    pthread_join(threads[k], NULL);
    if (memcmp(results[k], given, n_given * sizeof(double))) fail("threads differ");
    free(results[k]);
  }
}
#endif

int main(void) {
  size_t i, k;
  for (i = 0; i < ENTRIES; ++i) {
    for (k = 0; k < entries[i].ins + entries[i].outs; ++k)
      *(k < entries[i].ins ? &n_taken : &n_given) += entries[i].sizes[k];
  }
  taken = (double *)exact(n_taken * sizeof(double));
  given = (double *)exact(n_given * sizeof(double));
  if (fread(taken, sizeof(double), n_taken, stdin) != n_taken) fail("too few numbers");
  evaluate(given);
#ifdef THREADS
  in_threads();
#endif
  fwrite(given, sizeof(double), n_given, stdout);
  free(taken);
  free(given);
  return 0;
}
