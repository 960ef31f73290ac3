"""Recognises objectives that decrease without limit."""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.nlp import Floats
from stc.solver.products import term_sums
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["is_unbounded"]

FAR = 1e7
LOW = -1e20
LOW_WHEN_FAR = -1e15
RAY = (10.0, 100.0, 1000.0)
FEASIBLE = 1e-6
RELATIVE = 1e-8
SMALL = 1e-4


def is_unbounded(form: Formulation, it: Iterate, size: float) -> bool:
    """True when the objective is below any sensible value, or keeps falling along the ray through a far iterate.

    Both the iterate and the points tried on the ray have to be feasible, relative to the size of the terms in
    each row.

    Args:
        size: of the largest variable.
    """
    if not isinstance(form, ScaledProblem):
        return False
    if it.f > -1.0 or not (size > FAR or it.f < LOW):
        return False
    x = it.w[: form.n]
    if not _feasible(form, x, it.r):
        return False
    if it.f < (LOW_WHEN_FAR if size > FAR else LOW):
        return True
    # Small variables may have to stay; or they may belong to what grows, as the first frames of a motion do.
    large = np.where(np.abs(x) > SMALL * size, x, 0.0)
    return _falls(form, it, large) or _falls(form, it, x.copy())


def _falls(form: ScaledProblem, it: Iterate, direction: Floats) -> bool:
    """Whether the objective keeps falling along a ray of feasible points from a far iterate."""
    x, last = it.w[: form.n], it.f
    for factor in RAY:
        beyond = x + (factor - 1.0) * direction
        f, r = form.values(beyond)
        if not np.isfinite(f) or f > last - 0.5 * abs(last) or not _feasible(form, beyond, r):
            return False
        last = f
    return True


def _feasible(form: ScaledProblem, x: Floats, r: Floats) -> bool:
    _, jac, _ = form.derivatives(x, np.zeros(form.m))
    size = term_sums(form.jac_rows, form.jac_cols, jac, x, form.m)
    lower, upper = form.true_rows
    off = np.maximum(np.maximum(lower - r, r - upper), 0.0)
    x_lower, x_upper = form.true_x
    off_x = np.maximum(np.maximum(x_lower - x, x - x_upper), 0.0)
    return bool(
        np.all(off <= FEASIBLE + RELATIVE * size) and np.all(off_x <= FEASIBLE + RELATIVE * np.abs(x))
    )
