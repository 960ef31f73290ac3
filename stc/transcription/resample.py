"""An earlier solution's multipliers on other frames, statement by statement.

Frames keep their share of the motion, so that phases stay phases.  What a statement on a stretch of frames costs is a density in time: each of
its rows carries the share of the time around its node, so that twice as many rows have half the multiplier each.
A statement on a single frame, and the link of a step (whose multiplier is the costate), have values of their own
that do not depend on the step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stc.problem import Problem
from stc.solution import MultiplierBlock, Solution
from stc.transcription.bind import BoundProgram
from stc.transcription.grid import AFTER, BEFORE, IntArray, Nodes
from stc.transcription.multipliers import bound_nodes, rows_by_statement
from stc.transcription.statements import LINK
from stc.transcription.transcription import Transcription

FloatArray = NDArray[np.float64]

#: How far, as a share of the motion, the two sides of a jump are held apart for interpolation.
APART = 1e-9
MOST_OFF = 1e3


def resample_multipliers(
    solution: Solution, transcription: Transcription, lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Multipliers of rows (m,) and bounds (size,) that follow an earlier solution's; 0 for what it does not have.

    Args:
        lengths: (n,) duration of every step of the motion to start.
    """
    n, program = transcription.grid.n, transcription.program
    rows, bounds = np.zeros(program.row_count), np.zeros(program.size)
    if not n or not solution.n:
        return rows, bounds
    old_lengths = np.diff(solution.time)
    earlier = {
        (block.kind, block.label): _strands(block, solution.n, old_lengths) for block in solution.multipliers
    }
    for (kind, label), (nodes, ids, owner) in rows_by_statement(transcription).items():
        strands = earlier.get((kind, label), [])
        turn = occurrence(nodes)
        wide = _is_wide(transcription.problem, owner)
        for k, strand in enumerate(strands):
            mine = turn == k
            density = np.full(mine.sum(), k > 0) if kind == "link" else wide[mine]
            rows[ids[mine]] = strand.at(nodes[mine], n, lengths, density)
    for label, nodes, position in bound_nodes(transcription):
        for strand in earlier.get(("bound", label), [])[:1]:
            bounds[position] = strand.at(nodes, n, lengths, np.full(len(nodes), len(nodes) > 1))
    return rows, bounds


def fitted(bound: BoundProgram, rows: FloatArray, bounds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both kinds of multipliers times the one factor that balances the objective's gradient best.

    It corrects what the densities cannot know: an objective that is a plain sum over frames grows with n.
    """
    gradient, jac, _ = bound.derivatives(bound.x0, rows, 1.0)
    pull = np.bincount(bound.jac_cols, weights=jac * rows[bound.jac_rows], minlength=bound.n) + bounds
    loose = (bound.x_lower < bound.x_upper) & np.isfinite(pull) & np.isfinite(gradient)
    size = float(pull[loose] @ pull[loose])
    factor = -float(gradient[loose] @ pull[loose]) / size if size > 0.0 else 1.0
    if not 1.0 / MOST_OFF < factor < MOST_OFF:
        return rows, bounds
    return factor * rows, factor * bounds


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


def _shares(nodes: Nodes, n: int) -> FloatArray:
    """Where in the motion each node lies, from 0 to 1. (k,)"""
    aside = np.where(nodes.side == BEFORE, -APART, np.where(nodes.side == AFTER, APART, 0.0))
    return nodes.position / (2.0 * n) + aside


@dataclass(frozen=True, slots=True)
class _Strand:
    """The multipliers of one row of a statement along the motion.

    ``share`` (k,) where they stand, ``value`` (k,) and ``density`` (k,) the same per unit of time.
    """

    share: FloatArray
    value: FloatArray
    density: FloatArray

    def at(self, nodes: Nodes, n: int, lengths: FloatArray, density: NDArray[np.bool_]) -> FloatArray:
        """The multipliers at other nodes. (len(nodes),)"""
        share = _shares(nodes, n)
        simpson = bool(nodes.is_midpoint.any())
        spread = np.interp(share, self.share, self.density) * node_weights(nodes, lengths, simpson)
        return np.where(density, spread, np.interp(share, self.share, self.value))


def _strands(block: MultiplierBlock, n: int, lengths: FloatArray) -> list[_Strand]:
    nodes = Nodes(
        np.rint(2.0 * block.nodes).astype(np.int64), np.array([0, AFTER, BEFORE])[block.sides.astype(int)]
    )
    turn = occurrence(nodes)
    found = []
    for k in range(int(turn.max(initial=-1)) + 1):
        mine = turn == k
        here = nodes[mine]
        weights = node_weights(here, lengths, bool(here.is_midpoint.any()))
        found.append(_Strand(_shares(here, n), block.values[mine], block.values[mine] / weights))
    return found
