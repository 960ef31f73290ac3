"""Newton's method on the active bounds and rows as equalities: the last steps, and the warm start.

Optimality is written as the projection equation

    x - clip(x - g, x_lower, x_upper) = 0,       g = grad f + J^T y
    r - clip(r + y, row_lower, row_upper) = 0,

whose generalised derivative drops out of the clipping: where it clips, the bound is active and the unknown is
set to it; elsewhere the derivative of the Lagrangian (the multiplier) has to vanish.  Newton's method on it
solves one equality-constrained quadratic program per step and moves constraints in and out of the active set
by itself (M. Hintermueller, K. Ito and K. Kunisch, The primal-dual active set strategy as a semismooth Newton
method, SIAM J. Optim. 13, 2002).  It converges fast near a solution and is abandoned where it doesn't contract.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from stc.solver.constants import ACCURATE, CONTRACTION, HALF
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.monitor import Monitor
from stc.solver.nlp import Floats, Mask
from stc.solver.outcome import ACCEPTABLE
from stc.solver.products import NOTHING, ROUNDED, at_bounds, between
from stc.solver.projection import AGAINST_DEPENDENT_ROWS, CHANGES, REFINEMENTS, Projection, ProjectionPair
from stc.solver.scaled_problem import ScaledProblem

__all__ = [
    "Finish", "bends_upwards", "fitting_multipliers", "newton_on_active_set", "newton_point",
]  # fmt: skip

NEAR = 1e-2
STEPS = 8
PATIENCE = 2
"""From a neighbour: how many steps may fail to halve the error."""


def newton_on_active_set(
    form: ScaledProblem,
    x: Floats,
    y: Floats,
    monitor: Monitor,
    *,
    tolerance: float,
    patience: int = 0,
    regularity: int = 0,
) -> tuple[Projection | None, bool]:
    """Iterate from ``(x, y)``.

    Args:
        tolerance: error to reach.
        patience: how many steps may fail to contract before giving up; with any, contracting a little is enough.
        regularity: to begin with (see ``ProjectionPair``).

    Returns:
        The last point (None when nothing was gained; its arrays serve the next call) and whether it is a solution: the
        error is below the tolerance and the curvature on the active set is positive.
    """
    pair = _pair_of(form)
    pair.regularity = regularity
    if not pair.start(between(x, *form.true_x), y):
        return None, False
    enough = HALF if patience > 0 else CONTRACTION
    certified = False
    contraction = 0.0
    for _ in range(STEPS):
        error = pair.point.error
        # Two digits or more make one more step worth its while.
        if certified and error <= (tolerance if contraction > CONTRACTION**2 else ACCURATE * tolerance):
            return pair.point, True
        if not pair.step(tolerance):
            return None, False
        new = pair.next
        if new.error > max(enough * error, ACCURATE * tolerance):
            patience -= 1
            if patience < 0:
                return None, False
        contraction = new.error / max(error, 1e-300)
        certified = True
        monitor.count()
        as_stated, f = partial(form.as_stated, new.x, new.y), form.user_objective(new.f)
        monitor.record("active-set", as_stated, f, new.violation, new.error, pair.change)
        pair.swap()
    return pair.point, certified and pair.point.error <= tolerance


def newton_point(form: ScaledProblem, x: Floats, y: Floats) -> Projection | None:
    """One such step from ``(x, y)``: the point that it leads to, not evaluated; None where there is none."""
    pair = _pair_of(form)
    pair.regularity = 0
    return pair.next if pair.start(between(x, *form.true_x), y) and pair.advance() else None


def bends_upwards(form: ScaledProblem) -> bool:
    """Whether the last factorisation of Newton's method found the curvature on its active set to be positive unshifted.

    Such a point meets the second-order sufficient condition; where it took a shift, the necessary one, nearly.
    """
    return _pair_of(form).regularity <= AGAINST_DEPENDENT_ROWS


def _pair_of(form: ScaledProblem) -> ProjectionPair:
    """The pair of points at which the functions of the form are evaluated; made on first use."""
    return form.keep(ProjectionPair)


class Finish:
    """Tries :func:`newton_on_active_set` once an iterate is near enough and tells what is active.

    Where that fails, it is tried ever more rarely: at a tenth of the error, then at a hundredth of that, and so on.

    Attributes:
        threshold: the error at which it is tried next.
    """

    def __init__(self, form: Formulation, tolerance: float, monitor: Monitor) -> None:
        self._form, self._tolerance, self._monitor = form, tolerance, monitor
        self.threshold = NEAR
        self._failures = self._regularity = 0

    def is_due(self, error: float) -> bool:
        """Whether to try it at an iterate of that error."""
        return isinstance(self._form, ScaledProblem) and error <= self.threshold

    def attempt(self, it: Iterate, error: float) -> Projection | None:
        """The solution, or None; where it ``is_due``."""
        form = self._form
        assert isinstance(form, ScaledProblem)
        point, solved = newton_on_active_set(
            form, it.w[: form.n], it.y, self._monitor, tolerance=self._tolerance,
            regularity=self._regularity,
        )  # fmt: skip
        # Rows that depend on one another do so at the next attempt, too.
        self._regularity = _pair_of(form).regularity
        self._failures += not solved
        self.threshold = CONTRACTION**self._failures * min(self.threshold, error)
        return point if solved else None


def _balancing(form: ScaledProblem, jac: Floats, free: Mask, active: Mask) -> Callable[[Floats], Floats]:
    """A function: which multipliers (m,) of the active rows pull on free variables as near as can be to what is given,
    (n,); of least norm, nearly. Good until the system is factorised again.
    """
    entries = jac * (active[form.jac_rows] & free[form.jac_cols])
    shift = np.where(active, NOTHING, 1.0)
    form.kkt.factorize(np.zeros(form.hess_rows.size), entries, np.ones(form.n), shift)
    return lambda pull: np.where(active, form.kkt.solve(pull, np.zeros(form.m))[1], 0.0)


def fitting_multipliers(form: ScaledProblem, x: Floats) -> Floats:
    """Row multipliers (m,) that make the Lagrangian's gradient smallest at a point ``x`` (n,) given without
    multipliers.

    All rows and bounds that hold with equality there count at first; then those are left out, all at once, whose
    multipliers would have to pull the wrong way, until none has to.
    """
    y = np.zeros(form.m)
    _, r = form.values(x)
    gradient, jac, hess = form.derivatives(x, y)
    if not np.isfinite(r.sum() + gradient.sum() + jac.sum() + hess.sum()):
        return y
    below_x, above_x = at_bounds(x, *form.true_x, ACCEPTABLE)
    below, above = at_bounds(r, *form.true_rows, ACCEPTABLE)
    for _ in range(CHANGES):
        free, active = ~(below_x | above_x), below | above
        balance = _balancing(form, jac, free, active)
        left, y = np.where(free, -gradient, 0.0), np.zeros(form.m)
        for _ in range(REFINEMENTS):  # the shift against dependent rows is taken out again
            y += balance(left)
            pull = np.bincount(form.jac_cols, weights=jac * y[form.jac_rows], minlength=form.n)
            left = np.where(free, -gradient - pull, 0.0)
            if float(np.abs(left).max(initial=0.0)) <= ROUNDED:
                break
        wrong = (below & ~above & (y > 0.0)) | (above & ~below & (y < 0.0))
        z = np.where(free, 0.0, -gradient - pull)
        wrong_x = (below_x & ~above_x & (z > 0.0)) | (above_x & ~below_x & (z < 0.0))
        if not (wrong.any() or wrong_x.any()):
            break
        below, above = below & ~wrong, above & ~wrong
        below_x, above_x = below_x & ~wrong_x, above_x & ~wrong_x
    return y
