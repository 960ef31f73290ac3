"""Meeting the equations to the last digits where an iteration has only come near enough."""

from __future__ import annotations

import numpy as np

from stc.solver.kkt.contract import NotFinite
from stc.solver.multipliers import shift_of_equations
from stc.solver.nlp import Floats
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["MET", "meet_equations"]

#: Equations met so well are left alone.
MET = 1e-11
#: Variables so near to a bound stay there, and inequalities are left out: the ones are so stiff, the others so soft.
NEAR = 1e-6
STIFF = 1e8
STEPS = 2
HALF = 0.5


def meet_equations(form: ScaledProblem, x: Floats) -> Floats:
    """The nearest point to ``x`` (n,), scaled, where the equality rows hold, to first order; ``x`` if that is no gain.

    The system is that of least-squares multipliers (see stc.solver.multipliers), for the least step instead.
    """
    residual = _residual(form, x)
    for _ in range(STEPS):
        worst = float(np.abs(residual).max(initial=0.0))
        if not worst > MET:
            break
        moved = x + _step(form, x, residual)
        left = _residual(form, moved)
        if not float(np.abs(left).max()) <= HALF * worst:
            break
        x, residual = moved, left
    return x


def _residual(form: ScaledProblem, x: Floats) -> Floats:
    """How far the equality rows are from their right-hand sides, (m,); 0 for other rows."""
    _, r = form.values(x)
    return np.where(form.equality, r - form.target, 0.0)


def _step(form: ScaledProblem, x: Floats, residual: Floats) -> Floats:
    """The least step that meets the linearised equality rows, (n,); ``residual`` (m,) is theirs."""
    _, jac, _ = form.derivatives(x, np.zeros(form.m))
    lower, upper = form.true_x
    at_bound = (x - lower <= NEAR) | (upper - x <= NEAR)
    kkt = form.attached_kkt
    kkt.hess[:], kkt.jac[:] = 0.0, jac
    kkt.primal[:] = np.where(at_bound, STIFF, 1.0)
    kkt.dual[:] = np.where(form.equality, shift_of_equations(jac), STIFF)
    try:
        kkt.refactor()
    except NotFinite:
        return np.zeros(form.n)
    kkt.rhs[: form.n] = 0.0
    kkt.rhs[form.n :] = -residual
    kkt.solve_call()
    kkt.check_solution()
    return kkt.solution[: form.n] * form.free_factor
