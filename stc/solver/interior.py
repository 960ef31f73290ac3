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
from stc.solver.elastic import ElasticProblem
from stc.solver.formulation import Formulation
from stc.solver.globalization import LineSearch, barrier_value
from stc.solver.iterate import Errors, Iterate, errors_of, evaluate
from stc.solver.monitor import Monitor
from stc.solver.multipliers import least_squares_multipliers
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.nlp import Floats
from stc.solver.options import Options
from stc.solver.restoration import Acceptance, back_from, elastic_start
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.unboundedness import is_unbounded

__all__ = ["ACCEPTABLE", "End", "Outcome", "Tactics", "feasible_first", "optimise"]

FINISH_BELOW = 1e-2
STALLED_STEPS = 3
ESCAPES = 5
ACCEPTABLE = 1e-6
LARGEST_ERROR = 1e50
FARTHEST = 1e20
PATIENCE = 15
SMALL_STEP = 1e-9
FEASIBLE = 0.01
NEARLY = 1e-6
DOUBTFUL = 10.0
"""A stationary violation of nonlinear rows proves nothing while it is this near to the tolerance."""
HALF = 0.5
SLOW = 0.1
MUCH = 1e-6
LAGGING_STEPS = 3
LARGEST_MULTIPLIER = 1e8
MANY_GAPS = 100.0
GAP = 1e-7
"""Largest sum of gap times multiplier, relative to the objective, which it bounds the error of."""
TOO_LITTLE = 0.99
NOTICEABLE = 0.9
SHORTEST = 0.02
SHORTER = (10.0, 10.0, 1e3, 1e8)


class End(Enum):
    """Why the loop ended."""

    CONVERGED = "converged"
    STOPPED = "stopped"  # by the caller's condition
    STATIONARY_VIOLATION = "stationary violation"
    UNBOUNDED = "unbounded"
    STUCK = "stuck"


@dataclass(frozen=True, slots=True)
class Tactics:
    """What differs from one attempt to the next.

    Attributes:
        adaptive: choose the barrier parameter freely while that makes progress.
        largest_theta: admissible violation, relative to that of the start or to 1.
        budget: steps after which the attempt ends.
    """

    adaptive: bool = True
    largest_theta: float = 30.0
    budget: int = 500


@dataclass(slots=True)
class Outcome:
    """Where and why the loop ended.

    Attributes:
        end: why.
        form: the formulation that was solved.
        x, y: the point, (n,) and (m,), in the formulation's scale.
        error: KKT error there.
        iterate: the last iterate of the barrier.
    """

    end: End
    form: Formulation
    x: Floats
    y: Floats
    error: float
    iterate: Iterate


