"""The nodes of statements in time: frames, midpoints and the two sides of jumps.

A *node* is a place where an expression is evaluated.  Its position is counted in half frames, so that frame
``i`` is ``2*i`` and the midpoint after it ``2*i + 1``; its side says which of the two values of a jump it
reads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.problem import DefinitionPiece, FrameRange, Problem
from stc.records import dataclass

IntArray = NDArray[np.int64]

SINGLE, BEFORE, AFTER = 0, 1, 2
"""Sides of a node: one-valued, before a jump, after a jump."""

SIDES = {"": SINGLE, "before": BEFORE, "after": AFTER}


@dataclass(frozen=True, slots=True)
class Nodes:
    """The nodes of a statement, in time order.

    ``position`` (k,): twice the frame index (odd at midpoints); ``side`` (k,): SINGLE, BEFORE or AFTER; ``row`` (k,):
    of a statement on the rows of a data set, which row each is for, of which several may be within one step; else None.
    """

    position: IntArray
    side: IntArray
    row: IntArray | None = None

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, which: NDArray[np.bool_] | IntArray) -> Nodes:
        return Nodes(self.position[which], self.side[which], None if self.row is None else self.row[which])

    @property
    def frame(self) -> IntArray:
        """The frame of each node; for a midpoint the frame before it. (k,)"""
        return self.position // 2

    @property
    def is_midpoint(self) -> NDArray[np.bool_]:
        return (self.position & 1).astype(bool)

    def key(self) -> bytes:
        """Equal for equal nodes: it groups statements on the same nodes."""
        rows = b"" if self.row is None else b"|" + self.row.tobytes()
        return self.position.tobytes() + b"|" + self.side.tobytes() + rows


def join(parts: list[Nodes]) -> Nodes:
    """All nodes of several lists, each once, in time order."""
    position = np.concatenate([p.position for p in parts])
    side = np.concatenate([p.side for p in parts])
    order = distinct(4 * position + side)
    return Nodes(order // 4, order % 4)


class Grid:
    """The frames of a motion, with midpoints if the method has them, and the frames with jumps."""

    def __init__(self, problem: Problem) -> None:
        self.n = problem.n
        self.method = problem.method
        self.has_midpoints = problem.method == "hermite-simpson"
        self.jump = np.zeros(self.n + 1, bool)
        for jump in problem.jumps:
            self.jump[jump.frame] = True
        self.any_jump = bool(self.jump.any())
        self._known: dict[tuple[int, int], Nodes] = {}

    def nodes(self, where: FrameRange) -> Nodes:
        """The nodes of a statement on ``where``: frames, their sides at jumps, midpoints between them.

        A range that ends at a jump reads the value before it, one that starts there the value after it; one
        that passes through, or stands on it alone, holds for both.
        """
        key = where.first, where.last
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = self._nodes(*key)
        return found

    def _nodes(self, first: int, last: int) -> Nodes:
        frames = np.arange(first, last + 1)
        position, side = 2 * frames, np.zeros(len(frames), np.int64)
        jumps = np.flatnonzero(self.jump[first : last + 1]) + first if self.any_jump else np.zeros(0, int)
        if len(jumps):
            here = jumps - first
            side[here] = BEFORE
            if first < last and self.jump[first]:
                side[0] = AFTER
            twice = jumps[(jumps > first) & (jumps < last)] if first < last else jumps
            position = np.concatenate([position, 2 * twice])
            side = np.concatenate([side, np.full(len(twice), AFTER)])
        if self.has_midpoints and last > first:
            position = np.concatenate([position, 2 * np.arange(first, last) + 1])
            side = np.concatenate([side, np.zeros(last - first, np.int64)])
        order = np.argsort(4 * position + side, kind="stable")
        return Nodes(position[order], side[order])

    def step_nodes(self) -> Nodes:
        """The midpoints of all steps, for quantities that are defined once per step. (n,)"""
        return Nodes(2 * np.arange(self.n) + 1, np.zeros(self.n, np.int64))

    def pieces(
        self,
        pieces: list[DefinitionPiece] | tuple[DefinitionPiece, ...],
        nodes: Nodes,
        of_steps: bool = False,
    ) -> IntArray:
        """The piece of a ranged definition at each node, -1 if there is none. (k,)

        Of overlapping pieces the later one is used; at a jump, pieces that end there define the value before it and
        pieces that start there the value after it.  A midpoint uses the piece of the frame before, after its jump if
        there is one.  A definition ``of_steps``, such as ``h``, belongs to the steps that begin at its frames, and is
        the same on both sides of a jump.
        """
        frame = nodes.frame
        found = np.full(len(nodes), -1)
        preferred = np.full(len(nodes), -1)
        is_before = (nodes.side == BEFORE) & ~nodes.is_midpoint
        is_after = np.where(nodes.is_midpoint, self.jump[frame], nodes.side == AFTER)
        for k, piece in enumerate(pieces):
            a, b = piece.range.first, piece.range.last
            holds = (frame >= a) & (frame <= b)
            found[holds] = k
            if a < b and not of_steps:
                holds &= ~((is_before & (frame == a)) | (is_after & (frame == b)))
            preferred[holds] = k
        return np.where(preferred >= 0, preferred, found)
