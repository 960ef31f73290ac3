/* A system of segments and a rest: equilibrating it, eliminating, and solving with the factors of both.
 *
 * The segments are in one or two parts, which more than one thread can be at (see segmented_parts.h); what
 * they leave to the rest is put together here.  Vectors are in the order of the segments, the rest behind them from
 * outer on.  Entry e of the rest off the diagonal is given[source[e]] in the places first[e] and second[e]
 * of vectors; the entries of segments are where the tables of lanes.h say. */
#include "../native.h"
#include "lane_rows.h"
#include "lane_state.h"
#include "segmented_parts.h"
#include "segmented_passes.h"
#include "substitution.h"
#include "values.h"

int64_t segmented_passes_diagonal_of(int64_t n, int64_t m, int64_t at, int64_t curvatures, int64_t curved,
                                     const int32_t *restrict curved_variable, const int32_t *restrict curved_source,
                                     int64_t checked, const double *restrict given, double *restrict diagonal,
                                     int64_t *restrict found) {
    const double *own = given + at;
    for (int64_t k = 0; k < n; k++) diagonal[k] = own[k];
    for (int64_t k = n; k < n + m; k++) diagonal[k] = -own[k];
    for (int64_t k = 0; k < curved; k++) diagonal[curved_variable[k]] += given[curved_source[k]];
    double check = 0.0;
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < n + m; k++) check += diagonal[k] * 0.0;
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < checked; k++) check += given[k] * 0.0;
    int64_t k = 0;
    while (k < curvatures && given[k] == 0.0) k++;
    found[0] = k < curvatures ? 1 : 0;
    return check == 0.0 ? 0 : 1;
}

/* Largest entry of each row of S K S. */
static void largest_of_rows(int64_t fetched, int64_t groups, const int64_t *restrict table,
                            const int32_t *restrict index, const int32_t *restrict code, int64_t outer,
                            int64_t rest, int64_t entries, const int32_t *restrict first,
                            const int32_t *restrict second, const int32_t *restrict source,
                            const double *restrict given, const double *restrict diagonal,
                            const double *restrict scale, double *restrict most, double *restrict scales,
                            double *restrict part) {
    for (int64_t k = outer; k < outer + rest; k++) most[k] = fabs(diagonal[index[k]]) * scale[k] * scale[k];
    for (int64_t e = 0; e < entries; e++) {
        int64_t a = first[e];
        int64_t b = second[e];
        double value = fabs(given[source[e]]) * scale[a] * scale[b];
        most[a] = dmax(most[a], value);
        most[b] = dmax(most[b], value);
    }
    lane_rows_largest_in_segments(fetched, groups, table, index, code, given, diagonal, scale, most, scales, part);
}

int64_t segmented_passes_equilibrate_all(int64_t sweeps, int64_t fetched, int64_t groups,
                                         const int64_t *restrict table, const int32_t *restrict index,
                                         const int32_t *restrict code, int64_t outer, int64_t rest, int64_t entries,
                                         const int32_t *restrict first, const int32_t *restrict second,
                                         const int32_t *restrict source, const double *restrict given,
                                         const double *restrict diagonal, double *restrict scale,
                                         double *restrict most, double *restrict scales, double *restrict part) {
    largest_of_rows(fetched, groups, table, index, code, outer, rest, entries, first, second, source, given,
                    diagonal, scale, most, scales, part);
    int64_t size = outer + rest;
    if (!(values_spread_of(size, most) > STALE)) return 0;
    double far = 0.0;
    for (int64_t k = 0; k < size; k++) {
        far = dmax(far, fabs(scale[k] - 1.0));
        scale[k] = 1.0;
    }
    for (int64_t sweep = 0; sweep < sweeps; sweep++) {
        if (sweep > 0 || far != 0.0) {
            largest_of_rows(fetched, groups, table, index, code, outer, rest, entries, first, second, source, given,
                            diagonal, scale, most, scales, part);
        }
        if (values_find_scale(size, most, scale) == 0) break;
    }
    return 1;
}

/* Put the scaled entries of the rest into result, filled of them and a diagonal, and keep them.
 *
 * Returns 0, or nan where an entry is not finite. */
static double load_rest(const int32_t *restrict index, int64_t outer, int64_t rest, int64_t entries,
                        const int32_t *restrict target, const int32_t *restrict first,
                        const int32_t *restrict second, const int32_t *restrict source, int64_t variables,
                        int64_t filled, const double *restrict given, const double *restrict diagonal,
                        const double *restrict scale, double *restrict most, double *restrict matrix,
                        double *restrict result) {
    double check = 0.0;
    for (int64_t k = 0; k < filled; k++) result[k] = 0.0;
    for (int64_t k = 0; k < rest; k++) {
        int64_t at = outer + k;
        double value = diagonal[index[at]] * scale[at] * scale[at];
        matrix[k] = value;
        most[at] = fabs(value);
        result[filled + k] = k < variables ? value : -value;
    }
    double *own = matrix + rest;
    for (int64_t k = 0; k < entries; k++) {
        int64_t a = first[k];
        int64_t b = second[k];
        double value = given[source[k]] * scale[a] * scale[b];
        check += value * 0.0;
        own[k] = value;
        most[a] = nanmax(most[a], fabs(value));
        most[b] = nanmax(most[b], fabs(value));
        result[target[k]] = value;
    }
    return check;
}

