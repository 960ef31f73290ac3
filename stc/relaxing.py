"""Products that are meant to be zero, brought down to it in several solves.

Of a gap and the force that closes it one is zero.  Where their product is a row there is no point with room on all sides,
and Newton's method has nothing to hold on to: the motion stays in the order of contacts that it was guessed in.  So the
product may be as large as a constant, large enough at first for forces to act at a distance, and is solved for smaller
and smaller values, each from the one before (Scholtes 2001, with the continuation of Hoheisel, Kanzow and Schwartz 2013).
What the early ones find is a start and no result: they get few iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from stc.solver import Options, Result, Start, Status
from stc.solver.status import advice, sentence

__all__ = ["brought_down"]

#: Where the constant starts: a force as large as the weight acts from so many m away.
FIRST = 0.03
#: What it is multiplied by from one solve to the next.
FACTOR = 0.1
#: Iterations of each solve but the last.
ITERATIONS = 50

Solve = Callable[[float, Options, Start | None], Result]


def values(last: float) -> Iterator[float]:
    """The values of the constant in turn, ending with ``last``."""
    value = FIRST
    while value > last:
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
    iterations = factorizations = 0
    for value in [last] if known else values(last):
        left = options.max_iterations - iterations
        few = replace(options, max_iterations=min(ITERATIONS, left), retries=0)
        chosen = replace(options, max_iterations=left) if value == last else few
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
    return replace(found, iterations=iterations, factorizations=factorizations)
