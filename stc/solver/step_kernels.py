"""The step of an iteration, compiled: right-hand sides, what follows from a solution, and how far it may go.

See :mod:`stc.solver.kernels` for the vectors and the array of numbers.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native, sqrt
from stc.solver.kernels import EQUALITY, IGNORED, INEQUALITY
from stc.solver.products import NOTHING
from stc.solver.state import (
    DUAL_SHIFT,
    DUAL_SQUARED,
    DUAL_STEP,
    FINITE,
    LENGTH,
    LOG_SLOPE,
    PRIMAL_SQUARED,
    PRIMAL_STEP,
    PRODUCTS,
    REACH,
    RELATIVE,
    SHIFT,
    SIGMA,
    SLOPE,
    WHOLE,
)

#: What a shift may add to the curvature of a variable that only the objective bends: so much of what it has, and so
#: much of the shift.
SHARE, SLIGHT = 0.1, 1e-3
#: How much of the rows' part of the Hessian is used where the whole of it makes the matrix indefinite.
ROWS_SHARE = 0.4
#: Gaps that are looked at for one trial after the other, so that they stay at hand.
BLOCK = 512


@native(fast=True)
def diagonals(
    n: i64, m: i64, gaps: i64, index: i64s, free: f64s, kind: i32s, extra: f64s, smallest: f64,
    z: f64s, gap: f64s, ratio: f64s, sigma: f64s, primal: f64s, d: f64s,
) -> None:  # fmt: skip
    """``ratio = z / gap``, its sum per entry of w, and the diagonals without shifts."""
    for i in range(n + m):
        sigma[i] = 0.0
    for k in range(gaps):
        ratio[k] = z[k] / gap[k]
    for k in range(gaps):
        sigma[index[k]] += ratio[k]
    for i in range(n):
        primal[i] = sigma[i] + extra[i] if free[i] != 0.0 else 1.0
    for r in range(m):
        d[r] = 1.0 / max(sigma[n + r], smallest)
        if kind[r] == IGNORED:
            d[r] = 1.0


@native(fast=True)
def shifted(
    n: i64, m: i64, free: f64s, kind: i32s, w: f64s, primal: f64s, d: f64s, convex: i64, variable: i64s, entry: i64s,
    hess: f64s, shifts: f64s, out_primal: f64s, out_dual: f64s, s: f64s,
) -> None:  # fmt: skip
    """The diagonals with the ``shifts`` (n,) of the Hessian and of the equality rows.

    Where the rows' part of the Hessian is damped, shifts are larger for large variables ``w`` (n + m,), so that steps
    are kept short relative to them: rates and accelerations of a fast motion should change less, of itself, than
    slow ones. (As trust regions are scaled: D. W. Marquardt, J. SIAM 11, 1963; J. J. More, LNM 630, 1978.)

    A ``variable`` (convex,) that only the objective bends, upwards, as torques are, makes no matrix indefinite: it gets
    little of a shift, so that steps stay long in its direction. (As modified factorisations shift a diagonal only where
    that is needed: P. E. Gill and W. Murray, Math. Program. 7, 1974; R. B. Schnabel and E. Eskow, SIAM J. Sci. Stat.
    Comput. 11, 1990.)
    """
    shift = s[SHIFT]
    sized = shift > 0.0 and s[WHOLE] == 0.0
    for i in range(n):
        shifts[i] = shift * free[i]
        if sized:
            shifts[i] *= sqrt(sqrt(1.0 + w[i] * w[i]))
    for k in range(convex):
        i = variable[k]
        curvature = primal[i] + hess[entry[k]]
        if curvature > 0.0:
            shifts[i] = min(shifts[i], SHARE * curvature + SLIGHT * shifts[i])
    for i in range(n):
        out_primal[i] = primal[i] + shifts[i]
    for r in range(m):
        out_dual[r] = s[DUAL_SHIFT] if kind[r] == EQUALITY else d[r]


@native(fast=True)
def damped(entries: i64, bend: f64s, hess: f64s, out: f64s) -> None:
    """The Hessian ``hess`` with a share of the rows' part of it: ``bend`` is the objective's."""
    for e in range(entries):
        out[e] = bend[e] + ROWS_SHARE * (hess[e] - bend[e])


@native(fast=True)
def mean_centre(gaps: i64, gap: f64s, centre: f64s, s: f64s) -> None:
    """The target of equal products of gaps and multipliers, as large as they are on average."""
    average = s[PRODUCTS] / gaps
    for k in range(gaps):
        centre[k] = average / gap[k]


@native(fast=True)
def mu_centre(gaps: i64, mu: f64s, gap: f64s, centre: f64s) -> None:
    """``mu / gap``."""
    for k in range(gaps):
        centre[k] = mu[0] / gap[k]


@native(fast=True)
def right_hand_side(
    n: i64, m: i64, gaps: i64, with_residuals: i64, index: i64s, sign: f64s, kind: i32s,
    centre: f64s, dual: f64s, c: f64s, d: f64s, pull: f64s, rhs: f64s,
) -> None:  # fmt: skip
    """Of the reduced system, for gaps' multipliers that are to become ``centre``.

    Without residuals: the part that is linear in ``centre``.
    """
    for i in range(n + m):
        pull[i] = 0.0
    for k in range(gaps):
        pull[index[k]] += sign[k] * centre[k]
    if with_residuals != 0:
        for i in range(n + m):
            pull[i] -= dual[i]
    for i in range(n):
        rhs[i] = pull[i]
    for r in range(m):
        value = 0.0
        if kind[r] == INEQUALITY:
            value = d[r] * pull[n + r]
        if with_residuals != 0:
            value -= c[r]
        rhs[n + r] = value


@native(fast=True)
def recover(
    n: i64, m: i64, gaps: i64, with_residuals: i64, entries: i64, entry: i64s, index: i64s, sign: f64s, free: f64s,
    kind: i32s, rows: i64s, cols: i64s, jac: f64s, c: f64s, z: f64s, ratio: f64s, centre: f64s, solution: f64s,
    dw: f64s, dy: f64s, dz: f64s,
) -> None:  # fmt: skip
    """Steps of variables, slacks and gap multipliers from the solution of the reduced system.

    ``entry`` (entries,) are those of ``jac`` in rows that have a slack.
    """
    for i in range(n):
        dw[i] = solution[i] * free[i]
    slacks = dw[n:]
    for r in range(m):
        slacks[r] = 0.0
        dy[r] = solution[n + r]
    for k in range(entries):
        e = entry[k]
        slacks[rows[e]] += jac[e] * dw[cols[e]]
    for r in range(m):
        value = slacks[r]
        if with_residuals != 0:
            value += c[r]
        slacks[r] = value if kind[r] == INEQUALITY else 0.0
    for k in range(gaps):
        value = centre[k] - ratio[k] * (sign[k] * dw[index[k]])
        dz[k] = value
    if with_residuals != 0:
        for k in range(gaps):
            dz[k] -= z[k]


@native(fast=True)
def lengths(
    n: i64, m: i64, gaps: i64, index: i64s, sign: f64s, tau: f64s, w: f64s, z: f64s, gap: f64s, gradient: f64s,
    dw: f64s, dy: f64s, dz: f64s, s: f64s,
) -> None:  # fmt: skip
    """How far the bounds let a step go, and how it begins."""
    fall = 0.0
    fall_z = 0.0
    log_slope = 0.0
    for k in range(gaps):
        change = sign[k] * dw[index[k]] / gap[k]
        fall = max(fall, -change)
        log_slope += change
        fall_z = max(fall_z, -dz[k] / z[k])
    fraction = tau[0]
    s[REACH] = fraction / max(fall, NOTHING)
    s[PRIMAL_STEP] = 1.0 if fall <= fraction else fraction / fall
    s[DUAL_STEP] = 1.0 if fall_z <= fraction else fraction / fall_z
    s[LOG_SLOPE] = log_slope
    slope = 0.0
    squared = 0.0
    for i in range(n):
        slope += gradient[i] * dw[i]
        squared += dw[i] * dw[i]
    s[SLOPE] = slope
    s[LENGTH] = sqrt(squared)
    check = 0.0
    most = 0.0
    for i in range(n + m):
        most = max(most, fabs(dw[i]) / (1.0 + fabs(w[i])))
        check += dw[i] * 0.0
    for r in range(m):
        check += dy[r] * 0.0
    for k in range(gaps):
        check += dz[k] * 0.0
    s[RELATIVE] = most
    s[FINITE] = check


@native(fast=True)
def combine(count: i64, factor: f64s, one: f64s, other: f64s, out: f64s) -> None:
    """``out = one + factor * other``."""
    for i in range(count):
        out[i] = one[i] + factor[0] * other[i]


@native(fast=True, inline=True)
def _steps_to_bounds(
    begin: i64, end: i64, count: i64, index: i64s, sign: f64s, grid: f64s, gap: f64s, z: f64s, affine: f64s,
    affine_z: f64s, centring: f64s, centring_z: f64s, gap_1: f64s, gap_2: f64s, fall: f64s, falls: f64s, falls_z: f64s,
) -> None:  # fmt: skip
    """Collect what some gaps change by, and by which share of them at most, for each of ``grid`` (count,)."""
    fall_1 = fall[0:]
    fall_2 = fall[BLOCK:]
    fall_z1 = fall[2 * BLOCK :]
    fall_z2 = fall[3 * BLOCK :]
    for k in range(begin, end):
        gap_1[k] = sign[k] * affine[index[k]]
        gap_2[k] = sign[k] * centring[index[k]]
    for k in range(begin, end):
        inverse = -1.0 / gap[k]
        fall_1[k - begin] = gap_1[k] * inverse
        fall_2[k - begin] = gap_2[k] * inverse
        inverse_z = -1.0 / z[k]
        fall_z1[k - begin] = affine_z[k] * inverse_z
        fall_z2[k - begin] = centring_z[k] * inverse_z
    for trial in range(count):
        sigma = grid[trial]
        most = falls[trial]
        most_z = falls_z[trial]
        for k in range(end - begin):
            most = max(most, fall_1[k] + sigma * fall_2[k])
            most_z = max(most_z, fall_z1[k] + sigma * fall_z2[k])
        falls[trial] = most
        falls_z[trial] = most_z


@native(fast=True, inline=True)
def _squares(
    begin: i64, end: i64, sigma: f64, a: f64, b: f64, gap: f64s, z: f64s, affine_z: f64s, centring_z: f64s,
    gap_1: f64s, gap_2: f64s,
) -> f64:  # fmt: skip
    """The sum of the squares of products of some gaps and multipliers after a step."""
    squares = 0.0
    for k in range(begin, end):
        product = (gap[k] + a * (gap_1[k] + sigma * gap_2[k])) * (
            z[k] + b * (affine_z[k] + sigma * centring_z[k])
        )
        squares += product * product
    return squares


@native(fast=True)
def choose_centring(
    gaps: i64, count: i64, moving: f64, rows: f64, smallest_tau: f64, short: f64, index: i64s, sign: f64s, grid: f64s,
    gap: f64s, z: f64s, affine: f64s, affine_z: f64s, centring: f64s, centring_z: f64s, gap_1: f64s, gap_2: f64s,
    fall: f64s, trials: f64s, s: f64s,
) -> None:  # fmt: skip
    """The centring parameter of those in ``grid`` (count,) whose step is predicted to leave the smallest squared error.

    A step for sigma is ``affine + sigma * centring``; ``moving`` and ``rows`` are the numbers of dual and primal
    conditions.  Where even the best step is less than ``short``, bounds are in its way: products are not made smaller.

    Args:
        gap_1, gap_2: room, (gaps,); fall: room, (4 BLOCK,); trials: room, (4 count,).
    """
    average = s[PRODUCTS] / gaps
    # First by how much gaps and multipliers fall at most, then how far to go; then the error without products, and
    # with them.
    reaches = trials[0:]
    reaches_z = trials[count:]
    errors = trials[2 * count :]
    squares = trials[3 * count :]
    for trial in range(count):
        reaches[trial] = 1e-300
        reaches_z[trial] = 1e-300
        squares[trial] = 0.0
    begin = 0
    while begin < gaps:
        end = min(begin + BLOCK, gaps)
        _steps_to_bounds(
            begin, end, count, index, sign, grid, gap, z, affine, affine_z, centring, centring_z, gap_1, gap_2, fall,
            reaches, reaches_z,
        )  # fmt: skip
        begin = end
    likely = 0
    for trial in range(count):
        tau = max(smallest_tau, 1.0 - grid[trial] * average)
        reaches[trial] = min(1.0, tau / reaches[trial])
        reaches_z[trial] = min(1.0, tau / reaches_z[trial])
        dual = (1.0 - reaches_z[trial]) ** 2 * s[DUAL_SQUARED] / moving
        errors[trial] = dual + (1.0 - reaches[trial]) ** 2 * s[PRIMAL_SQUARED] / rows
        if errors[trial] < errors[likely]:
            likely = trial
    # Those whose error is no less without products than the likeliest one's with them are out of the question.
    begin = 0
    while begin < gaps:
        end = min(begin + BLOCK, gaps)
        squares[likely] += _squares(
            begin,
            end,
            grid[likely],
            reaches[likely],
            reaches_z[likely],
            gap,
            z,
            affine_z,
            centring_z,
            gap_1,
            gap_2,
        )
        begin = end
    enough = errors[likely] + squares[likely] / gaps
    begin = 0
    while begin < gaps:
        end = min(begin + BLOCK, gaps)
        for trial in range(count):
            if trial != likely and errors[trial] < enough:
                squares[trial] += _squares(
                    begin, end, grid[trial], reaches[trial], reaches_z[trial], gap, z, affine_z, centring_z, gap_1,
                    gap_2,
                )  # fmt: skip
        begin = end
    best = likely
    least = enough
    for trial in range(count):
        if trial != likely and errors[trial] < enough:
            error = errors[trial] + squares[trial] / gaps
            if error < least or (error == least and trial < best):
                best = trial
                least = error
    s[SIGMA] = grid[best] if reaches[best] >= short else max(grid[best], 1.0)


@native(fast=True)
def least_squares(
    n: i64, m: i64, gaps: i64, entries: i64, curved: i64, index: i64s, sign: f64s, free: f64s, kind: i32s, z: f64s,
    gradient: f64s, jac: f64s, pull: f64s, out_hess: f64s, out_jac: f64s, primal: f64s, dual: f64s, rhs: f64s,
) -> None:  # fmt: skip
    """The system whose solution makes the Lagrangian's gradient smallest.

    Equality rows are softened, against dependent ones, by :data:`NOTHING` times the square of the largest entry of J.
    """
    for e in range(curved):
        out_hess[e] = 0.0
    largest = 0.0
    for e in range(entries):
        out_jac[e] = jac[e]
        largest = max(largest, fabs(jac[e]))
    soft = NOTHING * min(1.0, largest * largest)
    for i in range(n + m):
        pull[i] = 0.0
    for k in range(gaps):
        pull[index[k]] += sign[k] * z[k]
    for i in range(n):
        primal[i] = 1.0
        rhs[i] = (pull[i] - gradient[i]) * free[i]
    for r in range(m):
        dual[r] = soft if kind[r] == EQUALITY else 1.0
        rhs[n + r] = pull[n + r] if kind[r] == INEQUALITY else 0.0
