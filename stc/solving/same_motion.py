"""Whether two problems state the same motion on different numbers of frames.

The frames that statements name, the times at these frames, and the weights of the objective must be the same in both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.errors import UsageError
from stc.phases import resolved, stretches
from stc.problem import ConstantRef, IndexRef, ObjectiveTerm, ParameterRef, Problem, TimeRef, VariableRef
from stc.symbolic.expr import Expr, evaluate, render, symbols

__all__ = ["BESIDE", "check_same_motion", "takes_longer"]

FloatArray = NDArray[np.float64]
Knots = NDArray[np.int_] | FloatArray
"""Corresponding frames of two motions, (k,) each, ascending, with both ends."""

BESIDE = 1
"""Largest offset of a frame number from one that scales with n, as in n/2 + 1 or a - 1."""
CLOSE = 1e-9
TRIALS = (1.0, 1.7)
"""Values of all parameters at which durations are compared."""


def check_same_motion(problem: Problem, other: Problem, old: Knots, new: Knots) -> float:
    """Compare the named frames and the objective's weights; :func:`takes_longer` compares the times.

    Returns:
        The ratio of the other problem's objective to this one: 1 except for plain sums over frames.

    Raises:
        UsageError: the other problem does not state the same motion; the message says where.
    """
    if len(problem.named) != len(other.named):
        raise UsageError(f"{problem.name} reads other frames with n = {other.n} than with n = {problem.n}")
    for one, there in zip(problem.named, other.named, strict=True):
        if not _scales(one.frame, there.frame, old, new):
            raise UsageError(
                f"{one.span.location}: frame {one.frame} of {problem.n} would be frame {there.frame} of {other.n}: "
                "it does not keep its share of the motion",
                f"write frame numbers as shares of n, here `{one.frame}/{problem.n}*n`, or as constants "
                "such as `a = n/2`",
            )
    if len(problem.objective) != len(other.objective):
        raise UsageError(f"{problem.name} has another objective with n = {other.n} than with n = {problem.n}")
    return _check_objective(problem, other, old, new)


def takes_longer(problem: Problem, other: Problem, old: Knots, new: Knots) -> bool:
    """Whether the last frame, or a frame at which another definition or statement begins, has a different time."""
    cuts = np.array(sorted({first for first, _ in stretches(problem, problem.relations)}))
    cuts = np.append(cuts, problem.n)
    for trial in TRIALS:
        before, after = frame_times(problem, trial), frame_times(other, trial)
        there = np.interp(np.interp(cuts, old, new), np.arange(other.n + 1), after)
        if not np.allclose(there, before[cuts], rtol=CLOSE, atol=CLOSE * abs(before[-1])):
            return True
    return False


def _scales(frame: float, other: float, old: Knots, new: Knots) -> bool:
    """Whether a frame keeps its share of the motion, or a fixed distance from such a frame."""
    for beside in range(-BESIDE, BESIDE + 1):
        at = frame - beside
        if old[0] <= at <= old[-1] and abs(np.interp(at, old, new) + beside - other) <= CLOSE * old[-1]:
            return True
    return False


def frame_times(problem: Problem, trial: float) -> FloatArray:
    """The time of every frame where each parameter has the value ``trial``. (n+1,)"""
    known: dict[object, object] = {ConstantRef(name): value for name, value in problem.constants.items()}
    known.update({ParameterRef(name): trial for name in problem.parameters})
    lengths = np.zeros(problem.n)
    for first, last in stretches(problem, ()):
        step = resolved(problem, problem.step, first)
        values = {**known, IndexRef(): np.arange(first, last, dtype=float)}
        lengths[first:last] = np.asarray(evaluate(step, values))
    return np.concatenate([[0.0], np.cumsum(lengths)])


def _check_objective(coarse: Problem, fine: Problem, old: Knots, new: Knots) -> float:
    """Check that plain sums over frames have the same weight relative to the rest of the objective.

    Raises:
        UsageError: one does not.
    """
    ratios: list[float] = []
    blamed = None
    for term, other in zip(coarse.objective, fine.objective, strict=True):
        if term.integral or term.range.first == term.range.last:
            ratios.append(1.0)
            continue
        blamed = term
        before, after = (
            _sum(p, t.body, t.range.first, t.range.last) for p, t in ((coarse, term), (fine, other))
        )
        ratios.append(after / before if before else 1.0)
    # The ends of a range count as whole frames in a sum: a relative difference of that size is the sum's own.
    tolerance = 4.0 / max(1, min(int(np.diff(old).min()), int(np.diff(new).min())))
    if blamed is not None and max(ratios) > min(ratios) * (1.0 + tolerance):
        raise growing_sum(blamed)
    return float(np.mean(ratios)) if ratios else 1.0


def is_of_parameters(term: ObjectiveTerm) -> bool:
    """Whether a plain term adds the same number, made of parameters alone, for several frames."""
    several = not term.integral and term.range.first < term.range.last
    return several and all(isinstance(key, ConstantRef | ParameterRef) for key in symbols(term.body))


def growing_sum(term: ObjectiveTerm) -> UsageError:
    """The error for a plain sum over frames, which changes the objective with the number of frames."""
    return UsageError(
        f"{term.span.location}: a plain sum over frames grows with n, so that the objective would be another one",
        instead_of_sum(term),
    )


def instead_of_sum(term: ObjectiveTerm) -> str:
    """A replacement for a plain sum over frames that does not grow with n."""
    text = render(term.body) if "integral" in term.text else term.text  # of a statement with both, the sum
    if is_of_parameters(term):  # the integral of a duration is its square
        return f"write `[0]: {text};`, which counts it once"
    return f"write `integral({text})`"


def _sum(problem: Problem, body: Expr, first: int, last: int) -> float:
    """The sum of a term over its frames with a fixed value for every variable."""
    values: dict[object, object] = {ConstantRef(name): value for name, value in problem.constants.items()}
    values.update({ParameterRef(name): 1.3 for name in problem.parameters})
    total = 0.0
    for a, b in stretches(problem, ()):
        start, end = max(a, first), min(b, last)
        if start >= end:
            continue
        here = resolved(problem, body, a)
        index = np.arange(start, end, dtype=float)
        known = {**values, IndexRef(): index / problem.n, TimeRef(): index / problem.n}
        for key in symbols(here):
            if isinstance(key, VariableRef):
                known[key] = 0.7 + 0.11 * (len(key.name) + key.order)
        total += float(np.sum(np.broadcast_to(np.asarray(evaluate(here, known)), index.shape)))
    return total
