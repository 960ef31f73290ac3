"""A system of segments and a rest: equilibrating it, eliminating, and solving with the factors of both.

The segments are in one or two parts, which more than one thread can be at (see stc.solver.kkt.segmented_parts); what
they leave to the rest is put together here.  Vectors are in the order of the segments, the rest behind them from
``outer`` on.  Entry e of the rest off the diagonal is ``given[source[e]]`` in the places ``first[e]`` and ``second[e]``
of vectors; the entries of segments are where the tables of stc.solver.kkt.lanes say.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.lane_rows import largest_in_segments
from stc.solver.kkt.lane_state import (
    STALE,
    STATE,
    WATCHED,
    is_doubtful,
    is_watched,
    note_watched,
    put_together,
    spread_in,
)
from stc.solver.kkt.segmented_parts import (
    ACTIVE,
    BACKWARD,
    FORWARD,
    NORMS,
    OTHER_ACTIVE,
    OTHER_RIGHT,
    RETURN,
    RIGHT,
    SPREADS,
    STEPS,
)
from stc.solver.kkt.substitution import improves, substitute
from stc.solver.kkt.values import add_to, bring_scaled, find_scale, raise_to, return_scaled, spread_of

__all__ = [
    "DOUBTED_SCALE",
    "REFUSED",
    "STALE_SCALE",
    "diagonal_of",
    "eliminate_all",
    "equilibrate_all",
    "solve_all",
]

#: Results of ``eliminate_all``.
REFUSED = 1
STALE_SCALE = 2
DOUBTED_SCALE = 3


@native(fast=True)
def diagonal_of(
    n: i64, m: i64, at: i64, curvatures: i64, curved: i64, curved_variable: i32s, curved_source: i32s, checked: i64,
    given: f64s, diagonal: f64s, found: i64s,
) -> i64:  # fmt: skip
    """Collect the diagonal, (n + m,); p and d begin at ``given[at]``.

    Args:
        curvatures: so many entries of H are given first; ``found[0]`` becomes 1 where one of them is not zero, else 0.
        checked: so many given entries are checked besides the diagonal.

    Returns:
        0, or 1 when not all is finite.
    """
    own = given[at:]
    for k in range(n):
        diagonal[k] = own[k]
    for k in range(n, n + m):
        diagonal[k] = -own[k]
    for k in range(curved):
        diagonal[curved_variable[k]] += given[curved_source[k]]
    check = 0.0
    for k in range(n + m):
        check += diagonal[k] * 0.0
    for k in range(checked):
        check += given[k] * 0.0
    k = 0
    while k < curvatures and given[k] == 0.0:
        k += 1
    found[0] = 1 if k < curvatures else 0
    return 0 if check == 0.0 else 1


@native
def _largest_of_rows(
    fetched: i64, groups: i64, table: i64s, index: i32s, code: i32s, outer: i64, rest: i64, entries: i64, first: i32s,
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
    largest_in_segments(fetched, groups, table, index, code, given, diagonal, scale, most, scales, part)


@native
def equilibrate_all(
    sweeps: i64,
    fetched: i64,
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
        fetched, groups, table, index, code, outer, rest, entries, first, second, source, given, diagonal, scale, most,
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
                fetched, groups, table, index, code, outer, rest, entries, first, second, source, given, diagonal,
                scale, most, scales, part,
            )  # fmt: skip
        if find_scale(size, most, scale) == 0:
            break
    return 1


@native(fast=True)
def _load_rest(
    index: i32s, outer: i64, rest: i64, entries: i64, target: i32s, first: i32s, second: i32s, source: i32s,
    variables: i64, filled: i64, given: f64s, diagonal: f64s, scale: f64s, most: f64s, matrix: f64s, result: f64s,
) -> f64:  # fmt: skip
    """Put the scaled entries of the rest into ``result``, ``filled`` of them and a diagonal, and keep them.

    Returns 0, or nan where an entry is not finite.
    """
    check = 0.0
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
        check += value * 0.0
        own[k] = value
        most[a] = max(most[a], fabs(value))
        most[b] = max(most[b], fabs(value))
        result[target[k]] = value
    return check


@native(shared=True)
def eliminate_all(
    calls: i64s,
    place: i64,
    parts: i64,
    states: f64s,
    spreads: f64s,
    length: i64,
    other_results: f64s,
    other_most: f64s,
    index: i32s,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    most: f64s,
    result: f64s,
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
    """Load the rest, eliminate the segments and add what they leave to the rest, ``result``.

    Args:
        calls, place: where ``eliminate_part`` of all parts is among the prepared calls.
        parts: how many there are; ``states``, ``spreads``: of each part.
        length: of ``result`` and of each of ``other_results``, those of the parts but the first; other_most: what is
            ``most`` to these.

    Returns:
        0, ``REFUSED`` when a pivot was not accepted or an entry is not finite, ``STALE_SCALE`` when the scale does not
        serve the matrix, ``DOUBTED_SCALE`` when it was not tested but perhaps does not; ``state[COUNTED]`` becomes the
        number of negative pivots.
    """
    check = _load_rest(
        index, outer, rest, entries, target, first, second, source, variables, filled, given, diagonal, scale, most,
        rest_matrix, result,
    )  # fmt: skip
    if check != 0.0:
        return REFUSED
    watched = is_watched(state)
    for part in range(parts):
        states[part * STATE + WATCHED] = 1.0 * watched
    invoke(calls, place)
    if put_together(parts, states, state) != 0:
        return REFUSED
    for part in range(1, parts):
        add_to(length, other_results[(part - 1) * length :], result)
    if watched == 0:
        return DOUBTED_SCALE if is_doubtful(state) != 0 else 0
    for part in range(1, parts):
        raise_to(rest, other_most[(part - 1) * (outer + rest) + outer :], most[outer:])
    highest = spread_of(rest, most[outer:])
    for part in range(parts):
        highest = max(highest, spread_in(spreads[SPREADS * part :]))
    note_watched(highest, state)
    return STALE_SCALE if highest > STALE else 0


@native(fast=True)
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


@native(fast=True)
def _largest_of(count: i64, x: f64s) -> f64:
    """The largest magnitude, nan when not all is finite."""
    check = 0.0
    high = 0.0
    for k in range(count):
        check += x[k] * 0.0
        high = max(high, fabs(x[k]))
    return high + check


@native
def _higher(a: f64, b: f64) -> f64:
    """The larger one, nan where either is."""
    return max(a, b) + (a + b) * 0.0


@native(fast=True)
def _begin_forward(outer: i64, rest: i64, x: f64s, between: f64s) -> None:
    """What the rest has before the segments add to it."""
    for k in range(outer, outer + rest):
        between[k] = x[k]


@native(fast=True)
def _collect(
    parts: i64, outer: i64, rest: i64, order: i32s, scale: f64s, left: f64s, between: f64s, rest_x: f64s
) -> None:  # fmt: skip
    """The rest's right-hand side, what the parts but the first have ``left`` added, in the order of its pivots."""
    for part in range(1, parts):
        add_to(rest, left[(part - 1) * (outer + rest) + outer :], between[outer:])
    for k in range(rest):
        rest_x[k] = between[outer + order[k]] * scale[k]


