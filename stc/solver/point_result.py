"""The result of a method that has a point and perhaps multipliers, judged anew from the problem as stated."""

from __future__ import annotations

from stc.solver.dual_estimate import assess_point
from stc.solver.monitor import Monitor
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.report import Result
from stc.solver.residuals import assess
from stc.solver.status import Status, advice, sentence

__all__ = ["point_result"]


def point_result(
    nlp: NLP,
    x: Floats,
    status: Status,
    options: Options,
    monitor: Monitor,
    y: Floats | None = None,
    message: str = "",
    factorizations: int = 0,
) -> Result:
    """Make a result of ``x`` (n,), and call it optimal when, and only when, it is.

    Without row multipliers ``y`` (m,) those that suit the point best are found by least squares.  An end for want
    of progress becomes ``optimal`` where the conditions hold, and a claim to be optimal becomes ``failed``
    where they do not; ``infeasible`` and ``unbounded`` are left as they are, for they need certificates of
    their own.
    """
    y, judged = assess_point(nlp, x, options.unscaled_tolerance) if y is None else (y, assess(nlp, x, y))
    holds = (
        judged.violation <= options.feasibility_tolerance and judged.optimality <= options.unscaled_tolerance
    )
    if status in (Status.OPTIMAL, Status.FAILED):
        status = Status.OPTIMAL if holds else Status.FAILED
    if status is Status.OPTIMAL:
        message = ""
    return Result(
        status=status,
        x=x,
        row_multipliers=y,
        bound_multipliers=judged.bound_multipliers,
        objective=judged.objective,
        violation=judged.violation,
        optimality=judged.optimality,
        scaled_optimality=judged.optimality,
        iterations=monitor.iterations,
        factorizations=factorizations,
        message=message or f"{sentence(status)} {advice(status)}".strip(),
        history=monitor.history,
    )
