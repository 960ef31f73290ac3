"""Ways to go about a problem, each of which leads to an outcome: from a guess, from a neighbour's solution, others."""

from __future__ import annotations

import numpy as np

from stc.solver.active_set import PATIENCE, bends_upwards, newton_on_active_set, newton_point
from stc.solver.constants import ACCURATE, SMALL_VIOLATION
from stc.solver.formulation import Formulation
from stc.solver.interior import optimise
from stc.solver.iterate import Iterate
from stc.solver.judgement import Judgement
from stc.solver.monitor import Monitor
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.outcome import BUDGET, SHORT_BUDGET, End, Outcome, Tactics
from stc.solver.report import Start
from stc.solver.restoration import elastic_of, meet_rows, returned
from stc.solver.scaled_problem import NEARBY, ScaledProblem
from stc.solver.starting import WARM_BARRIER, cold_iterate, warm_iterate

__all__ = ["Strategies", "least_violation"]


class Strategies:
    """The strategies for one problem, which share their limits and their log."""

    def __init__(self, nlp: NLP, options: Options, monitor: Monitor, judgement: Judgement) -> None:
        self.nlp, self.options, self.monitor, self.judgement = nlp, options, monitor, judgement

    def warm(self, form: ScaledProblem, x0: Floats, start: Start, trusting: bool) -> Outcome:
        """Steps from a neighbour's solution; where they do not converge, a short barrier path to it.

        Along a flat valley of the objective that path is a long one. There a parameter that is chosen freely grows
        again, and leads away from where the rows are nearly met: after some steps it is held from the first.
        """
        assert start.row_multipliers is not None
        x, y, z = x0 / form.x_scale, form.scaled_multipliers(start.row_multipliers), np.zeros(form.n)
        if start.bound_multipliers is not None:
            z = form.scaled_bound_multipliers(start.bound_multipliers)
        if not trusting:
            outcome = self._by_newton(form, x, y, PATIENCE)
            if outcome is not None:
                return outcome
            if not form.gaps:  # no other active set to be found
                return self.barrier(form, x0, Tactics())
        from stc.solver.warm_start import from_neighbour

        point, minimum = from_neighbour(form, x, y, z, self.options.tolerance, self.monitor)
        if point is not None:
            return Outcome(End.CONVERGED, form, point.x, point.y, point.error, minimum=minimum)
        it = warm_iterate(form, x, y)
        free = Tactics(budget=SHORT_BUDGET)
        outcome = optimise(form, it, WARM_BARRIER, self.options, self.monitor, tactics=free)
        left = self.monitor.limit - self.monitor.iterations
        if outcome.end is End.CONVERGED or not (outcome.early and form.gaps and trusting and left > 0):
            return outcome
        held = Tactics(adaptive=False, budget=self.options.max_iterations)
        it = warm_iterate(form, x, y)
        return optimise(form, it, WARM_BARRIER, self.options, self.monitor, tactics=held)

    def cold(self, form: ScaledProblem, x0: Floats) -> Outcome:
        """From ``x0`` (n,)."""
        outcome = self.linear_equations(form, x0)
        return self.barrier(form, x0, Tactics()) if outcome is None else outcome

    def linear_equations(self, form: ScaledProblem, x0: Floats) -> Outcome | None:
        """A quadratic program without inequalities: its optimality conditions are linear equations.

        The problem as stated confirms the solution, which is evaluated only once then. None for other programs.
        """
        if form.gaps or not form.quadratic_program:
            return None
        x, y = np.where(form.held, form.held_value, x0 / form.x_scale), np.zeros(form.m)
        point = newton_point(form, x, y)
        if point is not None:
            outcome = Outcome(
                End.CONVERGED, form, point.x.copy(), point.y.copy(), 0.0, minimum=bends_upwards(form)
            )
            stated = self.judgement.stated(outcome)
            judged = self.judgement.assess(stated)
            outcome.error = max(judged.violation, judged.optimality)
            if outcome.error <= ACCURATE * self.options.tolerance:
                step = float(np.abs(outcome.x - x).max(initial=0.0))
                self.monitor.count()
                errors = judged.violation, judged.optimality
                self.monitor.record(
                    "active-set", lambda: (stated.x, stated.y), judged.objective, *errors, step
                )
                return outcome
        return self._by_newton(form, x, y)

    def _by_newton(self, form: ScaledProblem, x: Floats, y: Floats, patience: int = 0) -> Outcome | None:
        """The solution that Newton's method on the active set finds from ``(x, y)``, scaled; None where it does not."""
        tolerance = self.options.tolerance
        point, solved = newton_on_active_set(form, x, y, self.monitor, tolerance=tolerance, patience=patience)
        if point is None or not solved:
            return None
        x, y, minimum = point.x.copy(), point.y.copy(), bends_upwards(form)
        return Outcome(End.CONVERGED, form, x, y, point.error, minimum=minimum)

    def barrier(self, form: ScaledProblem, x0: Floats, tactics: Tactics) -> Outcome:
        """By a barrier, from near ``x0`` (n,)."""
        it = cold_iterate(form, x0 / form.x_scale)
        return optimise(form, it, self.options.initial_barrier, self.options, self.monitor, tactics=tactics)

    def feasible_first(self, form: ScaledProblem, x0: Floats, reached: Floats) -> Outcome:
        """From the feasible point that the elastic problem near ``x0`` (n,) has: it is found before looking at the
        objective."""
        options, it = self.options, cold_iterate(form, x0 / form.x_scale)

        def solve(problem: Formulation, start: Iterate, mu: float) -> Outcome:
            return optimise(problem, start, mu, options, self.monitor, tactics=Tactics())

        end, outcome = meet_rows(form, it, options.initial_barrier, options.feasibility_tolerance, solve)
        if end is not None:
            return Outcome(end, form, it.w[: form.n].copy(), it.y.copy(), outcome.error, it)
        return solve(form, it, options.initial_barrier)

    def perturbed(self, form: ScaledProblem, x0: Floats, reached: Floats) -> Outcome:
        """Start a little off, with patience."""
        noise = np.random.default_rng(self.options.seed).uniform(-1.0, 1.0, x0.size)
        moved = x0 + NEARBY * noise * np.maximum(np.abs(x0), form.x_scale)
        moved = np.clip(moved, self.nlp.x_lower, self.nlp.x_upper)
        f, r = self.nlp.values(moved)
        tactics = Tactics(budget=self.options.max_iterations)
        return self.barrier(form, moved if np.isfinite(f + r.sum()) else x0, tactics)


