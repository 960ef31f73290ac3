"""A point with multipliers for rows and bounds, and how far it is from optimal."""

from __future__ import annotations

import math

import numpy as np

from stc.core.functions import function
from stc.core.structures import structure
from stc.records import dataclass
from stc.solver.nlp import Floats, Mask
from stc.solver.products import multiplier_scale
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
    x = np.clip(x, *form.true_x)
    f, r = form.values(x)
    if not np.isfinite(f + r.sum()):
        return None
    gradient, jac, hess = form.derivatives(x, y)
    lagrangian, z = np.empty(form.n), z.copy()
    balanced = form.held_factor if balancing is None else np.maximum(form.held_factor, balancing)
    point = structure("primal_dual")(
        nlp=form.program, x=x, y=y, z=z, r=r, gradient=gradient, jac=jac, lagrangian=lagrangian
    )
    function("conditions_balance")(point, balanced)
    dual, total = point.stationarity, point.multipliers
    if not math.isfinite(dual + total) or not np.isfinite(hess.sum()):
        return None
    error = max(point.violation, dual / multiplier_scale(total, form.m + form.n))
    return PrimalDual(x, y, z, f, r, gradient, jac, hess, lagrangian, error)
