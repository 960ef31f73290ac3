/* Random KKT systems through the core, under sanitizers: the inertia against dense elimination, residuals, and no fault.
 *
 *     fuzz SEED COUNT
 *
 * Prints the number of systems, or what failed. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kkt.h"

static uint64_t state;

static uint64_t next(void) { /* SplitMix64 */
    uint64_t z = state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static int below(int count) { return (int)(next() % (uint64_t)count); }
static double uniform(void) { return (double)(next() >> 11) * 0x1p-53; }
static double normal(void) { return sqrt(-2.0 * log(uniform() + 1e-300)) * cos(6.283185307179586 * uniform()); }

/* Eigenvalues below zero of a dense matrix, by Jacobi rotations; the smallest magnitude over the largest. */
static int negative_of(double *a, int size, double *margin) {
    for (int sweep = 0; sweep < 60; sweep++) {
        double off = 0.0, all = 0.0;
        for (int i = 0; i < size; i++)
            for (int j = 0; j < size; j++) {
                all += a[i * size + j] * a[i * size + j];
                if (i != j) off += a[i * size + j] * a[i * size + j];
            }
        if (off <= 1e-28 * all) break;
        for (int p = 0; p < size; p++)
            for (int q = p + 1; q < size; q++) {
                double b = a[p * size + q];
                if (b == 0.0) continue;
                double t = (a[q * size + q] - a[p * size + p]) / (2.0 * b);
                t = (t >= 0.0 ? 1.0 : -1.0) / (fabs(t) + sqrt(1.0 + t * t));
                double c = 1.0 / sqrt(1.0 + t * t), s = t * c;
                for (int k = 0; k < size; k++) {
                    double x = a[k * size + p], y = a[k * size + q];
                    a[k * size + p] = c * x - s * y;
                    a[k * size + q] = s * x + c * y;
                }
                for (int k = 0; k < size; k++) {
                    double x = a[p * size + k], y = a[q * size + k];
                    a[p * size + k] = c * x - s * y;
                    a[q * size + k] = s * x + c * y;
                }
            }
    }
    int count = 0;
    double least = INFINITY, most = 0.0;
    for (int i = 0; i < size; i++) {
        double value = a[i * size + i];
        count += value < 0.0;
        least = fabs(value) < least ? fabs(value) : least;
        most = fabs(value) > most ? fabs(value) : most;
    }
    *margin = most > 0.0 ? least / most : 0.0;
    return count;
}

enum { MOST = 400 };

