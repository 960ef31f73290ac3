"""Points of the iteration, compiled: each pass goes once over the vectors and leaves a few numbers.

Those that find the step from one point to the next are in :mod:`stc.solver.step_kernels`.

Vectors are those of :class:`stc.solver.workspace.Workspace`, ``s`` is its array of numbers (:mod:`stc.solver.state`).
``index``, ``sign``, ``kind``, ``free`` and ``moving`` describe the form of the problem (:mod:`stc.solver.formulation`),
``start``, ``order`` and ``rows`` the columns of J (:func:`column_times`):
rows are equalities, inequalities or ignored (:data:`EQUALITY`, :data:`INEQUALITY`, :data:`IGNORED`).
"""

from __future__ import annotations

from typing import Final

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, inf, log, native
from stc.solver.state import (
    COMPLEMENTARITY,
    DUAL,
    DUAL_ERROR,
    DUAL_SQUARED,
    DUAL_STEP,
    ERROR,
    FARTHEST,
    GAP_ERROR,
    LOGARITHMS,
    MOVED,
    OBJECTIVE,
    PRIMAL,
    PRIMAL_SQUARED,
    PRODUCTS,
    STATED,
    STEP,
    THETA,
    TRIAL_GAP,
    TRIAL_LOGARITHMS,
    TRIAL_THETA,
    Y_SUM,
    Z_SUM,
)

EQUALITY: Final = 0
INEQUALITY: Final = 1
IGNORED: Final = 2

#: Products of gaps between these are collected before their logarithm is taken.
UNDERFLOW: Final = 1e-140
OVERFLOW: Final = 1e140
#: See :func:`multiplier_scale`.
MEAN_MULTIPLIER: Final = 100.0
LARGEST_MULTIPLIER: Final = 1e3
#: Gap multipliers stay within this factor of mu / gap.
NEAR_CENTRE: Final = 1e10


@native(fast=True)
def log_sum(count: i64, values: f64s) -> f64:
    """Sum of the logarithms of positive numbers, nan when one is not."""
    total = 0.0
    product = 1.0
    for k in range(count):
        value = values[k]
        if not (value > 0.0):
            return value * 0.0 / 0.0
        if value < UNDERFLOW or value > OVERFLOW:
            total += log(value)
        else:
            product *= value
            if product < UNDERFLOW or product > OVERFLOW:
                total += log(product)
                product = 1.0
    return total + log(product)


@native(fast=True)
def multiplier_scale(total: f64, count: i64) -> f64:
    """What dual errors are divided by where multipliers are large, given the sum of their magnitudes.

    Bounded, because multipliers that grow without limit are no sign of optimality.
    """
    return min(max(total / max(count, 1) / MEAN_MULTIPLIER, 1.0), LARGEST_MULTIPLIER)


@native(fast=True)
def measure(
    size: i64, m: i64, gaps: i64, unit: f64, index: i64s, sign: f64s, mu: f64s,
    w: f64s, y: f64s, z: f64s, gap: f64s, c: f64s, dual: f64s, residual: f64s, s: f64s,
) -> None:  # fmt: skip
    """Errors of the optimality conditions; ``residual`` becomes the gradient of the whole Lagrangian.

    ``unit`` is the scaled objective that is 1 in the user's terms.
    """
    s[STATED] = s[OBJECTIVE] / unit
    z_sum = 0.0
    products = 0.0
    largest = 0.0
    target = mu[0]
    for k in range(gaps):
        product = gap[k] * z[k]
        z_sum += z[k]
        products += product
        largest = max(largest, fabs(product - target))
    s[COMPLEMENTARITY] = largest + products * 0.0
    s[Z_SUM] = z_sum
    s[PRODUCTS] = products
    for i in range(size):
        residual[i] = dual[i]
    for k in range(gaps):
        residual[index[k]] -= sign[k] * z[k]
    largest = 0.0
    squared = 0.0
    far = 0.0
    check = 0.0
    for i in range(size):
        value = residual[i]
        largest = max(largest, fabs(value))
        squared += value * value
        check += value * 0.0
        far = max(far, fabs(w[i]))
    s[DUAL] = largest + check
    s[DUAL_SQUARED] = squared
    s[FARTHEST] = far
    largest = 0.0
    squared = 0.0
    y_sum = 0.0
    check = 0.0
    for r in range(m):
        value = c[r]
        largest = max(largest, fabs(value))
        squared += value * value
        check += value * 0.0
        y_sum += fabs(y[r])
    s[PRIMAL] = largest + check
    s[PRIMAL_SQUARED] = squared
    s[Y_SUM] = y_sum
    s[DUAL_ERROR] = s[DUAL] / multiplier_scale(y_sum + z_sum, m + gaps)
    s[GAP_ERROR] = s[COMPLEMENTARITY] / multiplier_scale(z_sum, gaps)
    s[ERROR] = max(s[DUAL_ERROR], s[PRIMAL], s[GAP_ERROR])


