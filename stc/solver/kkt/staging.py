"""When each unknown enters the window of the elimination, when it leaves, and where it stands meanwhile.

    stage          0      1      2      3   ...
    x(0), y(0)   enters
                 leaves
    x(1)         enters leaves                  coupled with frame 0 through a row of stage 0
    parameter    enters   .      .      .   ... leaves last: a border

An unknown enters at the first stage at which any of its neighbours is eliminated and leaves at its own.  What is
in the window at one time decides the cost, so unknowns whose neighbours are spread over many later stages are
moved to the last of these, and stages themselves are renumbered when some other order has a smaller window.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct, ranks
from stc.core.functions import function
from stc.records import dataclass
from stc.solver.kkt.ordering import LEAF
from stc.solver.nlp import Ints

__all__ = ["Staging", "assign_stages"]

Int32s = NDArray[np.int32]

#: An unknown becomes part of the border when it would hold others in the window for this many times longer
#: than it would itself stay there, over at least this many stages.
BORDER_RATIO = 4
BORDER_SPAN = 8
#: When stages are renumbered, what couples with more of them than this is border.
BORDER_STAGES = 16


@dataclass(frozen=True)
class Staging:
    """Life of the unknowns (N of them) in the window.

    Attributes:
        stages: how many stages there are.
        stage: stage at which an unknown is eliminated, (N,).
        slot: place in the window, (N,).
        top: slots in use at a stage, (stages,): all are below this number.
        window: slots in use at most.
    """

    stages: int
    stage: Int32s
    slot: Int32s
    top: Int32s
    window: int


def assign_stages(stage: Ints, variables: int, first: Ints, second: Ints) -> Staging:
    """Plan the window for a symmetric sparsity pattern.

    Args:
        stage: suggested stage of each unknown, (N,), any whole numbers.
        variables: how many of the unknowns, the first ones, are variables; the others are rows.
        first, second: the two unknowns of every coupling, (E,), each unordered pair once, rows first.
    """
    stage, count = ranks(np.asarray(stage, dtype=np.int64))
    if stage.size == 0:
        nothing = np.zeros(0, dtype=np.int32)
        return Staging(0, nothing, nothing, nothing, 0)
    stage = _border(stage, first, second)
    border = _spread(stage, first, second)
    stage = _rows_last(stage, variables, border, first, second)
    stage = _parts_late(stage, border, first, second)
    entry = _entries(stage, first, second)
    load = _load(entry, stage, count)
    if load.max() > 3 * np.bincount(stage, minlength=count).max() + 64:
        other = _level_order(stage, first, second, count)
        other_entry = _entries(other, first, second)
        if (_load(other_entry, other, count) ** 2).sum() < 0.7 * (load**2).sum():
            stage, entry = other, other_entry
    kept = distinct(stage)
    stage = np.searchsorted(kept, stage)
    entry = np.searchsorted(kept, entry)
    count = kept.size

    # Those that stay longest come first and get the lowest slots: regular chains then repeat after two stages. Those
    # with few couplings come last: most are eliminated without touching their part of the window.
    degree = np.bincount(first, minlength=stage.size) + np.bincount(second, minlength=stage.size)
    key = 2 * (entry * count + (count - 1 - stage)) + (degree <= LEAF)
    entering = np.argsort(key, kind="stable").astype(np.int32)
    leaving = np.argsort(stage, kind="stable").astype(np.int32)
    slot = np.zeros(stage.size, dtype=np.int32)
    top = np.zeros(count, dtype=np.int32)
    used = np.zeros(int(_load(entry, stage, count).max()) + 1, dtype=np.int32)
    _assign_slots(count, _pointers(entry, count), entering, _pointers(stage, count), leaving, slot, top, used)
    return Staging(count, stage.astype(np.int32), slot, top, int(top.max()))


def _pointers(keys: NDArray[np.int64], count: int) -> Int32s:
    """Where each key's run starts in the sorted order, (count + 1,)."""
    return np.concatenate([[0], np.cumsum(np.bincount(keys, minlength=count))]).astype(np.int32)


def _entries(stage: NDArray[np.int64], first: Ints, second: Ints) -> NDArray[np.int64]:
    """First stage at which an unknown or one of its neighbours is eliminated, (N,)."""
    entry = stage.copy()
    np.minimum.at(entry, first, stage[second])
    np.minimum.at(entry, second, stage[first])
    return entry


