"""An earlier solution's multipliers on other frames, statement by statement.

Frames go where those of their phase are (see :mod:`stc.alignment`).  What a statement on a stretch of frames costs is
a density in time: each of its rows carries the share of the time around its node, so that twice as many rows
have half the multiplier each.  A statement on a single frame, and the link of a step (whose multiplier is the
costate), have values of their own that do not depend on the step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.alignment import Alignment
from stc.records import dataclass
from stc.solution import MultiplierBlock, Solution
from stc.transcription.bind import BoundProgram
from stc.transcription.grid import AFTER, BEFORE, IntArray, Nodes
from stc.transcription.multipliers import bound_nodes, rows_by_statement
from stc.transcription.statements import LINK
from stc.transcription.transcription import Transcription

FloatArray = NDArray[np.float64]

#: How far, as a share of the motion, the two sides of a jump are held apart for interpolation.
APART = 1e-9

SAME, MOST_OFF = 0.2, 1e3
"""Objectives whose logarithms differ by less count as equal; a ratio beyond the other says nothing."""


def resample_multipliers(
    solution: Solution,
    transcription: Transcription,
    bound: BoundProgram,
    lengths: FloatArray,
    alignment: Alignment,
) -> tuple[FloatArray, FloatArray]:
    """Multipliers of rows (m,) and bounds (size,) that follow an earlier solution's; 0 for what it does not have.

    Args:
        bound: the program to start, its ``x0`` following the same solution.
        lengths: (n,) duration of every step there.
        alignment: which frames of the solution are which there.
    """
    n, program = transcription.grid.n, transcription.program
    rows, bounds = np.zeros(program.row_count), np.zeros(program.size)
    if not n or not solution.n:
        return rows, bounds
    several = np.array([r.range.first < r.range.last for r in transcription.problem.relations] + [False])
    before = _Before(alignment, n, np.diff(solution.time))
    earlier = {(block.kind, block.label): before.strands(block) for block in solution.multipliers}
    after = _After(n, lengths)
    for (kind, label), (nodes, ids, owner) in rows_by_statement(transcription).items():
        strands = earlier.get((kind, label), [])
        if not strands:
            continue
        turn = occurrence(nodes)
        wide = _of_owners(several, owner)
        for k, strand in enumerate(strands):
            mine = turn == k
            density = np.full(mine.sum(), k > 0) if kind == "link" else wide[mine]
            rows[ids[mine]] = after.values(strand, nodes[mine], density)
    for label, nodes, position in bound_nodes(transcription):
        strands = earlier.get(("bound", label), [])
        if strands:
            owner = np.maximum(bound.bounds.lower_from[position], bound.bounds.upper_from[position])
            wide = _of_owners(several, owner) & (len(nodes) > 1)
            bounds[position] = after.values(strands[0], nodes, wide)
    factor = _objective_ratio(solution, bound)
    return factor * rows, factor * bounds


def _objective_ratio(solution: Solution, bound: BoundProgram) -> float:
    """How many times larger the objective has become: one that is a plain sum grows with the number of frames."""
    objective, _ = bound.values(bound.x0)
    ratio = objective / solution.objective if solution.objective else 1.0
    return ratio if 1.0 / MOST_OFF < ratio < MOST_OFF and abs(np.log(ratio)) > SAME else 1.0


def _of_owners(several: NDArray[np.bool_], owner: IntArray) -> NDArray[np.bool_]:
    """Which of some rows belong to relations on several frames; the last entry is for those without relation. (k,)"""
    return several[np.where(owner == LINK, len(several) - 1, owner)]


def occurrence(nodes: Nodes) -> IntArray:
    """How many earlier entries stand on the same node; entries are in order of time. (k,)"""
    code = 4 * nodes.position + nodes.side
    first = np.searchsorted(code, code, side="left")
    return np.arange(len(code)) - first


def node_weights(nodes: Nodes, lengths: FloatArray) -> FloatArray:
    """The time that each node stands for by the trapezoid rule, or Simpson's with its midpoints. (k,)"""
    frame, n = nodes.frame, len(lengths)
    edge = 1.0 / 6.0 if nodes.is_midpoint.any() else 0.5
    left = np.where((frame > 0) & (nodes.side != AFTER), lengths[np.clip(frame - 1, 0, n - 1)], 0.0)
    right = np.where((frame < n) & (nodes.side != BEFORE), lengths[np.clip(frame, 0, n - 1)], 0.0)
    weights = np.where(
        nodes.is_midpoint, (4.0 / 6.0) * lengths[np.clip(frame, 0, n - 1)], edge * (left + right)
    )
    return np.maximum(weights, 1e-300)


