"""An earlier solution's multipliers on other frames, statement by statement.

Frames are aligned phase by phase (see :mod:`stc.guesses.alignment`).  The multipliers of a statement on a range of
frames are a density in time: each of its rows has the share of the time around its node, so that twice as many rows
have half the multiplier each.  A statement on a single frame, and the link of a step (whose multiplier is the
costate), have values of their own that do not depend on the step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.guesses.alignment import Alignment
from stc.records import dataclass
from stc.solution import MultiplierBlock, Solution
from stc.transcription.bind import BoundProgram
from stc.transcription.grid import AFTER, BEFORE, IntArray, Nodes
from stc.transcription.multipliers import bound_nodes, rows_by_statement
from stc.transcription.statements import LINK
from stc.transcription.transcription import LARGEST_KEPT, Transcription

FloatArray = NDArray[np.float64]

#: How far, as a share of the motion, the two sides of a jump are held apart for interpolation.
APART = 1e-9

#: Ways from one motion to another that are known for each.
KEPT = 4

SAME, MOST_OFF = 0.2, 1e3
"""Objectives whose logarithms differ by less than the first count as equal; ratios above the second are ignored.
"""


def resample_multipliers(
    solution: Solution,
    transcription: Transcription,
    bound: BoundProgram,
    lengths: FloatArray,
    alignment: Alignment,
) -> tuple[FloatArray, FloatArray]:
    """Multipliers of rows (m,) and bounds (size,) that follow an earlier solution's; 0 for statements that it does not
    have.

    Args:
        bound: the program to start, its ``x0`` following the same solution.
        lengths: (n,) duration of every step there.
        alignment: which frames of the solution are which there.
    """
    row_count = transcription.program.row_count
    if not transcription.grid.n or not solution.n or not solution.multipliers:
        return np.zeros(row_count), np.zeros(transcription.program.size)
    values = np.concatenate([block.values for block in solution.multipliers])
    way = _way_of(solution, transcription, bound, alignment)
    found = way.follow(values, np.diff(solution.time), lengths)
    found *= _objective_ratio(solution, bound)
    return found[:row_count], found[row_count:]


def _objective_ratio(solution: Solution, bound: BoundProgram) -> float:
    """The ratio of the new objective to the old one: a plain sum grows with the number of frames."""
    objective, _ = bound.values(bound.x0)
    ratio = objective / solution.objective if solution.objective else 1.0
    return ratio if 1.0 / MOST_OFF < ratio < MOST_OFF and abs(np.log(ratio)) > SAME else 1.0


def _of_owners(several: NDArray[np.bool_], owner: IntArray) -> NDArray[np.bool_]:
    """Which of some rows belong to relations on several frames; the last entry is for those without relation. (k,)"""
    return several[np.where(owner == LINK, len(several) - 1, owner)]


def occurrence(nodes: Nodes) -> IntArray:
    """The number of earlier entries at the same node; entries are in order of time. (k,)"""
    code = 4 * nodes.position + nodes.side
    first = np.searchsorted(code, code, side="left")
    return np.arange(len(code)) - first


@dataclass(frozen=True, slots=True)
class _Weights:
    """The time that each of some nodes stands for, from the durations of steps.

    It is ``share`` of that of step ``left`` where there is ``before``, and of step ``right`` where there is ``after``.
    Everything has the shape (k,).
    """

    share: FloatArray
    left: IntArray
    before: FloatArray
    right: IntArray
    after: FloatArray

    @classmethod
    def of(cls, nodes: Nodes, n: int) -> _Weights:
        """The weights of the trapezoid rule, or of Simpson's rule with midpoints, in a motion of n steps."""
        frame, middle = nodes.frame, nodes.is_midpoint
        edge = 1.0 / 6.0 if middle.any() else 0.5
        return cls(
            np.where(middle, 4.0 / 6.0, edge),
            np.clip(frame - 1, 0, n - 1),
            1.0 * (~middle & (frame > 0) & (nodes.side != AFTER)),
            np.clip(frame, 0, n - 1),
            1.0 * (middle | ((frame < n) & (nodes.side != BEFORE))),
        )

    @classmethod
    def joined(cls, parts: list[_Weights]) -> _Weights:
        """The nodes of several lists, one list after the other."""
        return cls(
            np.concatenate([part.share for part in parts]),
            np.concatenate([part.left for part in parts]),
            np.concatenate([part.before for part in parts]),
            np.concatenate([part.right for part in parts]),
            np.concatenate([part.after for part in parts]),
        )

    def among(self, which: NDArray[np.bool_] | IntArray) -> _Weights:
        """The entries of some of the nodes."""
        return _Weights(
            self.share[which], self.left[which], self.before[which], self.right[which], self.after[which]
        )

    def __call__(self, lengths: FloatArray) -> FloatArray:
        """The times, for durations (n,) of the steps. (k,)"""
        sum_ = self.before * lengths[self.left] + self.after * lengths[self.right]
        return np.maximum(self.share * sum_, 1e-300)


