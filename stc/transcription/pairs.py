"""The variables and rows of the two sides of each complementarity in the nonlinear program."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.problem import Relation
from stc.solver.pairs import Pairs
from stc.symbolic.expr import Expr
from stc.transcription.derive import Group
from stc.transcription.grid import IntArray, Nodes
from stc.transcription.layout import Layout
from stc.transcription.statements import Bound, Statements, node_codes

__all__ = ["find_pairs"]

FloatArray = NDArray[np.float64]
Limits = tuple[FloatArray, FloatArray]
At = Callable[[Expr, Nodes], FloatArray]


class _Places:
    """The nodes of a relation: the node's code, its row or variable, and whether its limit is a lower one."""

    def __init__(self) -> None:
        self.of: dict[int, tuple[int, bool]] = {}

    def add(self, codes: IntArray, places: IntArray, lower: NDArray[np.bool_]) -> None:
        for code, place, low in zip(codes.tolist(), places.tolist(), lower.tolist(), strict=True):
            self.of[code] = place, low


def find_pairs(
    relations: Sequence[Relation],
    statements: Statements,
    groups: Sequence[Group],
    layout: Layout,
    at: At,
    bounds: Limits,
) -> Pairs:
    """The complementary pairs of a program.

    A product that is a bound, because one side is known, is not a pair.  Nor is a product if another statement has
    narrowed the bound of a side: it remains an ordinary row.

    Args:
        relations: of the problem.
        groups: with their rows numbered.
        at: the value of an expression of constants and node data at nodes, (k,).
        bounds: lower and upper ones of the variables, (n,) each.
    """
    products = [k for k, relation in enumerate(relations) if relation.complementary]
    if not products:
        return Pairs.none()
    rows = _rows_of({number for k in products for number in (k - 2, k - 1, k)}, groups)
    sides = {k - past: _Places() for k in products for past in (1, 2)}
    n = layout.size
    for number, found in sides.items():
        if number in rows:
            codes, places = rows[number]
            low = np.full(len(codes), relations[number].lower is not None)
            found.add(codes, n + places, low)
    for bound in statements.bounds:
        if bound.relation in sides and bound.unknown is not None:
            _add_bound(sides[bound.relation], bound, layout, at, bounds)
    product: list[int] = []
    side: list[list[int]] = []
    lower: list[list[bool]] = []
    for k in products:
        if k not in rows:
            continue
        for code, row in zip(*(part.tolist() for part in rows[k]), strict=True):
            one, other = sides[k - 2].of.get(code), sides[k - 1].of.get(code)
            if one is not None and other is not None:
                product.append(row)
                side.append([one[0], other[0]])
                lower.append([one[1], other[1]])
    return Pairs(
        np.array(product, np.int64),
        np.array(side, np.int64).reshape(-1, 2),
        np.array(lower, bool).reshape(-1, 2),
    )


def _rows_of(wanted: set[int], groups: Sequence[Group]) -> dict[int, tuple[IntArray, IntArray]]:
    """The nodes' codes and the rows of each relation that has rows, (k,) each."""
    found: dict[int, tuple[list[IntArray], list[IntArray]]] = {}
    for group in groups:
        for r, row in enumerate(group.rows):
            codes, ids = node_codes(row.nodes), group.row_ids[r]
            owners = [(int(number), row.relation == number) for number in np.unique(row.relation)]
            also = {number for number, _ in row.also}
            owners += [(k, np.isin(codes, [code for number, code in row.also if number == k])) for k in also]
            for number, mine in owners:
                if number in wanted:
                    parts = found.setdefault(number, ([], []))
                    parts[0].append(codes[mine])
                    parts[1].append(ids[mine])
    return {k: (np.concatenate(codes), np.concatenate(ids)) for k, (codes, ids) in found.items()}


def _add_bound(into: _Places, bound: Bound, layout: Layout, at: At, bounds: Limits) -> None:
    """A side that is a bound of a variable, at the nodes where no other statement bounds it more tightly."""
    assert bound.unknown is not None
    slope, rest = at(bound.coefficient, bound.nodes), at(bound.rest, bound.nodes)
    end = bound.lower if bound.lower is not None else bound.upper
    assert end is not None
    places = layout.position(bound.unknown, bound.nodes)
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = (at(end, bound.nodes) - rest) / slope
    lower = (slope > 0.0) == (bound.lower is not None)
    own = np.where(lower, bounds[0][places], bounds[1][places]) == limit
    into.add(node_codes(bound.nodes)[own], places[own], lower[own])