def _load(entry: NDArray[np.int64], stage: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """How many unknowns are in the window at each stage, (count,)."""
    change = (
        np.bincount(entry, minlength=count + 1) - np.bincount(stage + 1, minlength=count + 1)[: count + 1]
    )
    return np.cumsum(change)[:count].astype(np.float64)


def _border(stage: NDArray[np.int64], first: Ints, second: Ints) -> NDArray[np.int64]:
    """Postpone unknowns that couple with many, much later ones."""
    for _ in range(2):
        last = stage.copy()
        np.maximum.at(last, first, stage[second])
        np.maximum.at(last, second, stage[first])
        span = last - stage
        if span.max(initial=0) < BORDER_SPAN:
            break
        forward = stage[first] < stage[second]
        earlier, later = np.where(forward, first, second), np.where(forward, second, first)
        # What belongs to the border itself, parameters say, is in the window all the time and nobody holds it there.
        apart = np.where(_spread(stage, first, second)[later], 0, stage[later] - stage[earlier] - 1)
        held = np.bincount(earlier, weights=np.maximum(apart, 0), minlength=stage.size)
        moved = (span >= BORDER_SPAN) & (held > BORDER_RATIO * span)
        if not moved.any():
            break
        stage = np.where(moved, last, stage)
    return stage


def _spread(stage: NDArray[np.int64], first: Ints, second: Ints) -> NDArray[np.bool_]:
    """Unknowns that couple with many others at distant stages, (N,)."""
    distance = np.abs(stage[first] - stage[second])
    span = np.zeros(stage.size, dtype=np.int64)
    np.maximum.at(span, first, distance)
    np.maximum.at(span, second, distance)
    total = np.bincount(first, distance, stage.size) + np.bincount(second, distance, stage.size)
    border: NDArray[np.bool_] = (span >= BORDER_SPAN) & (total > 4 * BORDER_RATIO * span)
    return border


def _rows_last(
    stage: NDArray[np.int64], variables: int, border: NDArray[np.bool_], first: Ints, second: Ints
) -> NDArray[np.int64]:
    """Eliminate rows along with the last of their variables, the border aside.

    At an earlier stage a row without diagonal may find no variable left to pair with.
    """
    inner = (first >= variables) & ~border[second]
    last = np.full(stage.size, -1, dtype=np.int64)
    np.maximum.at(last, first[inner], stage[second[inner]])
    return np.where((last >= 0) & ~border, last, stage)


def _parts_late(
    stage: NDArray[np.int64], border: NDArray[np.bool_], first: Ints, second: Ints
) -> NDArray[np.int64]:
    """Move parts of a stage that couple with later stages only to the first of these.

    Such parts, midpoints of collocation say, need not be in the window earlier, and find more to pair with later.
    """
    outside = np.iinfo(np.int64).max
    kept = ~(border[first] | border[second])
    first, second = first[kept], second[kept]
    part = np.arange(stage.size, dtype=np.int32)
    within = stage[first] == stage[second]
    _join(int(within.sum()), np.ascontiguousarray(first[within]), np.ascontiguousarray(second[within]), part)
    _flatten(part.size, part)
    neighbour = np.full(stage.size, outside)
    across = ~within
    for one, other in ((first[across], second[across]), (second[across], first[across])):
        np.minimum.at(neighbour, part[one], stage[other])
    stages = int(stage.max()) + 1
    whole = np.bincount(stage, minlength=stages)[stage] == np.bincount(part, minlength=stage.size)[part]
    target = neighbour[part]
    return np.where((target > stage) & (target < outside) & ~whole & ~border, target, stage)


def _level_order(stage: NDArray[np.int64], first: Ints, second: Ints, count: int) -> NDArray[np.int64]:
    """Renumber stages by their distance from an end of their graph (Cuthill and McKee 1969).

    Unknowns that couple with many stages, the border, are left out of the graph and placed last.
    """
    links = np.concatenate([first * count + stage[second], second * count + stage[first]])
    unknown = distinct(links) // count
    border = np.bincount(unknown, minlength=stage.size) > BORDER_STAGES
    inner = ~(border[first] | border[second])
    ends = np.stack([stage[first[inner]], stage[second[inner]]])
    pairs = distinct(np.concatenate([ends[0] * count + ends[1], ends[1] * count + ends[0]]))
    source, target = pairs // count, (pairs % count).astype(np.int32)
    pointers = _pointers(source, count)
    level = np.zeros(count, dtype=np.int32)
    _levels(count, pointers, target, level, np.zeros(count, dtype=np.int32))
    renumbered = level[stage].astype(np.int64)
    renumbered[border] = count - 1
    return renumbered


#: Unite the parts of each pair; a part is known by its smallest member.
_join = function("arranging_join")
_flatten = function("arranging_flatten")

#: Breadth-first levels; each component starts from a node at the far end of a first search, after the last.
_levels = function("arranging_levels")
#: Give each unknown the lowest free slot when it enters, and free it after its stage.
_assign_slots = function("arranging_assign_slots")
