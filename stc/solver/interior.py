"""The loop: sequential quadratic programming with the inequalities inside a barrier.

Each pass linearises the optimality conditions of the barrier problem with exact second derivatives, factorises
one structured system, and moves along the step as far as the filter allows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from stc.solver.active_set import Projection, newton_on_active_set
from stc.solver.barrier_parameter import BarrierParameter
from stc.solver.curvature import leave_saddle
from stc.solver.formulation import Formulation
from stc.solver.globalization import LineSearch
from stc.solver.iterate import Iterate, errors_of, evaluate
from stc.solver.monitor import Monitor
from stc.solver.multipliers import least_squares_multipliers
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.options import Options
from stc.solver.restoration import Acceptance, back_from, elastic_start
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.unboundedness import is_unbounded

__all__ = ["End", "Outcome", "optimise"]

FINISH_BELOW = 1e-2
STALLED_STEPS = 3
ESCAPES = 5
SHORTEST = (0.02, 0.02, 0.0)


class End(Enum):
    """Why the loop ended."""

    CONVERGED = "converged"
    STOPPED = "stopped"  # by the caller's condition
    STATIONARY_VIOLATION = "stationary violation"
    UNBOUNDED = "unbounded"
    STUCK = "stuck"


@dataclass(slots=True)
class Outcome:
    """Where and why the loop ended; ``solution`` is set when Newton's method on the active set finished it."""

    end: End
    iterate: Iterate
    solution: Projection | None = None


def optimise(
    form: Formulation,
    it: Iterate,
    mu: float,
    options: Options,
    monitor: Monitor,
    *,
    stop: Callable[[Formulation, Iterate], bool] | None = None,
    adaptive: bool = True,
) -> Outcome:
    """Solve from an interior iterate.

    Args:
        form: the problem; a restoration phase is available when it is a :class:`ScaledProblem`.
        it: the start; changed in place.
        mu: first barrier parameter.
        stop: ends the loop when it returns True.
        adaptive: choose the barrier parameter freely while that makes progress.

    Raises:
        Stopped: at a limit or on the user's request.
    """
    system = NewtonSystem(form)
    barrier = BarrierParameter(form, mu, options.tolerance / 11.0, adaptive)
    search = LineSearch(form, it.theta)
    finish = _Finish(form, options, monitor)
    step = length = 0.0
    stuck = False
    tiny_steps = 0
    escapes = 0
    while True:
        error = errors_of(form, it, 0.0).total
        _record(form, it, monitor, error, step, length, barrier.mu, system.shift)
        if stop is not None and monitor.history and stop(form, it):
            return Outcome(End.STOPPED, it)
        if is_unbounded(form, it):
            return Outcome(End.UNBOUNDED, it)
        done = finish.attempt(it, error)
        if done is not None:
            return Outcome(End.CONVERGED, it, done)
        if error <= options.tolerance:
            if escapes < ESCAPES and leave_saddle(form, it, system, options.seed + escapes):
                escapes += 1
                tiny_steps = 0
                stuck = False
                monitor.count()
                search = LineSearch(form, it.theta)
                barrier = BarrierParameter(form, barrier.mu, options.tolerance / 11.0, adaptive)
                continue
            return Outcome(End.CONVERGED, it)
        if tiny_steps >= STALLED_STEPS:
            return Outcome(End.STUCK, it)

        barrier.update(it, stuck)
        try:
            system.factorize(it, barrier.mu)
        except SingularSystem:
            return Outcome(End.STUCK, it)
        before = it.w
        length = _advance(it, system, barrier, search)
        monitor.count()
        step = float(np.abs(it.w - before).max(initial=0.0))
        if length > 0.0:
            stuck = search.tiny
            tiny_steps = tiny_steps + 1 if search.tiny and not barrier.changed else 0
            continue
        stuck = True
        if not isinstance(form, ScaledProblem):
            return Outcome(End.STUCK, it)
        restored = _restore(form, it, search, barrier, options, monitor)
        if restored is not None:
            return restored
        tiny_steps = 0


