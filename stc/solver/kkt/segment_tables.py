"""The tables that tell the compiled elimination of segments where everything is (``batch`` in ``stc/core/batch.h``)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.records import dataclass
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.seams import Kind, Sewn
from stc.solver.kkt.segments import ACROSS, BORDERING, LANES, Segmentation

__all__ = ["Rest", "tables_of"]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]


@dataclass(frozen=True)
class Rest:
    """What the segments leave: a matrix of the unknowns outside of them.

    Attributes:
        unknowns: their numbers, (R,), increasing.
        couplings: its pattern, all entries being given as those of H, which couple rows as well.
        entry, target: couplings of the whole matrix that are in it, and which entry of it they are.
        number: which of them each unknown of the whole matrix is, or -1.
        results: where the groups' results go (see ``batch``), (results, LANES) each.
    """

    unknowns: Int64s
    couplings: Couplings
    entry: Int64s
    target: Int32s
    number: Int64s
    results: list[Int64s]


def tables_of(
    couplings: Couplings, found: Segmentation, kinds: list[Kind], sewn: Sewn, one: int
) -> tuple[dict[str, Any], Rest]:
    """Fields of ``batch`` that tell of the segments and of the rest; and the rest.

    Args:
        one: place of a 1 among the numbers given, a -1 being behind it.
    """
    stages = found.stages
    source = np.concatenate(
        [couplings.hess_off, couplings.hess_count + np.arange(couplings.jac_count), np.full(sewn.added // 2, one + 1)]
    ).astype(np.int32)  # fmt: skip
    ends = []
    for group, before, after in zip(found.groups, sewn.before, sewn.after, strict=True):
        border = np.repeat(stages.border[kinds[group.kind].border][:, None], LANES, axis=1)
        ends.append(np.concatenate([after, before, border]).astype(np.int64))
    rest = _rest_of(found, sewn, ends)
    by_stage = np.lexsort((found.edge_code, found.edge_stage))
    first = np.searchsorted(found.edge_stage[by_stage], np.arange(stages.pointers.size))
    shapes: dict[tuple[int, int], int] = {}
    shape_rows, group_rows = [], []
    pairs, stage, unknowns, sources = [], [], [], []
    part = np.repeat(np.arange(len(found.parts)), found.parts)
    for number, group in enumerate(found.groups):
        kind, steps = kinds[group.kind], len(group.stages)
        shape = shapes.get((group.kind, steps))
        if shape is None:
            shape = shapes[group.kind, steps] = len(shapes)
            pairs.append(_entries_of(found, kind, group.kind, steps))
            order = kind.order(steps)
            own_stage = np.full(len(order) + len(ends[number]), -1)
            own_stage[: len(order)] = order // kind.own
            stage.append(own_stage)
            shape_rows.append(
                [steps * kind.own, steps * kind.variables, len(ends[number]), pairs[-1].shape[1]]
            )
        group_rows.append([shape, group.segments, part[number]])
        begin = stages.pointers[group.stages].astype(np.int64)
        all_own = stages.order[begin[:, None, :] + np.arange(kind.own)[:, None]].reshape(-1, LANES)
        unknowns.append(all_own[kind.order(steps)])
        count = found.codes[group.kind].size
        entries = source[by_stage[first[group.stages][:, None, :] + np.arange(count)[:, None]]]
        fixed = np.full((kind.following.size, LANES), one)
        sources.append(np.concatenate([fixed, entries.reshape(-1, LANES)]))
    tables = {
        "shapes": len(shapes), "groups": len(found.groups), "parts": len(found.parts),
        "shape": _flat(shape_rows, np.int64), "group": _flat(group_rows, np.int64),
        "one": _joined([own[0] for own in pairs]), "other": _joined([own[1] for own in pairs]),
        "stage": _joined(stage), "unknown": _joined(unknowns), "source": _joined(sources),
        "end": _joined([rest.number[own] for own in ends]), "result": _joined(rest.results),
        "rest": rest.unknowns.size, "rest_entries": rest.entry.size, "rest_variables": rest.couplings.n,
        "rest_filled": rest.couplings.hess_count, "rest_unknown": _joined([rest.unknowns]),
        "rest_first": _joined([rest.number[sewn.couplings.first[rest.entry]]]),
        "rest_second": _joined([rest.number[sewn.couplings.second[rest.entry]]]),
        "rest_source": _joined([source[rest.entry]]), "rest_target": _joined([rest.target]),
    }  # fmt: skip
    return tables, rest


def _flat(rows: list[list[int]], dtype: Any) -> NDArray[Any]:
    return np.array(rows, dtype=dtype).reshape(-1)


def _joined(parts: list[NDArray[Any]]) -> Int32s:
    """All of them, and a zero behind: there is always one to point at."""
    return np.concatenate([*(part.reshape(-1) for part in parts), [0]]).astype(np.int32)


def _entries_of(found: Segmentation, kind: Kind, number: int, steps: int) -> Int64s:
    """The two unknowns of each entry of a segment, (2, entries): those with the seam before it, then step by step."""
    codes, base, own = found.codes[number], found.base, kind.own
    types, i, j = codes // base**2, codes // base % base, codes % base
    place = np.empty(steps * own, dtype=np.int64)
    place[kind.order(steps)] = np.arange(steps * own)
    width = kind.following.size
    step = np.arange(steps)[:, None] * own
    one = place[step + i]
    other = place[np.minimum(step + j + own * (types == ACROSS), steps * own - 1)]
    last = steps * own + np.searchsorted(kind.following, j[types == ACROSS])
    other[-1, types == ACROSS] = last
    border = types == BORDERING
    other[:, border] = steps * own + 2 * width + np.searchsorted(kind.border, j[border])
    before = np.stack([place[kind.following], steps * own + width + np.arange(width)])
    return np.concatenate([before, np.stack([one.reshape(-1), other.reshape(-1)])], axis=1)


def _rest_of(found: Segmentation, sewn: Sewn, ends: list[Int64s]) -> Rest:
    """The matrix that is factorised after the segments: its unknowns, its pattern, and where their results go."""
    couplings, unknowns = sewn.couplings, sewn.outside
    size = couplings.size
    number = np.full(size, -1, dtype=np.int64)
    number[unknowns] = np.arange(unknowns.size)
    count = unknowns.size
    variables = int(np.searchsorted(unknowns, couplings.n))
    entry = np.flatnonzero((number[couplings.first] >= 0) & (number[couplings.second] >= 0))
    pairs = [_key(number[couplings.first[entry]], number[couplings.second[entry]], count)]
    corners = []
    for group, own in zip(found.groups, ends, strict=True):
        a, b = np.tril_indices(len(own))
        corners.append((number[own[a]], number[own[b]], np.arange(LANES) < group.segments))
        pairs.append(_key(*corners[-1][:2], count)[:, : group.segments].reshape(-1))
    keys = distinct(np.concatenate(pairs))
    keys = keys[keys // count != keys % count]
    none = np.zeros(0, dtype=np.intp)
    pattern = Couplings(
        variables, count - variables, (keys // count).astype(np.int32), (keys % count).astype(np.int32),
        np.arange(keys.size), none, none.astype(np.int32), keys.size, 0,
    )  # fmt: skip
    results = []
    for one, other, real in corners:
        diagonal = keys.size + one
        # The diagonal of rows is given with its sign changed.
        diagonal = np.where(one < variables, diagonal, -1 - diagonal)
        place = np.where(one == other, diagonal, np.searchsorted(keys, _key(one, other, count)))
        results.append(np.where(real, place, 0))
    target = np.searchsorted(keys, pairs[0]).astype(np.int32)
    return Rest(unknowns, pattern, entry, target, number, results)


def _key(one: Int64s, other: Int64s, count: int) -> Int64s:
    return np.maximum(one, other) * count + np.minimum(one, other)
