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

from functools import partial

import numpy as np

from stc.records import dataclass
from stc.solver.conditions import project_entries, restrict
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate, multiplier_scale
from stc.solver.kkt.attached import attached
from stc.solver.kkt.contract import NotFinite
from stc.solver.monitor import Monitor
from stc.solver.nlp import Floats
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["Finish", "Projection", "newton_on_active_set", "project", "smaller_multipliers"]

NEAR = 1e-2
RETREAT = 0.1
FINISHING_STEPS = 8
CONTRACTION = 0.1
FAST = 1e-2
"""Contraction that makes one more step worth its while: it gains two digits or more."""
ACCURATE = 0.1
DUAL_SHIFT = 1e-9
PRIMAL_SHIFT = 1e-8
SAME = 1e-8


@dataclass(slots=True)
class Projection:
    """A primal-dual point with its optimality error in projected form.

    Attributes:
        x, y: the point, scaled.
        f, r: objective and rows (m,).
        gradient, jac, hess: derivatives at the point.
        lagrangian: ``grad f + J^T y``, (n,); the multipliers of the bounds are its negative.
        active_x: 1 for variables at a bound, else 0, (n,), and ``x_target`` that bound.
        active_rows: 1 for rows at a bound, else 0, (m,), and ``row_target`` that bound.
        error: the largest violated condition, dual ones over the size of the multipliers.
    """

    x: Floats
    y: Floats
    f: float
    r: Floats
    gradient: Floats
    jac: Floats
    hess: Floats
    lagrangian: Floats
    active_x: Floats
    x_target: Floats
    active_rows: Floats
    row_target: Floats
    error: float


def project(form: ScaledProblem, x: Floats, y: Floats) -> Projection | None:
    """The projected optimality conditions at ``(x, y)``; None where a function is undefined."""
    f, r = form.values(x)
    if not np.isfinite(f + r.sum()):
        return None
    gradient, jac, hess = form.derivatives(x, y)
    lagrangian = gradient + form.transpose_times(jac, y)
    if not np.isfinite(lagrangian.sum() + hess.sum()):
        return None
    n, m = form.n, form.m
    x_target, active_x, row_target, active_rows = np.empty(n), np.empty(n), np.empty(m), np.empty(m)
    of_x, of_rows = np.empty(3), np.empty(3)
    project_entries(n, 1, x, lagrangian, *form.true_x, form.held_factor, x_target, active_x, of_x)
    project_entries(m, 0, r, y, *form.true_rows, form.equality_factor, row_target, active_rows, of_rows)
    (primal, dual, total), (primal_rows, dual_rows, total_rows) = of_x.tolist(), of_rows.tolist()
    error = max(primal, primal_rows, max(dual, dual_rows) / multiplier_scale(total + total_rows, m + n))
    return Projection(
        x, y, f, r, gradient, jac, hess, lagrangian, active_x, x_target, active_rows, row_target, error
    )


def _largest(v: Floats) -> float:
    return float(np.abs(v).max(initial=0.0))


def newton_on_active_set(
    form: ScaledProblem,
    x: Floats,
    y: Floats,
    monitor: Monitor,
    *,
    steps: int,
    tolerance: float,
    patience: int = 0,
) -> tuple[Projection | None, bool]:
    """Iterate from ``(x, y)``.

    Args:
        steps: at most this many.
        tolerance: error to reach.
        patience: how many steps may fail to contract before giving up.

    Returns:
        The last point (None when nothing was gained) and whether it is a solution: the error is below the
        tolerance and the curvature on the active set is positive.
    """
    x_lower, x_upper = form.true_x
    point = project(form, np.clip(x, x_lower, x_upper), y)
    if point is None:
        return None, False
    certified = False
    contraction = 0.0
    for _ in range(steps):
        if certified and point.error <= (tolerance if contraction > FAST else ACCURATE * tolerance):
            return point, True
        step = _newton_step(form, point)
        if step is None:
            return None, False
        dx, dy = step
        new = project(form, np.clip(point.x + dx, x_lower, x_upper), point.y + dy)
        if new is None:
            return None, False
        if new.error > max(CONTRACTION * point.error, ACCURATE * tolerance):
            patience -= 1
            if patience < 0:
                return None, False
        contraction = new.error / max(point.error, 1e-300)
        certified = True
        monitor.count()
        f_user, violation = form.user_measures(new.x, new.f, new.r)
        monitor.record(
            partial(form.as_stated, new.x, new.y),
            f_user,
            violation,
            new.error,
            _largest(dx),
            1.0,
            0.0,
            0.0,
            "active-set",
        )
        point = new
    return point, certified and point.error <= tolerance


