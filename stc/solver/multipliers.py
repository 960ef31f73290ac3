"""Multipliers of the rows from the gradients alone."""

from __future__ import annotations

import numpy as np

from stc.codegen.native import f64s, i64, native
from stc.solver.iterate import errors_of, evaluate
from stc.solver.kkt.contract import NotFinite
from stc.solver.nlp import Floats
from stc.solver.places import DUAL_ERROR, ERROR, LAGGING, LAGGING_DUAL, LENGTH_TAKEN, PRIMAL
from stc.solver.step_passes import SOFT
from stc.solver.workspace import Workspace

__all__ = ["LaggingMultipliers", "lags", "least_squares_multipliers", "shift_of_equations"]

LARGEST = 1e3
LARGEST_LATER = 1e8
NEARLY = 1e-6
HALF = 0.5
LAGGING_STEPS = 3


def least_squares_multipliers(work: Workspace, largest: float = LARGEST) -> Floats:
    """Multipliers (m,) that make the Lagrangian's gradient smallest at the iterate; zero when one would exceed
    ``largest``, or where a derivative is infinite.

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
    return y if np.abs(y).max() <= largest else np.zeros(m)  # which nan is not


def shift_of_equations(jac: Floats) -> float:
    """What to soften equality rows by where the Hessian is the identity, given the Jacobian's entries."""
    return SOFT * min(1.0, float(np.abs(jac).max(initial=0.0))) ** 2


@native
def lags(s: f64s) -> i64:
    """For :class:`LaggingMultipliers`: 1 after several whole steps that met the rows but left the dual error."""
    dual = s[DUAL_ERROR]
    lagging = s[PRIMAL] <= NEARLY and dual > max(HALF * s[LAGGING_DUAL], 10.0 * s[PRIMAL])
    s[LAGGING] = s[LAGGING] + 1.0 if lagging and s[LENGTH_TAKEN] == 1.0 else 0.0
    s[LAGGING_DUAL] = dual
    return 1 if s[LAGGING] >= LAGGING_STEPS else 0


class LaggingMultipliers:
    """Replaces the row multipliers where Newton's method leaves them behind.

    Where the rows' gradients vanish in the limit, the multipliers grow without bound and each Newton step leaves
    a constant share of the dual error, while the rows are met better and better.
    """

    def __init__(self, work: Workspace) -> None:
        self._work = work
        work.s[LAGGING_DUAL], work.s[LAGGING] = np.inf, 0.0

    def renew(self) -> None:
        """Give the iterate its least-squares multipliers if they are better, and measure it."""
        work = self._work
        work.s[LAGGING] = 0.0
        form, it, total = work.form, work.it, work.s[ERROR]
        y = least_squares_multipliers(work, LARGEST_LATER)
        work.provide_attempt()
        other = evaluate(form, it.w, y, it.z)
        if errors_of(form, other, 0.0).total < HALF * total:
            work.load(other)
            work.errors()
