"""Programs with complementary pairs, solved by an exact penalty whose weight grows.

Each pass solves the program with the products ``a*b`` in the objective (:mod:`stc.solver.penalised`).  Where they
are not nothing at the solution, the weight was too small: the next pass begins there with a larger one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.pairs import Pairs
from stc.solver.penalised import Penalised
from stc.solver.report import Callback, IterationRecord, Result, Start
from stc.solver.residuals import assess
from stc.solver.status import Status

__all__ = ["by_penalty"]

FIRST_WEIGHT, GROWTH, LARGEST_WEIGHT = 1.0, 10.0, 1e8
COMPLEMENTARY = 1e-6
"""The smaller side of a pair that counts as nothing, relative to ``max(1, larger side)``."""

Solve = Callable[[NLP, Options, Callback | None, Start], Result]


def residual(nlp: NLP, pairs: Pairs, x: Floats) -> float:
    """The largest of the smaller sides at ``x`` (n,), relative to ``max(1, larger side)``."""
    spare = pairs.spare(nlp, x, nlp.values(x)[1])
    smaller, larger = spare.min(axis=1), spare.max(axis=1)
    return float((smaller / np.maximum(1.0, larger)).max(initial=0.0))


def by_penalty(
    nlp: NLP, pairs: Pairs, options: Options, callback: Callback | None, start: Start, solve: Solve
) -> Result:
    """Solve a program with complementary pairs.

    Args:
        solve: solves a program without.
    """
    weight = _first_weight(pairs, start)
    iterations = factorizations = 0
    history: list[IterationRecord] = []
    result: Result | None = None
    while True:
        program = Penalised(nlp, pairs, weight)
        left = replace(options, max_iterations=options.max_iterations - iterations)
        passed = solve(program, left, _told(callback, iterations), _start_of(start, program))
        history += [replace(record, iteration=record.iteration + iterations) for record in passed.history]
        iterations += passed.iterations
        factorizations += passed.factorizations
        result = _as_of(nlp, program, passed)
        met = residual(nlp, pairs, passed.x) <= COMPLEMENTARY
        ended = passed.status in (
            Status.INFEASIBLE,  # whatever the products
            Status.TIME_LIMIT,
            Status.INTERRUPTED,
            Status.ITERATION_LIMIT,
        )
        if ended or (passed.success and met) or weight >= LARGEST_WEIGHT:
            break
        weight *= GROWTH
        options = replace(options, warm_start=False)
        if passed.success:
            start = Start(passed.x)
    return replace(result, iterations=iterations, factorizations=factorizations, history=history)


def _first_weight(pairs: Pairs, start: Start) -> float:
    """That of an earlier solution, which products have as their multiplier, else the smallest."""
    if start.row_multipliers is None:
        return FIRST_WEIGHT
    return max(FIRST_WEIGHT, float(np.abs(start.row_multipliers[pairs.product]).max(initial=0.0)))


def _start_of(start: Start, program: Penalised) -> Start:
    """A start of the whole program, as it concerns the penalised one."""
    y, another = start.row_multipliers, start.another

    def other(left: int) -> tuple[Start | None, int]:
        assert another is not None
        found, spent = another(left)
        return None if found is None else _start_of(found, program), spent

    return Start(
        start.x,
        None if y is None else y[program.kept],
        start.bound_multipliers,
        None if another is None else other,
    )


def _told(callback: Callback | None, before: int) -> Callback | None:
    """A callback that counts the iterations of earlier passes."""
    if callback is None:
        return None
    its = callback
    return lambda record: its(replace(record, iteration=record.iteration + before))


def _as_of(nlp: NLP, program: Penalised, passed: Result) -> Result:
    """A result of a penalised program as one of the program itself."""
    y = program.all_multipliers(passed.row_multipliers)
    judged = assess(nlp, passed.x, y)
    return replace(
        passed,
        row_multipliers=y,
        bound_multipliers=judged.bound_multipliers,
        objective=judged.objective,
        violation=judged.violation,
        optimality=judged.optimality,
    )
