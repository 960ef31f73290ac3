"""A system of segments and a rest: equilibrating it, and solving with the factors of both.

Vectors are in the order of the segments, the rest behind them from ``outer`` on.  Entry e of the rest off the diagonal
is ``given[source[e]]`` in the places ``first[e]`` and ``second[e]`` of vectors; the entries of segments are where the
tables of stc.solver.kkt.lanes say.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.lane_panel import COUNTED, is_doubtful, is_watched, note_watched
from stc.solver.kkt.lane_rows import largest_in_segments, subtract_segments
from stc.solver.kkt.lane_solve import backward, forward
from stc.solver.kkt.lanes import eliminate
from stc.solver.kkt.substitution import improves, substitute
from stc.solver.kkt.values import find_scale, spread_of

__all__ = ["bring_scaled", "diagonal_of", "eliminate_all", "equilibrate_all", "return_scaled", "solve_all"]

#: A scale serves as long as the largest entries of all rows are within this factor of 1.
STALE = 1024.0
#: Results of ``eliminate_all``.
REFUSED = 1
STALE_SCALE = 2
DOUBTED_SCALE = 3


@native(fast=True)
def diagonal_of(
    n: i64, m: i64, at: i64, curvatures: i64, curved: i64, curved_variable: i32s, curved_source: i32s, given: f64s,
    diagonal: f64s, count: i64s,
) -> i64:  # fmt: skip
    """Collect the diagonal, (n + m,); p and d begin at ``given[at]``.  Returns 0, or 1 when not all is finite.

    ``count[0]`` becomes the number of entries of H that are not zero, of which ``curvatures`` are given first.
    """
    own = given[at:]
    for k in range(n):
        diagonal[k] = own[k]
    for k in range(n, n + m):
        diagonal[k] = -own[k]
    for k in range(curved):
        diagonal[curved_variable[k]] += given[curved_source[k]]
    check = 0.0
    found = 0
    for k in range(curvatures):
        check += given[k] * 0.0
        found += given[k] != 0.0
    for k in range(curvatures, at + n + m):
        check += given[k] * 0.0
    count[0] = found
    return 0 if check == 0.0 else 1


@native
def _largest_of_rows(
    distance: i64, groups: i64, table: i64s, index: i32s, code: i32s, outer: i64, rest: i64, entries: i64, first: i32s,
    second: i32s, source: i32s, given: f64s, diagonal: f64s, scale: f64s, most: f64s, scales: f64s, part: f64s,
) -> None:  # fmt: skip
    """Largest entry of each row of S K S."""
    for k in range(outer, outer + rest):
        most[k] = fabs(diagonal[index[k]]) * scale[k] * scale[k]
    for e in range(entries):
        a = first[e]
        b = second[e]
        value = fabs(given[source[e]]) * scale[a] * scale[b]
        most[a] = max(most[a], value)
        most[b] = max(most[b], value)
    largest_in_segments(distance, groups, table, index, code, given, diagonal, scale, most, scales, part)


@native
def equilibrate_all(
    sweeps: i64,
    distance: i64,
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    outer: i64,
    rest: i64,
    entries: i64,
    first: i32s,
    second: i32s,
    source: i32s,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    most: f64s,
    scales: f64s,
    part: f64s,
) -> i64:
    """Make ``scale`` serve the matrix (see ``stc.solver.kkt.values.equilibrate``); whether it did not do so before."""
    _largest_of_rows(
        distance, groups, table, index, code, outer, rest, entries, first, second, source, given, diagonal, scale, most,
        scales, part,
    )  # fmt: skip
    size = outer + rest
    if not (spread_of(size, most) > STALE):
        return 0
    far = 0.0
    for k in range(size):
        far = max(far, fabs(scale[k] - 1.0))
        scale[k] = 1.0
    for sweep in range(sweeps):
        if sweep > 0 or far != 0.0:
            _largest_of_rows(
                distance, groups, table, index, code, outer, rest, entries, first, second, source, given, diagonal,
                scale, most, scales, part,
            )  # fmt: skip
        if find_scale(size, most, scale) == 0:
            break
    return 1


@native(fast=True)
def _load_rest(
    index: i32s, outer: i64, rest: i64, entries: i64, target: i32s, first: i32s, second: i32s, source: i32s,
    variables: i64, filled: i64, given: f64s, diagonal: f64s, scale: f64s, most: f64s, matrix: f64s, result: f64s,
) -> None:  # fmt: skip
    """Put the scaled entries of the rest into ``result``, ``filled`` of them and a diagonal, and keep them."""
    for k in range(filled):
        result[k] = 0.0
    for k in range(rest):
        at = outer + k
        value = diagonal[index[at]] * scale[at] * scale[at]
        matrix[k] = value
        most[at] = fabs(value)
        result[filled + k] = value if k < variables else -value
    own = matrix[rest:]
    for k in range(entries):
        a = first[k]
        b = second[k]
        value = given[source[k]] * scale[a] * scale[b]
        own[k] = value
        most[a] = max(most[a], fabs(value))
        most[b] = max(most[b], fabs(value))
        result[target[k]] = value


@native
def eliminate_all(
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    growth: f64,
    suspect: f64,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    result: f64s,
    work: f64s,
    scales: f64s,
    columns: f64s,
    made: f64s,
    matrix: f64s,
    row_most: f64s,
    most: f64s,
    spread: f64s,
    factors: f64s,
    state: f64s,
    outer: i64,
    rest: i64,
    entries: i64,
    target: i32s,
    first: i32s,
    second: i32s,
    source: i32s,
    variables: i64,
    filled: i64,
    rest_matrix: f64s,
) -> i64:
    """Load the rest, eliminate the segments (see ``eliminate``) and add what they leave to the rest, ``result``.

    Returns:
        0, ``REFUSED`` when a pivot was not accepted, ``STALE_SCALE`` when the scale does not serve the matrix,
        ``DOUBTED_SCALE`` when it was not tested but perhaps does not; ``state[COUNTED]`` becomes the number of negative
        pivots.
    """
    _load_rest(
        index, outer, rest, entries, target, first, second, source, variables, filled, given, diagonal, scale, most,
        rest_matrix, result,
    )  # fmt: skip
    for k in range(16):
        spread[k] = -STALE
    watched = is_watched(state)
    negative = eliminate(
        groups, table, index, code, growth, suspect, given, diagonal, scale, result, work, scales, columns,
        made, matrix, watched, row_most, most, spread, factors, state,
    )  # fmt: skip
    state[COUNTED] = 1.0 * negative
    if negative < 0:
        return REFUSED
    if watched == 0:
        return DOUBTED_SCALE if is_doubtful(state) != 0 else 0
    highest = spread_of(rest, most[outer:])
    for lane in range(8):
        highest = max(highest, max(spread[lane], -1.0 / spread[8 + lane]))
    note_watched(highest, state)
    return STALE_SCALE if highest > STALE else 0


@native(fast=True, inline=True)
def bring_scaled(size: i64, index: i32s, scale: f64s, rhs: f64s, scaled_rhs: f64s) -> f64:
    """Bring a right-hand side to the order of a vector, scaled; its largest magnitude then."""
    most = 0.0
    for k in range(size):
        value = rhs[index[k]] * scale[k]
        scaled_rhs[k] = value
        most = max(most, fabs(value))
    return most


@native(fast=True, inline=True)
def return_scaled(size: i64, index: i32s, scale: f64s, solution: f64s, result: f64s) -> None:
    """The solution in the unknowns' own order."""
    for k in range(size):
        result[index[k]] = solution[k] * scale[k]


