"""A point with multipliers for rows and bounds, and how far it is from optimal."""

from __future__ import annotations

import math

import numpy as np

from stc.records import dataclass
from stc.solver.conditions import POINT, point_conditions
from stc.solver.kernels import multiplier_scale
from stc.solver.nlp import Floats, Mask
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["PrimalDual", "measure"]


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
    n, m = form.n, form.m
    lagrangian, out, z = np.empty(n), np.empty(POINT), z.copy()
    balanced = form.held_factor if balancing is None else np.maximum(form.held_factor, balancing)
    point_conditions(
        n, m, form.jac_rows.size, balanced, form.jac_rows, form.jac_cols, x, y, z, r, gradient, jac, x_lower, x_upper,
        row_lower, row_upper, lagrangian, out,
    )  # fmt: skip
    violation, dual, total = out.tolist()
    if not math.isfinite(dual + total) or not np.isfinite(hess.sum()):
        return None
    error = max(violation, dual / multiplier_scale(total, m + n))
    return PrimalDual(x, y, z, f, r, gradient, jac, hess, lagrangian, error)
