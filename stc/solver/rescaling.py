"""Attempts at a problem in other scales: where units stand in the way of the usual one, or sizes come to light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stc.solver.ablation import on
from stc.solver.attempts import Attempts
from stc.solver.interior import optimise
from stc.solver.judgement import Point
from stc.solver.nlp import Floats
from stc.solver.outcome import End, Outcome, Tactics
from stc.solver.products import between
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.starting import WARM_BARRIER, warm_iterate

__all__ = ["Rescalings"]

DIVIDED, SHARED = 1e-3, 0.25
"""Rows that are multiplied by so little in the mean leave the objective too heavy beside them; the power of that by
which it is multiplied, too."""
FAR_LARGER = 1e3
"""A variable that has become so many times larger than it was, or than it is measured in, tells of its units."""
LIGHT = 1e-3, 1e-6
"""Curvatures of the objective beside which scaled linear equations are told from such that depend on one another."""
SAME = 10.0
"""Units of variables that differ by less would lead to the same again."""
SMALLEST, SMALL, EXACT = 1e-12, 1e-3, 1e-5
"""Objectives between which what may still be gained is held against the objective itself; the share that is let go."""
STEPS = 100


class Rescalings:
    """Other scales for the problem of some attempts. Each attempt is None where nothing would be different."""

    def __init__(self, attempts: Attempts) -> None:
        self.attempts = attempts
        self.nlp, self.options = attempts.nlp, attempts.options
        self.monitor, self.judgement = attempts.monitor, attempts.judgement

    def scaled_anew(
        self,
        form: ScaledProblem,
        x: Floats,
        objective_factor: float,
        *,
        small_too: bool = False,
        even: bool = False,
    ) -> ScaledProblem:
        """The problem scaled at another point ``x`` (n,), or otherwise, with the linear algebra of ``form``."""
        return ScaledProblem(
            self.nlp, x, self.options, lambda *_: form.kkt, objective_factor, small_too, even
        )

    def lighter(
        self, form: ScaledProblem, x0: Floats, settle: Callable[[Outcome], Outcome]
    ) -> Outcome | None:
        """From the guess, the objective divided like the rows, in part, and small pivots trusted; then ``settle``.

        Where differences over short intervals make rows large, multipliers are as many times larger beside an objective
        that is not divided, and matrices singular to working precision: fourth differences on 240 frames are.
        """
        mean = float(np.exp(np.log(form.row_scale).mean())) if form.m else 1.0
        if mean >= DIVIDED:
            return None
        factor = mean**SHARED
        lighter = self.scaled_anew(form, x0, factor)
        kkt = lighter.attached_kkt
        kkt.trust_small_pivots(True)
        try:
            options = replace(self.options, tolerance=factor * self.options.tolerance)
            return settle(self.attempts.cold(lighter, x0, options))
        finally:
            kkt.trust_small_pivots(False)

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
        for light in LIGHT:
            factor = light / max(curvature, light)
            even = self.scaled_anew(form, x0, factor * form.objective_factor, even=True)
            outcome = self.attempts.linear_equations(even, x0)
            if outcome is not None:
                return outcome
        return None

    def sized(self, form: ScaledProblem, x0: Floats) -> Outcome | None:
        """From the guess, the variables of a linear program scaled by a point that meets the equations.

        A violation that seems to be stationary may be of rows whose variables have far to go.
        """
        if not form.linear or not self.options.scaling:
            return None
        from stc.solver.nearest import nearest_point

        monitor = self.monitor
        most = monitor.limit - monitor.iterations
        left = replace(self.options, max_iterations=most)
        unit = self.scaled_anew(form, x0, form.objective_factor, even=True).x_scale
        there, spent = nearest_point(self.nlp, unit, left)
        monitor.iterations += spent
        sized = self.scaled_anew(form, there, form.objective_factor)
        ratio = sized.x_scale / form.x_scale
        if ((ratio <= SAME) & (ratio >= 1.0 / SAME)).all():
            return None
        return self.attempts.cold(sized, x0, self.options)

    def resized(self, form: ScaledProblem, x0: Floats, reached: Floats) -> Outcome | None:
        """From the guess, variables that are much larger where an attempt ended, (n,), scaled by that.

        A claim of infeasibility is as good as the scales that it was made with.
        """
        larger = np.abs(reached) > FAR_LARGER * np.maximum(form.x_scale, np.abs(x0))
        if not self.options.scaling or not larger.any():
            return None
        resized = self.scaled_anew(form, np.where(larger, reached, x0), form.objective_factor)
        return self.attempts.cold(resized, x0, self.options)

    def enlarged(self, form: ScaledProblem, x0: Floats) -> Outcome:
        """Start there with small variables scaled, too: units may be such that all are."""
        larger = self.scaled_anew(form, x0, form.objective_factor, small_too=True)
        return self.attempts.cold(larger, x0, self.options)

    def on_from(self, form: ScaledProblem, point: Point, tactics: Tactics, share: float = 1.0) -> Outcome:
        """On from a point of the problem as stated that is nearly a solution, in the scale of ``form``, to such a
        share of the usual tolerance."""
        it = warm_iterate(form, point.x / form.x_scale, form.scaled_multipliers(point.y))
        options = replace(self.options, tolerance=share * self.options.tolerance)
        return optimise(form, it, WARM_BARRIER, options, self.monitor, tactics=tactics)

    def in_own_units(self, outcome: Outcome, settle: Callable[[Outcome], Outcome]) -> Outcome | None:
        """On from a solution whose objective is small, multiplied such that it is not, as the variables are.

        Beside an objective of a millionth, what is left to gain counts that is below any tolerance otherwise. None
        where there is nothing to gain, or where that leads to no solution.
        """
        if outcome.end is not End.CONVERGED or not self.options.scaling:
            return None
        point = self.judgement.stated(outcome)
        size = abs(self.judgement.assess(point).objective)
        if not SMALLEST < size < SMALL or self.judgement.gain(point) <= EXACT * size:
            return None
        if not on("own_units"):
            return None
        form = outcome.form
        assert isinstance(form, ScaledProblem)
        unit = self.scaled_anew(form, point.x, 1.0, small_too=True).objective_scale
        own = self.scaled_anew(form, point.x, 1.0 / (size * unit), small_too=True)
        other = settle(self.on_from(own, point, Tactics(budget=STEPS)))
        return other if other.end is End.CONVERGED else None

    def from_least_violation(self, form: ScaledProblem, x: Floats | None) -> Outcome | None:
        """From the feasible point that the least violation leads to from ``x`` (n,), all scaled anew at either.

        None without ``x``, or where functions are undefined there.
        """
        from stc.solver.feasible_start import least_violation

        if x is None:
            return None
        x = between(x, self.nlp.x_lower, self.nlp.x_upper)
        f, r = self.nlp.values(x)
        if not np.isfinite(f + r.sum()):
            return None
        there = self.scaled_anew(form, x, form.objective_factor)
        end, outcome = least_violation(there, x, self.options, self.monitor)
        return outcome if end is not None else self.from_feasible(there, self.judgement.stated(outcome).x)

    def from_feasible(self, form: ScaledProblem, x: Floats) -> Outcome:
        """From a feasible point ``x`` (n,), scaled anew there: a guess far from it tells little of sizes."""
        return self.attempts.cold(self.scaled_anew(form, x, form.objective_factor), x, self.options)
