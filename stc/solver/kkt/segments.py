"""Where a horizon repeats itself: runs of stages with the same pattern, cut into segments of equal length.

    stage    0 1 | 2 3 4 | 5 6 7 | 8 9 10 | 11 ...
                 |  lane |  lane |  lane  |
            rest seam 0 seam 1  seam  2   rest

Segments are sewn together by unknowns of their own (see stc.solver.kkt.seams), so that each of them couples with the
seams alone, or with a stage left out, and with unknowns of the last stage group (parameters) and others that couple
with many stages, the border.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import ranks
from stc.core.functions import function
from stc.records import dataclass
from stc.solver.kkt.couplings import Couplings, sort_by_key

__all__ = [
    "Group",
    "Numbered",
    "Segmentation",
    "Stages",
    "find_segments",
    "number_stages",
]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]

#: Segments that are eliminated at once.
LANES = 8
#: Stages of a segment at least.
SHORTEST = 3
#: Unknowns that couple with distant stages at most.
LARGEST_BORDER = 64
#: Couplings at most for each unknown of a stage. Fronts grow with this number, and wide ones do well one by one: with
#: 3.5 to 5.2, segments take 0.84 to 0.91 of the time, with 6 to 7 as long, with 7.5 and 9 1.1 and 1.3 times as long.
DENSEST = 6.0
#: A step of eight segments takes as long as a stage of the rest, about, and once more for so many unknowns of a stage:
#: there are more rows, and wide ones do well in the rest, too.
STEP_GROWTH = 80.0
#: A seam takes this many times as long as a stage of the rest, about.
SEAM_COST = 0.5
#: Segments should cost this much less than their stages would in the rest.
WORTH = 0.8
#: Groups are even in number, so that two threads can share them, where that costs no more than this share of all; of
#: what a factorisation costs, less than this, in steps times the square of the unknowns of a stage, is not shared (a
#: third of a millisecond on a machine of 2022), nor where the smaller part is less than so much of all.
EVENING = 0.015
SHARED = 5e4
SMALLER_PART = 0.25
#: Kinds of codes of entries: inside a stage, with the next stage, with the border, on the diagonal of H; variables
#: that are held. Without these, a segment that begins right before a waypoint has a matrix without inverse.
INSIDE, ACROSS, BORDERING, CURVED, HELD = range(5)


@dataclass(frozen=True)
class Stages:
    """Unknowns by stage.

    Attributes:
        stage: of each unknown, (N,), numbered without gaps.
        order, pointers: unknowns by stage, those of a stage by number, (N,) and (stages + 1,).
        local: place of each unknown in its stage, (N,).
        border: unknowns that couple with distant stages; they make their own stage irregular.
    """

    stage: Int32s
    order: Int32s
    pointers: Int32s
    local: Int32s
    border: Int32s


@dataclass(frozen=True)
class Numbered:
    """Stages, and what they have in common.

    Attributes:
        edge_stage: stage to which each coupling belongs, the earlier of two, -1 for those inside the border, (E,).
        edge_code: what is the same for all stages of a kind (see ``_codes``), (E,); ``base`` decodes them:
            ``code = (type * base + i) * base + j``.
        features: unknowns, variables, couplings and two sums of codes, equal for stages of a kind, (5, stages).
        irregular: stages with unknowns of the border, (stages,).
    """

    stages: Stages
    edge_stage: Int32s
    edge_code: Int64s
    base: int
    features: Int64s
    irregular: NDArray[np.bool_]


@dataclass(frozen=True)
class Group:
    """Up to eight segments of one kind.

    Attributes:
        kind: number of the kind.
        stages: (steps, LANES); lanes beyond ``segments`` repeat the first one.
    """

    kind: int
    stages: Int64s
    segments: int


@dataclass(frozen=True)
class Segmentation:
    """All groups.

    Attributes:
        example: one stage of each kind.
        codes: entries of a stage of each kind, sorted (see ``_codes``); ``base`` decodes them:
            ``code = (type * base + i) * base + j``.
        edge_stage: stage to which each coupling belongs, -1 for those of the rest, (E,); edge_code, (E,).
        interior: stages that are eliminated, (stages,).
        parts: how many groups belong to the first part of the horizon, and to a second one, if there are two.
    """

    stages: Stages
    groups: list[Group]
    example: list[int]
    codes: list[Int64s]
    base: int
    edge_stage: Int32s
    edge_code: Int64s
    interior: NDArray[np.bool_]
    parts: tuple[int, ...]


def number_stages(
    couplings: Couplings, suggested: Int64s, held: NDArray[np.bool_] | None = None
) -> Numbered | None:
    """Number stages and the unknowns of each, and find out what stages have in common.

    None where there are too few for any two of them to be alike, or where too much couples with distant ones.

    Args:
        suggested: stage of each unknown, (N,), any whole numbers.
        held: variables that never move, (n,); a stage is only like others that hold the same ones.
    """
    size, first, second = couplings.size, couplings.first, couplings.second
    if size == 0:
        return None
    numbers, count = ranks(suggested)
    if count < 2 * LANES:
        return None
    stage = numbers.astype(np.int32)
    far, flagged, ahead, behind = (np.zeros(size, dtype=np.int32) for _ in range(4))
    _flag_border(first.size, first, second, stage, far, flagged, ahead, behind)
    border = np.flatnonzero(flagged).astype(np.int32)
    if border.size > LARGEST_BORDER:
        return None
    # What a stage passes on to the next is to be little.
    if np.count_nonzero(behind) > np.count_nonzero(ahead):
        stage = (stage + (ahead > behind)).astype(np.int32)
    stages = int(stage.max()) + 1
    order, pointers = sort_by_key(stage, stages)
    widest = int(np.diff(pointers).max())
    local = np.empty(size, dtype=np.int32)
    local[order] = np.arange(size, dtype=np.int32) - pointers[stage[order]]
    number = np.full(size, -1, dtype=np.int32)
    number[border] = np.arange(border.size, dtype=np.int32)
    base = max(widest, border.size) + 1
    edge_stage, edge_code = np.empty(first.size, dtype=np.int32), np.empty(first.size, dtype=np.int64)
    sums = np.zeros(2 * stages, dtype=np.int64)
    _codes(first.size, first, second, stage, local, number, base, edge_stage, edge_code, sums)
    curved = couplings.hess_variable
    _own_codes(CURVED, curved.size, curved, stage, local, base, sums)
    if held is not None:
        fixed = np.flatnonzero(held).astype(np.int32)
        _own_codes(HELD, fixed.size, fixed, stage, local, base, sums)
    variables = np.bincount(stage[: couplings.n], minlength=stages)
    coupled = np.bincount(edge_stage[edge_stage >= 0], minlength=stages)
    features = np.stack([np.diff(pointers), variables, coupled, sums[0::2], sums[1::2]])
    irregular = np.zeros(stages, dtype=bool)
    irregular[stage[border]] = True
    return Numbered(
        Stages(stage, order, pointers, local, border), edge_stage, edge_code, base, features, irregular
    )


def find_segments(numbered: Numbered) -> Segmentation | None:
    """Cut the horizon, or None where too little of it repeats."""
    features, irregular = numbered.features, numbered.irregular
    stages, edge_stage, edge_code = numbered.stages, numbered.edge_stage, numbered.edge_code
    changes = np.any(features[:, 1:] != features[:, :-1], axis=0) | irregular[1:] | irregular[:-1]
    starts = np.concatenate([[0], np.flatnonzero(changes) + 1])
    lengths = np.diff(np.concatenate([starts, [irregular.size]]))
    groups, example = _cut(starts, lengths, features)
    if not groups:
        return None
    groups, parts = _shared_out(groups, features)
    interior = np.zeros(irregular.size, dtype=bool)
    for group in groups:
        interior[group.stages] = True
    codes = []
    for stage_of_kind in example:
        own = np.sort(edge_code[edge_stage == stage_of_kind])
        codes.append(own)
    return Segmentation(stages, groups, example, codes, numbered.base, edge_stage, edge_code, interior, parts)


def _shared_out(groups: list[Group], features: Int64s) -> tuple[list[Group], tuple[int, ...]]:
    """The groups part by part, and how many each part has: two of about the same cost, or one."""
    costs = [len(group.stages) * float(features[0, group.stages[0, 0]]) ** 2 for group in groups]
    parts: tuple[list[int], list[int]] = [], []
    loads = [0.0, 0.0]
    for number in sorted(range(len(groups)), key=lambda number: -costs[number]):
        part = int(loads[1] < loads[0])
        parts[part].append(number)
        loads[part] += costs[number]
    if sum(loads) < SHARED or min(loads) < SMALLER_PART * sum(loads):
        return groups, (len(groups),)
    return [groups[number] for part in parts for number in sorted(part)], (len(parts[0]), len(parts[1]))


def _cut(starts: Int64s, lengths: Int64s, features: Int64s) -> tuple[list[Group], list[int]]:
    """Groups of segments of the runs of stages, and a stage of each kind."""
    groups: list[Group] = []
    example: list[int] = []
    width, _, coupled = features[:3, starts]
    waiting = np.flatnonzero((lengths > SHORTEST) & (coupled <= DENSEST * width))
    known: dict[bytes, list[int]] = {}
    for run in waiting:
        known.setdefault(features[:, starts[run]].tobytes(), []).append(int(run))
    for runs in known.values():
        width = int(features[0, starts[runs[0]]])
        first = len(groups)
        for together in _shared(runs, lengths, width):
            cost, span = _span(lengths[together], width)
            if cost > WORTH * lengths[together].sum():
                continue
            begins = np.concatenate(
                [starts[run] + 1 + span * np.arange((lengths[run] - 1) // span) for run in together]
            )
            for at in range(0, begins.size, LANES):
                chosen = begins[at : at + LANES]
                all_lanes = np.concatenate([chosen, np.repeat(chosen[:1], LANES - chosen.size)])
                groups.append(Group(len(example), np.arange(span)[:, None] + all_lanes, chosen.size))
        if len(groups) > first:
            example.append(int(groups[first].stages[0, 0]))
    return groups, example


def _shared(runs: list[int], lengths: Int64s, width: int) -> list[list[int]]:
    """Which runs of one kind have segments of equal length: all, but for those that do better on their own."""
    together: list[int] = runs
    alone: list[list[int]] = []
    cost = _span(lengths[together], width)[0]
    for run in sorted(runs, key=lambda run: -lengths[run]):
        others = [other for other in together if other != run]
        if not others or lengths[run] <= LANES * SHORTEST:
            break
        rest = _span(lengths[others], width)[0]
        if rest + _span(lengths[[run]], width)[0] < cost:
            together, alone, cost = others, [*alone, [run]], rest
    return [together, *alone]


def _span(lengths: Int64s, width: int) -> tuple[float, int]:
    """The best length of the segments of some runs whose stages have ``width`` unknowns, and its cost before it."""
    steps = np.arange(SHORTEST, max(int(lengths.max()), SHORTEST + 1))
    counts = (lengths[:, None] - 1) // steps
    left = lengths.sum() - (counts * steps).sum(axis=0)
    segments = counts.sum(axis=0)
    step_cost = 1.0 + width / STEP_GROWTH
    groups = -(-segments // LANES)
    cost = groups * steps * step_cost + left + SEAM_COST * segments
    best = int(np.argmin(cost))
    even = int(np.argmin(np.where(groups % 2 == 0, cost, np.inf)))
    if cost[even] <= (1.0 + EVENING) * cost[best]:
        best = even
    return float(cost[best]), int(steps[best])


#: Mark, of each two unknowns that are more than a stage apart, the one with more such couplings.
_flag_border = function("arranging_flag_border")
#: Stage and code of each coupling: the earlier stage, and what is the same for all stages of a kind.
_codes = function("arranging_codes")
#: The same for what concerns variables alone.
_own_codes = function("arranging_own_codes")
