"""A solve in progress, for code that must end it from outside.

A solve that stops by itself also returns multipliers; this is for a solve that cannot stop soon.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from stc.errors import StcError
from stc.optimizers import DEFAULT
from stc.records import dataclass
from stc.solution import Solution
from stc.solver import IterationRecord, Options, Result, Status
from stc.solver.status import advice, sentence
from stc.solving.collect import collect
from stc.transcription import Transcription

__all__ = ["Unfinished", "current", "motion_at"]


@dataclass(slots=True)
class Unfinished:
    """A solve in progress.

    Attributes:
        transcription, constants, overrides, optimizer: as for :func:`stc.solving.collect.collect`.
        start: the start on all frames, (n,), once it is known.
        best: the record of the best iterate so far.
    """

    transcription: Transcription
    constants: Mapping[str, float]
    overrides: Mapping[str, float]
    optimizer: str
    start: NDArray[np.float64] | None = None
    best: IterationRecord | None = None

    def note(self, record: IterationRecord) -> None:
        """Keep an iterate if it is the best so far; iterates on fewer frames, which have no variables, are ignored."""
        if record.x is None:
            return
        before = self.best
        if before is None or _rank(record) < _rank(before):
            self.best = IterationRecord(
                record.iteration,
                record.objective,
                record.violation,
                record.optimality,
                record.step,
                record.step_length,
                record.mu,
                record.regularization,
                record.phase,
                record.x.copy(),
            )

    def solution(self, status: Status) -> Solution | None:
        """The best iterate, else the start, else the guess, with that status; None where the guess has no value."""
        nan = float("nan")
        record = self.best
        if record is None:
            start = self.start
            if start is None:
                try:
                    start = self.transcription.guess(self.constants)
                except StcError:
                    return None
            record = IterationRecord(0, nan, nan, nan, 0.0, 0.0, 0.0, 0.0, "", start)
        message = f"{sentence(status)} {advice(status)}"
        return motion_at(
            self.transcription, record, self.constants, self.overrides, status, message, self.optimizer
        )


def _rank(record: IterationRecord) -> tuple[float, float]:
    """A sort key of iterates: smaller for better ones, feasible ones first."""
    violated = record.violation > Options().feasibility_tolerance
    return record.violation if violated else 0.0, record.objective


def motion_at(
    transcription: Transcription,
    record: IterationRecord,
    constants: Mapping[str, float],
    overrides: Mapping[str, float],
    status: Status,
    message: str,
    optimizer: str = DEFAULT,
) -> Solution:
    """The motion at an iterate, without multipliers; arguments as for :func:`stc.solving.collect.collect`."""
    assert record.x is not None
    result = Result(
        status=status,
        x=record.x,
        row_multipliers=np.zeros(transcription.program.row_count),
        bound_multipliers=np.zeros(len(record.x)),
        objective=record.objective,
        violation=record.violation,
        optimality=record.optimality,
        iterations=record.iteration,
        factorizations=0,
        message=message,
    )
    return collect(transcription, result, constants, overrides, {}, optimizer)


#: The solve of this process that began last and has not ended, for the command line, which has but one at a time.
current: Unfinished | None = None