def _shares(nodes: Nodes, n: int, alignment: Alignment | None = None) -> FloatArray:
    """The place of each node in the motion of n steps, from 0 to 1; with an alignment, its place in the old motion.
    (k,)
    """
    frame = 0.5 * nodes.position
    frame = frame if alignment is None else alignment.to_new(frame)
    aside = np.where(nodes.side == BEFORE, -APART, np.where(nodes.side == AFTER, APART, 0.0))
    return frame / n + aside


@dataclass(frozen=True, slots=True)
class _Strand:
    """One row of a statement along the earlier motion: the positions of its multipliers, and their places in the new
    motion.

    ``place`` (k,) and ``share`` (k,), from 0 to 1; ``key`` is equal where the shares are.
    """

    place: IntArray
    share: FloatArray
    key: bytes


@dataclass(frozen=True, slots=True)
class _Way:
    """The computation of multipliers of one motion from those of another, for any numbers.

    Attributes:
        known_by: all its inputs except the bounds.
        bounds: bounds of the program to start.
        old: time of each of the old multipliers.
        new: time of each new multiplier computed by density.
        dense: indices of those, among the entries below.
        target: index of each entry, rows and then bounds.
        left, right: the old multipliers on either side; those per unit of time follow all others.
        part: its position between the two.
        beside: whether it is at the right one.
        size: numbers of rows and bounds.
    """

    known_by: tuple[object, ...]
    bounds: object
    old: _Weights
    new: _Weights
    dense: IntArray
    target: IntArray
    left: IntArray
    right: IntArray
    part: FloatArray
    beside: NDArray[np.bool_]
    size: int

    def follow(self, values: FloatArray, old_lengths: FloatArray, new_lengths: FloatArray) -> FloatArray:
        """Linear between the old multipliers (k,), where dense those per unit of time; 0 where there are none.

        They are 0 beside a node without a multiplier: a multiplier of a single frame belongs to that frame.
        """
        both = np.concatenate([values, values / self.old(old_lengths)])
        after, before = both[self.right], both[self.left]
        between = before + self.part * (after - before)
        between[(after == 0.0) | (before == 0.0)] = 0.0
        entries = np.where(self.beside, after, between)
        entries[self.dense] *= self.new(new_lengths)
        found = np.zeros(self.size)
        found[self.target] = entries
        return found


def _way_of(
    solution: Solution, transcription: Transcription, bound: BoundProgram, alignment: Alignment
) -> _Way:
    """The computation for a solution and a program; the last ones are cached."""
    nodes = [(b.kind, b.label, b.nodes.tobytes(), b.sides.tobytes()) for b in solution.multipliers]
    known_by = solution.n, alignment.old.tobytes(), alignment.new.tobytes(), *nodes
    ways: list[_Way] = transcription.remembered("ways of multipliers", lambda _: [])
    for way in ways:
        if way.bounds is bound.bounds and way.known_by == known_by:
            return way
    way = _new_way(known_by, solution, transcription, bound, alignment)
    if bound.n + bound.m <= LARGEST_KEPT:
        ways[:] = [way, *ways[: KEPT - 1]]
    return way


def _new_way(
    known_by: tuple[object, ...],
    solution: Solution,
    transcription: Transcription,
    bound: BoundProgram,
    alignment: Alignment,
) -> _Way:
    n, program = transcription.grid.n, transcription.program
    several = np.array([r.range.first < r.range.last for r in transcription.problem.relations] + [False])
    before = _Before(alignment, n, solution)
    after = _After(n, before.count)
    for (kind, label), (nodes, ids, owner) in rows_by_statement(transcription).items():
        strands = before.strands.get((kind, label), [])
        if not strands:
            continue
        turn = occurrence(nodes)
        wide = _of_owners(several, owner)
        for k, strand in enumerate(strands):
            mine = turn == k
            density = np.full(mine.sum(), k > 0) if kind == "link" else wide[mine]
            after.add(strand, nodes[mine], density, ids[mine])
    for label, nodes, position in bound_nodes(transcription):
        strands = before.strands.get(("bound", label), [])
        if strands:
            owner = np.maximum(bound.bounds.lower_from[position], bound.bounds.upper_from[position])
            wide = _of_owners(several, owner) & (len(nodes) > 1)
            after.add(strands[0], nodes, wide, program.row_count + position)
    target, left, right, part, beside, dense = after.joined()
    new = _Weights.joined(after.weights)
    size = program.row_count + program.size
    return _Way(known_by, bound.bounds, before.weights, new, dense, target, left, right, part, beside, size)


