"""The points of a sweep, and the neighbour from which each of them starts.

The values of each constant form an axis, in increasing order; the points are all combinations.  On every axis the
values form a binary tree: its root is the value closest to the spec's own, for which the spec's guess was written, and
each remaining part is split in the middle.  A point's parent is its neighbour in one of these trees, on the axis on
which the point is at the deepest level, so that the parent is close.  The parent thus depends on the grid alone.  A
sweep over k points of one axis takes about log2(k) rounds; all points of a round can be solved at the same time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from stc.arguments import number
from stc.errors import UsageError

__all__ = ["MOST_POINTS", "Grid"]

#: A grid with more points than this is likely to be a slip: each of them takes a solve and several files.
MOST_POINTS = 100_000


class Grid:
    """All combinations of values of some constants.

    Args:
        axes: the values of each constant, in any order.
        own: the spec's own values of these constants, as far as they are known.

    Attributes:
        axes: the values of each constant in increasing order; the last axis varies fastest with the index of a point.

    Raises:
        UsageError: no constants, a constant without values, a value twice, one that is not a finite number, or more
            than :data:`MOST_POINTS` points.
    """

    def __init__(self, axes: Mapping[str, Iterable[float]], own: Mapping[str, float]) -> None:
        if not isinstance(axes, Mapping) or not axes:
            raise UsageError("a sweep needs constants with their values, such as {'g': [1.62, 3.7, 9.81]}")
        self.axes: dict[str, tuple[float, ...]] = {
            name: _values(name, values) for name, values in axes.items()
        }
        if len(self) > MOST_POINTS:
            raise UsageError(f"the grid has {len(self)} points; at most {MOST_POINTS} can be swept")
        self._trees = [_tree(values, own.get(name)) for name, values in self.axes.items()]

    def __len__(self) -> int:
        return math.prod(len(values) for values in self.axes.values())

    def constants(self, index: int) -> dict[str, float]:
        """The values of the constants at a point, by name."""
        return {name: values[at] for (name, values), at in zip(self.axes.items(), self._coordinates(index))}

    def parent(self, index: int) -> int | None:
        """The point that a point starts from; None for the root."""
        at = self._coordinates(index)
        levels = [tree[1][k] for tree, k in zip(self._trees, at)]
        axis = max(range(len(at)), key=lambda a: (levels[a], a))
        if levels[axis] == 0:
            return None
        at[axis] = self._trees[axis][0][at[axis]]
        return self._index(at)

    def rounds(self) -> list[list[int]]:
        """The points in the order of their solution; parents belong to an earlier round than their children."""
        found: dict[int, list[int]] = {}
        for index in range(len(self)):
            depth = sum(tree[1][k] for tree, k in zip(self._trees, self._coordinates(index)))
            found.setdefault(depth, []).append(index)
        return [found[depth] for depth in sorted(found)]

    def _coordinates(self, index: int) -> list[int]:
        at = []
        for values in reversed(self.axes.values()):
            index, k = divmod(index, len(values))
            at.append(k)
        return at[::-1]

    def _index(self, at: Sequence[int]) -> int:
        index = 0
        for values, k in zip(self.axes.values(), at):
            index = index * len(values) + k
        return index


def _values(name: str, given: Iterable[float]) -> tuple[float, ...]:
    """The values of one axis, checked and in order."""
    if isinstance(given, str | bytes) or not isinstance(given, Iterable):
        raise UsageError(f"the values of {name} are given as a list of numbers, not as {given!r}")
    values = sorted(number(value, f"a value of {name}") for value in given)
    if not values:
        raise UsageError(f"{name} is given no values")
    for value, following in zip(values, [*values[1:], math.inf]):
        if not math.isfinite(value):
            raise UsageError(f"a value of {name} is {value:g}; a sweep takes finite numbers")
        if value == following:
            raise UsageError(f"{name} is given the value {value:.15g} twice")
    return tuple(values)


def _tree(values: Sequence[float], own: float | None) -> tuple[list[int], list[int]]:
    """The position of the parent and the level of each value of an axis; the root is its own parent, at level 0."""
    root = len(values) // 2
    if own is not None and math.isfinite(own):
        root = min(range(len(values)), key=lambda k: abs(values[k] - own))
    parents, levels = [root] * len(values), [0] * len(values)
    halves = [(root, 0, root, 1), (root, root + 1, len(values), 1)]
    while halves:
        parent, low, high, level = halves.pop()
        if low < high:
            middle = (low + high) // 2
            parents[middle], levels[middle] = parent, level
            halves += [(middle, low, middle, level + 1), (middle, middle + 1, high, level + 1)]
    return parents, levels
