"""A spec's statements between the frames of its solution.

A transcription imposes statements at its nodes.  Between them the motion follows the method's polynomials, so that an
inequality may be violated and an equation hold only approximately.  This module evaluates every statement on a range of
frames between the nodes, for the validation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from stc.errors import StcError
from stc.phases import resolved, stretches
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, Relation, TimeRef, VariableRef
from stc.solution import Solution
from stc.solution_restated import problem_of
from stc.symbol_values import values_at
from stc.symbolic.expr import ZERO, Expr, evaluate_all, symbols
from stc.validate.limits import BETWEEN_SHARES
from stc.validate.statements import StatementCheck

FloatArray = NDArray[np.float64]

#: Steps that are looked at in one go: bounds the memory of long motions.
_CHUNK = 4096
#: Positions and other states do not leap: where they break a limit they are held against the sizes there, or this share
#: of those elsewhere on the motion. Forces may turn at a frame, and are held against all of the motion.
ELSEWHERE = 0.1


def statements_between(solution: Solution) -> list[StatementCheck]:
    """The violations of a solution's own statements; none if its text cannot be parsed."""
    if not solution.n:
        return []
    try:
        return check_statements(problem_of(solution), solution)
    except StcError:  # a motion from elsewhere, whose text is not a spec
        return []


def check_statements(problem: Problem, solution: Solution) -> list[StatementCheck]:
    """The worst violation of each statement between the nodes.

    Statements on single frames or on frames alone, statements that read other frames or one side of a jump, and those
    with a derivative that the solution does not contain are left out, as are statements that are undefined everywhere.

    Args:
        problem: the problem with the constants of the solution.
        solution: a solution of this problem.
    """
    found: dict[int, StatementCheck] = {}
    for first, last in stretches(problem, problem.relations):
        here = [
            (number, parts)
            for number, relation in enumerate(problem.relations)
            if relation.range.first <= first
            and last <= relation.range.last
            and not relation.on_frames
            and (parts := _parts(problem, relation, solution, first)) is not None
        ]
        for begin in range(first, last, _CHUNK):
            steps = np.arange(begin, min(begin + _CHUNK, last))
            values = values_at(solution, (steps[:, None] + np.array(BETWEEN_SHARES)).reshape(-1))
            for number, check in _evaluated(problem, here, values):
                if number not in found or check.share > found[number].share:
                    found[number] = check
    return [found[number] for number in sorted(found)]


class _Parts:
    """A statement on an interval of frames: its body, its bounds and the summands that determine its scale.

    Attributes:
        of_state: whether it limits a quantity that cannot jump, such as a position.
        of_squares: whether it limits a sum of squares, such as a squared distance.
    """

    def __init__(self, body: Expr, lower: Expr | None, upper: Expr | None, of_state: bool) -> None:
        self.body, self.lower, self.upper, self.of_state = body, lower, upper, of_state
        self.summands = _summands(body)
        self.of_squares = of_state and all(map(_is_square, self.summands))
        self.all = [body, lower or ZERO, upper or ZERO, *self.summands]


def _is_square(term: Expr) -> bool:
    if term.op == "mul":
        return term.args[0] is term.args[1]
    return term.op == "pow" and term.args[1].op == "num" and term.args[1].payload == 2.0


def _parts(problem: Problem, relation: Relation, solution: Solution, first: int) -> _Parts | None:
    """A statement prepared for evaluation after frame ``first``, or None if that is not possible."""
    bounds = (relation.between or relation.body, relation.lower, relation.upper)
    keys = [k for e in bounds if e is not None for k in symbols(e)]
    if any(getattr(key, "side", "") or getattr(key, "name", "") in problem.at_nodes for key in keys):
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
    limited = [key for key in symbols(body) if isinstance(key, VariableRef)]
    has_rates = all((key.name, key.order + 1) in solution.trajectories for key in limited)
    of_state = not relation.is_equality and has_rates
    return _Parts(body, lower, upper, of_state)


def _summands(body: Expr) -> list[Expr]:
    """The summands of a sum without their signs; nested sums are expanded."""
    stack, found = [body], []
    while stack:
        node = stack.pop()
        if node.op in ("add", "sub", "neg"):
            stack.extend(node.args)
        else:
            found.append(node)
    return found


def _evaluated(
    problem: Problem, parts: list[tuple[int, _Parts]], values: Mapping[object, FloatArray | float]
) -> Iterator[tuple[int, StatementCheck]]:
    """The point with the worst violation of each statement."""
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
            limits = [
                (bound, sign)
                for bound, expression, sign in ((lower, part.lower, -1.0), (upper, part.upper, 1.0))
                if expression is not None
            ]
            if part.of_squares and all(np.all(bound >= 0.0) for bound, _ in limits):
                body, size = np.sqrt(body), np.sqrt(size)
                limits = [(np.sqrt(bound), sign) for bound, sign in limits]
            for bound, sign in limits:
                violation = np.maximum(violation, sign * (body - bound))
                size = np.maximum(size, np.where(np.isfinite(bound), np.abs(bound), 0.0))
        if not np.isfinite(violation).any():
            continue
        scale = np.full_like(size, np.nanmax(size))
        if part.of_state:
            scale = np.maximum(size, ELSEWHERE * scale)
        share = np.divide(violation, scale, out=violation.copy(), where=scale > 0.0)
        worst = int(np.nanargmax(share))
        relation = problem.relations[number]
        yield (
            number,
            StatementCheck(
                relation.text,
                relation.span.location,
                relation.is_equality,
                float(share[worst]),
                float(time[worst]),
            ),
        )
