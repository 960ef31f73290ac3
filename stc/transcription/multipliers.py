"""Multipliers by the statement of the spec they belong to."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.solution import MultiplierBlock
from stc.transcription.grid import AFTER, BEFORE, IntArray, Nodes
from stc.transcription.stated import Stated
from stc.transcription.statements import LINK

FloatArray = NDArray[np.float64]


Statement = tuple[str, str]
"""Kind (``row`` or ``link``) and text of the statement that rows come from."""


Rows = tuple[Nodes, IntArray, IntArray]
"""Nodes, row numbers and relations, (k,) each and in order of time."""

Places = tuple[str, Nodes, IntArray]
"""A name, nodes in order of time, and positions in the decision vector."""


def rows_by_statement(stated: Stated) -> dict[Statement, Rows]:
    """The rows of every statement; cached."""
    known: dict[Statement, Rows] = stated.remembered("rows by statement", _rows_by_statement)
    return known


def _rows_by_statement(stated: Stated) -> dict[Statement, Rows]:
    problem = stated.problem
    parts: dict[Statement, list[Rows]] = {}
    for group in stated.groups:
        for r, row in enumerate(group.rows):
            ids = group.row_ids[r]
            if row.label:
                parts.setdefault(("link", row.label), []).append((row.nodes, ids, row.relation))
                continue
            for owner in distinct(row.relation):
                mine = row.relation == owner
                assert owner != LINK
                text = problem.relations[int(owner)].text
                parts.setdefault(("row", text), []).append((row.nodes[mine], ids[mine], row.relation[mine]))
    found = {}
    for statement, several in parts.items():
        position = np.concatenate([nodes.position for nodes, _, _ in several])
        side = np.concatenate([nodes.side for nodes, _, _ in several])
        order = np.argsort(4 * position + side, kind="stable")
        ids, owner = (np.concatenate([part[k] for part in several])[order] for k in (1, 2))
        found[statement] = Nodes(position[order], side[order]), ids, owner
    return found


def bound_nodes(stated: Stated) -> list[Places]:
    """The positions of every variable and parameter; cached."""
    known: list[Places] = stated.remembered("bound nodes", lambda found: list(_bound_nodes(found)))
    return known


def _bound_nodes(stated: Stated) -> Iterator[Places]:
    layout = stated.layout
    for name, order, before, after, middle in layout.slots():
        frames = np.arange(len(before))
        two = before != after
        position = np.concatenate([before, after[two], middle])
        where = np.concatenate([2 * frames, 2 * frames[two], 2 * np.arange(len(middle)) + 1])
        side = np.concatenate(
            [np.where(two, BEFORE, 0), np.full(two.sum(), AFTER), np.zeros(len(middle), int)]
        )
        along = np.argsort(4 * where + side, kind="stable")
        yield name + "'" * order, Nodes(where[along], side[along]), position[along]
    for name, at in layout.parameters.items():
        yield name, Nodes(np.zeros(1, np.int64), np.zeros(1, np.int64)), np.array([at])


def multiplier_blocks(
    stated: Stated, row_multipliers: FloatArray, bound_multipliers: FloatArray
) -> list[MultiplierBlock]:
    """One block per statement with rows, per link and per bounded variable that has a multiplier."""
    rows, bounds = stated.remembered("multiplier blocks", _blocks)
    result = [_filled(block, row_multipliers[ids]) for block, ids in rows]
    for block, position in bounds:
        values = bound_multipliers[position]
        if values.any():
            result.append(_filled(block, values))
    return result


Blocks = list[tuple[MultiplierBlock, IntArray]]
"""Blocks without values, and where these are in a vector of multipliers."""


def _blocks(stated: Stated) -> tuple[Blocks, Blocks]:
    """The blocks of rows and those of bounds."""
    return (
        [
            (_block(kind, label, nodes), ids)
            for (kind, label), (nodes, ids, _) in rows_by_statement(stated).items()
        ],
        [(_block("bound", label, nodes), at) for label, nodes, at in bound_nodes(stated)],
    )


def _block(kind: str, label: str, nodes: Nodes) -> MultiplierBlock:
    sides = np.array([0, -1, 1], np.int8)[nodes.side]
    frames = nodes.position / 2.0
    for shared in (frames, sides):
        shared.flags.writeable = False
    return MultiplierBlock(kind, label, frames, sides, np.zeros(0))


def _filled(block: MultiplierBlock, values: FloatArray) -> MultiplierBlock:
    return MultiplierBlock(block.kind, block.label, block.nodes, block.sides, values)