@native(fast=True, inline=True)
def _collect(outer: i64, rest: i64, order: i32s, scale: f64s, x: f64s, rest_x: f64s) -> None:
    for k in range(rest):
        rest_x[k] = x[outer + order[k]] * scale[k]


@native(fast=True, inline=True)
def _return(outer: i64, rest: i64, order: i32s, scale: f64s, rest_x: f64s, x: f64s) -> None:
    for k in range(rest):
        x[outer + order[k]] = rest_x[k] * scale[k]


@native(inline=True)
def _substitute(
    both: i64, distance: i64, groups: i64, table: i64s, index: i32s, code: i32s, outer: i64, rest: i64, factors: f64s,
    lane_part: f64s, rest_order: i32s, rest_scale: f64s, pivot_count: i64s, columns: i32s, rest_values: f64s,
    pivots: i32s, starts: i32s, indices: i32s, rest_factors: f64s, inverse: f64s, rest_x: f64s, part: f64s,
    other_rest_x: f64s, other_part: f64s, x: f64s, between: f64s, y: f64s, other_x: f64s, other_between: f64s,
    other_y: f64s,
) -> None:  # fmt: skip
    """Solve for ``x`` with the factors, by way of ``between``, and for ``other_x`` when ``both``."""
    for k in range(outer, outer + rest):
        between[k] = x[k]
        if both != 0:
            other_between[k] = other_x[k]
    forward(
        both, distance, groups, table, index, code, factors, x, between, other_x, other_between, lane_part
    )
    _collect(outer, rest, rest_order, rest_scale, between, rest_x)
    if both != 0:
        _collect(outer, rest, rest_order, rest_scale, other_between, other_rest_x)
    substitute(
        both, pivot_count[0], columns, rest_values[rest:], pivots, starts, indices, rest_factors, inverse, rest_x,
        other_rest_x, part, other_part,
    )  # fmt: skip
    if both != 0:
        _return(outer, rest, rest_order, rest_scale, other_rest_x, other_y)
    _return(outer, rest, rest_order, rest_scale, rest_x, y)
    backward(
        both, distance, groups, table, index, code, factors, between, y, other_between, other_y, lane_part
    )


