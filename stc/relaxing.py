"""Products that are meant to be zero, brought down to it in several solves.

Of a gap and the force that closes it one is zero.  Where their product is a row no point has room on all sides, and
Newton's method has nothing to hold on to: the motion stays in the order of contacts that it was guessed in.  So the
product may be as large as a constant, large enough at first for forces to act at a distance, and is solved for smaller
and smaller values, each from the one before (Scholtes 2001).  What the early ones find is a start and no result: they
get few iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from stc.solver import Options, Result, Start, Status
from stc.solver.status import advice, sentence

__all__ = ["brought_down"]

#: Where the constant starts: a force as large as the weight acts from so many m away.
FIRST = 0.03
#: What it is multiplied by from one solve to the next; by less only to the last value.
FACTOR = 0.1
#: Iterations of each solve but the last, which gets ten times as many; the larger number, and no end to the last one,
#: where the smaller one has led to no solution.
ITERATIONS = 30, 500
#: How exactly all but the last are solved.
TOLERANCE = 1e-2

Solve = Callable[[float, Options, Start | None], Result]


def values(last: float) -> Iterator[float]:
    """The values of the constant in turn, ending with ``last``."""
    value = FIRST
    while value * FACTOR > last:
        yield value
        value *= FACTOR
    yield last


def brought_down(solve: Solve, last: float, options: Options, start: Start | None) -> Result:
    """Solve for smaller and smaller values of the constant.

    Parameters
    ----------
    solve
        Solves for a value, from a start or from the guess.
    last
        The value that is wanted.
    options
        Of all solves together.
    start
        Where to begin.  One with multipliers is the solution of a neighbour: it leads to the last value at once.

    Returns
    -------
    Result
        For the last value, iterations and factorisations of all solves counted; where a limit was reached before it,
        the point so far with what it violates.
    """
    known = start is not None and start.row_multipliers is not None
    found: Result | None = None
    iterations = factorizations = 0
    for most in ITERATIONS[1:] if known else ITERATIONS:
        left = replace(options, max_iterations=options.max_iterations - iterations)
        found, ended = _walked(solve, [last] if known else [*values(last)], left, most, start)
        iterations += found.iterations
        factorizations += found.factorizations
        if found.status is Status.OPTIMAL or ended or iterations >= options.max_iterations:
            break
    assert found is not None
    return replace(found, iterations=iterations, factorizations=factorizations)


def _walked(
    solve: Solve, by: Sequence[float], options: Options, most: int, start: Start | None
) -> tuple[Result, bool]:
    """The result of the last of some values, each solved from the one before, and whether a limit ended it.

    Parameters
    ----------
    most
        Iterations of each but the last: see :data:`ITERATIONS`.
    """
    iterations = factorizations = 0
    last = by[-1]
    for value in by:
        left = options.max_iterations - iterations
        few = replace(
            options, max_iterations=min(most, left), tolerance=max(TOLERANCE, options.tolerance), retries=0
        )
        whole = replace(options, max_iterations=left if most == ITERATIONS[-1] else min(10 * most, left))
        chosen = whole if value == last else few
        warm = start is not None and start.row_multipliers is not None
        found = solve(value, replace(chosen, warm_start=warm), start)
        iterations += found.iterations
        factorizations += found.factorizations
        start = Start(found.x, found.row_multipliers, found.bound_multipliers)
        ended = found.status in (Status.TIME_LIMIT, Status.INTERRUPTED)
        if value != last and (ended or iterations >= options.max_iterations):
            status = found.status if ended else Status.ITERATION_LIMIT
            there = solve(last, replace(options, max_iterations=0), Start(found.x))
            found = replace(there, status=status, message=f"{sentence(status)} {advice(status)}")
            break
    return replace(found, iterations=iterations, factorizations=factorizations), ended