class _Before:
    """The rows of the earlier motion.

    Most statements stand on the same nodes: where these are in the motion is found once.

    Attributes:
        strands: by statement, one for every row that it has on a node.
        weights: time that the multipliers of all blocks stand for.
        count: the number of these.
    """

    def __init__(self, alignment: Alignment, n: int, solution: Solution) -> None:
        self._alignment, self._n, self._old_n = alignment, n, solution.n
        self._known: dict[bytes, tuple[FloatArray, bytes, _Weights]] = {}
        self.strands: dict[tuple[str, str], list[_Strand]] = {}
        self.count = 0
        weights: list[_Weights] = []
        for block in solution.multipliers:
            self.strands[block.kind, block.label] = self._of_block(block, weights)
            self.count += len(block.values)
        self.weights = _Weights.joined(weights)

    def _of_block(self, block: MultiplierBlock, weights: list[_Weights]) -> list[_Strand]:
        nodes = Nodes(
            np.rint(2.0 * block.nodes).astype(np.int64),
            np.array([0, AFTER, BEFORE])[block.sides.astype(int)],
        )
        turn = occurrence(nodes)
        rows = [np.flatnonzero(turn == k) for k in range(int(turn.max(initial=-1)) + 1)]
        found = []
        parts: list[_Weights] = []
        for own in rows:
            share, key, part = self._places(nodes[own])
            found.append(_Strand(self.count + own, share, key))
            parts.append(part)
        if len(parts) == 1:
            weights.extend(parts)
        elif parts:
            weights.append(_Weights.joined(parts).among(np.argsort(np.concatenate(rows))))
        return found

    def _places(self, nodes: Nodes) -> tuple[FloatArray, bytes, _Weights]:
        key = nodes.key()
        if key not in self._known:
            share = _shares(nodes, self._n, self._alignment)
            self._known[key] = share, share.tobytes(), _Weights.of(nodes, self._old_n)
        return self._known[key]


class _After:
    """The computation of multipliers of the new motion; neighbours are found once for all statements on the same nodes.

    Attributes:
        weights: time that those found by density stand for.
    """

    def __init__(self, n: int, count: int) -> None:
        self._n, self._count = n, count
        self._known: dict[tuple[bytes, bytes], tuple[IntArray, IntArray, FloatArray, NDArray[np.bool_]]] = {}
        self._times: dict[bytes, _Weights] = {}
        none = np.zeros(0, np.int64)
        self._entries: list[tuple[NDArray[np.generic], ...]] = [
            (none, none, none, np.zeros(0), np.zeros(0, bool), np.zeros(0, bool))
        ]
        self.weights: list[_Weights] = [_Weights.of(Nodes(none, none), n)]

    def add(self, strand: _Strand, nodes: Nodes, density: NDArray[np.bool_], target: IntArray) -> None:
        """Let multipliers at ``nodes`` follow a strand, where ``density`` (len(nodes),) is True by unit of time."""
        if not len(strand.place):
            return
        key = nodes.key()
        left, right, part, beside = self._between(strand, nodes, key)
        behind = np.where(density, self._count, 0)
        self._entries.append(
            (target, strand.place[left] + behind, strand.place[right] + behind, part, beside, density)
        )
        if density.any():
            if key not in self._times:
                self._times[key] = _Weights.of(nodes, self._n)
            weights = self._times[key]
            self.weights.append(weights if density.all() else weights.among(density))

    def joined(self) -> tuple[IntArray, IntArray, IntArray, FloatArray, NDArray[np.bool_], IntArray]:
        """Targets, places before and after, the fraction between them, whether at the end; which are found by
        density.
        """
        target, left, right, part, beside, density = (
            np.concatenate([entry[k] for entry in self._entries]) for k in range(6)
        )
        return target, left, right, part, beside, np.flatnonzero(density)

    def _between(
        self, strand: _Strand, nodes: Nodes, key: bytes
    ) -> tuple[IntArray, IntArray, FloatArray, NDArray[np.bool_]]:
        """The neighbours before and after each node, its position between them, and whether it is at the end."""
        both = strand.key, key
        if both not in self._known:
            own, share = _shares(nodes, self._n), strand.share
            right = np.minimum(np.searchsorted(share, own), len(share) - 1)
            left = np.maximum(right - 1, 0)
            gap = share[right] - share[left]
            part = np.clip((own - share[left]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)
            self._known[both] = left, right, part, np.abs(share[right] - own) <= APART
        return self._known[both]
