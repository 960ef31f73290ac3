"""The optimality conditions at a point, compiled: as stated, and as a projection equation."""

from __future__ import annotations

from typing import Final

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native

__all__ = [
    "advance",
    "better_signs",
    "gradient_of_lagrangian",
    "point_conditions",
    "project_entries",
    "remaining",
    "respond",
    "restrict",
    "restricted_diagonals",
    "stated_conditions",
]

#: Places in the results of :func:`stated_conditions`.
STATIONARITY: Final = 0
COMPLEMENTARITY: Final = 1
VIOLATION: Final = 2
GRADIENT: Final = 3  # largest entries, and sums of multipliers
TERM: Final = 4
MULTIPLIER: Final = 5
SUM: Final = 6
STATED: Final = 7
#: Bounds beyond this are none.
NONE: Final = 1e300


@native(fast=True, inline=True)
def _overstepped(value: f64, lower: f64, upper: f64) -> f64:
    """Violation of the bounds, relative to ``max(1, |bound|)``."""
    worst = 0.0
    if lower > -NONE:
        worst = max(worst, (lower - value) / max(1.0, fabs(lower)))
    if upper < NONE:
        worst = max(worst, (value - upper) / max(1.0, fabs(upper)))
    return worst


@native(fast=True, inline=True)
def _product(multiplier: f64, value: f64, lower: f64, upper: f64) -> f64:
    """Multiplier times the distance to its bound; far bounds count as near."""
    slack = upper - value if multiplier > 0.0 else value - lower
    return fabs(multiplier * min(max(slack, 0.0), 1.0))


@native(fast=True)
def stated_conditions(
    n: i64, m: i64, entries: i64, given: i64, x: f64s, y: f64s, z: f64s, r: f64s, gradient: f64s, rows: i32s,
    cols: i32s, jac: f64s, x_lower: f64s, x_upper: f64s, row_lower: f64s, row_upper: f64s, lagrangian: f64s, out: f64s,
) -> None:  # fmt: skip
    """See :func:`stc.solver.residuals.assess`; without ``given`` multipliers of the bounds, ``z`` (n,) is chosen."""
    term = 0.0
    check = 0.0
    most = 0.0
    for i in range(n):
        value = gradient[i]
        lagrangian[i] = value
        most = max(most, fabs(value))
        check += value * 0.0
    out[GRADIENT] = most + check
    for e in range(entries):
        value = jac[e] * y[rows[e]]
        lagrangian[cols[e]] += value
        term = max(term, fabs(value))
        check += value * 0.0
    out[TERM] = term + check
    total = 0.0
    stationarity = 0.0
    complementarity = 0.0
    violation = 0.0
    largest = 0.0
    for i in range(n):
        slope = lagrangian[i]
        multiplier = z[i]
        if given == 0:
            room = x[i] - x_lower[i] if slope > 0.0 else x_upper[i] - x[i]
            multiplier = -slope if room < 1.0 or x_lower[i] == x_upper[i] else 0.0
            z[i] = multiplier
        total += fabs(multiplier)
        largest = max(largest, fabs(multiplier))
        stationarity = max(stationarity, fabs(slope + multiplier))
        complementarity = max(complementarity, _product(multiplier, x[i], x_lower[i], x_upper[i]))
        worst = _overstepped(x[i], x_lower[i], x_upper[i])
        check += x[i] * 0.0
        violation = max(violation, worst)
    for k in range(m):
        total += fabs(y[k])
        complementarity = max(complementarity, _product(y[k], r[k], row_lower[k], row_upper[k]))
        worst = _overstepped(r[k], row_lower[k], row_upper[k])
        check += r[k] * 0.0
        violation = max(violation, worst)
    out[STATIONARITY] = stationarity + check
    out[COMPLEMENTARITY] = complementarity
    out[VIOLATION] = violation + check
    out[MULTIPLIER] = largest
    out[SUM] = total


@native(fast=True)
def project_entries(
    count: i64, gradient: i64, value: f64s, push: f64s, lower: f64s, upper: f64s, fixed: f64s, target: f64s,
    active: f64s, out: f64s,
) -> None:  # fmt: skip
    """Where each value ends when pushed and clipped, and which ones are clipped.

    A push away from the bound nearby leaves that bound; it does not reach the one on the other side. ``fixed`` ones
    are active always. The push is minus the ``gradient`` of variables, or the multiplier of rows.

    Results: the largest violation, the largest dual residual, the sum of the multipliers.
    """
    primal = 0.0
    dual = 0.0
    total = 0.0
    check = 0.0
    for k in range(count):
        low, high, v = lower[k], upper[k], value[k]
        p = -push[k] if gradient != 0 else push[k]
        pushed = v + p
        goal = min(max(pushed, low), high)
        clipped = 0.0
        if pushed < low or pushed > high:
            clipped = 1.0
            if low < high:
                if p > 0.0:
                    if pushed > high and v - low < high - v:
                        clipped = 0.0
                elif pushed < low and high - v < v - low:
                    clipped = 0.0
        if fixed[k] != 0.0:
            clipped = 1.0
        active[k] = clipped
        target[k] = goal
        check += pushed * 0.0
        if clipped != 0.0:
            primal = max(primal, fabs(v - goal))
        else:
            dual = max(dual, fabs(p))
        if clipped != 0.0 or gradient == 0:
            total += fabs(p)
    out[0] = primal + check
    out[1] = dual + check
    out[2] = total


