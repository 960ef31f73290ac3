"""Recorded motions in statements: where a recording has no number, nothing is made up.

A column of a data set with times is a function of time.  Between its rows it is a spline; over a gap, and before its
first number or after its last one, it has no value that anybody has measured.  What an integral asks of it there counts
not at all: each term of the integrand that reads such a column is multiplied by a function that is 1 where the column
has numbers and 0 elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from stc.language.data import Data
from stc.problem import DefinitionPiece, DefinitionRef
from stc.symbolic.expr import Expr, add, looked_up, mul, neg, reachable, sub
from stc.symbolic.tables import TableRef

__all__ = ["counted_where_known", "references"]


def references(e: Expr, pieces: Mapping[str, Sequence[DefinitionPiece]]) -> list[TableRef]:
    """The functions of time that an expression reads, also by definitions that stand under range headers."""
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
    """An integrand each of whose terms is 0 where a column that it reads has no number."""
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


def _of_time(node: Expr) -> bool:
    place = node.args[1]
    return place.op == "table" and bool(place.payload.of_time)
