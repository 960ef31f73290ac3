"""A system of segments and a rest: equilibrating it, and solving with the factors of both.

Entry e off the diagonal is ``given[source[e]]`` in row and column ``first[e]`` and ``second[e]``; only the entries of
the rest are listed so, those of segments are where the tables of stc.solver.kkt.lanes say.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.lane_rows import largest_in_segments, subtract_segments
from stc.solver.kkt.lane_solve import backward, forward
from stc.solver.kkt.substitution import LARGEST_GAIN, substitute
from stc.solver.kkt.values import find_scale, spread_of

__all__ = ["diagonal_of", "equilibrate_all", "load_rest", "solve_all"]

#: A scale serves as long as the largest entries of all rows are within this factor of 1.
STALE = 1024.0


@native(fast=True)
def diagonal_of(
    n: i64, m: i64, at: i64, curved: i64, curved_variable: i32s, curved_source: i32s, given: f64s, diagonal: f64s
) -> f64:  # fmt: skip
    """Collect the diagonal, (n + m,); p and d begin at ``given[at]``.  Returns 0, or nan when not all is finite."""
    own = given[at:]
    for k in range(n):
        diagonal[k] = own[k]
    for k in range(n, n + m):
        diagonal[k] = -own[k]
    for k in range(curved):
        diagonal[curved_variable[k]] += given[curved_source[k]]
    check = 0.0
    for k in range(at + n + m):
        check += given[k] * 0.0
    return check


@native
def _largest_of_rows(
    groups: i64, table: i64s, index: i32s, code: i32s, unknowns: i64, unknown: i64s, count: i64, first: i32s,
    second: i32s, source: i32s, given: f64s, diagonal: f64s, scale: f64s, most: f64s, scales: f64s, part: f64s,
) -> None:  # fmt: skip
    """Largest entry of each row of S K S."""
    for k in range(unknowns):
        own = unknown[k]
        most[own] = fabs(diagonal[own]) * scale[own] * scale[own]
    for e in range(count):
        a = first[e]
        b = second[e]
        value = fabs(given[source[e]]) * scale[a] * scale[b]
        most[a] = max(most[a], value)
        most[b] = max(most[b], value)
    largest_in_segments(groups, table, index, code, given, diagonal, scale, most, scales, part)


@native
def equilibrate_all(
    size: i64,
    sweeps: i64,
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    unknowns: i64,
    unknown: i64s,
    count: i64,
    first: i32s,
    second: i32s,
    source: i32s,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    most: f64s,
    scales: f64s,
    part: f64s,
) -> None:
    """Make ``scale`` (N,) serve the matrix (see ``stc.solver.kkt.values.equilibrate``)."""
    _largest_of_rows(
        groups, table, index, code, unknowns, unknown, count, first, second, source, given, diagonal, scale, most,
        scales, part,
    )  # fmt: skip
    if spread_of(size, most) > STALE:
        for k in range(size):
            scale[k] = 1.0
        for _sweep in range(sweeps):
            _largest_of_rows(
                groups, table, index, code, unknowns, unknown, count, first, second, source, given, diagonal,
                scale, most, scales, part,
            )  # fmt: skip
            if find_scale(size, most, scale) == 0:
                break


@native(fast=True)
def load_rest(
    unknowns: i64,
    unknown: i64s,
    entries: i64,
    target: i32s,
    first: i32s,
    second: i32s,
    source: i32s,
    variables: i64,
    filled: i64,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    result: f64s,
) -> None:
    """The scaled entries of the rest, to which the segments' results are added: ``filled`` of them, and a diagonal."""
    for k in range(filled):
        result[k] = 0.0
    for k in range(entries):
        result[target[k]] = given[source[k]] * scale[first[k]] * scale[second[k]]
    for k in range(unknowns):
        own = unknown[k]
        value = diagonal[own] * scale[own] * scale[own]
        result[filled + k] = value if k < variables else -value


@native(fast=True)
def _norm(size: i64, x: f64s) -> f64:
    most = 0.0
    for k in range(size):
        most = max(most, fabs(x[k]))
    return most


@native(fast=True)
def _scaled_norm(size: i64, scale: f64s, x: f64s) -> f64:
    """Scale a vector; its largest magnitude then, nan when not finite."""
    most = 0.0
    check = 0.0
    for k in range(size):
        value = x[k] * scale[k]
        x[k] = value
        check += value * 0.0
        most = max(most, fabs(value))
    return most + check


@native
def solve_all(
    size: i64,
    refinements: i64,
    accuracy: f64s,
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    factors: f64s,
    count: i64,
    first: i32s,
    second: i32s,
    source: i32s,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    work: f64s,
    lane_part: f64s,
    rest_size: i64,
    rest_unknown: i64s,
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
    rhs: f64s,
    change: f64s,
    kept: f64s,
    result: f64s,
    report: f64s,
) -> None:
    """Solve K x = rhs: the segments' part, the rest's, the segments' again; refined as in ``substitution.solve``.

    Args:
        size, groups, table, index, code, factors: N, and what the elimination of the segments left.
        first, second, source, given, diagonal, scale: the matrix, see above; ``count`` entries are listed.
        rest_unknown ... inverse: the rest, see ``FrontalKKT.factors_in_order``.
        work, lane_part, rest_x, part, change, kept: work space.
        rhs, result: (N,); report: see ``substitution.REPORT``.
    """
    for k in range(size):
        change[k] = rhs[k] * scale[k]
        result[k] = 0.0
    norm = _norm(size, change)
    relative = 1.0
    gain = 0.0
    steps = 0
    while norm > 0.0:
        forward(groups, table, index, code, factors, change, lane_part)
        for k in range(rest_size):
            rest_x[k] = change[rest_unknown[rest_order[k]]] * rest_scale[k]
        substitute(
            pivot_count[0], columns, rest_values[rest_size:], pivots, starts, indices, rest_factors, inverse, rest_x,
            part,
        )  # fmt: skip
        for k in range(rest_size):
            change[rest_unknown[rest_order[k]]] = rest_x[k] * rest_scale[k]
        backward(groups, table, index, code, factors, change, lane_part)
        highest = 0.0
        for k in range(size):
            kept[k] = change[k] * scale[k]
            total = result[k] + kept[k]
            result[k] = total
            highest = max(highest, fabs(total / scale[k]))
            change[k] = rhs[k]
        for k in range(rest_size):
            own = rest_unknown[k]
            change[own] -= diagonal[own] * result[own]
        for e in range(count):
            a = first[e]
            b = second[e]
            value = given[source[e]]
            change[a] -= value * result[b]
            change[b] -= value * result[a]
        subtract_segments(groups, table, index, code, given, diagonal, result, change, work, lane_part)
        now = _scaled_norm(size, scale, change) / (norm + min(highest, LARGEST_GAIN * norm))
        if not (now < relative):
            if steps > 0:
                for k in range(size):
                    result[k] -= kept[k]
            else:
                relative = now
            break
        stagnant = now > 0.5 * relative
        relative = now
        gain = highest / norm
        if stagnant or relative <= accuracy[0] or steps >= refinements:
            break
        steps += 1
    report[0] = relative if norm > 0.0 else 0.0
    report[1] = 1.0 * steps
    report[2] = gain