@native(fast=True, inline=True)
def _subtract_rest(
    outer: i64, rest: i64, entries: i64, first: i32s, second: i32s, matrix: f64s, x: f64s, y: f64s, z: f64s
) -> None:  # fmt: skip
    """``z = y - K x`` for the entries of the rest."""
    for k in range(rest):
        at = outer + k
        z[at] = y[at] - matrix[k] * x[at]
    own = matrix[rest:]
    for e in range(entries):
        a = first[e]
        b = second[e]
        z[a] -= own[e] * x[b]
        z[b] -= own[e] * x[a]


@native(fast=True, inline=True)
def _largest_outside(outer: i64, rest: i64, most: f64, x: f64s) -> f64:
    """The larger of ``most`` and the largest magnitude in the rest, nan when not all is finite."""
    check = 0.0
    high = most
    for k in range(outer, outer + rest):
        check += x[k] * 0.0
        high = max(high, fabs(x[k]))
    return high + check


@native(inline=True)
def _subtract(
    both: i64, distance: i64, groups: i64, table: i64s, index: i32s, code: i32s, outer: i64, rest: i64, entries: i64,
    first: i32s, second: i32s, matrix: f64s, rest_matrix: f64s, work: f64s, lane_part: f64s, norms: f64s, x: f64s,
    y: f64s, z: f64s, other_x: f64s, other_y: f64s, other_z: f64s,
) -> None:  # fmt: skip
    """``z = y - K x``; ``norms`` become those of x and z, and of the other ones when ``both``."""
    _subtract_rest(outer, rest, entries, first, second, rest_matrix, x, y, z)
    if both != 0:
        _subtract_rest(outer, rest, entries, first, second, rest_matrix, other_x, other_y, other_z)
    subtract_segments(
        both,
        distance,
        groups,
        table,
        index,
        code,
        matrix,
        x,
        y,
        z,
        other_x,
        other_y,
        other_z,
        work,
        lane_part,
        norms,
    )
    norms[0] = _largest_outside(outer, rest, norms[0], x)
    norms[1] = _largest_outside(outer, rest, norms[1], z)
    if both != 0:
        norms[2] = _largest_outside(outer, rest, norms[2], other_x)
        norms[3] = _largest_outside(outer, rest, norms[3], other_z)


@native(inline=True)
def _solve(
    both: i64, refinements: i64, accuracy: f64s, distance: i64, groups: i64, table: i64s, index: i32s, code: i32s,
    outer: i64, rest: i64, entries: i64, first: i32s, second: i32s, factors: f64s, matrix: f64s, rest_matrix: f64s,
    scale: f64s, work: f64s, lane_part: f64s, norms: f64s, rest_order: i32s, rest_scale: f64s, pivot_count: i64s,
    columns: i32s, rest_values: f64s, pivots: i32s, starts: i32s, indices: i32s, rest_factors: f64s, inverse: f64s,
    rest_x: f64s, part: f64s, other_rest_x: f64s, other_part: f64s, rhs: f64s, scaled_rhs: f64s, solution: f64s,
    change: f64s, between: f64s, kept: f64s, result: f64s, other_rhs: f64s, other_scaled_rhs: f64s,
    other_solution: f64s, other_change: f64s, other_between: f64s, other_kept: f64s, other_result: f64s,
    report: f64s, other_report: f64s,
) -> None:  # fmt: skip
    """See ``solve_all``; ``both`` is a constant here."""
    size = outer + rest
    length = bring_scaled(size, index, scale, rhs, scaled_rhs)
    other_length = 0.0
    if both != 0:
        other_length = bring_scaled(size, index, scale, other_rhs, other_scaled_rhs)
    active = 1 if length > 0.0 else 0
    other_active = 1 if other_length > 0.0 else 0
    report[0] = 1.0 * active
    report[1] = 0.0
    report[2] = 0.0
    other_report[0] = 1.0 * other_active
    steps = 0
    going = 1
    while going != 0:
        # The first solution needs no vector for the change, nor one that was there before.
        source = change[0:]
        target = kept[0:]
        other_source = other_change[0:]
        other_target = other_kept[0:]
        if steps == 0:
            source = scaled_rhs[0:]
            target = solution[0:]
            other_source = other_scaled_rhs[0:]
            other_target = other_solution[0:]
        _substitute(
            both, distance, groups, table, index, code, outer, rest, factors, lane_part, rest_order, rest_scale,
            pivot_count, columns, rest_values, pivots, starts, indices, rest_factors, inverse, rest_x, part,
            other_rest_x, other_part, source, between, target, other_source, other_between, other_target,
        )  # fmt: skip
        if steps > 0 and active != 0:
            for k in range(size):
                solution[k] += kept[k]
        if steps > 0 and other_active != 0:
            for k in range(size):
                other_solution[k] += other_kept[k]
        _subtract(
            both, distance, groups, table, index, code, outer, rest, entries, first, second, matrix, rest_matrix, work,
            lane_part, norms, solution, scaled_rhs, change, other_solution, other_scaled_rhs, other_change,
        )  # fmt: skip
        if steps == 0 and active != 0:
            report[2] = norms[0] / length
        report[1] = 1.0 * steps
        if active != 0:
            active = improves(
                size, steps, refinements, accuracy[0], norms[1], length, norms[0], report, kept, solution
            )
        if other_active != 0:
            other_active = improves(
                size, steps, refinements, accuracy[0], norms[3], other_length, norms[2], other_report, other_kept,
                other_solution,
            )  # fmt: skip
        steps += 1
        going = active + other_active
    return_scaled(size, index, scale, solution, result)
    if both != 0:
        return_scaled(size, index, scale, other_solution, other_result)
        report[0] = max(report[0], other_report[0])