@native(fast=True)
def _return(
    outer: i64, rest: i64, order: i32s, scale: f64s, rest_x: f64s, added: i64, y: f64s, solution: f64s
) -> None:  # fmt: skip
    """The rest's solution; where that is what is to be ``added``, so it is."""
    for k in range(rest):
        y[outer + order[k]] = rest_x[k] * scale[k]
    if added != 0:
        add_to(rest, y[outer:], solution[outer:])


@native(fast=True)
def _end_products(
    parts: i64, place: i64, outer: i64, rest: i64, x: f64s, left: f64s, z: f64s, norms: f64s, report: f64s
) -> None:  # fmt: skip
    """Put together what the parts and the rest have of ``y - K x``; its largest magnitude, and that of x."""
    for part in range(1, parts):
        add_to(rest, left[(part - 1) * (outer + rest) + outer :], z[outer:])
    report[0] = _largest_of(rest, x[outer:])
    report[1] = _largest_of(rest, z[outer:])
    for part in range(parts):
        report[0] = _higher(report[0], norms[NORMS * part + place])
        report[1] = _higher(report[1], norms[NORMS * part + place + 1])


@native(shared=True)
def solve_all(
    both: i64,
    refinements: i64,
    accuracy: f64s,
    calls: i64s,
    place: i64,
    parts: i64,
    progress: i64s,
    norms: f64s,
    high: f64s,
    left: f64s,
    other_left: f64s,
    index: i32s,
    outer: i64,
    rest: i64,
    entries: i64,
    first: i32s,
    second: i32s,
    rest_matrix: f64s,
    scale: f64s,
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
    rest_part: f64s,
    other_rest_x: f64s,
    other_rest_part: f64s,
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
        calls, place: where the calls of the parts are among the prepared ones: FORWARD and so on from ``place`` on.
        parts: how many there are; ``progress`` tells them how far this is; ``norms``: NORMS of each; ``left``: what the
            parts but the first leave to the rest, a vector of each; high: work space.
        rest_matrix: what ``eliminate_all`` has kept of the rest.
        rest_order ... inverse: the rest, see ``FrontalKKT.factors_in_order``.
        rhs, result: (N,); report: see ``substitution.REPORT``; the other arrays are work space.
    """
    size = outer + rest
    length = bring_scaled(rest, index[outer:], scale[outer:], rhs, scaled_rhs[outer:])
    other_length = 0.0
    if both != 0:
        other_length = bring_scaled(rest, index[outer:], scale[outer:], other_rhs, other_scaled_rhs[outer:])
    progress[STEPS] = 0
    progress[ACTIVE] = 1
    progress[OTHER_ACTIVE] = both
    going = 1
    while going != 0:
        steps = progress[STEPS]
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
        _begin_forward(outer, rest, source, between)
        if both != 0:
            _begin_forward(outer, rest, other_source, other_between)
        invoke(calls, place + FORWARD)
        if steps == 0:
            for part in range(parts):
                length = max(length, norms[NORMS * part + RIGHT])
                other_length = max(other_length, norms[NORMS * part + OTHER_RIGHT])
            if not (length > 0.0):
                progress[ACTIVE] = 0
            if both == 0 or not (other_length > 0.0):
                progress[OTHER_ACTIVE] = 0
            report[0] = 1.0 * progress[ACTIVE]
            report[2] = 0.0
            other_report[0] = 1.0 * progress[OTHER_ACTIVE]
        _collect(parts, outer, rest, rest_order, rest_scale, left, between, rest_x)
        if both != 0:
            _collect(parts, outer, rest, rest_order, rest_scale, other_left, other_between, other_rest_x)
        substitute(
            both, pivot_count[0], columns, rest_values[rest:], pivots, starts, indices, rest_factors, inverse, rest_x,
            other_rest_x, rest_part, other_rest_part,
        )  # fmt: skip
        active = progress[ACTIVE]
        other_active = progress[OTHER_ACTIVE]
        refining = 1 if steps > 0 else 0
        _return(outer, rest, rest_order, rest_scale, rest_x, refining * active, target, solution)
        _subtract_rest(outer, rest, entries, first, second, rest_matrix, solution, scaled_rhs, change)
        if both != 0:
            _return(
                outer, rest, rest_order, rest_scale, other_rest_x, refining * other_active, other_target, other_solution
            )  # fmt: skip
            _subtract_rest(
                outer, rest, entries, first, second, rest_matrix, other_solution, other_scaled_rhs, other_change
            )  # fmt: skip
        invoke(calls, place + BACKWARD)
        report[1] = 1.0 * steps
        _end_products(parts, 0, outer, rest, solution, left, change, norms, high)
        if steps == 0 and active != 0:
            report[2] = high[0] / length
        if active != 0:
            active = improves(
                size, steps, refinements, accuracy[0], high[1], length, high[0], report, kept, solution
            )
        if both != 0:
            _end_products(parts, 2, outer, rest, other_solution, other_left, other_change, norms, high)
            if other_active != 0:
                other_active = improves(
                    size, steps, refinements, accuracy[0], high[1], other_length, high[0], other_report, other_kept,
                    other_solution,
                )  # fmt: skip
        progress[STEPS] = steps + 1
        progress[ACTIVE] = active
        progress[OTHER_ACTIVE] = other_active
        going = active + other_active
    invoke(calls, place + RETURN)
    return_scaled(rest, index[outer:], scale[outer:], solution[outer:], result)
    if both != 0:
        return_scaled(rest, index[outer:], scale[outer:], other_solution[outer:], other_result)
        report[0] = max(report[0], other_report[0])