static int try_one(void) {
    static int32_t hess_rows[MOST * MOST], hess_cols[MOST * MOST], jac_rows[MOST * MOST], jac_cols[MOST * MOST], stage[MOST];
    int stages = 1 + below(8), width = 1 + below(9), n = stages * width, m = below(n + 1), size = n + m;
    int64_t h = 0, j = 0;
    double density = 0.05 + 0.9 * uniform();
    int last = below(4) ? -1 : n - 1; /* a variable that does */
    for (int i = 0; i < n; i++) stage[i] = i / width;
    for (int i = 0; i < m; i++) stage[n + i] = m ? i * stages / m : 0;
    for (int a = 0; a < n; a++)
        for (int b = 0; b <= a; b++)
            if (a == last || (stage[a] - stage[b] < 2 && uniform() < density)) {
                hess_rows[h] = a;
                hess_cols[h++] = b;
            }
    for (int r = 0; r < m; r++) {
        int whole = below(20) == 0; /* a row that couples with everything */
        for (int a = 0; a < n; a++)
            if (whole || (abs(stage[n + r] - stage[a]) < 2 && uniform() < density) || below(200) == 0) {
                jac_rows[j] = r;
                jac_cols[j++] = a;
            }
    }
    double *dense = calloc((size_t)(size * size + 1), sizeof(double));
    double *numbers = calloc((size_t)(h + j + 8 * size + 64), sizeof(double)), *at = numbers;
    double *hess = at, *jac = (at += h), *primal = (at += j), *dual = (at += n), *rhs = (at += m), *second = (at += size);
    double *solution = (at += size), *other = (at += size);
    int64_t inertia[3];
    /* Entries off the diagonal, by column: of the same unknown before those of others, H before J. */
    static int32_t column[MOST * MOST], row[MOST * MOST], source[MOST * MOST], start[MOST + 1], unknown[MOST];
    static int32_t curved_variable[MOST], curved_source[MOST];
    int32_t entries = 0, curved = 0;
    for (int a = 0; a < size; a++) {
        unknown[a] = a;
        start[a] = entries;
        for (int32_t e = 0; e < h; e++)
            if (hess_cols[e] == a && hess_rows[e] != a) {
                row[entries] = hess_rows[e];
                source[entries] = e;
                column[entries++] = a;
            } else if (hess_cols[e] == a) {
                curved_variable[curved] = a;
                curved_source[curved++] = e;
            }
        for (int32_t e = 0; e < j; e++)
            if (jac_cols[e] == a) {
                row[entries] = n + jac_rows[e];
                source[entries] = (int32_t)h + e;
                column[entries++] = a;
            }
    }
    start[size] = entries;
    kkt system = {.n = n, .m = m, .total = size, .given_count = h + j, .curved = curved, .curved_variable = curved_variable,
                  .curved_source = curved_source, .size = size, .variables = n, .entries = entries, .filled = entries,
                  .column = column, .row = row, .start = start, .source = source, .unknown = unknown, .stage = stage,
                  .given = hess, .rhs = rhs, .second_rhs = second, .solution = solution, .second_solution = other,
                  .report = (at += size), .accuracy = (at += 3), .inertia = inertia, .fine = 1e-13};
    int failed = kkt_new(&system) != KKT_OK;
    for (int matrix = 0; matrix < 4 && !failed; matrix++) {
        int whole = below(4) == 0;
        for (int64_t k = 0; k < h; k++) hess[k] = whole ? below(5) - 2 : normal() * (below(5) ? 1.0 : 0.0);
        for (int64_t k = 0; k < j; k++) jac[k] = whole ? below(5) - 2 : normal();
        for (int k = 0; k < n; k++) primal[k] = below(3) ? 0.0 : whole ? below(3) : pow(10.0, 16.0 * uniform() - 8.0);
        for (int k = 0; k < m; k++) dual[k] = below(2) ? 0.0 : whole ? below(3) : pow(10.0, 12.0 * uniform() - 8.0);
        memset(dense, 0, sizeof(double) * (size_t)(size * size));
        for (int64_t k = 0; k < h; k++) dense[hess_rows[k] * size + hess_cols[k]] = dense[hess_cols[k] * size + hess_rows[k]] = hess[k];
        for (int64_t k = 0; k < j; k++)
            dense[(n + jac_rows[k]) * size + jac_cols[k]] = dense[jac_cols[k] * size + n + jac_rows[k]] = jac[k];
        for (int k = 0; k < n; k++) dense[k * size + k] += primal[k];
        for (int k = 0; k < m; k++) dense[(n + k) * size + n + k] -= dual[k];
        system.replan = below(3) == 0;
        system.threshold = below(2) ? 1e-4 : 0.4 * uniform();
        int64_t ended = kkt_refactor(&system);
        if (ended > KKT_SINGULAR || inertia[0] + inertia[1] + inertia[2] != size) {
            printf("ended with %d, inertia %d %d %d of %d\n", (int)ended, (int)inertia[0], (int)inertia[1], (int)inertia[2], size);
            failed = 1;
        }
        for (int k = 0; k < size; k++) rhs[k] = normal();
        for (int k = 0; k < size; k++) second[k] = normal();
        if (!failed && (below(2) ? kkt_solve(&system) : kkt_solve_both(&system))) failed = 1;
        for (int k = 0; k < size && !failed; k++)
            if (!isfinite(solution[k])) failed = 1;
        if (failed) break;
        double residual = 0.0, scale = 0.0, margin;
        for (int a = 0; a < size; a++) {
            double sum = -rhs[a], terms = fabs(rhs[a]);
            for (int b = 0; b < size; b++) {
                sum += dense[a * size + b] * solution[b];
                terms += fabs(dense[a * size + b] * solution[b]);
            }
            residual = fabs(sum) > residual ? fabs(sum) : residual;
            scale = terms > scale ? terms : scale;
        }
        /* Scaled like the core does it: otherwise diagonals of 1e8 hide everything. */
        double *scales = malloc(sizeof(double) * (size_t)(size + 1));
        for (int k = 0; k < size; k++) scales[k] = 1.0;
        for (int sweep = 0; sweep < 20; sweep++)
            for (int a = 0; a < size; a++) {
                double most = 0.0;
                for (int b = 0; b < size; b++) {
                    double value = fabs(dense[a * size + b]) * scales[a] * scales[b];
                    most = value > most ? value : most;
                }
                if (most > 0.0) scales[a] /= sqrt(most);
            }
        for (int a = 0; a < size; a++)
            for (int b = 0; b < size; b++) dense[a * size + b] *= scales[a] * scales[b];
        free(scales);
        int negative = negative_of(dense, size, &margin);
        if (margin > 1e-9 && (inertia[1] != negative || inertia[2] || residual > 1e-8 * scale)) {
            printf("n %d m %d: %d negative and %d zero, not %d; residual %g of %g, margin %g\n", n, m, (int)inertia[1],
                   (int)inertia[2], negative, residual, scale, margin);
            failed = 1;
        }
    }
    kkt_free(&system);
    free(dense);
    free(numbers);
    return failed;
}

int main(int count, char **arguments) {
    state = count > 1 ? strtoull(arguments[1], NULL, 10) : 1;
    int systems = count > 2 ? atoi(arguments[2]) : 100;
    for (int k = 0; k < systems; k++) {
        uint64_t before = state;
        if (try_one()) {
            printf("failed: system %d, state %llu\n", k, (unsigned long long)before);
            return 1;
        }
    }
    printf("%d systems\n", systems);
    return 0;
}
