"""Recognises objectives that decrease without limit."""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["is_unbounded"]

FAR = 1e7
LOW = -1e25
RAY = (10.0, 100.0, 1000.0)
ROUNDING = 1e-12
FEASIBLE = 1e-6


def is_unbounded(form: Formulation, it: Iterate) -> bool:
    """True when the objective is below any sensible value, or keeps falling along the ray through a far iterate.

    Both the iterate and the points tried on the ray have to be feasible, up to the rounding errors of numbers of
    their size.
    """
    if not isinstance(form, ScaledProblem):
        return False
    x = it.w[: form.n]
    size = float(np.abs(x).max(initial=0.0))
    if it.f > -1.0 or not (size > FAR or it.f < LOW):
        return False
    if form.violation(x, it.r) > FEASIBLE + ROUNDING * size:
        return False
    if it.f < LOW:
        return True
    last = it.f
    direction = np.where(np.abs(x) > 1e-4 * size, x, 0.0)
    for factor in RAY:
        beyond = x + (factor - 1.0) * direction
        f, r = form.values(beyond)
        if not np.isfinite(f) or f > last - 0.5 * abs(last):
            return False
        if form.violation(beyond, r) > FEASIBLE + ROUNDING * factor * size:
            return False
        last = f
    return True