@native(fast=True)
def overstepped(
    row_count: i64, row_places: i64s, row_limits: f64s, row_units: f64s, r: f64s, x_count: i64, x_places: i64s,
    x_limits: f64s, x_units: f64s, x: f64s, out: f64s,
) -> None:  # fmt: skip
    """Largest ``(limit - value) * unit`` of rows and variables, at least 0; infinite where a row is no number."""
    worst = 0.0
    check = 0.0
    for k in range(row_count):
        value = r[row_places[k]]
        check += value * 0.0
        worst = max(worst, (row_limits[k] - value) * row_units[k])
    for k in range(x_count):
        worst = max(worst, (x_limits[k] - x[x_places[k]]) * x_units[k])
    out[0] = worst if check == 0.0 else inf


@native(fast=True)
def copy(count: i64, source: f64s, target: f64s) -> None:
    """Copy a vector."""
    for i in range(count):
        target[i] = source[i]


@native(fast=True)
def place(n: i64, size: i64, alpha: f64s, w: f64s, dw: f64s, trial: f64s, x: f64s) -> None:
    """The point at a fraction of the step, and its variables where the functions look for them."""
    for i in range(size):
        trial[i] = w[i] + alpha[0] * dw[i]
    for i in range(n):
        x[i] = trial[i]


@native(fast=True)
def inspect(
    n: i64, m: i64, gaps: i64, index: i64s, sign: f64s, bound: f64s, kind: i32s, w: f64s, r: f64s,
    gap: f64s, c: f64s, s: f64s,
) -> None:  # fmt: skip
    """Gaps, residual of the rows and what the filter asks of a point whose rows have been evaluated."""
    theta = 0.0
    for k in range(m):
        value = r[k] - w[n + k]
        value = 0.0 if kind[k] == IGNORED else value
        c[k] = value
        theta += fabs(value)
    smallest = 1e300
    for k in range(gaps):
        value = sign[k] * (w[index[k]] - bound[k])
        gap[k] = value
        smallest = min(smallest, value)
    s[TRIAL_THETA] = theta
    s[TRIAL_GAP] = smallest
    s[TRIAL_LOGARITHMS] = log_sum(gaps, gap)


@native(inline=True)
def column_times(begin: i64, end: i64, order: i32s, rows: i32s, jac: f64s, y: f64s) -> f64:
    """A column of J times ``y``: its entries are ``jac[order[k]]``, in row ``rows[k]``, for k from ``begin`` on."""
    total = 0.0
    for k in range(begin, end):
        total += jac[order[k]] * y[rows[k]]
    return total


@native(fast=True)
def blend(
    n: i64, m: i64, gaps: i64, index: i64s, sign: f64s, shifts: f64s, moving: f64s, start: i32s, order: i32s,
    rows: i32s, jac: f64s, alpha: f64s, shifted: f64s, mu: f64s, residual: f64s, dw: f64s, dy: f64s, dz: f64s, y: f64s,
    z: f64s, trial_gap: f64s, left: f64s, turn: f64s, trial_y: f64s, trial_z: f64s, evaluated_y: f64s, s: f64s,
) -> None:  # fmt: skip
    """Multipliers of the trial point.

    The rows' multipliers take that fraction of their step that leaves the smallest gradient of the Lagrangian, to
    first order, when the primal and the dual variables take different fractions of theirs. A shift of the Hessian is
    no part of the Lagrangian, and a large one shows in ``dy``: it counts as well.
    """
    primal = alpha[0]
    dual = s[DUAL_STEP]
    fraction = primal
    if primal != dual or shifted[0] != 0.0:
        for i in range(n):
            turn[i] = column_times(start[i], start[i + 1], order, rows, jac, dy)
        for r in range(m):
            turn[n + r] = -dy[r]
        for i in range(n + m):
            left[i] = 0.0
        for k in range(gaps):
            left[index[k]] += sign[k] * dz[k]
        for i in range(n + m):
            turn[i] *= moving[i]
            left[i] = (1.0 - primal) * residual[i] + (primal - dual) * left[i]
        for i in range(n):
            left[i] -= primal * shifted[0] * shifts[i] * dw[i]
        length = 0.0
        product = 0.0
        for i in range(n + m):
            length += turn[i] * turn[i]
            product += left[i] * turn[i]
        if length != 0.0:
            fraction = min(max(primal - product / length, 0.0), 1.0)
    for r in range(m):
        trial_y[r] = y[r] + fraction * dy[r]
        evaluated_y[r] = trial_y[r]
    for k in range(gaps):
        value = z[k] + dual * dz[k]
        centre = mu[0] / trial_gap[k]
        trial_z[k] = min(max(value, centre / NEAR_CENTRE), NEAR_CENTRE * centre)


