"""Grouping of rows and summands by their nodes, and the numbers of the rows in the nonlinear program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stc.transcription.derive import Group
from stc.transcription.grid import IntArray
from stc.transcription.statements import Statements


def build_groups(statements: Statements) -> list[Group]:
    """Statements by the nodes they stand on, in order of appearance."""
    found: dict[bytes, Group] = {}
    for row in statements.rows:
        found.setdefault(row.nodes.key(), Group(row.nodes, [], [])).rows.append(row)
    for summand in statements.summands:
        found.setdefault(summand.nodes.key(), Group(summand.nodes, [], [])).summands.append(summand)
    return list(found.values())


def number_rows(groups: Sequence[Group]) -> tuple[NDArray[np.int32], IntArray, IntArray, IntArray]:
    """Number the rows frame by frame, in order of time and then of appearance: sets ``row_ids`` of the groups.

    Returns:
        Per row (m,) its frame, its group, its number there and its node in the group.
    """
    frames, owner, number, instance = [], [], [], []
    for g, group in enumerate(groups):
        r, k = len(group.rows), group.size
        frames.append(np.tile(group.nodes.frame, r))
        owner.append(np.full(r * k, g))
        number.append(np.repeat(np.arange(r), k))
        instance.append(np.tile(np.arange(k), r))
    if not frames or not sum(map(len, frames)):
        for group in groups:
            group.row_ids = np.zeros((0, group.size), np.int64)
        empty = np.zeros(0, np.int64)
        return empty.astype(np.int32), empty, empty, empty
    frame, group_of, number_of, instance_of = map(np.concatenate, (frames, owner, number, instance))
    order = np.argsort(frame, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    at = 0
    for group in groups:
        r, k = len(group.rows), group.size
        group.row_ids = rank[at : at + r * k].reshape(r, k)
        at += r * k
    return frame[order].astype(np.int32), group_of[order], number_of[order], instance_of[order]
