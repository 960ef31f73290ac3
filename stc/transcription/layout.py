"""The positions of the unknowns in the vector of decision variables.

Frame by frame, so that the KKT system is block banded::

    | frame 0 | (mid 0) | frame 1 | (mid 1) | ... | frame n | parameters |

A frame holds every variable with its derivatives up to the highest order in use; at a jump the two-valued ones
follow once more with their values after it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from stc.problem import ParameterRef, Problem, VariableRef
from stc.transcription.grid import AFTER, BEFORE, SIDES, Grid, IntArray, Nodes


class Layout:
    """Maps (variable, order, node) to positions in the decision vector.

    Attributes:
        size: number of decision variables.
        order: highest derivative order that is an unknown, per variable.
        stage: (size,) int32, the frame of each decision variable; parameters come last.
    """

    def __init__(self, problem: Problem, grid: Grid, orders: dict[str, int]) -> None:
        self.grid = grid
        self.order = orders
        self.names = [(name, k) for name in problem.variables for k in range(orders[name] + 1)]
        n, width = grid.n, len(self.names)
        column = {name: c for c, name in enumerate(self.names)}
        two_valued = np.zeros((n + 1, width), bool)
        for (name, k), c in column.items():
            if k and k == orders[name]:
                two_valued[grid.jump, c] = True
        for jump in problem.jumps:
            top = orders[jump.name]
            for k in range(min(jump.order, top), top + 1):
                two_valued[jump.frame, column[jump.name, k]] = True
        extra = two_valued.sum(axis=1)
        middle = width if grid.has_midpoints else 0
        lengths = width + extra + middle
        lengths[n] -= middle
        start = np.concatenate([[0], np.cumsum(lengths)])
        self.two_valued = two_valued
        self._single = [not column.any() for column in two_valued.T]
        self.before = start[:-1, None] + np.arange(width)
        self.after = np.where(
            two_valued, start[:-1, None] + width + np.cumsum(two_valued, axis=1) - 1, self.before
        )
        self.middle: IntArray = np.zeros((n, 0), np.int64)
        if grid.has_midpoints:
            self.middle = (start[:-1] + width + extra)[:n, None] + np.arange(width)
        self.column = column
        self.parameters = {name: int(start[-1]) + p for p, name in enumerate(problem.parameters)}
        self.size = int(start[-1]) + len(self.parameters)
        self.stage = np.full(self.size, n + 1, np.int32)
        self.stage[: start[-1]] = np.repeat(np.arange(n + 1), lengths)

    def position(self, ref: VariableRef | ParameterRef, nodes: Nodes) -> IntArray:
        """Positions of the reference ``ref`` at each node. (k,)

        At another frame, a two-valued quantity gives the value on the side closer to the node.
        """
        if isinstance(ref, ParameterRef):
            return np.full(len(nodes), self.parameters[ref.name])
        column = self.column[ref.name, ref.order]
        target = _half_frames(ref, nodes)
        frame = target // 2
        result = self.before[frame, column]
        if not self._single[column]:
            if ref.side:
                read_after = np.full(len(nodes), SIDES[ref.side] == AFTER)
            else:
                read_after = (target < nodes.position) | ((target == nodes.position) & (nodes.side == AFTER))
            result = np.where(read_after, self.after[frame, column], result)
        at_midpoint = (target & 1).astype(bool)
        if at_midpoint.any():
            result[at_midpoint] = self.middle[frame[at_midpoint], column]
        return result

    def reachable(self, ref: VariableRef, nodes: Nodes, reach: int = 0) -> NDArray[np.bool_]:
        """Whether ``ref``, with ``reach`` frames on either side, is within the motion. (k,)"""
        if (ref.scale, ref.shift) == (1, 0):
            target, whole = nodes.position, np.ones(len(nodes), bool)
        elif ref.scale.denominator == 1 and ref.shift.denominator == 1:
            target = _half_frames(ref, nodes)
            whole = target % 2 == 0
        else:
            exact = [ref.scale * int(p) + 2 * ref.shift for p in nodes.position]
            whole = np.array([e.denominator == 1 and e.numerator % 2 == 0 for e in exact], bool)
            target = np.array([int(e) for e in exact], np.int64)
        return whole & (target >= 2 * reach) & (target <= 2 * (self.grid.n - reach))

    def describe(self, position: int) -> tuple[str, int, float, str]:
        """(name, order, frame, side) of a decision variable; frame is -1 for a parameter."""
        for name, p in self.parameters.items():
            if p == position:
                return name, 0, -1.0, ""
        frame = int(self.stage[position])
        for side, table in (("before", self.before), ("after", self.after)):
            hit = np.flatnonzero(table[frame] == position)
            if len(hit):
                name, order = self.names[int(hit[0])]
                two = bool(self.two_valued[frame, hit[0]])
                return name, order, float(frame), side if two else ""
        name, order = self.names[int(np.flatnonzero(self.middle[frame] == position)[0])]
        return name, order, frame + 0.5, ""

    def slots(self) -> Iterator[tuple[str, int, IntArray, IntArray, IntArray]]:
        """Per (variable, order): positions before (n+1,), after (n+1,) and at midpoints (n or 0,)."""
        for (name, order), c in self.column.items():
            middle = self.middle[:, c] if self.grid.has_midpoints else np.zeros(0, np.int64)
            yield name, order, self.before[:, c], self.after[:, c], middle


def _half_frames(ref: VariableRef, nodes: Nodes) -> IntArray:
    """The place a reference means, counted in half frames; whole by construction of the nodes. (k,)"""
    if ref.scale.denominator == 1:
        return int(ref.scale) * nodes.position + int(2 * ref.shift)
    return np.array([int(ref.scale * int(p) + 2 * ref.shift) for p in nodes.position], np.int64)


__all__ = ["AFTER", "BEFORE", "Layout"]