class Finish:
    """Tries :func:`newton_on_active_set` once an iterate is near enough, ever more rarely when that fails."""

    def __init__(self, form: Formulation, tolerance: float, monitor: Monitor) -> None:
        self._form, self._tolerance, self._monitor = form, tolerance, monitor
        self._threshold = NEAR

    def attempt(self, it: Iterate, error: float) -> Projection | None:
        """The solution, or None."""
        form = self._form
        if not isinstance(form, ScaledProblem) or error > self._threshold:
            return None
        point, solved = newton_on_active_set(
            form, it.w[: form.n], it.y, self._monitor, steps=FINISHING_STEPS, tolerance=self._tolerance
        )
        self._threshold = RETREAT * min(self._threshold, error)
        return point if solved else None


def _newton_step(form: ScaledProblem, point: Projection) -> tuple[Floats, Floats] | None:
    """One equality-constrained Newton step, or None where the curvature on the active set isn't positive."""
    n, m = form.n, form.m
    kkt = attached(form.kkt, n, m, form.jac_rows.size, form.hess_rows.size)
    dx, dy = np.empty(n), np.empty(m)
    largest = restrict(
        n, m, form.jac_rows.size, form.hess_rows.size, form.jac_rows, form.jac_cols, form.hess_rows, form.hess_cols,
        point.jac, point.hess, point.active_x, point.active_rows, point.x, point.y, point.r, point.lagrangian,
        point.x_target, point.row_target, dx, dy, kkt.hess, kkt.jac, kkt.rhs,
    )  # fmt: skip
    flat = PRIMAL_SHIFT * max(1.0, largest)
    for shift_x, shift_y in ((0.0, 0.0), (0.0, DUAL_SHIFT), (flat, DUAL_SHIFT)):
        kkt.primal[:] = shift_x + (1.0 - shift_x) * point.active_x
        kkt.dual[:] = 1.0 + (shift_y - 1.0) * point.active_rows
        try:
            inertia = kkt.refactor()
        except NotFinite:
            return None
        if inertia.zero == 0 and inertia.negative == form.m:
            break
    else:
        return None
    kkt.solve_call()
    kkt.check_solution()
    dx += kkt.solution[:n]
    dy += kkt.solution[n:]
    return (dx, dy) if np.isfinite(dx.sum() + dy.sum()) else None


def smaller_multipliers(form: ScaledProblem, x: Floats, y: Floats) -> Floats:
    """Row multipliers (m,) of least norm, nearly, that do not leave a larger error than ``y`` (m,) or 1e-8.

    Where gradients of active constraints depend on one another, multipliers are not unique, and an iteration may
    end with huge ones that cancel.
    """
    point = project(form, x, y)
    if point is None:
        return y
    free, active = point.active_x == 0.0, point.active_rows != 0.0
    jac = point.jac * (active[form.jac_rows] & free[form.jac_cols])
    form.kkt.factorize(np.zeros_like(point.hess), jac, np.ones(form.n), np.where(active, DUAL_SHIFT, 1.0))
    _, smaller = form.kkt.solve(np.where(free, -point.gradient, 0.0), np.zeros(form.m))
    smaller = np.where(active, smaller, 0.0)
    new = project(form, x, smaller)
    return smaller if new is not None and new.error <= max(point.error, SAME) else y
