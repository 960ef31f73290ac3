"""First iterates of the barrier iteration, cold and warm."""

from __future__ import annotations

import numpy as np

from stc.solver.constants import LARGEST_MULTIPLIER
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.kkt.contract import NotFinite
from stc.solver.nlp import Floats
from stc.solver.scaled_problem import RELAXATION, ScaledProblem
from stc.solver.workspace import Workspace, workspace_of

__all__ = ["WARM_BARRIER", "active_iterate", "cold_iterate", "least_squares_multipliers", "warm_iterate"]

PUSH = 1e-2
WARM_PUSH = 1e-3
WARM_BARRIER = 1e-4
ACTIVE_BARRIER = 1e-12
"""With such a product, very near to its bound, what is active is as good as held, and what is not as good as free."""


def cold_iterate(form: ScaledProblem, x: Floats, *, by_gaps: bool = True) -> Iterate:
    """A strictly interior point near ``x`` (n,), scaled, with the row multipliers that leave the least gradient of the
    Lagrangian; it is the iterate of the form's workspace.

    Many gaps have multipliers that are smaller the wider they are: one over the square root, half way between equal
    products, as solutions of barrier problems have them, and the equal multipliers that few gaps have.
    """
    w = _inside(form, x, PUSH)
    work = workspace_of(form)
    it = work.evaluate(w, np.zeros(form.m), np.ones(form.gaps))
    if by_gaps and form.many_gaps:
        np.divide(1.0, np.sqrt(it.gap), out=it.z)
    return work.evaluate(w, least_squares_multipliers(work), it.z)


def warm_iterate(form: ScaledProblem, x: Floats, y: Floats) -> Iterate:
    """A strictly interior point very near ``x`` (n,), scaled, that keeps the row multipliers ``y`` (m,).

    The gap multipliers are those of a barrier problem with parameter :data:`WARM_BARRIER`, or, where the rows'
    multipliers tell of a larger one, that.
    """
    return _iterate_at(form, x, y, WARM_PUSH, WARM_BARRIER)


def active_iterate(form: ScaledProblem, x: Floats, y: Floats) -> Iterate:
    """An iterate as near to a solution ``x`` (n,), with multipliers ``y`` (m,), as a barrier comes at its end."""
    return _iterate_at(form, x, y, RELAXATION, ACTIVE_BARRIER)


def _iterate_at(form: ScaledProblem, x: Floats, y: Floats, push: float, barrier: float) -> Iterate:
    w = _inside(form, x, push)
    work = workspace_of(form)
    it = work.evaluate(w, y, np.zeros(form.gaps))
    return work.evaluate(w, y, np.maximum(form.sign * it.dual[form.index], barrier / it.gap))


def _inside(form: Formulation, x: Floats, push: float) -> Floats:
    """``w`` (n + m,) at ``x`` moved inside the bounds, less far where functions are undefined there."""
    n = form.n
    work = workspace_of(form)
    ev, w, move_inside = work.evaluator, work.start_w, work.push_inside
    while True:
        move_inside.set("push", push)
        w[:n], w[n:] = x, form.target
        if form.any_held:
            np.copyto(w[:n], form.held_value, where=form.held)
        move_inside()
        ev.x[:] = w[:n]
        ev.values_call()
        if ev.values_status[0] == 0.0 or push < ACTIVE_BARRIER:
            break
        push *= 0.1
    if form.any_inequality:
        np.copyto(w[n:], ev.r, where=form.inequality)
        move_inside()
    return w


def least_squares_multipliers(work: Workspace) -> Floats:
    """Multipliers (m,) that make the Lagrangian's gradient smallest at the iterate; zero when one would exceed
    :data:`LARGEST_MULTIPLIER`, or where a derivative is infinite.

    Solves the usual system with the identity for a Hessian (Waechter and Biegler 2006, equation 36).
    """
    m, kkt = work.form.m, work.kkt
    if m == 0:
        return np.zeros(0)
    work.run("step_least_squares")
    try:
        kkt.refactor()
    except NotFinite:
        return np.zeros(m)
    kkt.solve_call()
    kkt.check_solution()
    y = kkt.solution[work.form.n :].copy()
    return y if np.abs(y).max() <= LARGEST_MULTIPLIER else np.zeros(m)  # which nan is not
