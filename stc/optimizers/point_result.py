"""The result of a method that returns a point and perhaps multipliers, checked against the problem as stated."""

from __future__ import annotations

from stc.optimizers.dual_estimate import assess_point
from stc.records import dataclass
from stc.solver.curvature import SecondOrder, second_order_at
from stc.solver.judgement import possible_gain
from stc.solver.kkt import structured_kkt
from stc.solver.monitor import Monitor
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.report import Result
from stc.solver.residuals import Assessment, assess
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.status import NO_MINIMUM, Status, advice, sentence

__all__ = ["Judgement", "judge", "point_result"]

GAIN = 100.0
"""The accepted first-order gain, as a multiple of the tolerance of the optimality error."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """A point, the multipliers that fit it, and their distance from optimality.

    Attributes:
        x: variables, (n,).
        y: row multipliers, (m,).
        conditions: violation, optimality error and what goes with them.
        error: the largest of violation, optimality error and possible gain, each over what counts as solved.
    """

    x: Floats
    y: Floats
    conditions: Assessment
    error: float

    @property
    def optimal(self) -> bool:
        """Whether all tolerances are met."""
        return self.error <= 1.0


def judge(nlp: NLP, x: Floats, options: Options, y: Floats | None = None) -> Judgement:
    """Check a point ``x`` (n,) against the optimality conditions.

    Without row multipliers ``y`` (m,), those that fit best are found by least squares.
    """
    y, found = assess_point(nlp, x, options.unscaled_tolerance) if y is None else (y, assess(nlp, x, y))
    gain = possible_gain(nlp, x, y, found.bound_multipliers)
    error = max(
        found.violation / options.feasibility_tolerance,
        found.optimality / options.unscaled_tolerance,
        gain / (GAIN * options.unscaled_tolerance),
    )
    return Judgement(x, y, found, error if error == error else float("inf"))


def point_result(
    nlp: NLP,
    judgement: Judgement,
    status: Status,
    monitor: Monitor,
    message: str = "",
    factorizations: int = 0,
) -> Result:
    """A result that is ``optimal`` if and only if the conditions hold.

    This includes the second-order condition: no lower point is found along negative curvature.  A lack of progress
    becomes ``optimal`` if the conditions hold, and an alleged optimum becomes ``failed`` if they do not; other
    statuses do not change, since they need evidence of their own.
    """
    if status in (Status.OPTIMAL, Status.FAILED):
        status = Status.OPTIMAL if judgement.optimal else Status.FAILED
    if status is Status.OPTIMAL:
        message = ""
        if _is_saddle(nlp, judgement.x, judgement.y, monitor.options):
            status, message = Status.FAILED, NO_MINIMUM
    found = judgement.conditions
    return Result(
        status=status,
        x=judgement.x,
        row_multipliers=judgement.y,
        bound_multipliers=found.bound_multipliers,
        objective=found.objective,
        violation=found.violation,
        optimality=found.optimality,
        iterations=monitor.iterations,
        factorizations=factorizations,
        message=message or f"{sentence(status)} {advice(status)}".strip(),
        history=monitor.history,
    )


def _is_saddle(nlp: NLP, x: Floats, y: Floats, options: Options) -> bool:
    """Whether negative curvature leads to a lower point from a stationary one ``x`` (n,), with multipliers ``y`` (m,).

    The point may be less exact than our own: what bends downwards counts only where it leads lower.
    """
    form = ScaledProblem(nlp, x, options, structured_kkt)
    found = second_order_at(form, x / form.x_scale, form.scaled_multipliers(y), options.seed)
    return found is SecondOrder.LEFT