@native(fast=True)
def restrict(
    n: i64, m: i64, entries: i64, curved: i64, rows: i64s, cols: i64s, hess_rows: i64s, hess_cols: i64s, jac: f64s,
    hess: f64s, active_x: f64s, active_rows: f64s, x: f64s, y: f64s, r: f64s, lagrangian: f64s, x_target: f64s,
    row_target: f64s, dx: f64s, dy: f64s, out_hess: f64s, out_jac: f64s, rhs: f64s, largest: f64s,
) -> None:  # fmt: skip
    """Matrix and right-hand side of the Newton step on an active set.

    ``dx`` and ``dy`` become the part of the step that the active set fixes: variables go to their bounds, multipliers
    of rows that are not active to zero. The matrix has all entries, whatever is active: diagonals tell that (see
    ``restricted_diagonals``). ``largest[0]`` becomes the largest entry of the Hessian.
    """
    moved = 0.0
    for i in range(n):
        dx[i] = x_target[i] - x[i] if active_x[i] != 0.0 else 0.0
        rhs[i] = -lagrangian[i]
        moved = max(moved, fabs(dx[i]))
    pulled = 0.0
    for k in range(m):
        dy[k] = 0.0 if active_rows[k] != 0.0 else -y[k]
        rhs[n + k] = row_target[k] - r[k] if active_rows[k] != 0.0 else 0.0
        pulled = max(pulled, fabs(dy[k]))
    high = 0.0
    for e in range(curved):
        out_hess[e] = hess[e]
        high = max(high, fabs(hess[e]))
    largest[0] = high
    for e in range(entries):
        out_jac[e] = jac[e]
    if moved > 0.0:
        for e in range(curved):
            i, j = hess_rows[e], hess_cols[e]
            rhs[i] -= hess[e] * dx[j]
            if i != j:
                rhs[j] -= hess[e] * dx[i]
    if moved > 0.0 or pulled > 0.0:
        for e in range(entries):
            k, i = rows[e], cols[e]
            rhs[i] -= jac[e] * dy[k]
            rhs[n + k] -= jac[e] * dx[i] * active_rows[k]
    for i in range(n):
        if active_x[i] != 0.0:
            rhs[i] = 0.0


@native(fast=True)
def respond(
    n: i64, m: i64, entries: i64, curved: i64, rows: i64s, cols: i64s, hess_rows: i64s, hess_cols: i64s, jac: f64s,
    hess: f64s, gradient: f64s, d: f64s, y: f64s, pull: f64s, moved: f64s,
) -> f64:  # fmt: skip
    """What a step does: ``pull = -(gradient + H d + J^T y)`` and ``moved = J d``.

    Returns 0, or nan where the step or the multipliers are not finite.
    """
    check = 0.0
    for i in range(n):
        pull[i] = -gradient[i]
        check += d[i] * 0.0
    for k in range(m):
        moved[k] = 0.0
        check += y[k] * 0.0
    for e in range(curved):
        i, j = hess_rows[e], hess_cols[e]
        pull[i] -= hess[e] * d[j]
        if i != j:
            pull[j] -= hess[e] * d[i]
    for e in range(entries):
        k, i = rows[e], cols[e]
        pull[i] -= jac[e] * y[k]
        moved[k] += jac[e] * d[i]
    return check


@native
def better_signs(
    count: i64,
    slack: f64,
    active: i32s,
    equal: f64s,
    move: f64s,
    multiplier: f64s,
    low: f64s,
    high: f64s,
    out: i32s,
) -> i64:
    """The active set that a solution for ``active`` suggests; returns in how many constraints they differ.

    Args:
        slack: smallest violation, and multiplier of the wrong sign, that counts.
        equal: 1 for constraints that are active always, whose sign is 0.
        move: what the step changes, ``low`` and ``high`` how far it may.
    """
    different = 0
    for k in range(count):
        now = active[k]
        new = 0
        if equal[k] == 0.0:
            if now > 0:
                new = now if multiplier[k] >= -slack else 0
            elif now < 0:
                new = now if multiplier[k] <= slack else 0
            elif move[k] > high[k] + slack:
                new = 1 if not (move[k] < low[k] - slack) else 0
            elif move[k] < low[k] - slack:
                new = -1
        out[k] = new
        different += new != now
    return different