@native(fast=True)
def lagrangian(
    n: i64, m: i64, moving: f64s, start: i32s, order: i32s, rows: i32s, y: f64s, gradient: f64s, jac: f64s,
    status: f64s, dual: f64s,
) -> f64:  # fmt: skip
    """``dual = (grad f + J^T y, -y)``; 0, or nan where a derivative, of which ``status`` tells, is not finite."""
    check = status[0]
    for i in range(n):
        dual[i] = gradient[i] + column_times(start[i], start[i + 1], order, rows, jac, y)
    for r in range(m):
        dual[n + r] = -y[r]
    for i in range(n + m):
        dual[i] *= moving[i]
        check += dual[i] * 0.0
    return check


@native(fast=True)
def move(
    n: i64, m: i64, gaps: i64, moving: f64s, start: i32s, order: i32s, rows: i32s, gradient: f64s, jac: f64s,
    status: f64s, trial_w: f64s, trial_y: f64s, trial_z: f64s, trial_f: f64s, trial_r: f64s, trial_gap: f64s,
    trial_c: f64s, trial_dual: f64s, w: f64s, y: f64s, z: f64s, r: f64s, gap: f64s, c: f64s, dual: f64s, s: f64s,
) -> None:  # fmt: skip
    """Make the trial point the iterate, unless a derivative is not finite there."""
    check = lagrangian(n, m, moving, start, order, rows, trial_y, gradient, jac, status, trial_dual)
    if check != 0.0:
        s[MOVED] = 0.0
        return
    s[MOVED] = 1.0
    step = 0.0
    for i in range(n + m):
        step = max(step, fabs(trial_w[i] - w[i]) / (1.0 + fabs(w[i])))
        w[i] = trial_w[i]
        dual[i] = trial_dual[i]
    for k in range(m):
        y[k] = trial_y[k]
        r[k] = trial_r[k]
        c[k] = trial_c[k]
    for k in range(gaps):
        z[k] = trial_z[k]
        gap[k] = trial_gap[k]
    s[STEP] = step
    s[OBJECTIVE] = trial_f[0]
    s[THETA] = s[TRIAL_THETA]
    s[LOGARITHMS] = s[TRIAL_LOGARITHMS]


@native(fast=True)
def adopt(
    n: i64, m: i64, moving: f64s, start: i32s, order: i32s, rows: i32s, y: f64s, gradient: f64s, jac: f64s,
    status: f64s, dual: f64s, f: f64s, s: f64s,
) -> None:  # fmt: skip
    """Complete an iterate that has been evaluated and inspected."""
    lagrangian(n, m, moving, start, order, rows, y, gradient, jac, status, dual)
    s[OBJECTIVE] = f[0]
    s[THETA] = s[TRIAL_THETA]
    s[LOGARITHMS] = s[TRIAL_LOGARITHMS]


@native
def push_inside(size: i64, push: f64, lower: f64s, upper: f64s, w: f64s) -> None:
    """Move ``w`` inside its bounds by ``push``, relative to the bound's size or the bounds' distance."""
    for i in range(size):
        low, high = lower[i], upper[i]
        span = high - low
        if low > -inf:
            low += push * min(max(1.0, fabs(low)), span)
        if high < inf:
            high -= push * min(max(1.0, fabs(high)), span)
        w[i] = min(max(w[i], low), high)
