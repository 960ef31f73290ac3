"""A point with multipliers for rows and bounds, and how far it is from optimal."""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.nlp import Floats, Mask
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["PrimalDual", "measure"]

MEAN_MULTIPLIER = 100.0


@dataclass(frozen=True, slots=True)
class PrimalDual:
    """A point of a scaled problem.

    Attributes:
        x: variables inside their bounds, (n,).
        y, z: multipliers of rows (m,) and bounds (n,); positive at an upper bound, negative at a lower one.
        f, r: objective and rows (m,).
        gradient, jac, hess: derivatives.
        lagrangian: ``grad f + J^T y``, (n,).
        error: largest of stationarity, violation and complementarity; the dual ones over the size of the
            multipliers.
    """

    x: Floats
    y: Floats
    z: Floats
    f: float
    r: Floats
    gradient: Floats
    jac: Floats
    hess: Floats
    lagrangian: Floats
    error: float


def measure(
    form: ScaledProblem, x: Floats, y: Floats, z: Floats, balancing: Mask | None = None
) -> PrimalDual | None:
    """Evaluate the problem at ``(x, y, z)``; None where a function is undefined.

    Where ``balancing`` (n,) is True, and where a variable is held, z is what makes the Lagrangian stationary.
    """
    x_lower, x_upper = form.true_x
    row_lower, row_upper = form.true_rows
    x = np.clip(x, x_lower, x_upper)
    f, r = form.values(x)
    if not np.isfinite(f + r.sum()):
        return None
    gradient, jac, hess = form.derivatives(x, y)
    lagrangian = gradient + form.transpose_times(jac, y)
    if not np.isfinite(lagrangian.sum() + hess.sum()):
        return None
    z = np.where(form.held if balancing is None else form.held | balancing, -lagrangian, z)
    size = (np.abs(y).sum() + np.abs(z).sum()) / max(1, form.m + form.n)
    dual = max(
        _largest(lagrangian + z),
        _complementarity(z, x - x_lower, x_upper - x),
        _complementarity(y, r - row_lower, row_upper - r),
    )
    violation = float(np.maximum(row_lower - r, r - row_upper).max(initial=0.0))
    error = max(violation, dual / max(1.0, size / MEAN_MULTIPLIER))
    return PrimalDual(x, y, z, f, r, gradient, jac, hess, lagrangian, error)


def _complementarity(multiplier: Floats, below: Floats, above: Floats) -> float:
    """Largest product of a multiplier and the distance to the bound it belongs to; far bounds count as near."""
    distance = np.where(multiplier > 0.0, above, np.where(multiplier < 0.0, below, 0.0))
    return _largest(multiplier * np.clip(distance, 0.0, 1.0))


def _largest(v: Floats) -> float:
    return float(np.abs(v).max(initial=0.0))