@native(fast=True)
def gradient_of_lagrangian(
    n: i64, entries: i64, rows: i64s, cols: i64s, y: f64s, gradient: f64s, jac: f64s, out: f64s
) -> None:
    """``grad f + J^T y``."""
    for i in range(n):
        out[i] = gradient[i]
    for e in range(entries):
        out[cols[e]] += jac[e] * y[rows[e]]


#: Places in the results of :func:`point_conditions`.
POINT_VIOLATION: Final = 0
POINT_DUAL: Final = 1
POINT_SUM: Final = 2
POINT: Final = 3


@native(fast=True)
def point_conditions(
    n: i64, m: i64, entries: i64, balanced: f64s, rows: i64s, cols: i64s, x: f64s, y: f64s, z: f64s, r: f64s,
    gradient: f64s, jac: f64s, x_lower: f64s, x_upper: f64s, row_lower: f64s, row_upper: f64s, lagrangian: f64s,
    out: f64s,
) -> None:  # fmt: skip
    """Gradient of the Lagrangian, multipliers of bounds (n,) where ``balanced`` is not 0, and the errors."""
    gradient_of_lagrangian(n, entries, rows, cols, y, gradient, jac, lagrangian)
    check = 0.0
    total = 0.0
    dual = 0.0
    for i in range(n):
        slope = lagrangian[i]
        check += slope * 0.0
        multiplier = -slope if balanced[i] != 0.0 else z[i]
        z[i] = multiplier
        total += fabs(multiplier)
        dual = max(dual, fabs(slope + multiplier))
        if multiplier != 0.0:
            dual = max(dual, _product(multiplier, x[i], x_lower[i], x_upper[i]))
    violation = 0.0
    for k in range(m):
        total += fabs(y[k])
        if y[k] != 0.0:
            dual = max(dual, _product(y[k], r[k], row_lower[k], row_upper[k]))
        violation = max(violation, max(row_lower[k] - r[k], r[k] - row_upper[k]))
        check += r[k] * 0.0
    out[POINT_VIOLATION] = violation
    out[POINT_DUAL] = dual + check
    out[POINT_SUM] = total


@native(fast=True)
def restricted_diagonals(
    n: i64, m: i64, shift_x: f64, shift_y: f64, firm: f64, loose: f64, soft: f64, fixed: f64s, equality: f64s,
    active_x: f64s, active_rows: f64s, primal: f64s, dual: f64s,
) -> None:  # fmt: skip
    """Diagonals that hold active variables and leave out rows that are not active, nearly: as a barrier's do.

    Args:
        shift_x, shift_y: of variables and rows.
        firm: of variables at their bounds; loose: of rows that are not active; soft: of active inequalities, at least.
        fixed, equality: 1 for variables that have no derivatives, and for equations.
    """
    for i in range(n):
        primal[i] = shift_x if active_x[i] == 0.0 else 1.0 if fixed[i] != 0.0 else firm
    for k in range(m):
        dual[k] = loose if active_rows[k] == 0.0 else shift_y if equality[k] != 0.0 else max(soft, shift_y)


@native(fast=True)
def remaining(
    n: i64, m: i64, active_x: f64s, active_rows: f64s, lagrangian: f64s, row_target: f64s, r: f64s, dx: f64s, dy: f64s,
    rhs: f64s,
) -> None:  # fmt: skip
    """Right-hand side of another step on an active set that a point is on already: it fixes nothing more."""
    for i in range(n):
        dx[i] = 0.0
        rhs[i] = -lagrangian[i] * (1.0 - active_x[i])
    for k in range(m):
        dy[k] = 0.0
        rhs[n + k] = (row_target[k] - r[k]) * active_rows[k]


@native(fast=True)
def advance(
    n: i64, m: i64, active_x: f64s, active_rows: f64s, x: f64s, y: f64s, dx: f64s, dy: f64s, solution: f64s,
    lower: f64s, upper: f64s, next_x: f64s, next_y: f64s, out: f64s,
) -> None:  # fmt: skip
    """The point after a Newton step on the active set, inside the bounds; what that fixes does not move any further.

    Results: the largest change of a variable; 0, or nan where the step is not finite.
    """
    largest = 0.0
    check = 0.0
    for i in range(n):
        change = dx[i] + solution[i] * (1.0 - active_x[i])
        largest = max(largest, fabs(change))
        check += change * 0.0
        next_x[i] = min(max(x[i] + change, lower[i]), upper[i])
    for k in range(m):
        change = dy[k] + solution[n + k] * active_rows[k]
        check += change * 0.0
        next_y[k] = y[k] + change
    out[0] = largest
    out[1] = check
