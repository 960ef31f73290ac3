"""Stationary points of a program held against the second-order condition, whoever found them."""

from __future__ import annotations

from dataclasses import replace

from stc.solver.curvature import SecondOrder, second_order_at
from stc.solver.judgement import Point
from stc.solver.outcome import End, Outcome, Tactics
from stc.solver.rescaling import Rescalings
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import workspace_of

__all__ = ["beyond_saddle", "is_minimum"]


def beyond_saddle(outcome: Outcome, rescalings: Rescalings) -> tuple[Outcome, Outcome | None]:
    """A stationary point where it is a minimum; else what negative curvature leads to from there.

    Returns:
        That, and the stationary point again where it would do if that leads nowhere: where nothing bends downwards.
    """
    form, attempts = outcome.form, rescalings.attempts
    assert isinstance(form, ScaledProblem)
    found = second_order_at(form, outcome.x, outcome.y, attempts.options.seed)
    if found in (SecondOrder.HOLDS, SecondOrder.FLAT):
        return replace(outcome, minimum=True), None
    if found is SecondOrder.FAILS:
        return replace(outcome, end=End.SADDLE), None
    x = workspace_of(form).it.w[: form.n].copy()
    attempts.monitor.count()
    on = rescalings.on_from(form, Point(*form.as_stated(x, outcome.y)), Tactics())
    return on, replace(outcome, minimum=True) if found is SecondOrder.LOWER else None


def is_minimum(form: ScaledProblem, point: Point, seed: int) -> bool:
    """Whether a stationary point of the problem as stated meets the second-order condition."""
    found = second_order_at(form, point.x / form.x_scale, form.scaled_multipliers(point.y), seed)
    return found in (SecondOrder.HOLDS, SecondOrder.FLAT)
