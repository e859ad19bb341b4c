/* Times one function on SIMD lanes, `<FUNCTION>_batch` of native/batch.hpp: all states of the file
 * in one call, which counts as a call for each of them.
 *
 * argv: shared file, then driver.h's; files as in ours.c. */
#include "driver.h"

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define CALL(suffix) JOIN(FUNCTION, suffix)

int CALL(_batch)(size_t n, const double *const *in, const size_t *ld_in, double *const *out,
                 const size_t *ld_out, void *work, size_t bytes);
size_t CALL(_batch_bytes)(void);

/* Entries of each argument and of the result, as the compiler is told. */
static const size_t rows_in[] = {ROWS_IN}, rows_out = ROWS_OUT;
enum { N_IN = sizeof rows_in / sizeof *rows_in };

static const double *in[N_IN];
static size_t ld_in[N_IN], bytes, n_robots, n_shared;
static double *shared, *out, *row;
static void *work;

static void load(int n_states, size_t width, const double *states) {
    size_t used = 0;
    n_robots = (size_t)n_states;
    for (size_t port = 0; port < N_IN; port++) {
        double *to = (double *)calloc(rows_in[port] * n_robots + 1, sizeof(double));
        const int own = used < width || rows_in[port] == 0;
        for (size_t k = 0; k < rows_in[port]; k++)
            for (size_t i = 0; i < n_robots; i++)
                to[k * n_robots + i] = own ? states[i * width + used + k] : 0;
        in[port] = own ? to : shared + (used - width);
        ld_in[port] = own ? n_robots : 0;
        used += rows_in[port];
    }
    if (used != width + n_shared) fail("inputs do not fit the function", "ours_batch");
    out = (double *)calloc(rows_out * n_robots + 1, sizeof(double));
    row = (double *)calloc(rows_out + 1, sizeof(double));
    bytes = CALL(_batch_bytes)();
    work = malloc(bytes);
}

static int current;

static void evaluate(int state) {
    double *const results[] = {out};
    current = state;
    if (state == 0) CALL(_batch)(n_robots, in, ld_in, results, &n_robots, work, bytes);
}

static const double *result(void) {
    for (size_t k = 0; k < rows_out; k++) row[k] = out[k * n_robots + (size_t)current];
    return row;
}

static size_t result_size(void) { return rows_out; }

int main(int argc, char **argv) {
    if (argc != 6) fail("usage", "ours_batch SHARED STATES N_STATES RESULTS SECONDS");
    shared = read_states(argv[1], 1, &n_shared);
    return run(argv + 2);
}