int64_t segmented_passes_eliminate_all(const int64_t *calls, int64_t place, int64_t parts, double *states,
                                       const double *spreads, int64_t length, const double *other_results,
                                       const double *other_most, const int32_t *index, const double *given,
                                       const double *diagonal, const double *scale, double *most, double *result,
                                       double *state, int64_t outer, int64_t rest, int64_t entries,
                                       const int32_t *target, const int32_t *first, const int32_t *second,
                                       const int32_t *source, int64_t variables, int64_t filled,
                                       double *rest_matrix) {
    double check = load_rest(index, outer, rest, entries, target, first, second, source, variables, filled, given,
                             diagonal, scale, most, rest_matrix, result);
    if (check != 0.0) return SEGMENTED_PASSES_REFUSED;
    int64_t watched = lane_state_is_watched(state);
    for (int64_t part = 0; part < parts; part++) states[part * STATE + LANE_STATE_WATCHED] = 1.0 * watched;
    invoke(calls, place);
    if (lane_state_put_together(parts, states, state) != 0) return SEGMENTED_PASSES_REFUSED;
    for (int64_t part = 1; part < parts; part++) values_add_to(length, other_results + (part - 1) * length, result);
    if (watched == 0) return lane_state_is_doubtful(state) != 0 ? DOUBTED_SCALE : 0;
    for (int64_t part = 1; part < parts; part++)
        values_raise_to(rest, other_most + (part - 1) * (outer + rest) + outer, most + outer);
    double highest = values_spread_of(rest, most + outer);
    for (int64_t part = 0; part < parts; part++)
        highest = dmax(highest, lane_state_spread_in(spreads + SPREADS * part));
    lane_state_note_watched(highest, state);
    return highest > STALE ? STALE_SCALE : 0;
}

/* z = y - K x for the entries of the rest. */
static void subtract_rest(int64_t outer, int64_t rest, int64_t entries, const int32_t *restrict first,
                          const int32_t *restrict second, const double *restrict matrix, const double *restrict x,
                          const double *restrict y, double *restrict z) {
    for (int64_t k = 0; k < rest; k++) {
        int64_t at = outer + k;
        z[at] = y[at] - matrix[k] * x[at];
    }
    const double *own = matrix + rest;
    for (int64_t e = 0; e < entries; e++) {
        int64_t a = first[e];
        int64_t b = second[e];
        z[a] -= own[e] * x[b];
        z[b] -= own[e] * x[a];
    }
}

/* The largest magnitude, nan when not all is finite. */
static double largest_in(int64_t count, const double *restrict x) {
    double check = 0.0;
    double high = 0.0;
#pragma omp simd reduction(+ : check) reduction(highest : high)
    for (int64_t k = 0; k < count; k++) {
        check += x[k] * 0.0;
        high = nanmax(high, fabs(x[k]));
    }
    return high + check;
}

/* The larger one, nan where either is. */
static double higher(double a, double b) {
    return dmax(a, b) + (a + b) * 0.0;
}

/* What the rest has before the segments add to it. */
static void begin_forward(int64_t outer, int64_t rest, const double *restrict x, double *restrict between) {
    for (int64_t k = outer; k < outer + rest; k++) between[k] = x[k];
}

/* The rest's right-hand side, what the parts but the first have left added. */
static void collect(int64_t parts, int64_t outer, int64_t rest, const double *restrict left,
                    double *restrict between, double *restrict rest_rhs) {
    for (int64_t part = 1; part < parts; part++)
        values_add_to(rest, left + (part - 1) * (outer + rest) + outer, between + outer);
    for (int64_t k = 0; k < rest; k++) rest_rhs[k] = between[outer + k];
}

/* The rest's solution; where that is what is to be added, so it is. */
static void return_(int64_t outer, int64_t rest, const double *restrict rest_solution, int64_t added,
                    double *restrict y, double *restrict solution) {
    for (int64_t k = 0; k < rest; k++) y[outer + k] = rest_solution[k];
    if (added != 0) values_add_to(rest, y + outer, solution + outer);
}

/* Put together what the parts and the rest have of y - K x; its largest magnitude, and that of x. */
static void end_products(int64_t parts, int64_t place, int64_t outer, int64_t rest, const double *restrict x,
                         const double *restrict left, double *restrict z, const double *restrict norms,
                         double *restrict report) {
    for (int64_t part = 1; part < parts; part++)
        values_add_to(rest, left + (part - 1) * (outer + rest) + outer, z + outer);
    report[0] = largest_in(rest, x + outer);
    report[1] = largest_in(rest, z + outer);
    for (int64_t part = 0; part < parts; part++) {
        report[0] = higher(report[0], norms[NORMS * part + place]);
        report[1] = higher(report[1], norms[NORMS * part + place + 1]);
    }
}

