"""A system of segments and a rest: equilibrating it, and solving with the factors of both.

Vectors are in the order of the segments, the rest behind them from ``outer`` on.  Entry e of the rest off the diagonal
is ``given[source[e]]`` in the places ``first[e]`` and ``second[e]`` of vectors; the entries of segments are where the
tables of stc.solver.kkt.lanes say.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.lane_rows import largest_in_segments, subtract_segments
from stc.solver.kkt.lane_solve import backward, forward
from stc.solver.kkt.lanes import eliminate
from stc.solver.kkt.substitution import improves, norm, substitute, substitute_both
from stc.solver.kkt.values import find_scale, spread_of

__all__ = ["diagonal_of", "eliminate_all", "equilibrate_all", "solve_all", "solve_both"]

#: A scale serves as long as the largest entries of all rows are within this factor of 1.
STALE = 1024.0


@native(fast=True)
def diagonal_of(
    n: i64, m: i64, at: i64, curvatures: i64, curved: i64, curved_variable: i32s, curved_source: i32s, given: f64s,
    diagonal: f64s, count: i64s,
) -> f64:  # fmt: skip
    """Collect the diagonal, (n + m,); p and d begin at ``given[at]``.  Returns 0, or nan when not all is finite.

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
    return check


@native
def _largest_of_rows(
    groups: i64, table: i64s, index: i32s, code: i32s, outer: i64, rest: i64, entries: i64, first: i32s,
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
    largest_in_segments(groups, table, index, code, given, diagonal, scale, most, scales, part)


@native
def equilibrate_all(
    sweeps: i64,
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
        groups, table, index, code, outer, rest, entries, first, second, source, given, diagonal, scale, most, scales,
        part,
    )  # fmt: skip
    if not (spread_of(outer + rest, most) > STALE):
        return 0
    for k in range(outer + rest):
        scale[k] = 1.0
    for _sweep in range(sweeps):
        _largest_of_rows(
            groups, table, index, code, outer, rest, entries, first, second, source, given, diagonal, scale, most,
            scales, part,
        )  # fmt: skip
        if find_scale(outer + rest, most, scale) == 0:
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
    moving: f64s,
    columns: f64s,
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
        How many pivots are negative, -1 when one was not accepted, -2 when the scale does not serve the matrix.
    """
    _load_rest(
        index, outer, rest, entries, target, first, second, source, variables, filled, given, diagonal, scale, most,
        rest_matrix, result,
    )  # fmt: skip
    for k in range(16):
        spread[k] = -STALE
    negative = eliminate(
        groups, table, index, code, growth, suspect, given, diagonal, scale, result, work, scales, moving, columns,
        matrix, row_most, most, spread, factors, state,
    )  # fmt: skip
    if negative < 0:
        return -1
    highest = spread_of(rest, most[outer:])
    for lane in range(8):
        highest = max(highest, max(spread[lane], -1.0 / spread[8 + lane]))
    return -2 if highest > STALE else negative


@native(fast=True, inline=True)
def _begin(
    size: i64, index: i32s, scale: f64s, rhs: f64s, scaled_rhs: f64s, change: f64s, solution: f64s
) -> f64:  # fmt: skip
    """Bring a right-hand side to the order of the segments, scaled; its largest magnitude then."""
    for k in range(size):
        value = rhs[index[k]] * scale[k]
        scaled_rhs[k] = value
        change[k] = value
        solution[k] = 0.0
    return norm(size, scaled_rhs)


@native(fast=True, inline=True)
def _collect(
    outer: i64, rest: i64, order: i32s, scale: f64s, x: f64s, rest_x: f64s
) -> None:  # fmt: skip
    for k in range(rest):
        rest_x[k] = x[outer + order[k]] * scale[k]


@native(fast=True, inline=True)
def _return(
    outer: i64, rest: i64, order: i32s, scale: f64s, rest_x: f64s, x: f64s
) -> None:  # fmt: skip
    for k in range(rest):
        x[outer + order[k]] = rest_x[k] * scale[k]


@native(fast=True, inline=True)
def _add(
    size: i64, scaled_rhs: f64s, change: f64s, kept: f64s, solution: f64s
) -> f64:  # fmt: skip
    """Add a change to the solution, and keep it; its place is taken by the right-hand side."""
    highest = 0.0
    for k in range(size):
        value = change[k]
        kept[k] = value
        total = solution[k] + value
        solution[k] = total
        highest = max(highest, fabs(total))
        change[k] = scaled_rhs[k]
    return highest


@native(fast=True, inline=True)
def _subtract_rest(
    outer: i64, rest: i64, entries: i64, first: i32s, second: i32s, matrix: f64s, x: f64s, y: f64s
) -> None:  # fmt: skip
    """``y -= K x`` for the entries of the rest."""
    for k in range(rest):
        y[outer + k] -= matrix[k] * x[outer + k]
    own = matrix[rest:]
    for e in range(entries):
        a = first[e]
        b = second[e]
        y[a] -= own[e] * x[b]
        y[b] -= own[e] * x[a]


@native(fast=True, inline=True)
def _checked_norm(size: i64, x: f64s) -> f64:
    """Largest magnitude, nan when not all is finite."""
    most = 0.0
    check = 0.0
    for k in range(size):
        check += x[k] * 0.0
        most = max(most, fabs(x[k]))
    return most + check


@native(inline=True)
def _solve(
    both: i64, refinements: i64, accuracy: f64s, groups: i64, table: i64s, index: i32s, code: i32s, outer: i64,
    rest: i64, entries: i64, first: i32s, second: i32s, factors: f64s, matrix: f64s, rest_matrix: f64s, scale: f64s,
    work: f64s, lane_part: f64s, rest_order: i32s, rest_scale: f64s, pivot_count: i64s, columns: i32s,
    rest_values: f64s, pivots: i32s, starts: i32s, indices: i32s, rest_factors: f64s, inverse: f64s, rest_x: f64s,
    part: f64s, other_rest_x: f64s, other_part: f64s, rhs: f64s, scaled_rhs: f64s, solution: f64s, change: f64s,
    kept: f64s, result: f64s, other_rhs: f64s, other_scaled_rhs: f64s, other_solution: f64s, other_change: f64s,
    other_kept: f64s, other_result: f64s, report: f64s, other_report: f64s,
) -> None:  # fmt: skip
    """See ``solve_all``; when ``both`` is 1, a constant, the same for the other right-hand side."""
    size = outer + rest
    length = _begin(size, index, scale, rhs, scaled_rhs, change, solution)
    other_length = 0.0
    if both != 0:
        other_length = _begin(size, index, scale, other_rhs, other_scaled_rhs, other_change, other_solution)
    active = 1 if length > 0.0 else 0
    other_active = 1 if other_length > 0.0 else 0
    report[0] = 1.0 * active
    report[1] = 0.0
    report[2] = 0.0
    other_report[0] = 1.0 * other_active
    steps = 0
    while active + other_active > 0:
        forward(both, groups, table, index, code, factors, change, other_change, lane_part)
        _collect(outer, rest, rest_order, rest_scale, change, rest_x)
        if both != 0:
            _collect(outer, rest, rest_order, rest_scale, other_change, other_rest_x)
            substitute_both(
                pivot_count[0], columns, rest_values[rest:], pivots, starts, indices, rest_factors, inverse, rest_x,
                other_rest_x, part, other_part,
            )  # fmt: skip
            _return(outer, rest, rest_order, rest_scale, other_rest_x, other_change)
        else:
            substitute(
                pivot_count[0], columns, rest_values[rest:], pivots, starts, indices, rest_factors, inverse, rest_x,
                part,
            )  # fmt: skip
        _return(outer, rest, rest_order, rest_scale, rest_x, change)
        backward(both, groups, table, index, code, factors, change, other_change, lane_part)
        highest = 0.0
        other_highest = 0.0
        if active != 0:
            highest = _add(size, scaled_rhs, change, kept, solution)
            _subtract_rest(outer, rest, entries, first, second, rest_matrix, solution, change)
        if other_active != 0:
            other_highest = _add(size, other_scaled_rhs, other_change, other_kept, other_solution)
            _subtract_rest(outer, rest, entries, first, second, rest_matrix, other_solution, other_change)
        subtract_segments(
            both,
            groups,
            table,
            index,
            code,
            matrix,
            solution,
            change,
            other_solution,
            other_change,
            work,
            lane_part,
        )
        report[1] = 1.0 * steps
        if active != 0:
            active = improves(
                size, steps, refinements, accuracy[0], _checked_norm(size, change), length, highest, report, kept,
                solution,
            )  # fmt: skip
            report[2] = highest / length
        if other_active != 0:
            other_active = improves(
                size, steps, refinements, accuracy[0], _checked_norm(size, other_change), other_length,
                other_highest, other_report, other_kept, other_solution,
            )  # fmt: skip
        steps += 1
    for k in range(size):
        result[index[k]] = solution[k] * scale[k]
    if both != 0:
        for k in range(size):
            other_result[index[k]] = other_solution[k] * scale[k]
        report[0] = max(report[0], other_report[0])


@native
def solve_all(
    refinements: i64,
    accuracy: f64s,
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
    kept: f64s,
    result: f64s,
    report: f64s,
) -> None:
    """Solve K x = rhs: the segments' part, the rest's, the segments' again; refined as in ``substitution.solve``.

    Args:
        groups, table, index, code, factors, matrix, scale: see ``eliminate``.
        rest_matrix: what ``eliminate_all`` has kept of the rest.
        rest_order ... inverse: the rest, see ``FrontalKKT.factors_in_order``.
        rhs, result: (N,); report: see ``substitution.REPORT``; the other arrays are work space.
    """
    _solve(
        0, refinements, accuracy, groups, table, index, code, outer, rest, entries, first, second, factors,
        matrix, rest_matrix, scale, work, lane_part, rest_order, rest_scale, pivot_count, columns, rest_values,
        pivots, starts, indices, rest_factors, inverse, rest_x, part, other_rest_x, other_part, rhs, scaled_rhs,
        solution, change, kept, result, rhs, scaled_rhs, solution, change, kept, result, report, report[1:],
    )  # fmt: skip


@native
def solve_both(
    refinements: i64,
    accuracy: f64s,
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
    kept: f64s,
    result: f64s,
    other_rhs: f64s,
    other_scaled_rhs: f64s,
    other_solution: f64s,
    other_change: f64s,
    other_kept: f64s,
    other_result: f64s,
    report: f64s,
    other_report: f64s,
) -> None:
    """The same for another right-hand side as well, in common passes over the factors and the matrix.

    ``report`` tells of the one that is less accurate.
    """
    _solve(
        1, refinements, accuracy, groups, table, index, code, outer, rest, entries, first, second, factors,
        matrix, rest_matrix, scale, work, lane_part, rest_order, rest_scale, pivot_count, columns, rest_values,
        pivots, starts, indices, rest_factors, inverse, rest_x, part, other_rest_x, other_part, rhs, scaled_rhs,
        solution, change, kept, result, other_rhs, other_scaled_rhs, other_solution, other_change, other_kept,
        other_result, report, other_report,
    )  # fmt: skip
