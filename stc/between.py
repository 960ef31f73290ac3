"""A spec's statements between the frames of its solution.

A transcription imposes statements at its nodes.  Between them the motion is what the method's polynomials make
of it, and there an inequality may be broken and an equation hold only approximately.  Here every statement on a
stretch of frames is evaluated in between, for the validation to judge.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from stc.phases import resolved, stretches
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, Relation, TimeRef, VariableRef
from stc.solution import Solution
from stc.symbolic.expr import ZERO, Expr, evaluate_all, symbols
from stc.validate.limits import BETWEEN_SHARES
from stc.validate.statements import StatementCheck

FloatArray = NDArray[np.float64]

#: Steps that are looked at in one go: bounds the memory of long motions.
_CHUNK = 4096


def check_statements(problem: Problem, solution: Solution) -> list[StatementCheck]:
    """The worst violation of each statement between the nodes.

    Statements on single frames, statements that read other frames or one side of a jump, and those with a
    derivative that the solution does not know are left out, as are statements without a value anywhere.

    Args:
        problem: the spec with the numbers of the solution.
        solution: of this problem.
    """
    found: dict[int, StatementCheck] = {}
    for first, last in stretches(problem, problem.relations):
        here = [
            (number, parts)
            for number, relation in enumerate(problem.relations)
            if relation.range.first <= first
            and last <= relation.range.last
            and (parts := _parts(problem, relation, solution, first)) is not None
        ]
        for begin in range(first, last, _CHUNK):
            steps = np.arange(begin, min(begin + _CHUNK, last))
            values = _values(problem, solution, steps)
            for number, check in _evaluated(problem, here, values):
                if number not in found or check.share > found[number].share:
                    found[number] = check
    return [found[number] for number in sorted(found)]


class _Parts:
    """A statement as it reads on a stretch: its body, its bounds and the summands that give its size."""

    def __init__(self, body: Expr, lower: Expr | None, upper: Expr | None) -> None:
        self.body, self.lower, self.upper = body, lower, upper
        self.summands = _summands(body)
        self.all = [body, lower or ZERO, upper or ZERO, *self.summands]


def _parts(problem: Problem, relation: Relation, solution: Solution, first: int) -> _Parts | None:
    """A statement ready to be evaluated after frame ``first``, or None where that cannot be done."""
    bounds = (relation.body, relation.lower, relation.upper)
    keys = [k for e in bounds if e is not None for k in symbols(e)]
    if any(getattr(key, "side", "") for key in keys):
        return None
    body, lower, upper = (None if e is None else resolved(problem, e, first) for e in bounds)
    assert body is not None
    for part in (body, lower, upper):
        for key in symbols(part) if part is not None else ():
            if isinstance(key, VariableRef):
                if (key.scale, key.shift) != (1, 0) or (key.name, key.order) not in solution.trajectories:
                    return None
            elif not isinstance(key, ConstantRef | ParameterRef | TimeRef | IndexRef):
                return None
    return _Parts(body, lower, upper)


def _summands(body: Expr) -> list[Expr]:
    """What a sum adds up, signs aside; nested sums opened."""
    stack, found = [body], []
    while stack:
        node = stack.pop()
        if node.op in ("add", "sub", "neg"):
            stack.extend(node.args)
        else:
            found.append(node)
    return found


def _values(
    problem: Problem, solution: Solution, steps: NDArray[np.int_]
) -> dict[object, FloatArray | float]:
    """What every symbol is worth at the places between the nodes of some steps."""
    index = (steps[:, None] + np.array(BETWEEN_SHARES)).reshape(-1)
    motion = solution.at_frame(index)
    found: dict[object, FloatArray | float] = {ConstantRef(k): v for k, v in solution.constants.items()}
    found.update({ParameterRef(k): v for k, v in solution.parameters.items()})
    for name, order in solution.trajectories:
        found[VariableRef(name, order)] = motion[name + "'" * order]
    lengths = np.diff(solution.time)
    whole = index.astype(int)
    found[TimeRef()] = solution.time[whole] + (index - whole) * lengths[whole]
    found[IndexRef()] = index
    return found


def _evaluated(
    problem: Problem, parts: list[tuple[int, _Parts]], values: Mapping[object, FloatArray | float]
) -> Iterator[tuple[int, StatementCheck]]:
    """The worst place of each statement among some places."""
    time = np.asarray(values[TimeRef()])
    roots = [root for _, part in parts for root in part.all]
    numbers = [np.broadcast_to(np.asarray(v, float), time.shape) for v in evaluate_all(roots, values)]
    at = 0
    for number, part in parts:
        body, lower, upper, *summands = numbers[at : at + len(part.all)]
        at += len(part.all)
        violation = np.zeros_like(time)
        size = np.abs(np.array(summands)).max(axis=0)
        with np.errstate(invalid="ignore"):
            for bound, expression, over in (
                (lower, part.lower, lower - body),
                (upper, part.upper, body - upper),
            ):
                if expression is not None:
                    violation = np.maximum(violation, over)
                    size = np.maximum(size, np.where(np.isfinite(bound), np.abs(bound), 0.0))
        if not np.isfinite(violation).any():
            continue
        worst = int(np.nanargmax(violation))
        scale = float(np.nanmax(size))
        share = float(violation[worst]) / scale if scale > 0.0 else float(violation[worst])
        relation = problem.relations[number]
        yield (
            number,
            StatementCheck(
                relation.text, relation.span.location, relation.is_equality, share, float(time[worst])
            ),
        )