void segmented_passes_solve_all(int64_t both, int64_t refinements, const double *accuracy, const int64_t *calls,
                                int64_t place, int64_t parts, int64_t *progress, const double *norms, double *high,
                                const double *left, const double *other_left, const int32_t *index, int64_t outer,
                                int64_t rest, int64_t entries, const int32_t *first, const int32_t *second,
                                const double *rest_matrix, const double *scale, int64_t rest_place, double *rest_rhs,
                                const double *rest_solution, double *other_rest_rhs,
                                const double *other_rest_solution, const double *rhs, double *scaled_rhs,
                                double *solution, double *change, double *between, double *kept, double *result,
                                const double *other_rhs, double *other_scaled_rhs, double *other_solution,
                                double *other_change, double *other_between, double *other_kept,
                                double *other_result, double *report, double *other_report) {
    int64_t size = outer + rest;
    double length = values_bring_scaled(rest, index + outer, scale + outer, rhs, scaled_rhs + outer);
    double other_length = 0.0;
    if (both != 0)
        other_length = values_bring_scaled(rest, index + outer, scale + outer, other_rhs, other_scaled_rhs + outer);
    progress[SEGMENTED_PARTS_STEPS] = 0;
    progress[ACTIVE] = 1;
    progress[OTHER_ACTIVE] = both;
    int64_t going = 1;
    while (going != 0) {
        int64_t steps = progress[SEGMENTED_PARTS_STEPS];
        /* The first solution needs no vector for the change, nor one that was there before. */
        const double *source = change + 0;
        double *target = kept + 0;
        const double *other_source = other_change + 0;
        double *other_target = other_kept + 0;
        if (steps == 0) {
            source = scaled_rhs + 0;
            target = solution + 0;
            other_source = other_scaled_rhs + 0;
            other_target = other_solution + 0;
        }
        begin_forward(outer, rest, source, between);
        if (both != 0) begin_forward(outer, rest, other_source, other_between);
        invoke(calls, place + SEGMENTED_PARTS_FORWARD);
        if (steps == 0) {
            for (int64_t part = 0; part < parts; part++) {
                length = dmax(length, norms[NORMS * part + RIGHT]);
                other_length = dmax(other_length, norms[NORMS * part + OTHER_RIGHT]);
            }
            if (!(length > 0.0)) progress[ACTIVE] = 0;
            if (both == 0 || !(other_length > 0.0)) progress[OTHER_ACTIVE] = 0;
            report[0] = 1.0 * progress[ACTIVE];
            report[2] = 0.0;
            other_report[0] = 1.0 * progress[OTHER_ACTIVE];
        }
        collect(parts, outer, rest, left, between, rest_rhs);
        if (both != 0) collect(parts, outer, rest, other_left, other_between, other_rest_rhs);
        invoke(calls, rest_place + both);
        int64_t active = progress[ACTIVE];
        int64_t other_active = progress[OTHER_ACTIVE];
        int64_t refining = steps > 0 ? 1 : 0;
        return_(outer, rest, rest_solution, refining * active, target, solution);
        subtract_rest(outer, rest, entries, first, second, rest_matrix, solution, scaled_rhs, change);
        if (both != 0) {
            return_(outer, rest, other_rest_solution, refining * other_active, other_target, other_solution);
            subtract_rest(outer, rest, entries, first, second, rest_matrix, other_solution, other_scaled_rhs,
                          other_change);
        }
        invoke(calls, place + SEGMENTED_PARTS_BACKWARD);
        report[1] = 1.0 * steps;
        end_products(parts, 0, outer, rest, solution, left, change, norms, high);
        if (steps == 0 && active != 0) report[2] = high[0] / length;
        if (active != 0) {
            active = substitution_improves(size, steps, refinements, accuracy[0], high[1], length, high[0], report,
                                           kept, solution);
        }
        if (both != 0) {
            end_products(parts, 2, outer, rest, other_solution, other_left, other_change, norms, high);
            if (other_active != 0) {
                other_active = substitution_improves(size, steps, refinements, accuracy[0], high[1], other_length,
                                                     high[0], other_report, other_kept, other_solution);
            }
        }
        progress[SEGMENTED_PARTS_STEPS] = steps + 1;
        progress[ACTIVE] = active;
        progress[OTHER_ACTIVE] = other_active;
        going = active + other_active;
    }
    invoke(calls, place + SEGMENTED_PARTS_RETURN);
    values_return_scaled(rest, index + outer, scale + outer, solution + outer, result);
    if (both != 0) {
        values_return_scaled(rest, index + outer, scale + outer, other_solution + outer, other_result);
        report[0] = dmax(report[0], other_report[0]);
    }
}