def least_violation(
    form: ScaledProblem, x: Floats, options: Options, monitor: Monitor
) -> tuple[End | None, Outcome]:
    """Minimise the sum of the violations from ``x`` (n,), without a limit of the distance.

    A restoration keeps near where it begins and close to the bounds that hold there; this begins far inside of them.

    Returns:
        None where the rows are met, at least nearly, else why to stop there; and the outcome, in terms of ``form``.

    Raises:
        Stopped: at a limit or on the user's request.
    """
    it = cold_iterate(form, x / form.x_scale, by_gaps=False)
    elastic = elastic_of(form)
    elastic.stay_near(it.w[: form.n], 0.0)
    mu = max(options.initial_barrier, float(np.abs(it.c).max(initial=0.0)))
    start = elastic.start(it.w, np.zeros(form.m), it.z, mu)
    outcome = optimise(elastic, start, mu, options, monitor, tactics=Tactics(budget=BUDGET))
    end = returned(form, it, elastic, outcome, options.feasibility_tolerance)
    own = it.w[: form.n].copy()
    if end is None and form.violation(own, it.r) > SMALL_VIOLATION:
        end = End.STUCK  # a search with the objective would not meet the rows either
    return end, Outcome(end or End.CONVERGED, form, own, it.y.copy(), outcome.error, it)
