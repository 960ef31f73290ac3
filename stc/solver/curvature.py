"""The second-order conditions of a stationary point, and the way off one that does not meet them.

On the directions in which no active constraint changes, the null space of their Jacobian, the Lagrangian of a local
minimum bends nowhere downwards (the second-order necessary condition: J. Nocedal and S. J. Wright, Numerical
Optimization, 2006, theorem 12.5). Where every active constraint has a multiplier that is not zero (strict
complementarity) these directions are the critical cone, and no others matter. The inertia of the KKT matrix tells: with
m negative and no zero eigenvalues all directions bend upwards, with more negative ones some bend downwards (N. I. M.
Gould, On practical conditions for the existence and uniqueness of solutions to the general equality quadratic
programming problem, Math. Program. 32, 1985).

Where one does, inverse iteration with the shifted factorisation finds it, and the objective falls along it, either way
(J. J. More and D. C. Sorensen, On the use of directions of negative curvature in a modified Newton method, Math.
Program. 16, 1979). Where a direction does not bend at all, the
condition tells nothing; there the objective is tried a little way off.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from stc.solver.constants import CONTRACTION, MOST_CORRECTIONS, SMALLEST_TAU
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.nlp import Floats
from stc.solver.outcome import SHORT_BUDGET
from stc.solver.products import NOTHING, inner, norm
from stc.solver.scaled_problem import NEARBY, ScaledProblem
from stc.solver.starting import active_iterate
from stc.solver.workspace import workspace_of

__all__ = ["ESCAPES", "SecondOrder", "largest_step", "leave_saddle", "second_order_at"]

ESCAPES = 5
"""Stationary points that bend downwards, one after the other."""
SIGNIFICANT = 1e-11
TRIALS = 16
"""Lengths of a step along negative curvature, each half the one before."""


class SecondOrder(Enum):
    """The result of the second-order test at a stationary point."""

    HOLDS = "everything bends upwards"
    FLAT = "nothing bends downwards, but something does not bend at all"
    LOWER = "the same, but a lower point was found, to which the iterate was moved"
    LEFT = "something bends downwards, and the iterate was moved to a lower point"
    FAILS = "something bends downwards, but no lower point was found"


def leave_saddle(system: NewtonSystem, seed: int, probe: bool = False) -> SecondOrder:
    """Check the second-order condition at the iterate, and move off along negative curvature where it fails.

    Args:
        seed: of the random direction that inverse iteration begins with.
        probe: also look for a lower point where something does not bend at all.
    """
    form, work = system.form, system.work
    it = work.it
    mu = inner(it.gap, it.z) / max(1, form.gaps)
    negligible = NOTHING * max(1.0, float(np.abs(it.hess).max(initial=0.0)))
    try:
        system.factorize(max(mu, 1e-9), exact=True)
        if system.shift == 0.0:
            return SecondOrder.HOLDS
        flat = system.bears(negligible)
        if flat and not probe:
            return SecondOrder.FLAT
        if not flat:
            system.tighten()
    except SingularSystem:  # constraints depend on each other too much for the condition to say anything
        return SecondOrder.FLAT
    bent = _most_bent(system, seed)
    if bent is None:
        return SecondOrder.FLAT
    dw, curvature, uncertain = bent
    # What inertia says of a badly scaled matrix may be rounding, and its largest entry may hide what bends.
    flat = curvature >= -NOTHING * uncertain if probe else flat or curvature > -negligible
    if flat and (not probe or (form.linear and form.quadratic_objective)):
        return SecondOrder.FLAT
    if inner(it.dual[: form.n], dw[: form.n]) > 0.0:
        dw = -dw
    moved = _lower(system, dw, few=flat, beyond_errors=probe)
    if moved is None:
        return SecondOrder.FLAT if flat else SecondOrder.FAILS
    work.evaluate(moved, it.y, it.z)
    work.renew_calls()
    return SecondOrder.LOWER if flat else SecondOrder.LEFT


def _most_bent(system: NewtonSystem, seed: int) -> tuple[Floats, float, float] | None:
    """The direction (n + m,) that bends downwards most, its variables of length 1; how much it bends, and what that
    changes by, relative changes of the Hessian's entries and of the direction added up.

    By inverse iteration from a random direction; None where that breaks down.
    """
    form, hess = system.form, system.work.it.hess
    v = np.random.default_rng(seed).standard_normal(form.n) * form.free
    zeros, rhs = np.zeros(form.m), np.zeros(form.size)
    curvature = np.inf
    for _ in range(SHORT_BUDGET):
        rhs[: form.n] = v
        dw, _ = system.solve(rhs, zeros)
        length = norm(dw[: form.n])
        if not np.isfinite(length) or length == 0.0:
            return None
        dw = dw / length
        v = dw[: form.n]
        before, curvature = curvature, inner(v, form.hessian_times(hess, v))
        if abs(curvature - before) <= CONTRACTION * abs(curvature):
            break
    of_entries = inner(np.abs(v), form.hessian_times(np.abs(hess), np.abs(v)))
    return dw, curvature, of_entries + 2.0 * norm(form.hessian_times(hess, v))


def _lower(system: NewtonSystem, dw: Floats, *, few: bool, beyond_errors: bool) -> Floats | None:
    """A lower point (n + m,) along ``dw`` or its opposite, back on the rows after each trial, or None.

    Args:
        few: try a few lengths only: nothing promises that a shorter one will do.
        beyond_errors: lower by more than the first-order errors of the iterate explain.
    """
    form, it = system.form, system.work.it
    n = form.n
    scale = NEARBY * max(1.0, float(np.abs(it.w[:n]).max(initial=0.0)))
    price = 1.0 + 2.0 * float(np.abs(it.y).max(initial=0.0))
    merit = it.f + price * it.theta
    slope = abs(inner(it.dual - form.scatter(it.z), dw)) if beyond_errors else 0.0
    products = inner(it.gap, it.z) if beyond_errors else 0.0
    for direction in (dw, -dw):
        alpha = scale * largest_step(it.gap, scale * (form.sign * direction[form.index]), SMALLEST_TAU)
        for _ in range(MOST_CORRECTIONS if few else TRIALS):
            enough = SIGNIFICANT * (1.0 + abs(it.f)) + alpha * slope + products
            w = it.w + alpha * direction
            for _ in range(MOST_CORRECTIONS):
                f, r = form.values(w[:n])
                c = form.residual(r, w)
                theta = float(np.abs(c).sum())
                if not np.isfinite(f + theta):
                    break
                if f + price * theta < merit - enough:
                    return w
                if theta <= it.theta:
                    break
                back, _ = system.solve(np.zeros(form.size), c)
                w = w + largest_step(form.gap(w), form.sign * back[form.index], SMALLEST_TAU) * back
            alpha *= 0.5
    return None


def largest_step(value: Floats, change: Floats, fraction: float) -> float:
    """Largest alpha <= 1 with ``value + alpha * change >= (1 - fraction) * value``, for positive ``value``."""
    if not value.size:
        return 1.0
    worst = float((change / value).min())
    return 1.0 if worst >= -fraction else fraction / -worst


def second_order_at(form: ScaledProblem, x: Floats, y: Floats, seed: int) -> SecondOrder:
    """The second-order test at a scaled point (n,) with multipliers (m,); directions without curvature are probed.

    In a quadratic program what is flat is flat all the way, and needs no probe. A lower point that this leads to is the
    iterate of the form's workspace.
    """
    work = workspace_of(form)
    work.load(active_iterate(form, x, y))
    work.calls.forget()
    return leave_saddle(NewtonSystem(work), seed, probe=True)