def optimise(
    form: Formulation,
    it: Iterate,
    mu: float,
    options: Options,
    monitor: Monitor,
    *,
    tactics: Tactics,
    stop: Callable[[Formulation, Iterate], bool] | None = None,
) -> Outcome:
    """Solve from an interior iterate.

    Args:
        form: the problem; a restoration phase is available when it is a :class:`ScaledProblem`.
        it: the start; changed in place.
        mu: first barrier parameter.
        tactics: see :class:`Tactics`.
        stop: ends the loop when it returns True.
    Raises:
        Stopped: at a limit or on the user's request.
    """
    system = NewtonSystem(form)
    smallest_mu = options.tolerance / 11.0 / max(1.0, form.gaps / MANY_GAPS)
    barrier = BarrierParameter(form, mu, smallest_mu, tactics.adaptive)
    search = LineSearch(form, it.theta, tactics.largest_theta)
    finish = _Finish(form, options, monitor)
    nearest = _Nearest(form)
    fresh = _Refresh()
    drift = _Drift()
    last = monitor.iterations + tactics.budget
    step = length = 0.0
    stuck = False
    tiny_steps = small_steps = 0
    escapes = 0
    while True:
        parts = errors_of(form, it, 0.0)
        drift.note(it.f, parts.dual)
        if fresh.due(parts, length):
            parts = fresh.multipliers(form, it, parts)
        error = parts.total
        nearest.note(it, error)
        _record(form, it, monitor, error, step, length, barrier.mu, system.shift)
        if stop is not None and monitor.history and stop(form, it):
            return _outcome(form, End.STOPPED, it, error)
        if is_unbounded(form, it):
            return _outcome(form, End.UNBOUNDED, it, error)
        if not error < LARGEST_ERROR or float(np.abs(it.w).max(initial=0.0)) > FARTHEST:
            falling = drift.still_falling() and float(np.abs(it.c).max(initial=0.0)) <= ACCEPTABLE
            return _outcome(form, End.UNBOUNDED, it, error) if falling else nearest.outcome(it)
        done = None if drift.still_falling() else finish.attempt(it, error)
        if done is not None:
            return Outcome(End.CONVERGED, form, done.x, done.y, done.error, it)
        converged = error <= options.tolerance and float(it.gap @ it.z) <= GAP * max(1.0, abs(it.f))
        converged = converged and not drift.still_falling()
        stalled = tiny_steps >= STALLED_STEPS or small_steps >= PATIENCE or nearest.waiting >= PATIENCE
        stalled |= monitor.iterations >= last
        if converged or stalled:
            if escapes < ESCAPES and leave_saddle(form, it, system, options.seed + escapes):
                escapes += 1
                tiny_steps = small_steps = 0
                stuck = False
                monitor.count()
                nearest = _Nearest(form)
                search = LineSearch(form, it.theta, tactics.largest_theta)
                barrier = BarrierParameter(form, barrier.mu, smallest_mu, tactics.adaptive)
                continue
            return _outcome(form, End.CONVERGED, it, error) if converged else nearest.outcome(it)

        barrier.update(it, stuck)
        try:
            system.factorize(it, barrier.mu)
        except SingularSystem:
            return nearest.outcome(it)
        before = it.w
        length = _advance(it, system, barrier, search)
        system.relax(length)
        barrier.blocked(length)
        monitor.count()
        step = float((np.abs(it.w - before) / (1.0 + np.abs(before))).max(initial=0.0))
        if length > 0.0:
            stuck = search.tiny
            tiny_steps = tiny_steps + 1 if search.tiny and not barrier.changed else 0
            small_steps = small_steps + 1 if step <= SMALL_STEP else 0
            continue
        stuck = True
        if not isinstance(form, ScaledProblem) or nearest.error <= ACCEPTABLE:
            return nearest.outcome(it)
        lost = _restore(form, it, search, barrier, options, monitor, tactics)
        if lost is End.STUCK:
            return nearest.outcome(it)
        if lost is not None:
            return _outcome(form, lost, it, error)
        tiny_steps = small_steps = 0


def _outcome(form: Formulation, end: End, it: Iterate, error: float) -> Outcome:
    return Outcome(end, form, it.w[: form.n], it.y, error, it)


def feasible_first(
    form: ScaledProblem, it: Iterate, options: Options, monitor: Monitor, tactics: Tactics
) -> Outcome:
    """As :func:`optimise`, from the feasible point that the elastic problem without an objective leads to."""
    elastic, start, mu = elastic_start(form, it, options.initial_barrier)
    outcome = optimise(elastic, start, mu, options, monitor, tactics=tactics)
    end = _back(form, it, elastic, outcome, options)
    if end is not None:
        return _outcome(form, end, it, outcome.error)
    return optimise(form, it, options.initial_barrier, options, monitor, tactics=tactics)


class _Nearest:
    """The point with the smallest error so far, and how long nothing better has been found once it is small."""

    def __init__(self, form: Formulation) -> None:
        self._form = form
        self.error = np.inf
        self.waiting = 0
        self._x = self._y = np.zeros(0)

    def note(self, it: Iterate, error: float) -> None:
        if error < NOTICEABLE * self.error:
            self.waiting = 0
        elif self.error <= ACCEPTABLE:
            self.waiting += 1
        if error < self.error:
            self.error, self._x, self._y = error, it.w[: self._form.n], it.y

    def outcome(self, it: Iterate) -> Outcome:
        return Outcome(End.STUCK, self._form, self._x, self._y, self.error, it)


