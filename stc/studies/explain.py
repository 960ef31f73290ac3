"""The active inequalities of a solution, and the cost of each statement, from the multipliers.

At a solution ``grad f + J^T y + z = 0``, and moving the upper end of a statement by one unit at a frame changes the
least objective by ``-y`` there, to first order (J. Nocedal and S. J. Wright, Numerical Optimization, 2006, section
12.8).  A statement that holds on many frames is moved on all of them together.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stc.errors import UsageError
from stc.records import dataclass
from stc.transcription.bind import BoundProgram
from stc.transcription.ownership import Ownership, limits_of

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

__all__ = ["Explanation", "Sensitivity", "explain"]

NEGLIGIBLE = 1e-9
CLOSE = 1e-6


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """The cost of one end of one statement.

    Attributes:
        statement: its text.
        file, line, column: its position.
        end: ``upper`` or ``lower`` for the active end of an inequality, or ``equality``.
        change: change of the least objective per unit by which that end is relaxed at all its frames together: never
            positive for an inequality.  For an equation: per unit by which its right-hand side grows.
        frames: the frames where it is active, plus one half at midpoints; all frames of an equation.
        frame: the frame where it costs most; None in a problem without frames.
        change_there: the part of ``change`` that is due to that frame.
        weakly: True if it is active and costs nothing.
    """

    statement: str
    file: str
    line: int
    column: int
    end: str
    change: float
    frames: list[float]
    frame: float | None
    change_there: float
    weakly: bool


@dataclass(frozen=True, slots=True)
class Explanation:
    """The active inequalities of a solution, and the cost of each statement.

    Attributes:
        active: the active inequalities, in the order of the text.
        sensitivities: every statement with a cost, the most expensive first.
    """

    active: list[Sensitivity]
    sensitivities: list[Sensitivity]

    def to_dict(self) -> dict[str, Any]:
        """Both lists with their fields by name."""
        return {
            "active": [asdict(one) for one in self.active],
            "sensitivities": [asdict(one) for one in self.sensitivities],
        }


def explain(model: Model, solution: Solution) -> Explanation:
    """The active inequalities of an optimal solution, and the cost of each statement.

    Args:
        model: the spec.
        solution: of it, optimal.

    Raises:
        UsageError: the solution is not optimal, or of another problem.
    """
    if solution.status != "optimal":
        raise UsageError(f"only an optimal solution has sensitivities, and this one is {solution.status}")
    problem, transcription = model.transcription(solution.method, **solution.overrides)
    bound = transcription.bind(problem.constants)
    if len(solution.x) != bound.n or len(solution.row_multipliers) != bound.m:
        raise UsageError("this solution is of another problem: it has other unknowns and rows")
    return _Reading(Ownership(transcription, bound), bound, solution).run()


class _Reading:
    """Sums of multipliers by statement and end."""

    def __init__(self, ownership: Ownership, bound: BoundProgram, solution: Solution) -> None:
        self.ownership, self.bound = ownership, bound
        self.x, self.y, self.z = solution.x, solution.row_multipliers, solution.bound_multipliers
        self.rows = bound.values(self.x)[1].copy()
        largest = max(float(np.abs(self.y).max(initial=0.0)), float(np.abs(self.z).max(initial=0.0)))
        self.negligible = NEGLIGIBLE * max(1.0, largest)

    def run(self) -> Explanation:
        every = [one for relation in self.ownership.relations for one in self._of(relation)]
        active = [one for one in every if one.end != "equality"]
        costly = [one for one in every if abs(one.change) > self.negligible]
        return Explanation(active, sorted(costly, key=lambda one: -abs(one.change)))

    def _of(self, relation: int) -> list[Sensitivity]:
        """The relevant ends of a relation."""
        bound, ownership = self.bound, self.ownership
        rows = np.flatnonzero(ownership.rows_of(relation))
        value, y = [self.rows[rows]], [self.y[rows]]
        lower, upper = [bound.row_lower[rows]], [bound.row_upper[rows]]
        at = [ownership.row_nodes[0][rows] / 2]
        for entry in ownership.bounds:
            if entry.relation != relation:
                continue
            price = self._bound_multipliers(entry.relation, entry.position, *limits_of(entry)) / entry.slope
            value.append(entry.slope * self.x[entry.position])
            y.append(price)
            lower.append(entry.lower)
            upper.append(entry.upper)
            at.append(entry.nodes.position / 2)
        v, m, low, high, frame = (np.concatenate(part) for part in (value, y, lower, upper, at))
        found = []
        equal = low == high
        if equal.any():
            found.append(self._sensitivity(relation, "equality", -m[equal], frame[equal]))
        for end, limit, sign in (("upper", high, 1.0), ("lower", low, -1.0)):
            with np.errstate(invalid="ignore"):
                near = (
                    ~equal
                    & np.isfinite(limit)
                    & (np.abs(v - limit) <= CLOSE * np.maximum(1.0, np.abs(limit)))
                )
            pulls = ~equal & np.isfinite(limit) & (sign * m > self.negligible)
            on = near | pulls
            if on.any():
                found.append(self._sensitivity(relation, end, np.minimum(-sign * m[on], 0.0), frame[on]))
        return found

    def _bound_multipliers(
        self, relation: int, position: IntArray, low: FloatArray, high: FloatArray
    ) -> FloatArray:
        """The part of the unknowns' multipliers that is due to a relation that became a bound, (k,)."""
        bounds, z = self.bound.bounds, self.z[position]
        upper = (z > 0.0) & (high <= self.bound.x_upper[position]) & (bounds.upper_from[position] == relation)
        lower = (z < 0.0) & (low >= self.bound.x_lower[position]) & (bounds.lower_from[position] == relation)
        return np.where(upper | lower, z, 0.0)

    def _sensitivity(self, relation: int, end: str, change: FloatArray, frames: FloatArray) -> Sensitivity:
        stated = self.ownership.problem.relations[relation]
        span, whole = stated.span, float(change.sum())
        most = int(np.argmax(np.abs(change)))
        in_time = self.ownership.problem.n > 0
        return Sensitivity(
            stated.text,
            span.source.name,
            span.line,
            span.column,
            end,
            whole,
            sorted(set(frames.tolist())) if in_time else [],
            float(frames[most]) if in_time else None,
            float(change[most]),
            bool(np.abs(change).max() <= self.negligible),
        )


def frames_in_words(frames: Iterable[float], longest: int = 4) -> str:
    """Frame numbers as intervals: ``0-12, 20``; a step of one half at midpoints belongs to its interval."""
    stretches: list[list[float]] = []
    for frame in frames:
        if stretches and frame - stretches[-1][1] <= 1.0:
            stretches[-1][1] = frame
        else:
            stretches.append([frame, frame])
    words = [f"{a:g}" if a == b else f"{a:g}-{b:g}" for a, b in stretches]
    return ", ".join(words[:longest]) + (", ..." if len(words) > longest else "")
