"""The tables that tell the core where everything is (``kkt`` in ``stc/core/kkt.h``)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct, ranks
from stc.solver.kkt.couplings import Couplings, sort_by_key
from stc.solver.kkt.seams import Kind, Sewn, kind_of, sew
from stc.solver.kkt.segments import ACROSS, BORDERING, LANES, Segmentation

__all__ = ["entries_by_column", "tables_of"]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]


def entries_by_column(one: Any, other: Any, source: Any, size: int) -> dict[str, Int32s]:
    """The entries that couple these unknowns, (E,) each, column by column of the lower triangle."""
    column = np.minimum(one, other).astype(np.int32)
    order, start = sort_by_key(column, size)
    row = np.maximum(one, other).astype(np.int32)
    return {
        "column": column[order], "row": row[order], "start": start, "source": source[order].astype(np.int32)
    }  # fmt: skip


def tables_of(couplings: Couplings, found: Segmentation) -> dict[str, Any]:
    """The fields of ``kkt`` that tell of segments and of the rest."""
    stages = found.stages
    kinds = [kind_of(found, number, couplings.n) for number in range(len(found.example))]
    sewn = sew(couplings, found, kinds)
    one = couplings.hess_count + couplings.jac_count + couplings.size  # where a 1 is, a -1 being behind it
    source = np.concatenate([couplings.sources, np.full(sewn.added // 2, one + 1)]).astype(np.int32)
    ends = []
    for group, before, after in zip(found.groups, sewn.before, sewn.after, strict=True):
        border = np.repeat(stages.border[kinds[group.kind].border][:, None], LANES, axis=1)
        ends.append(np.concatenate([after, before, border]).astype(np.int64))
    by_stage = np.lexsort((found.edge_code, found.edge_stage))
    first = np.searchsorted(found.edge_stage[by_stage], np.arange(stages.pointers.size))
    shapes: dict[tuple[int, int], int] = {}
    shape_rows, group_rows = [], []
    orders, pairs, stage, unknowns, sources = [], [], [], [], []
    part = np.repeat(np.arange(len(found.parts)), found.parts)
    for number, group in enumerate(found.groups):
        kind, steps = kinds[group.kind], len(group.stages)
        shape = shapes.get((group.kind, steps))
        if shape is None:
            shape = shapes[group.kind, steps] = len(shapes)
            own_pairs = np.sort(_entries_of(found, kind, group.kind, steps), axis=0)
            orders.append(np.argsort(own_pairs[0], kind="stable"))
            pairs.append(own_pairs[:, orders[-1]])
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
        sources.append(np.concatenate([fixed, entries.reshape(-1, LANES)])[orders[shape]])
    return {
        "shapes": len(shapes), "groups": len(found.groups), "parts": len(found.parts),
        "shape": _flat(shape_rows, np.int64), "group": _flat(group_rows, np.int64),
        "shape_column": _joined([own[0] for own in pairs]), "shape_row": _joined([own[1] for own in pairs]),
        "shape_stage": _joined(stage), "group_unknown": _joined(unknowns), "group_source": _joined(sources),
        **_rest_of(found, sewn, ends, source),
    }  # fmt: skip


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


def _rest_of(found: Segmentation, sewn: Sewn, ends: list[Int64s], source: Int32s) -> dict[str, Any]:
    """The matrix that is left to fronts, its unknowns being those outside of segments, and where groups' results go."""
    couplings, unknowns = sewn.couplings, sewn.outside
    count = unknowns.size
    number = np.full(couplings.size, -1, dtype=np.int64)
    number[unknowns] = np.arange(count)
    entry = np.flatnonzero((number[couplings.first] >= 0) & (number[couplings.second] >= 0))
    given = entries_by_column(
        number[couplings.first[entry]], number[couplings.second[entry]], source[entry], count
    )
    keys = given["column"].astype(np.int64) * count + given["row"]
    corners = [number[own] for own in ends]
    triangles = [np.tril_indices(len(own)) for own in ends]
    pairs = [
        np.minimum(own[a], own[b]) * count + np.maximum(own[a], own[b])
        for own, (a, b) in zip(corners, triangles, strict=True)
    ]
    filled = distinct(np.concatenate([pair.reshape(-1) for pair in pairs]))
    filled = filled[filled // count != filled % count]
    ordered = np.sort(keys)
    filled = filled[~_among(filled, ordered)]
    keys = np.concatenate([keys, filled])
    order = np.argsort(keys)
    results = []
    for pair in pairs:
        place = order[np.minimum(np.searchsorted(keys, pair, sorter=order), keys.size - 1)]
        results.append(np.where(pair // count == pair % count, pair // count, count + place))
    column, row = (
        np.concatenate([given[name], own.astype(np.int32)])
        for name, own in (("column", filled // count), ("row", filled % count))
    )
    return {
        **given, "column": column, "row": row, "total": couplings.size, "size": count,
        "variables": int(np.searchsorted(unknowns, couplings.n)), "entries": entry.size, "filled": keys.size,
        "unknown": unknowns.astype(np.int32), "stage": ranks(sewn.stage[unknowns])[0].astype(np.int32),
        "group_end": _joined(corners), "group_result": _joined(results),
    }  # fmt: skip


def _among(values: Int64s, ordered: Int64s) -> NDArray[np.bool_]:
    """Which of some values are in an array in ascending order."""
    at = np.searchsorted(ordered, values)
    return np.append(ordered, -1)[at] == values
