"""The spec's statements between the nodes, where the transcription does not impose them: their violations.

The validation knows no expressions: a module that has the spec evaluates its statements along the motion and passes on
one :class:`StatementCheck` each (:mod:`stc.studies.statements`).
"""

from __future__ import annotations

from collections.abc import Sequence

from stc.records import dataclass
from stc.validate import limits
from stc.validate.metrics import Metric


@dataclass(frozen=True, slots=True)
class StatementCheck:
    """The worst violation of one statement between the nodes.

    Attributes:
        text: the statement as the spec writes it.
        place: file and line.
        equality: whether it is an equation.
        share: violation as a share of the compared quantity, see :mod:`stc.statements_between`.
        time: time of the violation, in seconds.
    """

    text: str
    place: str
    equality: bool
    share: float
    time: float


def statement_metrics(checks: Sequence[StatementCheck], method: str) -> list[Metric]:
    """The worst inequality with a verdict, all others beyond the limit, and the worst equation for information."""
    limit = limits.INEQUALITY_BETWEEN[method]
    metrics = []
    inequalities = sorted((c for c in checks if not c.equality), key=lambda c: -c.share)
    for rank, check in enumerate(inequalities):
        if rank == 0 or not check.share <= limit:
            metrics.append(Metric("inequality between frames", _subject(check), check.share, "share", limit))
    equations = [c for c in checks if c.equality]
    if equations:
        worst = max(equations, key=lambda c: c.share)
        metrics.append(Metric("equation between frames", _subject(worst), worst.share, "share"))
    return metrics


def _subject(check: StatementCheck) -> str:
    if check.share == 0.0:
        return "every equation" if check.equality else "every inequality"
    return f"{check.place}: {check.text} at t = {check.time:.4g} s"
