"""Minimise a nonlinear program."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stc.deadline import within
from stc.solver.active_set import fitting_multipliers
from stc.solver.constants import CONTRACTION
from stc.solver.convexity import is_convex
from stc.solver.curvature import ESCAPES, SecondOrder, second_order_at
from stc.solver.form_cache import give_back, kept_form, key_of, once
from stc.solver.judgement import Judgement, Point
from stc.solver.kkt import KKTSystem, structured_kkt
from stc.solver.monitor import Monitor, Stopped
from stc.solver.nlp import NLP, Floats, Mask
from stc.solver.options import Options
from stc.solver.outcome import ACCEPTABLE, End, Outcome, Tactics
from stc.solver.pairs import pairs_of
from stc.solver.presolve import presolved
from stc.solver.products import between
from stc.solver.report import Callback, Result, Start
from stc.solver.rescaling import Rescalings
from stc.solver.residuals import assess, rows_missed
from stc.solver.scaled_problem import NEARBY, ScaledProblem, relative_violation
from stc.solver.status import (
    FIXED_ROWS_MISSED,
    FLAT_BUT_FOR_ROUNDING,
    MET_BUT_FOR_ROUNDING,
    NO_MINIMUM,
    STILL_FALLING,
    Status,
    advice,
    sentence,
)
from stc.solver.strategies import Strategies, least_violation
from stc.solver.unboundedness import falling_to

__all__ = ["minimize"]

RESCALINGS = 3
LEFT_OUT: frozenset[str] = frozenset()
"""Names of strategies that are not to be tried, to measure what they are worth."""

Strategy = Callable[[ScaledProblem, Floats, Floats], Outcome | None]
"""What a problem, its guess (n,) and the point reached so far (n,) lead to; None where nothing would be different."""


def minimize(
    nlp: NLP,
    options: Options | None = None,
    callback: Callback | None = None,
    start: Start | None = None,
    new_kkt: Callable[..., KKTSystem] | None = None,
) -> Result:
    """Find a local minimum of ``nlp``.

    Args:
        nlp: the problem.
        options: settings; the defaults when None.
        callback: called after every iteration; returning True stops the solve.
        start: where to start instead of ``nlp.x0``; with ``options.warm_start`` its multipliers and active set
            are tried first.
        new_kkt: builds the linear algebra; the structured factorisation when None.

    Returns:
        The result; a limit, an interruption (Ctrl-C too) or a failure is a status, not an exception.
    """
    options = options or Options()
    with np.errstate(all="ignore"), within(options.time_limit):
        # Where no step is allowed the start is what is asked for, not what equations make of it.
        less = presolved(nlp) if options.presolve and options.max_iterations > 0 else None
        if less is not None:
            own = less.start(start or Start(np.asarray(nlp.x0, dtype=float)))
            result = less.restored(_solved(less, options, less.callback(callback), own, new_kkt), options)
            if result is not None:
                return result
        return _solved(nlp, options, callback, start, new_kkt)


def _solved(
    nlp: NLP,
    options: Options,
    callback: Callback | None,
    start: Start | None,
    new_kkt: Callable[..., KKTSystem] | None,
) -> Result:
    """As :func:`minimize`, without presolve."""
    pairs = pairs_of(nlp)
    if pairs is None or options.max_iterations <= 0:
        return _Solve(nlp, options, callback, start, new_kkt).run()
    from stc.solver.complementarity import by_penalty

    def solve(program: NLP, settings: Options, told: Callback | None, begin: Start) -> Result:
        return _Solve(program, settings, told, begin, new_kkt).run()

    start = start or Start(np.asarray(nlp.x0, dtype=float))
    return by_penalty(nlp, pairs, options, callback, start, solve)


def _contradicts(nlp: NLP) -> bool:
    """Whether two bounds do."""
    return bool(np.any(nlp.x_lower > nlp.x_upper) or np.any(nlp.row_lower > nlp.row_upper))


def _of_fixed_variables(nlp: NLP) -> Mask | None:
    """The rows that hold variables of equal bounds alone, (m,), or None where there is no such row."""
    free = nlp.x_lower < nlp.x_upper
    rows = np.ones(nlp.m, bool)
    rows[nlp.jac_rows[free[nlp.jac_cols]]] = False
    return rows if rows.any() else None


def _fixed_rows_missed(nlp: NLP, x: Floats, r: Floats, options: Options) -> bool:
    """Whether one of these rows, of the values ``r`` (m,) at ``x`` (n,), is violated: nothing can change that."""
    rows = once(_of_fixed_variables, nlp)
    tolerance = options.feasibility_tolerance
    if rows is None or (relative_violation(r, nlp.row_lower, nlp.row_upper)[rows] <= tolerance).all():
        return False
    return bool(rows_missed(nlp, x, tolerance)[rows].any())


class _Solve:
    """One solve: the phases in their order, and the result."""

    def __init__(
        self,
        nlp: NLP,
        options: Options,
        callback: Callback | None,
        start: Start | None,
        new_kkt: Callable[..., KKTSystem] | None,
    ) -> None:
        self.nlp, self.options = nlp, options
        self.start = start or Start(np.asarray(nlp.x0, dtype=float))
        self.monitor = Monitor(options, callback)
        self.new_kkt: Callable[..., KKTSystem] = new_kkt or structured_kkt
        self.form: ScaledProblem | None = None
        self._least: Outcome | None = None  # of a search for a feasible point from the guess
        self.judgement = Judgement(nlp, options)
        self.strategies = Strategies(nlp, options, self.monitor, self.judgement)
        self.rescalings = Rescalings(self.strategies, minimize)

    def run(self) -> Result:
        nlp = self.nlp
        if once(_contradicts, nlp):
            return self._result(Status.INFEASIBLE, self.start.x, message="Two bounds contradict each other.")
        x0 = between(np.asarray(self.start.x, dtype=float), nlp.x_lower, nlp.x_upper)
        key = key_of(nlp, x0, self.options, self.new_kkt)
        form = kept_form(nlp, key)
        if form is None:
            f, r = nlp.values(x0)
            if not (np.isfinite(f) and np.all(np.isfinite(r))):
                return self._result(
                    Status.FAILED, x0, message="A function is undefined at the starting point."
                )
            if nlp.n == 0:
                violation = assess(nlp, x0, np.zeros(nlp.m), np.zeros(0)).violation
                feasible = violation <= self.options.feasibility_tolerance
                return self._result(Status.OPTIMAL if feasible else Status.INFEASIBLE, x0)
            if _fixed_rows_missed(nlp, x0, r, self.options):
                return self._result(Status.INFEASIBLE, x0, message=FIXED_ROWS_MISSED)
            form = ScaledProblem(nlp, x0, self.options, self.new_kkt)
        self.form = form
        try:
            return self._solve(form, x0)
        except Stopped as stopped:
            return self._best(stopped.status)
        except KeyboardInterrupt:
            return self._best(Status.INTERRUPTED)
        finally:
            give_back(form, nlp, key)

    def _solve(self, form: ScaledProblem, x0: Floats) -> Result:
        options, strategies = self.options, self.strategies
        if options.max_iterations <= 0:
            return self._unmoved(form, x0)
        if options.warm_start and self.start.row_multipliers is not None:
            outcome = self._settle(strategies.warm(form, x0, self.start, options.trusting))
        else:
            outcome = self._settle(self._cold(form, x0))
        for name, strategy in self._strategies(form):
            if outcome.is_answer or (self._is_proof(outcome) and not name.startswith("rescaled")):
                break
            self.monitor.strategy = name
            other = strategy(form, x0, self.judgement.stated(outcome).x)
            if other is not None:
                outcome = self._better(outcome, self._settle(other))
        return self._conclude(outcome)

    def _strategies(self, form: ScaledProblem) -> list[tuple[str, Strategy]]:
        """The strategies, in order, after the barrier method from the guess has found no solution."""
        strategies, scales = self.strategies, self.rescalings
        convex = once(is_convex, self.nlp)
        constrained = form.m > 0 or form.gaps > 0
        table: list[tuple[str, bool, Strategy]] = [
            ("rescaled", True, scales.resized),
            ("rescaled by the point of least norm", form.linear, scales.by_least_norm),
            ("feasibility first", constrained, strategies.feasible_first),
            ("least violation", form.m > 0 and not convex, scales.from_least_violation),
            ("perturbed start", True, strategies.perturbed),
            ("best feasible point", constrained, self._from_feasible),
        ]
        suitable = [(name, strategy) for name, suits, strategy in table if suits and name not in LEFT_OUT]
        return suitable[: self.options.retries]

    def _from_feasible(self, form: ScaledProblem, x0: Floats, reached: Floats) -> Outcome | None:
        """Solve from the best feasible point so far, if there is one, and stay near the rows."""
        best = self._feasible()
        return None if best is None else self.strategies.barrier(form, best, Tactics(largest_theta=NEARBY))

    def _unmoved(self, form: ScaledProblem, x0: Floats) -> Result:
        """The start as the outcome if no step is allowed; whether it is a solution is judged later."""
        point = Point(
            x0, np.zeros(self.nlp.m) if self.start.row_multipliers is None else self.start.row_multipliers
        )
        judged = self.judgement.assess(point)
        if self.start.row_multipliers is None and self.judgement.is_met(x0, judged.violation):
            point = Point(x0, form.as_stated(x0, fitting_multipliers(form, x0 / form.x_scale))[1])
            judged = self.judgement.assess(point)
        if self._is_stationary(point) and self._is_minimum(point):
            return self._result(Status.OPTIMAL, point.x, point.y, at=point)
        stated = point.x, point.y
        self.monitor.record(
            "barrier", lambda: stated, judged.objective, judged.violation, judged.optimality, step_length=0.0
        )
        return self._best(Status.ITERATION_LIMIT)

    def _cold(self, form: ScaledProblem, x0: Floats) -> Outcome:
        """Solve from the guess."""
        outcome = self.strategies.linear_equations(form, x0)
        if outcome is None and form.quadratic_program and not form.gaps:
            outcome = self.rescalings.even_equations(form, x0)
        if outcome is not None:
            return outcome
        return self.strategies.barrier(form, x0, Tactics())

    def _is_proof(self, outcome: Outcome) -> bool:
        """Whether the violation of the outcome is proved to be the smallest possible one."""
        return outcome.end is End.STATIONARY_VIOLATION and once(is_convex, self.nlp)

    def _with_feasible_points(self, outcome: Outcome) -> Outcome:
        """An objective that falls without limit, unless rows that were met nowhere on the way cannot be: far out, what
        is missing is lost in rounding errors."""
        best = self.monitor.best
        if best is not None and best[0] <= self.options.feasibility_tolerance:
            return outcome
        if self._least is None:
            assert isinstance(outcome.form, ScaledProblem)
            x0 = between(np.asarray(self.start.x, dtype=float), self.nlp.x_lower, self.nlp.x_upper)
            form = self.rescalings.scaled_anew(outcome.form, x0, outcome.form.objective_factor)
            self._least = least_violation(form, x0, self.options, self.monitor)[1]
        return self._least if self._least.end is End.STATIONARY_VIOLATION else outcome

    def _settle(self, outcome: Outcome) -> Outcome:
        """A solution that meets the conditions of the first order and of the second, or what else an outcome leads to.

        A stationary point that bends downwards is left, and gone on from; where that has been done too often, or where
        nothing lower is found, it is no solution.
        """
        flat: Outcome | None = None  # the last one that would do
        for _ in range(ESCAPES):
            outcome = self._confirmed(outcome)
            if not outcome.is_answer:
                return flat or outcome
            if outcome.end is End.UNBOUNDED or outcome.minimum:
                return outcome
            outcome, flat = self.rescalings.beyond_saddle(outcome)
        outcome = self._confirmed(outcome)
        if outcome.end is End.CONVERGED and not outcome.minimum:
            outcome.end = End.SADDLE
        return outcome if outcome.is_answer else flat or outcome

    def _confirmed(self, outcome: Outcome) -> Outcome:
        """Hold a solution against the problem as stated; where it fails there, scale anew at it and go on.

        A point where the iteration stalled counts as a solution when the problem as stated confirms it, or when
        neither scaling could improve on it by more than rounding error, nor may anything be gained there.
        """
        if outcome.end is End.UNBOUNDED:
            return self._with_feasible_points(outcome)
        before: float | None = None
        refused = False  # a solution but for what it may gain
        for _ in range(RESCALINGS):
            if outcome.end not in (End.CONVERGED, End.STUCK):
                return outcome
            form = outcome.form
            assert isinstance(form, ScaledProblem)
            point, confirmed = self.judgement.stated(outcome), False
            if outcome.end is End.CONVERGED or outcome.error <= ACCEPTABLE:
                judged = self.judgement.assess(point)
                confirmed = self.judgement.confirms(point)
                if confirmed and not self.judgement.stalled_short(outcome, point, refused):
                    outcome.end = End.CONVERGED
                    return outcome
            # What is a solution but for what it may gain is gone on from, once.
            if outcome.end is End.STUCK and not (confirmed and before is None and not outcome.early):
                f = self.nlp.values(point.x)[0]
                same = before is not None and abs(f - before) <= self.options.tolerance * max(1.0, abs(f))
                if same and not outcome.early and not self.judgement.may_gain(point):
                    outcome.end = End.CONVERGED
                return outcome
            refused = confirmed
            before = judged.objective if judged.violation <= self.options.feasibility_tolerance else None
            form = self.rescalings.scaled_anew(form, point.x, form.objective_factor)
            outcome = self.rescalings.on_from(form, point, Tactics(), self.judgement.share_of_error(point))
        if outcome.end is End.CONVERGED:
            outcome.end = End.STUCK
        return outcome

    def _better(self, one: Outcome, other: Outcome) -> Outcome:
        """The outcome that says more; of two that say the same, that with the smaller violation."""
        if other.is_answer:
            return other
        points = [self.judgement.stated(o) for o in (one, other)]
        violations = [assess(self.nlp, p.x, p.y).violation for p in points]
        if one.end is not other.end:
            # A stationary violation says nothing of rows that another strategy came much nearer to.
            claim = 0 if one.end is End.STATIONARY_VIOLATION else 1
            disproved = violations[1 - claim] < CONTRACTION * violations[claim]
            return (one, other)[1 - claim if disproved else claim]
        return one if violations[0] <= violations[1] else other

    def _conclude(self, outcome: Outcome) -> Result:
        point = self.judgement.stated(outcome)
        if outcome.end is End.CONVERGED:
            return self._result(Status.OPTIMAL, point.x, point.y, at=point)
        if outcome.end is End.UNBOUNDED:
            return self._result(Status.UNBOUNDED, point.x, point.y)
        violated = self._is_proof(outcome) or (
            outcome.end is End.STATIONARY_VIOLATION and self._feasible() is None
        )
        if violated and not self.judgement.is_met(point.x, self.judgement.assess(point).violation):
            assert isinstance(outcome.form, ScaledProblem)
            x = between(point.x, self.nlp.x_lower, self.nlp.x_upper)
            return self._result(Status.INFEASIBLE, x, outcome.y * outcome.form.row_scale)
        # Solves on fewer frames may have used up what was left.
        used_up = self.monitor.iterations >= self.monitor.limit
        return self._best(Status.ITERATION_LIMIT if used_up else Status.FAILED)

    def _feasible(self) -> Floats | None:
        """The best point seen, (n,), if it is feasible."""
        best = self.monitor.best
        return best[2] if best is not None and self.judgement.is_met(best[2], best[0]) else None

    def _best(self, status: Status) -> Result:
        best = self.monitor.best
        if best is None:
            return self._result(status, np.asarray(self.start.x, dtype=float))
        _, _, x, y = best
        if y.size != self.nlp.m:
            y = np.zeros(self.nlp.m)
        point = Point(x, y)
        message = ""
        if status is Status.FAILED and self._is_stationary(
            point
        ):  # one that was passed on the way to nowhere
            minimum = self._is_minimum(point)
            status, message = (Status.OPTIMAL, "") if minimum else (status, NO_MINIMUM)
        return self._result(status, x, y, message, at=point)

    def _is_stationary(self, point: Point) -> bool:
        """Whether a point that was not solved for meets the conditions of the first order."""
        return self.judgement.confirms(point) and not self.judgement.may_gain(point)

    def _is_minimum(self, point: Point) -> bool:
        """Whether a stationary point meets those of the second."""
        form = self.form
        assert form is not None
        x, y = point.x / form.x_scale, form.scaled_multipliers(point.y)
        return second_order_at(form, x, y, self.options.seed) in (SecondOrder.HOLDS, SecondOrder.FLAT)

    def _result(
        self, status: Status, x: Floats, y: Floats | None = None, message: str = "", at: Point | None = None
    ) -> Result:
        nlp = self.nlp
        y = np.zeros(nlp.m) if y is None else y
        report = self.judgement.assess(at or Point(x, y))
        text = message or f"{sentence(status)} {advice(status)}".strip()
        if status is Status.OPTIMAL and report.violation > self.options.feasibility_tolerance:
            text += f" {MET_BUT_FOR_ROUNDING}"
        if status is Status.OPTIMAL and report.optimality > self.options.unscaled_tolerance:
            text += f" {FLAT_BUT_FOR_ROUNDING}"
        if status in (Status.ITERATION_LIMIT, Status.TIME_LIMIT, Status.FAILED):
            # What nothing bounds has no point that is nearly a solution.
            nearly = max(report.violation, report.optimality) <= ACCEPTABLE
            lowest = None if nearly else falling_to(self.monitor.history)
            text += "" if lowest is None else f" {STILL_FALLING.format(lowest)}"
        return Result(
            status, x, y, report.bound_multipliers, report.objective, report.violation, report.optimality,
            self.monitor.iterations, 0 if self.form is None else self.form.kkt.factorizations, text,
            self.monitor.history, self.monitor.strategy,
        )  # fmt: skip
