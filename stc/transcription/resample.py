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
from stc.problem import Problem
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
    problem = transcription.problem
    n, program = transcription.grid.n, transcription.program
    rows, bounds = np.zeros(program.row_count), np.zeros(program.size)
    if not n or not solution.n:
        return rows, bounds
    old_lengths = np.diff(solution.time)
    earlier = {
        (block.kind, block.label): _strands(block, alignment, n, old_lengths)
        for block in solution.multipliers
    }
    for (kind, label), (nodes, ids, owner) in rows_by_statement(transcription).items():
        strands = earlier.get((kind, label), [])
        turn = occurrence(nodes)
        wide = _is_wide(problem, owner)
        for k, strand in enumerate(strands):
            mine = turn == k
            density = np.full(mine.sum(), k > 0) if kind == "link" else wide[mine]
            rows[ids[mine]] = strand.at(nodes[mine], n, lengths, density)
    for label, nodes, position in bound_nodes(transcription):
        if ("bound", label) not in earlier:
            continue
        owners = bound.bounds.lower_from[position], bound.bounds.upper_from[position]
        wide = _is_wide(problem, np.maximum(*owners)) & (len(nodes) > 1)
        for strand in earlier.get(("bound", label), [])[:1]:
            bounds[position] = strand.at(nodes, n, lengths, wide)
    factor = _objective_ratio(solution, bound)
    return factor * rows, factor * bounds


def _objective_ratio(solution: Solution, bound: BoundProgram) -> float:
    """How many times larger the objective has become: one that is a plain sum grows with the number of frames."""
    objective, _ = bound.values(bound.x0)
    ratio = objective / solution.objective if solution.objective else 1.0
    return ratio if 1.0 / MOST_OFF < ratio < MOST_OFF and abs(np.log(ratio)) > SAME else 1.0


def _is_wide(problem: Problem, owner: IntArray) -> NDArray[np.bool_]:
    """Which rows belong to statements on several frames; ``owner`` (k,) are their relations."""
    wide = np.array([r.range.first < r.range.last for r in problem.relations] + [False])
    return wide[np.where(owner == LINK, len(wide) - 1, owner)]


def occurrence(nodes: Nodes) -> IntArray:
    """How many earlier entries stand on the same node; entries are in order of time. (k,)"""
    code = 4 * nodes.position + nodes.side
    first = np.searchsorted(code, code, side="left")
    return np.arange(len(code)) - first


def node_weights(nodes: Nodes, lengths: FloatArray, simpson: bool) -> FloatArray:
    """The time that each node stands for by the trapezoid rule, or Simpson's with its midpoints. (k,)"""
    frame, n = nodes.frame, len(lengths)
    edge = 1.0 / 6.0 if simpson else 0.5
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

    def at(self, nodes: Nodes, n: int, lengths: FloatArray, density: NDArray[np.bool_]) -> FloatArray:
        """The multipliers at other nodes: linear between those here, where ``density`` (len(nodes),) is True those
        per unit of time. (len(nodes),)

        They are 0 beside a node without a multiplier: what holds on one frame holds there alone.
        """
        if not self.value.any():
            return np.zeros(len(nodes))
        share = _shares(nodes, n)
        last = len(self.share) - 1
        right = np.minimum(np.searchsorted(self.share, share), last)
        left = np.maximum(right - 1, 0)
        value = np.where(density, self.density[right], self.value[right])
        before = np.where(density, self.density[left], self.value[left])
        gap = self.share[right] - self.share[left]
        part = np.clip((share - self.share[left]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)
        between = np.where((value == 0.0) | (before == 0.0), 0.0, before + part * (value - before))
        result = np.where(np.abs(self.share[right] - share) <= APART, value, between)
        if density.any():
            simpson = bool(nodes.is_midpoint.any())
            result *= np.where(density, node_weights(nodes, lengths, simpson), 1.0)
        return result


def _strands(block: MultiplierBlock, alignment: Alignment, n: int, lengths: FloatArray) -> list[_Strand]:
    nodes = Nodes(
        np.rint(2.0 * block.nodes).astype(np.int64), np.array([0, AFTER, BEFORE])[block.sides.astype(int)]
    )
    turn = occurrence(nodes)
    found = []
    for k in range(int(turn.max(initial=-1)) + 1):
        mine = turn == k
        here = nodes[mine]
        weights = node_weights(here, lengths, bool(here.is_midpoint.any()))
        found.append(_Strand(_shares(here, n, alignment), block.values[mine], block.values[mine] / weights))
    return found
