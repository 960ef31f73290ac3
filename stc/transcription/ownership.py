"""The statement of the spec for every row and every bound of the nonlinear program."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.problem import Problem
from stc.records import dataclass
from stc.transcription.bind import BoundProgram, step_limits
from stc.transcription.grid import AFTER, BEFORE, IntArray, Nodes
from stc.transcription.numbers import Numbers
from stc.transcription.statements import LINK, Bound
from stc.transcription.transcription import Transcription

FloatArray = NDArray[np.float64]

__all__ = ["BoundEntry", "Ownership", "Place"]


@dataclass(frozen=True, slots=True)
class BoundEntry:
    """The bound of one relation on single unknowns: ``lower <= slope * x[position] <= upper``, all (k,)."""

    relation: int
    nodes: Nodes
    position: IntArray
    slope: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True, slots=True)
class Place:
    """A place in the motion: a frame, plus one half at midpoints, and ``"before"`` or ``"after"`` at a jump."""

    frame: float
    side: str = ""

    def __str__(self) -> str:
        where = f"frame {self.frame:g}" if self.frame == int(self.frame) else f"the midpoint {self.frame:g}"
        return f"{where} ({self.side} the jump)" if self.side else where


class Ownership:
    """Rows and bounds by relation, for one binding of constants.

    Attributes:
        row_owner: (m,) index of each row's relation in ``Problem.relations``, LINK for the transcription's own rows.
        bounds: bounds of relations on single unknowns.
        relations: relations with an effect, in the order of the text.
    """

    def __init__(self, transcription: Transcription, bound: BoundProgram) -> None:
        self.problem: Problem = transcription.problem
        self.transcription = transcription
        program = transcription.program
        self.row_owner = np.full(bound.m, LINK)
        self._others: dict[int, set[int]] = {}
        self.row_nodes = np.zeros(bound.m, np.int64), np.zeros(bound.m, np.int64)
        for group in program.groups:
            for r, row in enumerate(group.rows):
                ids = group.row_ids[r]
                self.row_owner[ids] = row.relation
                self.row_nodes[0][ids], self.row_nodes[1][ids] = row.nodes.position, row.nodes.side
                if row.also:
                    at = dict(zip((4 * row.nodes.position + row.nodes.side).tolist(), ids.tolist()))
                    for relation, code in row.also:
                        self._others.setdefault(at[code], set()).add(relation)
        numbers = bound.numbers
        self.bounds = [
            entry
            for statement in transcription.statements.bounds
            if (entry := self._entry(statement, numbers)) is not None
        ]
        self._step_limits = step_limits(transcription.layout, numbers)
        owners = {int(k) for k in distinct(self.row_owner) if k != LINK}
        owners.update(k for others in self._others.values() for k in others if k != LINK)
        owners.update(entry.relation for entry in self.bounds)
        self.relations = sorted(owners)

    def _entry(self, statement: Bound, numbers: Numbers) -> BoundEntry | None:
        if statement.unknown is None:
            return None
        nodes = statement.nodes
        rest = numbers.at(statement.rest, nodes)
        ends = []
        for end, absent in ((statement.lower, -np.inf), (statement.upper, np.inf)):
            ends.append(np.full(len(nodes), absent) if end is None else numbers.at(end, nodes) - rest)
        slope = numbers.at(statement.coefficient, nodes)
        live = np.flatnonzero(slope)
        position = self.transcription.layout.position(statement.unknown, nodes)
        return BoundEntry(
            statement.relation, nodes[live], position[live], slope[live], ends[0][live], ends[1][live]
        )

    def rows_kept(self, kept: Iterable[int]) -> NDArray[np.bool_]:
        """(m,) rows that remain with these relations only: links, and rows that any of them states."""
        wanted = np.zeros(len(self.problem.relations) + 1, bool)
        wanted[list(kept)] = True
        wanted[LINK] = True
        rows = wanted[self.row_owner]
        for row, others in self._others.items():
            rows[row] |= any(wanted[k] for k in others)
        return np.asarray(rows)

    def rows_of(self, relation: int) -> NDArray[np.bool_]:
        """(m,) rows that a relation states, alone or with others."""
        rows = self.row_owner == relation
        for row, others in self._others.items():
            rows[row] |= relation in others
        return np.asarray(rows)

    def bounds_kept(self, kept: Iterable[int], size: int) -> tuple[FloatArray, FloatArray]:
        """(size,) bounds of the unknowns with these relations only; they may contradict each other."""
        wanted = set(kept)
        lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
        for at, least, most in self._step_limits:
            lower[at], upper[at] = least, most
        for entry in self.bounds:
            if entry.relation in wanted:
                low, high = limits_of(entry)
                np.maximum.at(lower, entry.position, low)
                np.minimum.at(upper, entry.position, high)
        return lower, upper

    def largest_by_relation(self, amount: FloatArray) -> dict[int, float]:
        """The largest of some amounts of the rows, (m,), for every relation that has rows."""
        most = np.zeros(len(self.problem.relations) + 1)
        np.maximum.at(most, self.row_owner, amount)
        for row, others in self._others.items():
            for relation in others:
                most[relation] = max(most[relation], amount[row])
        return {int(k): float(most[k]) for k in np.flatnonzero(most[:-1])}

    def place(self, row: int) -> Place:
        """The place of a row."""
        return place_of(int(self.row_nodes[0][row]), int(self.row_nodes[1][row]))

    def label(self, row: int) -> str:
        """The name of a row of the transcription itself."""
        program = self.transcription.program
        group = program.groups[program.row_group[row]]
        return group.rows[program.row_number[row]].label


def place_of(position: int, side: int) -> Place:
    """A node as a place."""
    return Place(position / 2, {BEFORE: "before", AFTER: "after"}.get(side, ""))


def limits_of(entry: BoundEntry) -> tuple[FloatArray, FloatArray]:
    """Bounds of the unknowns themselves, (k,) each."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = entry.lower / entry.slope, entry.upper / entry.slope
    rising = entry.slope > 0
    return np.where(rising, one, other), np.where(rising, other, one)
