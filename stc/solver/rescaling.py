"""Strategies in other scales, for problems whose units or sizes make the usual scale unsuitable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stc.solver.curvature import SecondOrder, second_order_at
from stc.solver.interior import optimise
from stc.solver.judgement import Point
from stc.solver.least_norm_point import Solve, least_norm_point
from stc.solver.nlp import Floats
from stc.solver.outcome import ACCEPTABLE, End, Outcome, Tactics
from stc.solver.products import between
from stc.solver.scaled_problem import ORDINARY, SMALLEST, ScaledProblem
from stc.solver.starting import WARM_BARRIER, warm_iterate
from stc.solver.strategies import Strategies, least_violation
from stc.solver.workspace import workspace_of

__all__ = ["Rescalings"]


class Rescalings:
    """Other scales for the problem of some strategies. Each is None where nothing would be different."""

    def __init__(self, strategies: Strategies, solve: Solve) -> None:
        """``solve`` solves another problem with settings: :func:`stc.solver.sqp.minimize`."""
        self.strategies, self.solve = strategies, solve
        self.nlp, self.options = strategies.nlp, strategies.options
        self.monitor, self.judgement = strategies.monitor, strategies.judgement

    def scaled_anew(
        self,
        form: ScaledProblem,
        x: Floats,
        objective_factor: float,
        *,
        even: bool = False,
    ) -> ScaledProblem:
        """The problem scaled at another point ``x`` (n,), or otherwise, with the linear algebra of ``form``."""
        return ScaledProblem(self.nlp, x, self.options, lambda *_: form.kkt, objective_factor, even)

    def even_equations(self, form: ScaledProblem, x0: Floats) -> Outcome | None:
        """The solution of a quadratic program's linear equations where the scale stands in the way, or None.

        A variable that makes little difference to its rows, as a force of tonnes does to accelerations, takes large
        multipliers, and a curvature beside which its rows seem to depend on one another.
        """
        if not self.options.scaling:
            return None
        even = self.scaled_anew(form, x0, form.objective_factor, even=True)
        _, _, hess = even.weighted_derivatives(x0 / even.x_scale, np.zeros(even.m), 1.0)
        curvature = float(np.abs(hess).max(initial=0.0))
        # Beside such curvatures scaled linear equations are told from such that depend on one another.
        for light in (SMALLEST, ACCEPTABLE):
            factor = light / max(curvature, light)
            even = self.scaled_anew(form, x0, factor * form.objective_factor, even=True)
            outcome = self.strategies.linear_equations(even, x0)
            if outcome is not None:
                return outcome
        return None

    def resized(self, form: ScaledProblem, x0: Floats, reached: Floats) -> Outcome | None:
        """Solve from the guess, with variables that a strategy made much larger, (n,), scaled by their final size.

        A claim of infeasibility may be wrong if the scales are.
        """
        larger = np.abs(reached) > ORDINARY[1] * np.maximum(form.x_scale, np.abs(x0))
        if not self.options.scaling or not larger.any():
            return None
        resized = self.scaled_anew(form, np.where(larger, reached, x0), form.objective_factor)
        return self.strategies.cold(resized, x0)

    def by_least_norm(self, form: ScaledProblem, x0: Floats, reached: Floats) -> Outcome | None:
        """Solve from the guess, with variables scaled by the point of least norm that satisfies the linear equations.

        A violation may only seem stationary because the variables of its rows are far from their solution.
        """
        if not self.options.scaling:
            return None
        unit = self.scaled_anew(form, x0, form.objective_factor, even=True).x_scale
        monitor = self.monitor
        left = replace(self.options, max_iterations=monitor.limit - monitor.iterations)
        there, spent = least_norm_point(self.nlp, unit, left, self.solve)
        monitor.iterations += spent
        sized = self.scaled_anew(form, there, form.objective_factor)
        if (sized.x_scale == form.x_scale).all():
            return None
        return self.strategies.cold(sized, x0)

    def beyond_saddle(self, outcome: Outcome) -> tuple[Outcome, Outcome | None]:
        """A stationary point where it is a minimum; else what negative curvature leads to from there.

        Returns:
            That, and the stationary point again where it would do if that leads nowhere: where nothing bends downwards.
        """
        form = outcome.form
        assert isinstance(form, ScaledProblem)
        found = second_order_at(form, outcome.x, outcome.y, self.options.seed)
        if found in (SecondOrder.HOLDS, SecondOrder.FLAT):
            return replace(outcome, minimum=True), None
        if found is SecondOrder.FAILS:
            return replace(outcome, end=End.SADDLE), None
        x = workspace_of(form).it.w[: form.n].copy()
        self.monitor.count()
        on = self.on_from(form, Point(*form.as_stated(x, outcome.y)), Tactics())
        return on, replace(outcome, minimum=True) if found is SecondOrder.LOWER else None

    def on_from(self, form: ScaledProblem, point: Point, tactics: Tactics, share: float = 1.0) -> Outcome:
        """Continue from a point of the stated problem that is nearly a solution, in the scale of ``form``.

        The tolerance is the given share of the usual one.
        """
        it = warm_iterate(form, point.x / form.x_scale, form.scaled_multipliers(point.y))
        options = replace(self.options, tolerance=share * self.options.tolerance)
        return optimise(form, it, WARM_BARRIER, options, self.monitor, tactics=tactics)

    def from_least_violation(self, form: ScaledProblem, x0: Floats, reached: Floats) -> Outcome | None:
        """Minimise the violation from the end of the search, then solve from that feasible point, each in new scales.

        None if a function is undefined there.
        """
        x = between(reached, self.nlp.x_lower, self.nlp.x_upper)
        f, r = self.nlp.values(x)
        if not np.isfinite(f + r.sum()):
            return None
        there = self.scaled_anew(form, x, form.objective_factor)
        end, outcome = least_violation(there, x, self.options, self.monitor)
        if end is not None:
            return outcome
        x = self.judgement.stated(outcome).x
        return self.strategies.cold(self.scaled_anew(there, x, form.objective_factor), x)