@native
def solve_all(
    both: i64,
    refinements: i64,
    accuracy: f64s,
    distance: i64,
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    outer: i64,
    rest: i64,
    entries: i64,
    first: i32s,
    second: i32s,
    factors: f64s,
    matrix: f64s,
    rest_matrix: f64s,
    scale: f64s,
    work: f64s,
    lane_part: f64s,
    norms: f64s,
    rest_order: i32s,
    rest_scale: f64s,
    pivot_count: i64s,
    columns: i32s,
    rest_values: f64s,
    pivots: i32s,
    starts: i32s,
    indices: i32s,
    rest_factors: f64s,
    inverse: f64s,
    rest_x: f64s,
    part: f64s,
    other_rest_x: f64s,
    other_part: f64s,
    rhs: f64s,
    scaled_rhs: f64s,
    solution: f64s,
    change: f64s,
    between: f64s,
    kept: f64s,
    result: f64s,
    other_rhs: f64s,
    other_scaled_rhs: f64s,
    other_solution: f64s,
    other_change: f64s,
    other_between: f64s,
    other_kept: f64s,
    other_result: f64s,
    report: f64s,
    other_report: f64s,
) -> None:
    """Solve K x = rhs: the segments' part, the rest's, the segments' again; refined as in ``substitution.solve``.

    Args:
        both: whether to do the same for ``other_rhs``, in common passes; ``report`` then tells of the less accurate.
        distance: how far ahead memory is asked for, which is written past the caches then; 0 where it is near.
        groups, table, index, code, factors, matrix, scale: see ``eliminate``.
        rest_matrix: what ``eliminate_all`` has kept of the rest.
        rest_order ... inverse: the rest, see ``FrontalKKT.factors_in_order``.
        rhs, result: (N,); report: see ``substitution.REPORT``; the other arrays are work space.
    """
    if both != 0:
        _solve(
            1, refinements, accuracy, distance, groups, table, index, code, outer, rest, entries, first, second,
            factors, matrix, rest_matrix, scale, work, lane_part, norms, rest_order, rest_scale, pivot_count,
            columns, rest_values, pivots, starts, indices, rest_factors, inverse, rest_x, part, other_rest_x,
            other_part, rhs, scaled_rhs, solution, change, between, kept, result, other_rhs, other_scaled_rhs,
            other_solution, other_change, other_between, other_kept, other_result, report, other_report,
        )  # fmt: skip
    else:
        _solve(
            0, refinements, accuracy, distance, groups, table, index, code, outer, rest, entries, first, second,
            factors, matrix, rest_matrix, scale, work, lane_part, norms, rest_order, rest_scale, pivot_count,
            columns, rest_values, pivots, starts, indices, rest_factors, inverse, rest_x, part, other_rest_x,
            other_part, rhs, scaled_rhs, solution, change, between, kept, result, other_rhs, other_scaled_rhs,
            other_solution, other_change, other_between, other_kept, other_result, report, other_report,
        )  # fmt: skip
