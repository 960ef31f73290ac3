"""Multipliers of the rows from the gradients alone."""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Errors, Iterate, errors_of, evaluate
from stc.solver.nlp import Floats
from stc.solver.workspace import Workspace

__all__ = ["LaggingMultipliers", "least_squares_multipliers", "shift_of_equations"]

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


class LaggingMultipliers:
    """Replaces the row multipliers where Newton's method leaves them behind.

    Where the rows' gradients vanish in the limit, the multipliers grow without bound and each Newton step leaves
    a constant share of the dual error, while the rows are met better and better.
    """

    def __init__(self) -> None:
        self._dual = np.inf
        self._waited = 0

    def due(self, errors: Errors, length: float) -> bool:
        """True after several whole steps that met the rows without reducing the dual error."""
        lagging = errors.primal <= NEARLY and errors.dual > max(HALF * self._dual, 10.0 * errors.primal)
        self._waited = self._waited + 1 if lagging and length == 1.0 else 0
        self._dual = errors.dual
        return self._waited >= LAGGING_STEPS

    def renew(self, work: Workspace, errors: Errors) -> Errors:
        """Give the iterate its least-squares multipliers if they are better; the errors then."""
        self._waited = 0
        form, it = work.form, work.it
        y = least_squares_multipliers(form, it, LARGEST_LATER)
        other = evaluate(form, it.w, y, it.z)
        new = errors_of(form, other, 0.0)
        if not new.total < HALF * errors.total:
            return errors
        work.load(other)
        return work.errors()
