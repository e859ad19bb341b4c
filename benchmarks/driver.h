/* What every timing driver shares: states in, results out, nanoseconds per call on stdout.
 *
 * A driver includes this file and defines the four functions below; its main() calls run().
 * States cycle, so that no call repeats the last one's input and the branch predictor and the
 * caches see what a simulation shows them. Valid as C99 and as C++. */
#ifndef DRIVER_H
#define DRIVER_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static void load(int n_states, size_t width, const double *states); /* untimed; may copy */
static void evaluate(int state);                                    /* the timed call */
static const double *result(void);                                  /* of the last call */
static size_t result_size(void);

static void fail(const char *what, const char *which) {
    fprintf(stderr, "%s: %s\n", what, which);
    exit(1);
}

static double seconds_now(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double *read_states(const char *path, int n_states, size_t *width) {
    FILE *file = fopen(path, "rb");
    if (!file) fail("cannot read", path);
    fseek(file, 0, SEEK_END);
    const size_t count = (size_t)ftell(file) / sizeof(double);
    rewind(file);
    double *states = (double *)malloc((count + 1) * sizeof(double));
    if (!states || fread(states, sizeof(double), count, file) != count) fail("cannot read", path);
    fclose(file);
    *width = count / (size_t)n_states;
    return states;
}

static double time_calls(int n_states, long calls) {
    const double start = seconds_now();
    for (long call = 0, state = 0; call < calls; call++) {
        evaluate((int)state);
        if (++state == n_states) state = 0;
    }
    return seconds_now() - start;
}

/* argv: states file, number of states, results file, seconds to spend timing (0: results only). */
static int run(char **argv) {
    const int n_states = atoi(argv[1]);
    const double budget = atof(argv[3]);
    size_t width = 0;
    double *states = read_states(argv[0], n_states, &width);
    load(n_states, width, states);
    FILE *file = fopen(argv[2], "wb");
    if (!file) fail("cannot write", argv[2]);
    for (int state = 0; state < n_states; state++) {
        evaluate(state);
        if (fwrite(result(), sizeof(double), result_size(), file) != result_size())
            fail("cannot write", argv[2]);
    }
    fclose(file);
    if (budget > 0) {
        long calls = n_states;
        double spent = time_calls(n_states, calls); /* doubling until 1/8 of the budget: warm-up */
        while (spent < budget / 8) spent = time_calls(n_states, calls *= 2);
        calls = (long)((double)calls * budget / spent) + 1;
        printf("%.4f\n", 1e9 * time_calls(n_states, calls) / (double)calls);
    }
    free(states);
    return 0;
}

#endif
