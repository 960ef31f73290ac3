"""Products that should be zero, reduced to zero in several solves.

Either a gap or its contact force is zero.  If their product is constrained to zero, the feasible set has no interior,
and Newton's method cannot change the order of contacts of the guess.  The product is therefore bounded by a constant,
at first large enough for forces to act at a distance, which is reduced from solve to solve (Scholtes 2001).  The early
solutions are only starts for the next, and get few iterations.  The numbers were compared with others
(docs/complementarity.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from stc.solver import Options, Result, Start, Status
from stc.solver.status import advice, sentence

__all__ = ["brought_down"]

#: What it is multiplied by from one solve to the next; by less only to the last value.
FACTOR = 0.1
#: Where the constant starts (a force as large as the weight acts from so many m away), and the iterations of each solve
#: but the last, which gets ten times as many.  Where that has led to no solution, it starts from more, with more
#: iterations and no end to the last one.
ROUNDS = (0.03, 30), (0.3, 500)
#: How exactly all but the last are solved.
TOLERANCE = 1e-2
#: If a row is still violated by more than this, relative to max(1, its bound), the same value is solved for again, at
#: most so many times, since smaller ones are harder to meet.
MISSED, AGAIN = 1.0, 3

Solve = Callable[[float, Options, Start | None], Result]


def values(value: float, last: float) -> Iterator[float]:
    """The values of the constant in order, from ``value`` to ``last``."""
    while value * FACTOR > last:
        yield value
        value *= FACTOR
    yield last


def brought_down(solve: Solve, last: float, options: Options, start: Start | None) -> Result:
    """Solve for decreasing values of the constant.

    Parameters
    ----------
    solve
        Solves for a value, from a start or from the guess.
    last
        The final value.
    options
        Options for all solves together.
    start
        The start.  A start with multipliers is the solution of a similar problem, and is solved for the last value
        directly.

    Returns
    -------
    Result
        The result for the last value, with the iterations and factorisations of all solves; if a limit was reached
        before it, the point so far with its violation.
    """
    known = start is not None and start.row_multipliers is not None
    found: Result | None = None
    iterations = factorizations = 0
    for first, most in ROUNDS[1:] if known else ROUNDS:
        left = replace(options, max_iterations=options.max_iterations - iterations)
        found, ended = _walked(solve, [last] if known else [*values(first, last)], left, most, start)
        iterations += found.iterations
        factorizations += found.factorizations
        if found.status is Status.OPTIMAL or ended or iterations >= options.max_iterations:
            break
    assert found is not None
    return replace(found, iterations=iterations, factorizations=factorizations)


def _walked(
    solve: Solve, by: Sequence[float], options: Options, most: int, start: Start | None
) -> tuple[Result, bool]:
    """Solve for some values in turn, each from the solution before. Returns the last result and if a limit ended it.

    Parameters
    ----------
    most
        Iterations of each but the last: see :data:`ROUNDS`.
    """
    iterations = factorizations = 0
    last, again, to_come = by[-1], 0, list(by)
    while to_come:
        value = to_come[0]
        left = options.max_iterations - iterations
        few = replace(
            options, max_iterations=min(most, left), tolerance=max(TOLERANCE, options.tolerance), retries=0
        )
        whole = replace(options, max_iterations=left if most == ROUNDS[-1][1] else min(10 * most, left))
        chosen = whole if value == last else few
        warm = start is not None and start.row_multipliers is not None
        found = solve(value, replace(chosen, warm_start=warm), start)
        iterations += found.iterations
        factorizations += found.factorizations
        ended = found.status in (Status.TIME_LIMIT, Status.INTERRUPTED)
        if value != last and (ended or iterations >= options.max_iterations):
            status = found.status if ended else Status.ITERATION_LIMIT
            there = solve(last, replace(options, max_iterations=0), Start(found.x))
            found = replace(there, status=status, message=f"{sentence(status)} {advice(status)}")
            break
        missed = found.status is Status.ITERATION_LIMIT and found.violation > MISSED
        if value != last and missed and again < AGAIN:
            again, start = again + 1, Start(found.x)
        else:
            again, start = 0, Start(found.x, found.row_multipliers, found.bound_multipliers)
            to_come = to_come[1:]
    return replace(found, iterations=iterations, factorizations=factorizations), ended
