"""Recorded motions in statements, and their gaps.

A column of a data set with times is a function of time.  Between its rows it is a spline; in a gap, and before its
first or after its last number, it has no measured value.  There it does not count in an integral: each term of the
integrand that reads such a column is multiplied by a function that is 1 where the column has numbers and 0 elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from stc.language.data import Data
from stc.problem import ConstantRef, DefinitionPiece, DefinitionRef, FrameRange, TimeRef
from stc.symbolic.expr import Expr, add, evaluate, looked_up, mul, neg, reachable, sub, symbols
from stc.symbolic.tables import TableRef

__all__ = ["counted_where_known", "first_gap", "references"]


def references(e: Expr, pieces: Mapping[str, Sequence[DefinitionPiece]]) -> list[TableRef]:
    """The functions of time that an expression reads, also through ranged definitions."""
    return sorted(dict.fromkeys(_references(e, pieces)), key=lambda ref: ref.name)


def _references(e: Expr, pieces: Mapping[str, Sequence[DefinitionPiece]]) -> Iterator[TableRef]:
    waiting, seen = [e], set[str]()
    while waiting:
        for node in reachable([waiting.pop()]):
            key = node.payload
            if node.op == "table" and key.of_time:
                yield key.base
            elif node.op == "sym" and isinstance(key, DefinitionRef) and key.name not in seen:
                seen.add(key.name)
                waiting += [piece.body for piece in pieces.get(key.name, ())]


def counted_where_known(e: Expr, data: Data, pieces: Mapping[str, Sequence[DefinitionPiece]]) -> Expr:
    """An integrand in which each term is 0 where a column that it reads has no number."""
    wanted = references(e, pieces)
    if not wanted:
        return e
    if e.op in ("add", "sub"):
        one, other = (counted_where_known(part, data, pieces) for part in e.args)
        return add(one, other) if e.op == "add" else sub(one, other)
    if e.op == "neg":
        return neg(counted_where_known(e.args[0], data, pieces))
    if e.op == "mul":
        free = [part for part in e.args if not references(part, pieces)]
        if free:
            rest = e.args[1] if free[0] is e.args[0] else e.args[0]
            return mul(free[0], counted_where_known(rest, data, pieces))
    # The time of a statement is that of its frame, so that each of them is looked up there.
    times = {node.args[0] for node in reachable([e]) if node.op == "look" and _of_time(node)}
    for ref in wanted:
        weight, _ = data.weight_of(ref)
        for time in sorted(times, key=lambda each: each.order):
            e = mul(looked_up(weight, time), e)
    return e


def first_gap(
    e: Expr,
    data: Data,
    pieces: Mapping[str, Sequence[DefinitionPiece]],
    where: FrameRange,
    step: float | None,
    midpoints: bool,
) -> tuple[TableRef, float | None] | None:
    """The first place at which a statement reads a recording in a gap; None if there is none.

    Args:
        e: the body of the statement, or one of its bounds.
        data: the recordings.
        pieces: the definitions that stand under range headers.
        where: the frames of the statement.
        step: the time from each frame to the next, in seconds; None if it is not a known constant.
        midpoints: whether the statement holds between its frames as well.

    Returns:
        the recording, and the time in seconds; None for the time if it is not known, so that a recording with gaps
        cannot be read at all.
    """
    at = np.arange(2 * where.first, 2 * where.last + 1, 1 if midpoints else 2) / 2.0
    for ref in references(e, pieces):
        weight, has_gaps = data.weight_of(ref)
        if not has_gaps:
            continue
        looks = [node for node in reachable([e]) if node.op == "look" and _of_time(node)]
        times = [node.args[0] for node in looks if node.args[1].payload.base == ref]
        if step is None or not times:
            return ref, None
        edges = weight.table.axes[0].x
        for time in times:
            values: dict[object, Any] = {
                key: at * step if isinstance(key, TimeRef) else at for key in symbols(time)
            }
            for key in values:
                if isinstance(key, ConstantRef):
                    values[key] = data.constants.values[key.name]
            instants = np.atleast_1d(np.asarray(evaluate(time, values), np.float64))
            known = np.asarray(evaluate(looked_up(weight, time), values)) != 0.0
            lacking = instants[~known & (instants > edges[0]) & (instants < edges[-1])]
            if lacking.size:
                return ref, float(lacking[0])
    return None


def _of_time(node: Expr) -> bool:
    place = node.args[1]
    return place.op == "table" and bool(place.payload.of_time)
