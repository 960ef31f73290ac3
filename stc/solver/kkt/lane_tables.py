"""The tables that tell the compiled elimination of segments where everything is (see stc.solver.kkt.lanes)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.records import dataclass
from stc.solver.kkt import lanes
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.lane_program import Kind, Program, triangle
from stc.solver.kkt.lane_runs import are_worthwhile, runs_of
from stc.solver.kkt.seams import Sewn
from stc.solver.kkt.segments import LANES, Group, Segmentation

__all__ = ["Layout", "Rest", "code_of", "lay_out"]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]


@dataclass(frozen=True)
class Rest:
    """What the segments leave: a matrix of the unknowns outside of them.

    Attributes:
        unknowns: their numbers, (R,), increasing.
        couplings: its pattern, all entries being given as those of H, which couple rows as well.
        entry, target: couplings of the whole matrix that are in it, and which entry of it they are.
        results: where the groups' results go (see ``RESULT_INDEX``), (results, LANES) each.
    """

    unknowns: Int64s
    couplings: Couplings
    entry: Int64s
    target: Int32s
    results: list[Int64s]


@dataclass(frozen=True)
class Layout:
    """What depends on the pattern alone.

    Attributes:
        index: see stc.solver.kkt.lanes; begins with the unknowns in the order of vectors: those of segments, then the
            rest.
        table: the same, complete but for what depends on the programs, (groups, FIELDS).
        places: where each unknown is in vectors, (N,); outer: where the rest begins; length: of vectors.
        matrix: numbers that the scaled entries of all segments have together.
        rest: what is left.
    """

    index: Int32s
    table: Int64s
    places: Int32s
    outer: int
    length: int
    matrix: int
    rest: Rest


class _Packed:
    """Whole numbers of many arrays, one after the other.

    Attributes:
        size: how many there are so far.
    """

    def __init__(self) -> None:
        self.size = 0
        self._parts: list[NDArray[np.integer]] = []

    def put(self, array: NDArray[np.integer]) -> int:
        """Append an array; where it begins."""
        begin = self.size
        self._parts.append(array.reshape(-1))
        self.size += array.size
        return begin

    def array(self) -> Int32s:
        """All of them, and a zero behind: there is always one to point at."""
        return np.concatenate([*self._parts, np.zeros(1, np.int32)]).astype(np.int32)


def lay_out(found: Segmentation, kinds: list[Kind], sewn: Sewn, source: Int32s, one: int) -> Layout:
    """Where the values of all segments' stages are.

    Args:
        source: place of each coupling's value among those given, (E,); one: that of a 1.
    """
    couplings = sewn.couplings
    stages = found.stages
    sources = _by_stage(found, kinds, source)
    index = _Packed()
    table = np.zeros((len(found.groups), lanes.FIELDS), dtype=np.int64)
    for row, group in zip(table, found.groups, strict=True):
        begin = stages.pointers[group.stages].astype(np.int64)
        row[lanes.UNKNOWNS] = index.put(
            stages.order[begin[:, None, :] + np.arange(kinds[group.kind].own)[:, None]]
        )
    outer = index.size
    index.put(sewn.outside)
    length = index.size
    places = np.empty(couplings.size, dtype=np.int32)
    # Other lanes than the segments' are copies of the first, which is to be the last one written.
    places[index.array()[:length][::-1]] = np.arange(length, dtype=np.int32)[::-1]
    ends = []
    matrix = 0
    for row, group, before, after in zip(table, found.groups, sewn.before, sewn.after, strict=True):
        kind = kinds[group.kind]
        at = group.stages
        border = np.repeat(stages.border[kind.border][:, None], LANES, axis=1)
        row[lanes.STEPS], row[lanes.OWN], row[lanes.SEGMENTS] = len(at), kind.own, group.segments
        row[lanes.NEXT], row[lanes.LEFT] = kind.following.size, kind.following.size
        row[lanes.BORDER] = kind.border.size
        ends.append(np.concatenate([after, before, border]).astype(np.int64))
        row[lanes.LASTS] = index.put(places[ends[-1]])
        row[lanes.ENDS] = row[lanes.LASTS] + LANES * kind.following.size
        own_sources = sources[group.kind]
        row[lanes.ENTRIES] = kind.rows.size
        order, row[lanes.ADDED] = kind.order
        of_steps = own_sources[at][..., order].transpose(0, 2, 1)
        row[lanes.ENTRY_INDEX] = index.put(of_steps)
        runs = runs_of(of_steps) if are_worthwhile(kind.rows.size, source.size) else None
        if runs is not None:
            row[lanes.RUNS] = index.put(runs)
        row[lanes.FIRST] = kind.following.size
        row[lanes.FIRST_INDEX] = index.put(np.full((kind.following.size, LANES), one))
        row[lanes.MATRIX] = matrix
        matrix += kind.following.size + len(at) * (kind.own + kind.rows.size)
    rest = _rest_of(found, sewn, ends)
    for row, results in zip(table, rest.results, strict=True):
        row[lanes.RESULT_INDEX] = index.put(results)
    return Layout(index.array(), table, places, outer, length, LANES * matrix, rest)


def _by_stage(found: Segmentation, kinds: list[Kind], source: Int32s) -> list[Int32s]:
    """Sources of the entries of all stages of each kind, (stages, entries), in the order of the codes."""
    stage_count = found.stages.pointers.size - 1
    kind_of_stage = np.full(stage_count, -1)
    for group in found.groups:
        kind_of_stage[group.stages] = group.kind
    owner = np.where(found.edge_stage >= 0, kind_of_stage[found.edge_stage], -1)
    sources = []
    for number in range(len(kinds)):
        members = np.flatnonzero(owner == number)
        place = np.searchsorted(found.codes[number], found.edge_code[members])
        table = np.zeros((stage_count, found.codes[number].size), dtype=np.int32)
        table[found.edge_stage[members], place] = source[members]
        sources.append(table)
    return sources


def _rest_of(found: Segmentation, sewn: Sewn, ends: list[Int64s]) -> Rest:
    """The pattern of what is left."""
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
    return Rest(unknowns, pattern, entry, target, results)


def _key(one: Int64s, other: Int64s, count: int) -> Int64s:
    return np.maximum(one, other) * count + np.minimum(one, other)


def code_of(table: Int64s, groups: list[Group], kinds: list[Kind], programs: list[Program]) -> Int32s:
    """What the programs determine: the rest of ``table``, and ``code``."""
    code = _Packed()
    fields: list[dict[int, int]] = []
    for kind, program in zip(kinds, programs, strict=True):
        own, near = kind.own, kind.near
        inner = np.arange(own)
        a, b = np.tril_indices(kind.size - own)
        results = triangle(own + a, own + b)
        left, moved = kind.moved
        order, added = kind.order
        rows, columns = kind.rows[order], kind.columns[order]
        places = triangle(rows, columns)
        used = program.used.copy()
        for more in (results, moved, places, triangle(inner, inner)):
            used[more] = True
        used[triangle(kind.first_rows, kind.following)] = True
        # What is stored before anything is added needs not be cleared.
        stored = np.zeros(used.size, dtype=bool)
        stored[places[added:]] = True
        # What moves leaves zeros behind.
        carried = np.zeros(used.size, dtype=bool)
        carried[left] = carried[moved] = True
        first = np.tril_indices(kind.size)[1] < near  # in the order of the triangle
        cleared = np.flatnonzero(used & first & ~stored & ~carried)
        empty = np.flatnonzero(used & (~first | carried))
        # Sorted by the unknown of U: entries inside U by the row, others by the column.
        often = np.where(rows < own, rows, columns)
        entries = np.stack([places, often, rows + columns - often], axis=1)
        across = np.stack(
            [triangle(kind.first_rows, kind.following), kind.first_rows, kind.following], axis=1
        )
        field = {
            lanes.ENTRY_CODE: code.put(entries),
            lanes.FIRST_CODE: code.put(across),
            lanes.CLEARED: cleared.size,
            lanes.CLEARED_CODE: code.put(cleared),
            lanes.EMPTY: empty.size,
            lanes.EMPTY_CODE: code.put(empty),
            lanes.MOVED: moved.size,
            lanes.MOVED_CODE: code.put(np.stack([left, moved], axis=1)),
            lanes.RESULTS: results.size,
            lanes.RESULT_CODE: code.put(results),
            lanes.FOLLOWING: code.put(kind.following),
            lanes.PANELS: len(program.panels),
            lanes.FACTOR_STEP: program.vectors,
            lanes.PANEL_CODE: code.size,
        }
        starts = np.array([code.put(panel) for panel in program.panels], dtype=np.int64)
        field[lanes.PANEL_STARTS] = code.put(starts)
        fields.append(field)
    factors = 0
    for row, group in zip(table, groups, strict=True):
        for name, value in fields[group.kind].items():
            row[name] = value
        row[lanes.FACTORS] = factors
        factors += int(row[lanes.STEPS] * row[lanes.FACTOR_STEP])
    return code.array()