def _shares(nodes: Nodes, n: int, alignment: Alignment | None = None) -> FloatArray:
    """Where in the motion of n steps each node lies, from 0 to 1; with an alignment, one of the old motion. (k,)"""
    frame = 0.5 * nodes.position
    frame = frame if alignment is None else alignment.to_new(frame)
    aside = np.where(nodes.side == BEFORE, -APART, np.where(nodes.side == AFTER, APART, 0.0))
    return frame / n + aside


@dataclass(frozen=True, slots=True)
class _Strand:
    """The multipliers of one row of a statement along the motion.

    ``share`` (k,) where they stand, ``value`` (k,) and ``density`` (k,) the same per unit of time.
    """

    share: FloatArray
    value: FloatArray
    density: FloatArray


class _Before:
    """The earlier multipliers by strands.

    Most statements stand on the same nodes: where these are in the motion is found once.
    """

    def __init__(self, alignment: Alignment, n: int, lengths: FloatArray) -> None:
        self._alignment, self._n, self._lengths = alignment, n, lengths
        self._known: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def strands(self, block: MultiplierBlock) -> list[_Strand]:
        """One for every row that the block has on a node."""
        nodes = Nodes(
            np.rint(2.0 * block.nodes).astype(np.int64),
            np.array([0, AFTER, BEFORE])[block.sides.astype(int)],
        )
        turn = occurrence(nodes)
        found = []
        for k in range(int(turn.max(initial=-1)) + 1):
            mine = turn == k
            share, weights = self._places(nodes[mine])
            found.append(_Strand(share, block.values[mine], block.values[mine] / weights))
        return found

    def _places(self, nodes: Nodes) -> tuple[FloatArray, FloatArray]:
        key = nodes.key()
        if key not in self._known:
            weights = node_weights(nodes, self._lengths)
            self._known[key] = _shares(nodes, self._n, self._alignment), weights
        return self._known[key]


class _After:
    """Multipliers at other nodes: between which of a strand's they are is found once for all that stand alike."""

    def __init__(self, n: int, lengths: FloatArray) -> None:
        self._n, self._lengths = n, lengths
        self._known: dict[tuple[bytes, bytes], tuple[IntArray, IntArray, FloatArray, NDArray[np.bool_]]] = {}
        self._weights: dict[bytes, FloatArray] = {}

    def values(self, strand: _Strand, nodes: Nodes, density: NDArray[np.bool_]) -> FloatArray:
        """The multipliers at ``nodes``: linear between those of the strand, where ``density`` (len(nodes),) is True
        those per unit of time. (len(nodes),)

        They are 0 beside a node without a multiplier: what holds on one frame holds there alone.
        """
        if not strand.value.any():
            return np.zeros(len(nodes))
        key = nodes.key()
        left, right, part, beside = self._between(strand.share, nodes, key)
        mixed = bool(density.any()) and not density.all()
        given = strand.density if density.any() else strand.value
        value, before = given[right], given[left]
        if mixed:
            value = np.where(density, value, strand.value[right])
            before = np.where(density, before, strand.value[left])
        between = np.where((value == 0.0) | (before == 0.0), 0.0, before + part * (value - before))
        result = np.where(beside, value, between)
        if density.any():
            weights = self._weights.get(key)
            if weights is None:
                weights = node_weights(nodes, self._lengths)
                self._weights[key] = weights
            result *= np.where(density, weights, 1.0) if mixed else weights
        return result

    def _between(
        self, share: FloatArray, nodes: Nodes, key: bytes
    ) -> tuple[IntArray, IntArray, FloatArray, NDArray[np.bool_]]:
        """Places before and after each node, how far it is from one to the other, and whether it is at the end."""
        both = share.tobytes(), key
        if both not in self._known:
            own = _shares(nodes, self._n)
            right = np.minimum(np.searchsorted(share, own), len(share) - 1)
            left = np.maximum(right - 1, 0)
            gap = share[right] - share[left]
            part = np.clip((own - share[left]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)
            self._known[both] = left, right, part, np.abs(share[right] - own) <= APART
        return self._known[both]
