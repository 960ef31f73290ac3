"""Follows a curve of feasible points along which the objective falls, to where it ends or beyond all bounds.

A predictor goes on in the direction of the last step, projected onto the tangent space of the rows; Newton steps of
least length, the correctors, lead back onto them (E. L. Allgower and K. Georg, Numerical Continuation Methods, 1990,
chapters 2 and 6). Lengths are doubled as long as the objective falls in proportion. On rows that are curved, such as
``y = x^2``, that tells what a ray cannot: that an objective falls without limit.

Lengths are measured relative to the gaps of bounds, as affine scaling does: a curve slides along a bound that is near
instead of ending at it.
"""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.formulation import Formulation
from stc.solver.globalization import largest_step
from stc.solver.kkt.contract import NotFinite
from stc.solver.multipliers import shift_of_equations
from stc.solver.nlp import Floats
from stc.solver.products import inner, norm, term_sums

__all__ = ["Followed", "follow"]

FRACTION = 0.9
"""Of the distance to a bound, the most that one step goes."""
LONGER, SHORTER, LEAST = 2.0, 0.25, 0.1
"""What a step's length is multiplied by after one that was taken and after one that was not, and the shortest one that
is tried, as a share of the last one."""
IN_PROPORTION = 0.5
"""Fall of the objective, per length, as a share of what it was in the last step and the length's growth undone."""
CORRECTIONS = 6
MET, ROUNDED = 1e-9, 1e-13
"""Rows are met within so much, or so much of the sum of their terms."""
STRAIGHT = 0.5
"""The most that correctors may change a step, as a share of its length."""
STEPS = 80
FAR, LOW = 1e10, -1e6
"""What a curve has no end by: variables so many times as large as at its start (or as 1), and an objective so far below
zero, in units of what it was at the start (or of 1). Rays are held to the same fall."""


@dataclass(frozen=True, slots=True)
class Followed:
    """Where a curve of falling objective led.

    Attributes:
        w: its last point, variables and slacks, (n + m,).
        endless: whether the objective fell all the way to points beyond anything that a problem can mean.
    """

    w: Floats
    endless: bool


def follow(form: Formulation, start: Floats, w: Floats) -> Followed:
    """Go on along the feasible curve through ``start`` and ``w`` (n + m,), at which the objective is lower.

    Both lie strictly inside their bounds; rows are met at neither more than nearly.
    """
    n = form.n
    size = max(1.0, float(np.abs(start[:n]).max(initial=0.0)))
    first, f = form.values(start[:n])[0], form.values(w[:n])[0]
    step = w - start
    fall = first - f
    lowest = LOW * max(1.0, abs(first))
    for _ in range(STEPS):
        length = norm(step)
        if not (np.isfinite(length) and length > 0.0):
            break
        taken = _next(form, w, step / length, length, f, fall / length)
        if taken is None:
            break
        before, (w, f) = f, taken[:2]
        step, fall = taken[2], before - f
        if f < lowest and float(np.abs(w[:n]).max()) > FAR * size:
            return Followed(w, True)
    return Followed(w, False)


def _next(
    form: Formulation, w: Floats, direction: Floats, length: float, f: float, slope: float
) -> tuple[Floats, float, Floats] | None:
    """The next point after ``w`` (n + m,), its objective and the step; None where the objective falls no more.

    Args:
        direction: of the last step, of length 1, (n + m,).
        length: the last step's.
        f: objective at ``w``.
        slope: what it fell by in the last step, per length.
    """
    ahead = _projected(form, w, direction)
    if ahead is None or not norm(ahead) > 0.0:
        return None
    ahead = ahead / norm(ahead)
    share = LONGER
    while share >= LEAST:
        step = share * length * ahead
        step = step * largest_step(form.gap(w), form.sign * step[form.index], FRACTION)
        new = _corrected(form, w + step)
        if new is not None:
            there, value = new
            moved = there - w
            straight = norm(moved - step) <= STRAIGHT * norm(step)
            enough = IN_PROPORTION * slope * norm(moved) / max(1.0, norm(moved) / length)
            if straight and f - value >= enough and value < f:
                return there, value, moved
        share *= SHORTER
    return None


def _corrected(form: Formulation, w: Floats) -> tuple[Floats, float] | None:
    """The point with the rows met that least steps lead to from ``w`` (n + m,), and the objective there, or None."""
    n = form.n
    for _ in range(CORRECTIONS):
        f, r = form.values(w[:n])
        if not np.isfinite(f + r.sum()):
            return None
        c = form.residual(r, w)
        _, jac, _ = form.derivatives(w[:n], np.zeros(form.m))
        if not np.isfinite(jac).all():
            return None
        terms = term_sums(form.jac_rows, form.jac_cols, jac, w[:n], form.m)
        if np.all(np.abs(c) <= MET + ROUNDED * terms):
            return w, f
        back = _least_step(form, w, jac, np.zeros(form.size), c)
        if back is None:
            return None
        w = w + largest_step(form.gap(w), form.sign * back[form.index], FRACTION) * back
    return None


def _projected(form: Formulation, w: Floats, direction: Floats) -> Floats | None:
    """The direction (n + m,) of the tangent space of the rows at ``w`` that is nearest to ``direction``."""
    _, jac, _ = form.derivatives(w[: form.n], np.zeros(form.m))
    if not np.isfinite(jac).all():
        return None
    return _least_step(form, w, jac, direction, np.zeros(form.m))


def _least_step(form: Formulation, w: Floats, jac: Floats, wanted: Floats, c: Floats) -> Floats | None:
    """The step (n + m,) nearest to the one ``wanted`` that makes up for the residual ``c`` (m,), to first order.

    With M the metric, ``J dx - ds = -c`` and ``s`` eliminated, that is the usual system with M for a Hessian.
    """
    n, kkt = form.n, form.attached_kkt
    metric = 1.0 + form.scatter(form.sign / form.gap(w) ** 2)
    kkt.hess[:], kkt.jac[:] = 0.0, jac
    kkt.primal[:] = metric[:n]
    kkt.dual[:] = np.where(form.equality, shift_of_equations(jac), 1.0 / metric[n:])
    try:
        kkt.refactor()
    except NotFinite:
        return None
    kkt.rhs[:n] = metric[:n] * wanted[:n]
    kkt.rhs[n:] = np.where(form.inequality, wanted[n:], 0.0) - c
    kkt.solve_call()
    kkt.check_solution()
    step = np.zeros(form.size)
    step[:n] = kkt.solution[:n] * form.free_factor
    step[n:] = np.where(form.inequality, form.jacobian_times(jac, step[:n]) + c, 0.0)
    return step if np.isfinite(inner(step, step)) else None
