"""The loop: sequential quadratic programming with the inequalities inside a barrier.

Each pass linearises the optimality conditions of the barrier problem with exact second derivatives, factorises
one structured system, and moves along the step as far as the filter allows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stc.solver.active_set import Finish, bends_upwards
from stc.solver.constants import (
    ACCURATE,
    ATTEMPT,
    BLOCKED,
    CORRECTION_PROGRESS,
    FACTORIZATION,
    LARGEST_ERROR,
    LOOK,
    MOST_CORRECTIONS,
    NOT_FINITE,
    SEARCH,
    SHORT,
    SMALL_VIOLATION,
    SMALLEST_TAU,
    TAKEN,
)
from stc.solver.curvature import ESCAPES, SecondOrder, leave_saddle
from stc.solver.formulation import MANY_GAPS, Formulation
from stc.solver.iterate import Iterate
from stc.solver.kkt.multifrontal import DOUBTFUL
from stc.solver.monitor import Monitor
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.nlp import Floats
from stc.solver.options import Options
from stc.solver.outcome import ACCEPTABLE, PROGRESS, End, Outcome, Tactics
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.unboundedness import LOW, TOO_FAR, is_unbounded
from stc.solver.workspace import LONGEST_RUN, Step, workspace_of

if TYPE_CHECKING:
    from stc.solver.elastic import ElasticProblem

__all__ = ["optimise"]

SMALL = 20_000
"""Unknowns up to which several iterations are made in a row."""

Condition = Callable[[Formulation, Iterate], bool]


def optimise(
    form: Formulation,
    it: Iterate,
    mu: float,
    options: Options,
    monitor: Monitor,
    *,
    tactics: Tactics,
    stop: Condition | None = None,
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
    return _Loop(form, options, monitor, tactics, stop).run(it, mu)


class _Loop:
    """The iteration and its state."""

    def __init__(
        self, form: Formulation, options: Options, monitor: Monitor, tactics: Tactics, stop: Condition | None
    ) -> None:
        self.form, self.options, self.monitor = form, options, monitor
        self.work = workspace_of(form)
        self.it, self.s = self.work.it, self.work.s
        self.work.calls.forget()
        self.tactics, self.stop = tactics, stop
        self.system = NewtonSystem(self.work)
        self.finish = Finish(form, options.tolerance, monitor)
        self.s.objective_now, self.s.dual_now = np.nan, np.inf
        self.last = monitor.iterations + tactics.budget
        self.escapes = self.restorations = 0
        self.early = False
        self.error = np.inf
        self.longest = LONGEST_RUN if form.size + form.m <= SMALL else 1
        restores = not isinstance(form, ScaledProblem)
        self.phase = "restoration" if restores else "barrier"
        self.s.lengthens = not restores
        self.s.length_taken = self.s.step_taken = 0.0
        self.s.doubt = DOUBTFUL

    def _begin(self, mu: float) -> None:
        """Forget how the current iterate was reached."""
        form, work, s = self.form, self.work, self.s
        smallest = self.options.tolerance / 11.0 / max(1.0, form.gaps / MANY_GAPS)
        s.mu, s.smallest_mu, s.largest_mu = mu if form.gaps else 0.0, smallest, np.inf
        s.adaptive, s.free = self.tactics.adaptive, self.tactics.adaptive and form.gaps > 0
        s.tau, s.changed = SMALLEST_TAU, 0
        work.accepted.restart(np.inf)
        scale = max(1.0, work.it.theta)
        s.small_theta, s.tiny = SMALL_VIOLATION * scale, 0
        work.filter.restart(self.tactics.largest_theta * scale)
        s.least_error, s.waiting = np.inf, 0
        work.incumbent.w[:], work.incumbent.y[:], work.incumbent.z[:] = work.it.w, work.it.y, work.it.z
        self._forget_steps()
        s.stuck, s.shortest = 0, SHORT
        s.feasibility = self.options.feasibility_tolerance
        s.attention = self._attention()

    def _forget_steps(self) -> None:
        """Begin to count steps that move nothing any more."""
        s = self.s
        s.tiny_steps = s.small_steps = s.short_steps = s.stalled = 0
        s.theta_before = np.inf

    def _attention(self) -> float:
        """The error at which more than the next step is to be thought of."""
        tolerance = self.options.tolerance
        return max(tolerance, self.finish.threshold) if isinstance(self.form, ScaledProblem) else tolerance

    def run(self, it: Iterate, mu: float) -> Outcome:
        work, monitor = self.work, self.monitor
        work.load(it)
        self._begin(mu)
        while True:
            ended = self._repeat()
            if ended == LOOK:
                end = self._end()
                if end is not None:
                    return end
                if self._converged():
                    second_order = self._leave_saddle()
                    if second_order is SecondOrder.LEFT:
                        continue
                    minimum = second_order is SecondOrder.HOLDS
                    return replace(self._outcome(End.CONVERGED), minimum=minimum)
                if self._stalled():
                    if self.s.least_error <= ACCEPTABLE:
                        work.evaluate(work.incumbent.w, work.incumbent.y, work.incumbent.z)
                    second_order = self._leave_saddle()
                    if second_order is SecondOrder.LEFT:
                        continue
                    return self._give_up()
                self.s.attention = self._attention()
                ended = work.iterate()
            elif ended == 0:
                continue
            try:
                work.calls.check()
                if ended == 0 or self._complete(ended):
                    monitor.count()
                    continue
            except SingularSystem:
                return self._give_up()
            monitor.count()
            end = self._restore()
            if end is not None:
                return end

    # -- the state -------------------------------------------------------------------------------------------------

    def _repeat(self) -> int:
        """Iterate as long as all is as usual, and keep account; see ``progress_repeat``."""
        work, monitor, s = self.work, self.monitor, self.s
        if monitor.watched or monitor.is_late or self.stop is not None:
            most = 0
        else:
            until = min(self.last, monitor.limit)
            most = max(0, min(self.longest, until - monitor.iterations))
        s.most, s.best_new = most, 0
        s.best_known = monitor.best is not None
        if monitor.best is not None:
            s.best_violation, s.best_objective = monitor.best[:2]
        ended = work.repeat()
        try:
            self._take_records(ended != 0)
        finally:
            work.calls.check()
        self.error = s.error
        return ended

    def _take_records(self, last_is_open: bool) -> None:
        work, s = self.work, self.s
        if s.made == 0:
            return
        best = (s.best_violation, s.best_objective, *self._stated(*work.best)) if s.best_new else None
        rows = work.records[: s.made].tolist()
        self.monitor.take(rows, self.phase, last_is_open, best, self._as_stated)

    def _stated(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Variables and row multipliers in the user's terms; no multipliers while rows may be violated."""
        form = self.form
        return (
            form.as_stated(x, y) if isinstance(form, ScaledProblem) else (form.user_variables(x), np.zeros(0))
        )

    def _as_stated(self) -> tuple[Floats, Floats]:
        return self._stated(self.it.w[: self.form.n], self.it.y)

    def _end(self) -> Outcome | None:
        """The outcome when the iterate ends the loop at once."""
        form, it = self.form, self.it
        if self.stop is not None and self.stop(form, it):
            return self._outcome(End.STOPPED)
        if is_unbounded(form, it, self.s.farthest):
            return self._outcome(End.UNBOUNDED)
        if not self.error < LARGEST_ERROR or self.s.farthest > TOO_FAR:
            falling = self.s.falling and it.f < 0.0
            far = self.s.farthest > TOO_FAR or it.f < LOW
            feasible = self.s.primal <= ACCEPTABLE
            return self._outcome(End.UNBOUNDED) if far and feasible and falling else self._give_up()
        if self.finish.is_due(self.error) and not self.s.falling:
            done = self.finish.attempt(it, self.error)
            if done is not None:
                assert isinstance(form, ScaledProblem)
                x, y, minimum = done.x.copy(), done.y.copy(), bends_upwards(form)
                return Outcome(End.CONVERGED, form, x, y, done.error, it, minimum=minimum)
            self.work.renew_calls()
        return None

    def _converged(self) -> bool:
        # Products of gaps and multipliers may still hide an error of the objective.
        negligible = ACCURATE * ACCEPTABLE * max(1.0, abs(self.it.f))
        small = self.error <= self.options.tolerance and not self.s.products > negligible
        return small and not self.s.falling

    def _stalled(self) -> bool:
        if self.s.stalled or self.s.waited:
            return True
        self.early = self.monitor.iterations >= self.last  # the attempt has used up its steps
        return self.early

    def _outcome(self, end: End) -> Outcome:
        it = self.it
        return Outcome(end, self.form, it.w[: self.form.n].copy(), it.y.copy(), self.error, it.snapshot())

    def _give_up(self) -> Outcome:
        """End at the iterate with the smallest error so far."""
        best, error = self.work.incumbent, float(self.s.least_error)
        x, y = best.w[: self.form.n].copy(), best.y.copy()
        return Outcome(End.STUCK, self.form, x, y, error, self.it.snapshot(), early=self.early)

    # -- moves -----------------------------------------------------------------------------------------------------

    def _leave_saddle(self) -> SecondOrder:
        """Move off a stationary point that is no minimum, unless that has been done too often."""
        if self.escapes >= ESCAPES:
            return SecondOrder.FAILS
        found = leave_saddle(self.system, self.options.seed + self.escapes)
        if found is SecondOrder.LEFT:
            self.escapes += 1
            self.monitor.count()
            self._begin(self.s.mu)
        return found

    def _complete(self, ended: int) -> bool:
        """Complete an iteration that needs help; False when no step was acceptable, or steps are too short to go on.

        Raises:
            SingularSystem: there is no step.
        """
        work, s, system = self.work, self.s, self.system
        if ended == FACTORIZATION:
            system.go_on(s.ended_by)
            ended = work.advance()
            work.calls.check()
            if ended == 0:
                return True
        if ended == BLOCKED:
            return False
        self._search(s.ended_by if ended == SEARCH else None)
        return work.settle() == 0 and s.length_taken > 0.0

    def _find_step(self) -> None:
        """Compute the step with the factorised system."""
        work, s = self.work, self.s
        while True:
            ended = work.find_step()
            work.calls.check()
            if not ended:
                break
            work.calls.put(ATTEMPT, None)
            if not work.kkt.check_solution():
                s.doubt = np.inf  # there is none better
            work.renew_solves()
        s.doubt = DOUBTFUL

    def _search(self, ended: int | None) -> None:
        """Compute a step and search along it; a search that has ``ended`` already is the first.

        A step that only a small fraction of is acceptable tells that the curvature along it is underestimated: it
        is computed anew with a stiffer Hessian, which also turns it. Where that does not make it shorter, it is the
        rows that ask for the step, and the first one is searched to the end.
        """
        work, system, s = self.work, self.system, self.s
        before: tuple[Step, float] | None = None
        for trial in range(MOST_CORRECTIONS + 1):
            final = trial == MOST_CORRECTIONS
            if ended is None:
                self._find_step()
                if before is not None and s.length > PROGRESS * before[1]:
                    system.soften()
                    work.step.become(before[0])
                    work.run("step_lengths")
                    final = True
                s.shortest = 0.0 if final else SHORT
                ended = work.search()
                work.calls.check()
            if final or ended in (TAKEN, NOT_FINITE):
                break
            ended = None
            before = work.spare, s.length
            work.spare.become(work.step)
            try:
                system.stiffen(work.step.dw)
            except SingularSystem:
                break
        s.shortest = SHORT

    def _restore(self) -> Outcome | None:
        """Run the restoration phase from a point where no step was acceptable.

        Returns None when the iteration can go on from where that led, else how it ends.
        """
        form, it, mu, filter = self.form, self.it, self.s.mu, self.work.filter
        if not isinstance(form, ScaledProblem) or self.s.least_error <= ACCEPTABLE:
            return self._give_up()
        if it.theta <= ACCURATE * self.options.tolerance:
            return self._give_up()
        from stc.solver.restoration import Acceptance, barrier_value, meet_rows

        theta = it.theta
        filter.add(theta, barrier_value(it.f, it.gap, mu))
        self.restorations += 1
        brief = self.restorations <= self.tactics.brief_restorations

        def solve(elastic: ElasticProblem, start: Iterate, its_mu: float) -> Outcome:
            stop = Acceptance(elastic, filter, theta, mu) if brief else None
            return optimise(
                elastic, start, its_mu, self.options, self.monitor, tactics=self.tactics, stop=stop
            )

        end, _ = meet_rows(form, it, mu, self.options.feasibility_tolerance, solve)
        self.work.load(it)
        self.work.renew_calls()
        if end is End.STUCK or (end is None and it.theta > CORRECTION_PROGRESS * theta):
            return self._give_up()
        self._forget_steps()
        return None if end is None else self._outcome(end)
