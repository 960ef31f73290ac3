"""Multipliers of the rows from the gradients alone."""

from __future__ import annotations

import numpy as np

from stc.codegen.native import f64s, i64, native
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate, errors_of, evaluate
from stc.solver.nlp import Floats
from stc.solver.places import DUAL_ERROR, ERROR, LAGGING, LAGGING_DUAL, LENGTH_TAKEN, PRIMAL
from stc.solver.workspace import Workspace

__all__ = ["LaggingMultipliers", "lags", "least_squares_multipliers", "shift_of_equations"]

LARGEST = 1e3
LARGEST_LATER = 1e8
NEARLY = 1e-6
HALF = 0.5
LAGGING_STEPS = 3
DUAL_SHIFT = 1e-8  # against dependent rows, relative to the square of the largest gradient entry


def least_squares_multipliers(form: Formulation, it: Iterate, largest: float = LARGEST) -> Floats:
    """Multipliers (m,) that make the Lagrangian's gradient smallest; zero when one would exceed ``largest``.

    Solves the usual system with the identity for a Hessian (Waechter and Biegler 2006, equation 36).
    """
    if form.m == 0:
        return np.zeros(0)
    d = np.where(form.equality, shift_of_equations(it.jac), 1.0)
    n = form.n
    kkt = form.attached_kkt
    kkt.hess[:], kkt.jac[:], kkt.primal[:], kkt.dual[:] = 0.0, it.jac, 1.0, d
    kkt.refactor()
    pull = form.scatter(it.z)
    np.subtract(pull[:n], it.gradient, out=kkt.rhs[:n])
    kkt.rhs[:n] *= form.free_factor
    np.multiply(pull[n:], form.inequality, out=kkt.rhs[n:])
    kkt.solve_call()
    kkt.check_solution()
    y = kkt.solution[n:].copy()
    if not np.isfinite(y.sum()) or np.abs(y).max(initial=0.0) > largest:
        return np.zeros(form.m)
    return y


def shift_of_equations(jac: Floats) -> float:
    """What to soften equality rows by where the Hessian is the identity, given the Jacobian's entries."""
    return DUAL_SHIFT * min(1.0, float(np.abs(jac).max(initial=0.0)) ** 2)


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
        y = least_squares_multipliers(form, it, LARGEST_LATER)
        other = evaluate(form, it.w, y, it.z)
        if errors_of(form, other, 0.0).total < HALF * total:
            work.load(other)
            work.errors()
