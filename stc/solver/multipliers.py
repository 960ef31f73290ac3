"""Multipliers of the rows from the gradients alone."""

from __future__ import annotations

import numpy as np

from stc.solver.kernels import LARGEST_MULTIPLIER
from stc.solver.kkt.contract import NotFinite
from stc.solver.nlp import Floats
from stc.solver.products import NOTHING
from stc.solver.workspace import Workspace

__all__ = ["least_squares_multipliers", "shift_of_equations"]


def least_squares_multipliers(work: Workspace) -> Floats:
    """Multipliers (m,) that make the Lagrangian's gradient smallest at the iterate; zero when one would exceed
    :data:`LARGEST_MULTIPLIER`, or where a derivative is infinite.

    Solves the usual system with the identity for a Hessian (Waechter and Biegler 2006, equation 36).
    """
    m, kkt = work.form.m, work.kkt
    if m == 0:
        return np.zeros(0)
    work.least_squares_call()
    try:
        kkt.refactor()
    except NotFinite:
        return np.zeros(m)
    kkt.solve_call()
    kkt.check_solution()
    y = kkt.solution[work.form.n :].copy()
    return y if np.abs(y).max() <= LARGEST_MULTIPLIER else np.zeros(m)  # which nan is not


def shift_of_equations(jac: Floats) -> float:
    """What to soften equality rows by where the Hessian is the identity, given the Jacobian's entries."""
    return NOTHING * min(1.0, float(np.abs(jac).max(initial=0.0))) ** 2