def _advance(it: Iterate, system: NewtonSystem, barrier: BarrierParameter, search: LineSearch) -> float:
    """Take one step; returns its length, 0 when none was acceptable.

    A step that only a small fraction of is acceptable tells that the curvature along it is underestimated: it is
    computed anew with a stiffer Hessian, which also turns it.
    """
    for shortest in SHORTEST:
        dw, dy, dz = barrier.step(it, system)
        if barrier.changed:
            search.filter.reset()
        if not np.isfinite(dw.sum() + dy.sum()):
            return 0.0
        length = search.search(it, system, barrier.mu, barrier.tau, dw, dy, dz, shortest)
        if length > 0.0 or not shortest:
            return length
        try:
            system.stiffen(it, dw)
        except SingularSystem:
            return 0.0
    return 0.0


def _record(
    form: Formulation,
    it: Iterate,
    monitor: Monitor,
    error: float,
    step: float,
    length: float,
    mu: float,
    shift: float,
) -> None:
    x, f, violation = form.user_view(it.w[: form.n], it.f, it.r)
    own = isinstance(form, ScaledProblem)
    multipliers = form.user_multipliers(it.y) if isinstance(form, ScaledProblem) else None
    monitor.record(
        x, multipliers, f, violation, error, step, length, mu, shift, "barrier" if own else "restoration"
    )


class _Finish:
    """Tries Newton's method on the active set once the iterate is near enough, ever more rarely when it fails."""

    def __init__(self, form: Formulation, options: Options, monitor: Monitor) -> None:
        self.form, self.options, self.monitor = form, options, monitor
        self.threshold = FINISH_BELOW

    def attempt(self, it: Iterate, error: float) -> Projection | None:
        form = self.form
        if not isinstance(form, ScaledProblem) or error > self.threshold:
            return None
        point, solved = newton_on_active_set(
            form, it.w[: form.n], it.y, self.monitor, steps=8, tolerance=self.options.tolerance
        )
        if solved:
            return point
        self.threshold = min(self.threshold * 0.1, error * 0.1)
        return None


def _restore(
    form: ScaledProblem,
    it: Iterate,
    search: LineSearch,
    barrier: BarrierParameter,
    options: Options,
    monitor: Monitor,
) -> Outcome | None:
    """Run the restoration phase from a point where no step was acceptable.

    Returns None when the iteration can go on (``it`` is then the restored point), else how the solve ended.
    """
    if it.theta <= 0.01 * options.tolerance:
        return Outcome(End.STUCK, it)
    phi = it.f - barrier.mu * float(np.log(it.gap).sum())
    search.filter.add(it.theta, phi)
    elastic, start, mu = elastic_start(form, it, barrier.mu)
    acceptance = Acceptance(elastic, search.filter, it.theta, barrier.mu)
    outcome = optimise(elastic, start, mu, options, monitor, stop=acceptance)
    w, z = back_from(elastic, outcome.iterate)
    restored = evaluate(form, w, np.zeros(form.m), z)
    if not np.isfinite(restored.theta + restored.f + restored.dual.sum()):
        return Outcome(End.STUCK, it)
    if outcome.end is not End.STOPPED:
        violation = form.user_view(w[: form.n], restored.f, restored.r)[2]
        if outcome.end is End.CONVERGED and violation > options.feasibility_tolerance:
            restored.y = outcome.iterate.y / elastic.price
            return Outcome(End.STATIONARY_VIOLATION, restored)
        if restored.theta > 0.99 * it.theta:
            return Outcome(End.STUCK, it)
    restored.y = least_squares_multipliers(form, restored)
    again = evaluate(form, w, restored.y, z)
    for name in it.__slots__:
        setattr(it, name, getattr(again, name))
    return None