def _advance(it: Iterate, system: NewtonSystem, barrier: BarrierParameter, search: LineSearch) -> float:
    """Take one step; returns its length, 0 when none was acceptable.

    A step that only a small fraction of is acceptable tells that the curvature along it is underestimated: it is
    computed anew with a stiffer Hessian, which also turns it.
    """
    for shorter in (*SHORTER, 0.0):
        shortest = SHORTEST if shorter else 0.0
        dw, dy, dz = barrier.step(it, system)
        if barrier.changed:
            search.filter.reset()
        if not np.isfinite(dw.sum() + dy.sum()):
            return 0.0
        length = search.search(it, system, barrier.mu, barrier.tau, dw, dy, dz, shortest)
        if length > 0.0 or not shorter:
            return length
        try:
            system.stiffen(it, dw, shorter)
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


class _Drift:
    """Tells slow descent along a valley that goes on for ever from convergence.

    Where the gradient fades as the variables grow, the error falls below any tolerance while every step still
    lowers the objective as much as the one before.
    """

    def __init__(self) -> None:
        self._f, self._dual = [np.nan, np.nan], [np.inf, np.inf]

    def note(self, f: float, dual: float) -> None:
        """The objective and the dual error of the next iterate."""
        self._f, self._dual = [self._f[1], f], [self._dual[1], dual]

    def still_falling(self) -> bool:
        """True when the last step reduced the dual error little and the objective much."""
        slow = self._dual[1] > SLOW * self._dual[0]
        return slow and self._f[0] - self._f[1] > MUCH * max(1.0, abs(self._f[1]))


class _Refresh:
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

    def multipliers(self, form: Formulation, it: Iterate, errors: Errors) -> Errors:
        """Take the least-squares multipliers if they are better; the errors then."""
        self._waited = 0
        y = least_squares_multipliers(form, it, LARGEST_MULTIPLIER)
        other = evaluate(form, it.w, y, it.z)
        new = errors_of(form, other, 0.0)
        if not new.total < HALF * errors.total:
            return errors
        for name in it.__slots__:
            setattr(it, name, getattr(other, name))
        return new


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
    tactics: Tactics,
) -> End | None:
    """Run the restoration phase from a point where no step was acceptable.

    ``it`` becomes the restored point.  Returns None when the iteration can go on there, else how it ends.
    """
    if it.theta <= FEASIBLE * options.tolerance:
        return End.STUCK
    search.filter.add(it.theta, barrier_value(it.f, it.gap, barrier.mu))
    elastic, start, mu = elastic_start(form, it, barrier.mu)
    acceptance = Acceptance(elastic, search.filter, it.theta, barrier.mu)
    outcome = optimise(elastic, start, mu, options, monitor, tactics=tactics, stop=acceptance)
    theta = it.theta
    end = _back(form, it, elastic, outcome, options)
    return End.STUCK if end is None and it.theta > TOO_LITTLE * theta else end


def _back(
    form: ScaledProblem, it: Iterate, elastic: ElasticProblem, outcome: Outcome, options: Options
) -> End | None:
    """Move ``it`` to where an elastic problem without an objective ended; why to stop there, or None."""
    w, z = back_from(elastic, outcome.iterate)
    restored = evaluate(form, w, np.zeros(form.m), z)
    if not np.isfinite(restored.theta + restored.f + restored.dual.sum()):
        return End.STUCK
    end: End | None = None
    minimal = outcome.end is End.CONVERGED or outcome.error <= ACCEPTABLE
    if outcome.end is not End.STOPPED and minimal:
        violation = form.violation(w[: form.n], restored.r)
        doubt = 1.0 if form.linear else DOUBTFUL
        if violation > doubt * options.feasibility_tolerance:
            end = End.STATIONARY_VIOLATION
    y = outcome.y / elastic.price if end else least_squares_multipliers(form, restored)
    restored = evaluate(form, w, y, z)
    for name in it.__slots__:
        setattr(it, name, getattr(restored, name))
    return end
