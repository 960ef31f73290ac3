"""The start of a solve from an earlier solution of the same or a similar problem."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stc.errors import StcError
from stc.guesses.alignment import Alignment
from stc.phases import named_cuts
from stc.problem import Problem
from stc.solution import Solution
from stc.solver import Start
from stc.transcription import Transcription
from stc.transcription.bind import BoundProgram


def start_from(
    earlier: Solution, alignment: Alignment, transcription: Transcription, problem: Problem
) -> tuple[Start, BoundProgram | None]:
    """The earlier solution's values, with its multipliers if it was optimal, resampled if the frames differ.

    Args:
        earlier: the solution to start from.
        alignment: the correspondence of its frames to the problem's.
        transcription, problem: to be solved.

    Returns:
        The start, and the program that was bound for it, if one was.
    """
    program = transcription.program
    same = (
        len(earlier.x) == program.size
        and len(earlier.row_multipliers) == program.row_count
        and len(earlier.bound_multipliers) == program.size
        and earlier.method == problem.method
        and alignment.is_identity
    )
    optimal = earlier.status == "optimal"
    if same and np.isfinite(earlier.x).all():
        if not optimal:
            return Start(earlier.x), None
        return Start(earlier.x, earlier.row_multipliers, earlier.bound_multipliers), None
    from stc.guesses.values import SolutionValues

    bound = transcription.bind(problem.constants, guess=SolutionValues(earlier, alignment), check=False)
    if not optimal or not earlier.multipliers:
        return Start(bound.x0), bound
    from stc.transcription.resample import resample_multipliers

    lengths = transcription.recovery(bound.x0, problem.constants).lengths
    return Start(bound.x0, *resample_multipliers(earlier, transcription, bound, lengths, alignment)), bound


def aligned(earlier: Solution, problem: Problem, before: Callable[[], Problem]) -> Alignment:
    """The correspondence of frames between an earlier solution and a problem.

    Args:
        earlier: of the same spec.
        problem: to be solved.
        before: identifies the problem that was solved; asked where it could matter. It may raise StcError.
    """
    even = Alignment.even(earlier.n, problem.n)
    if all(earlier.constants.get(k) == problem.constants[k] for k in problem.structural):
        return even
    try:
        old = before()
    except StcError:  # no problem by its own numbers alone
        return even
    return even if old.n != earlier.n else Alignment.of(named_cuts(old), named_cuts(problem))
