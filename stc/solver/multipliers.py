"""Multipliers of the rows from the gradients alone."""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.nlp import Floats

__all__ = ["least_squares_multipliers"]

LARGEST = 1e3
DUAL_SHIFT = 1e-8  # against dependent rows, relative to the square of the largest gradient entry


def least_squares_multipliers(form: Formulation, it: Iterate, largest: float = LARGEST) -> Floats:
    """Multipliers (m,) that make the Lagrangian's gradient smallest; zero when one would exceed ``largest``.

    Solves the usual system with the identity for a Hessian (Waechter and Biegler 2006, equation 36).
    """
    if form.m == 0:
        return np.zeros(0)
    d = np.where(form.equality, DUAL_SHIFT * min(1.0, float(np.abs(it.jac).max(initial=0.0)) ** 2), 1.0)
    form.kkt.factorize(np.zeros_like(it.hess), it.jac, np.ones(form.n), d)
    pull = form.scatter(it.z)
    rhs_x = pull[: form.n] - it.gradient
    if form.any_held:
        rhs_x[form.held] = 0.0
    rhs_s = np.where(form.inequality, pull[form.n :], 0.0)
    _, y = form.kkt.solve(rhs_x, rhs_s)
    if not np.isfinite(y.sum()) or np.abs(y).max(initial=0.0) > largest:
        return np.zeros(form.m)
    return y
