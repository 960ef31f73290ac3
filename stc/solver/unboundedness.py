"""Recognises objectives that decrease without limit."""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["is_unbounded"]

FAR = 1e8
FARTHEST = 1e20
RAY = (10.0, 100.0, 1000.0)
FEASIBLE = 1e-6


def is_unbounded(form: Formulation, it: Iterate) -> bool:
    """True when the iterate is far out and the objective keeps falling, feasibly, along the ray through it."""
    if not isinstance(form, ScaledProblem):
        return False
    x = it.w[: form.n]
    size = float(np.abs(x).max(initial=0.0))
    if size < FAR or it.f > -1.0:
        return False
    if float(np.abs(it.c).max(initial=0.0)) > FEASIBLE * size:
        return False
    if size > FARTHEST:
        return True
    last = it.f
    direction = np.where(np.abs(x) > 1e-4 * size, x, 0.0)
    for factor in RAY:
        beyond = x + (factor - 1.0) * direction
        f, r = form.values(beyond)
        if not np.isfinite(f) or f > last - 0.5 * abs(last):
            return False
        if form.violation(beyond, r) > FEASIBLE * factor * size:
            return False
        last = f
    return True
