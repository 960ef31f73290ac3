"""Multipliers by the statement of the spec they belong to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.solution import MultiplierBlock
from stc.transcription.grid import AFTER, BEFORE, Nodes
from stc.transcription.statements import LINK
from stc.transcription.transcription import Transcription

FloatArray = NDArray[np.float64]


def multiplier_blocks(
    transcription: Transcription, row_multipliers: FloatArray, bound_multipliers: FloatArray
) -> list[MultiplierBlock]:
    """One block per statement with rows, per link and per bounded variable that has a multiplier."""
    blocks: dict[tuple[str, str], list[tuple[Nodes, FloatArray]]] = {}
    problem = transcription.problem
    for group in transcription.program.groups:
        for r, row in enumerate(group.rows):
            values = row_multipliers[group.row_ids[r]]
            if row.label:
                blocks.setdefault(("link", row.label), []).append((row.nodes, values))
                continue
            for owner in np.unique(row.relation):
                mine = row.relation == owner
                assert owner != LINK
                text = problem.relations[int(owner)].text
                blocks.setdefault(("row", text), []).append((row.nodes[mine], values[mine]))
    result = [_block(kind, label, parts) for (kind, label), parts in blocks.items()]
    layout = transcription.layout
    for name, order, before, after, middle in layout.slots():
        frames = np.arange(len(before))
        two = before != after
        position = np.concatenate([before, after[two], middle])
        where = np.concatenate([2 * frames, 2 * frames[two], 2 * np.arange(len(middle)) + 1])
        side = np.concatenate(
            [np.where(two, BEFORE, 0), np.full(two.sum(), AFTER), np.zeros(len(middle), int)]
        )
        values = bound_multipliers[position]
        if values.any():
            result.append(_block("bound", name + "'" * order, [(Nodes(where, side), values)]))
    for name, at in layout.parameters.items():
        if bound_multipliers[at]:
            nodes = Nodes(np.zeros(1, np.int64), np.zeros(1, np.int64))
            result.append(_block("bound", name, [(nodes, bound_multipliers[[at]])]))
    return result


def _block(kind: str, label: str, parts: list[tuple[Nodes, FloatArray]]) -> MultiplierBlock:
    position = np.concatenate([n.position for n, _ in parts])
    side = np.concatenate([n.side for n, _ in parts])
    values = np.concatenate([v for _, v in parts])
    order = np.argsort(4 * position + side, kind="stable")
    sides = np.array([0, -1, 1], np.int8)[side[order]]
    return MultiplierBlock(kind, label, position[order] / 2.0, sides, values[order])
