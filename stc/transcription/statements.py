"""Sort the lowered relations of a problem into bounds, rows and contradictions, and weight the objective.

The result is still symbolic: expressions of decision variables, constants and node data, with their nodes.  Numbers
enter in :mod:`stc.transcription.assemble`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stc.deadline import look
from stc.errors import Diagnostic, SpecError
from stc.problem import FrameRange, ObjectiveTerm, ParameterRef, Problem, Relation, VariableRef
from stc.records import dataclass, field
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import ZERO, Expr, substitute, sum_of, sym, symbols
from stc.transcription.corrections import PLACES, corrections_on, of_steps
from stc.transcription.grid import Grid, IntArray, Nodes, join
from stc.transcription.lower import DataRef, Lowering, groups
from stc.transcription.rotations import norm_row, rotation_links, velocity_rows
from stc.transcription.schemes import link_nodes, links, quadrature, sum_weights

if TYPE_CHECKING:
    from stc.transcription.measured import Measured

LINK = -1
"""Relation number of the rows that tie derivatives together."""


@dataclass(slots=True)
class Row:
    """``lower <= body <= upper`` at every node; None means no bound.  ``relation`` indexes Problem.relations.

    ``also`` lists what other relations state the very same row: pairs of relation and node.
    """

    body: Expr
    lower: Expr | None
    upper: Expr | None
    nodes: Nodes
    relation: IntArray
    label: str = ""
    also: set[tuple[int, int]] = field(default_factory=set)


@dataclass(slots=True)
class Bound:
    """``lower <= coefficient*unknown + rest <= upper``: a bound on one decision variable.

    ``unknown`` is None if the relation contains no decision variable; it is then either true or a contradiction.
    ``positions`` are those of the unknown at the nodes, once they have been asked for.
    """

    unknown: VariableRef | ParameterRef | None
    coefficient: Expr
    rest: Expr
    lower: Expr | None
    upper: Expr | None
    nodes: Nodes
    relation: int
    positions: IntArray | None = None


@dataclass(slots=True)
class WeightTable:
    """The weights of an objective term at the nodes of one expression.

    Either ``fixed`` (k,), or the share of each step's basis coefficient ``basis`` that falls on each node.
    """

    size: int
    fixed: NDArray[np.float64] | None = None
    basis: int = 0
    node: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    step: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    share: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def values(self, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        if self.fixed is not None:
            return self.fixed
        amount = self.share * coefficients[self.basis, self.step]
        return np.bincount(self.node, amount, minlength=self.size).astype(np.float64)


@dataclass(slots=True)
class Summand:
    """A weighted objective term at the nodes where it has one form."""

    body: Expr
    nodes: Nodes
    term: int


@dataclass(slots=True)
class Statements:
    rows: list[Row]
    bounds: list[Bound]
    summands: list[Summand]
    weights: list[WeightTable]


def unknowns(e: Expr) -> list[VariableRef | ParameterRef]:
    return [k for k in symbols(e) if isinstance(k, VariableRef | ParameterRef)]


class Sorter:
    """Collects the statements of one problem."""

    def __init__(self, problem: Problem, grid: Grid, lowering: Lowering) -> None:
        self.problem, self.grid, self.lowering = problem, grid, lowering
        self.rows: dict[tuple[Expr, Expr | None, Expr | None], Row] = {}
        self.bounds: list[Bound] = []
        self.summands: list[Summand] = []
        self.weights: list[WeightTable] = []
        self.mistakes: list[Diagnostic] = []
        self.corrected = of_steps(problem.corrections, grid.method) if grid.method in PLACES else []

    def run(self) -> Statements:
        """All statements of the problem, lowered.

        Raises:
            SpecError: a statement is left without any frame to hold on.
        """
        self._links()
        self._rotations()
        for number, relation in enumerate(self.problem.relations):
            look()
            self._relation(number, relation)
        for number, term in enumerate(self.problem.objective):
            if term.rows:
                self._measured(number, term)
            elif term.integral:
                self._integral(number, term)
            else:
                self._plain(number, term)
        if self.mistakes:
            raise SpecError(self.mistakes)
        rows = [self._distinct(row) for row in self.rows.values()]
        return Statements(rows, self.bounds, self.summands, self.weights)

    def _links(self) -> None:
        if self.grid.method == "central" or self.grid.n == 0:
            return
        nodes = link_nodes(self.grid)
        for h, steps in self.lowering.link_groups(nodes):
            for added, where in corrections_on(self.problem.corrections, self.corrected, steps):
                for name, top in self.lowering.layout.order.items():
                    for order in range(top):
                        whole, *middle = links(self.grid.method, name, order, h)
                        for body in (whole + added.get((name, order), ZERO), *middle):
                            self._add_row(body, ZERO, ZERO, where, LINK, f"link of {name}{chr(39) * order}")

    def _rotations(self) -> None:
        """Unit norms at all nodes, and the relations between orientations and angular velocities."""
        everywhere = self.grid.nodes(FrameRange(0, self.grid.n))
        for rotation in self.problem.rotations:
            of = f"{rotation.quaternion[0]} to {rotation.quaternion[3]}"
            self._add_row(norm_row(rotation), ZERO, ZERO, everywhere, LINK, f"unit norm of {of}")
            if self.grid.n == 0:
                continue
            if self.grid.method == "central":
                for body in velocity_rows(rotation):
                    for lowered, nodes in self.lowering.lower(body, everywhere):
                        self._add_row(lowered, ZERO, ZERO, nodes, LINK, f"angular velocity of {of}")
                continue
            for h, steps in self.lowering.link_groups(link_nodes(self.grid)):
                for added, where in corrections_on(self.problem.corrections, self.corrected, steps):
                    bodies = rotation_links(self.grid.method, rotation, h)
                    for k, name in enumerate(rotation.velocity):
                        bodies[k] = bodies[k] + added.get((name, -1), ZERO)
                    for body in bodies:
                        self._add_row(body, ZERO, ZERO, where, LINK, f"link of {of}")

    def _relation(self, number: int, relation: Relation) -> None:
        where = self.grid.nodes(relation.range)
        if relation.on_frames:
            where = where[~where.is_midpoint]
        parts = self.lowering.lower(relation.body, where)
        if not parts:
            self.mistakes.append(
                Diagnostic(
                    "error",
                    "this statement holds on no frame: its derivatives or indices reach outside the motion",
                    relation.span,
                    "use a range farther from the ends, or a larger n",
                )
            )
        for body, nodes in parts:
            ends = [self._end(e) for e in (relation.lower, relation.upper)]
            if relation.is_equality:
                ends[1] = ends[0]
            loose = [e for e in ends if e is not None and unknowns(e)]
            if not loose:
                self._split(number, body, ends[0], ends[1], nodes)
            elif relation.is_equality:
                assert ends[0] is not None
                self._split(number, body - ends[0], ZERO, ZERO, nodes)
            else:  # an end that moves with the unknowns (t of free steps) is part of the row
                if ends[0] is not None:
                    self._split(number, body - ends[0], ZERO, None, nodes)
                if ends[1] is not None:
                    self._split(number, body - ends[1], None, ZERO, nodes)

    def _end(self, e: Expr | None) -> Expr | None:
        return None if e is None else self.lowering.with_data(e)

    def _split(self, number: int, body: Expr, lower: Expr | None, upper: Expr | None, nodes: Nodes) -> None:
        """Make a relation that is linear in a single unknown a bound, and any other a row."""
        found = unknowns(body)
        if len(found) > 1:
            self._add_row(body, lower, upper, nodes, number)
            return
        if not found:
            self.bounds.append(Bound(None, ZERO, body, lower, upper, nodes, number))
            return
        slope = derivative(body, found[0])
        if unknowns(slope):
            self._add_row(body, lower, upper, nodes, number)
        else:
            rest = substitute(body, {found[0]: ZERO})
            self.bounds.append(Bound(found[0], slope, rest, lower, upper, nodes, number))

    def _add_row(
        self,
        body: Expr,
        lower: Expr | None,
        upper: Expr | None,
        nodes: Nodes,
        relation: int,
        label: str = "",
    ) -> None:
        key = (body, lower, upper)
        row = self.rows.get(key)
        if row is None:
            self.rows[key] = Row(body, lower, upper, nodes, np.full(len(nodes), relation), label)
            return
        known = 4 * row.nodes.position + row.nodes.side
        code = 4 * nodes.position + nodes.side
        new = ~np.isin(code, known)
        row.also.update((relation, int(k)) for k in code[~new])
        if new.any():
            together = join([row.nodes, nodes])
            order = 4 * together.position + together.side
            owner = np.full(len(together), relation)
            owner[np.searchsorted(order, known)] = row.relation
            self.rows[key] = Row(body, lower, upper, together, owner, row.label, row.also)

    def _distinct(self, row: Row) -> Row:
        """Drop nodes that already have the same row: the other side of a jump, absolute indices."""
        keys = [k for e in (row.body, row.lower, row.upper) if e is not None for k in symbols(e)]
        fixed = not any(isinstance(k, DataRef) or (isinstance(k, VariableRef) and k.scale != 0) for k in keys)
        position = row.nodes.position
        if fixed:
            among = np.arange(len(row.nodes))
        else:  # at different places it has different unknowns or data
            several = position[1:] == position[:-1]
            among = np.flatnonzero(np.append(several, False) | np.append(False, several))
        if not among.size:
            return row
        nodes, layout = row.nodes[among], self.lowering.layout
        table = [layout.position(k, nodes) for k in keys if isinstance(k, VariableRef | ParameterRef)]
        if any(isinstance(k, DataRef) for k in keys):
            table.append(nodes.position)
        if not table:
            table = [np.zeros(len(nodes), np.int64)]
        _, first, same = np.unique(np.array(table), axis=1, return_index=True, return_inverse=True)
        code = node_codes(nodes)
        kept = code[first[same.reshape(-1)]]
        dropped = np.flatnonzero(kept != code)
        standing = dict(zip(code[dropped].tolist(), kept[dropped].tolist()))
        also = {(relation, standing.get(k, k)) for relation, k in row.also}
        also.update((int(row.relation[among[k]]), int(kept[k])) for k in dropped)
        left = np.delete(np.arange(len(row.nodes)), among[dropped])
        return Row(row.body, row.lower, row.upper, row.nodes[left], row.relation[left], row.label, also)

    def _measured(self, number: int, term: ObjectiveTerm) -> None:
        rows = self.measured(term)
        self.summands += [Summand(body, nodes, number) for body, nodes in rows.lowered(term.body)]

    def measured(self, term: ObjectiveTerm) -> Measured:
        """The meaning of expressions on the rows of a term's data set; its numbers become tables here.

        Raises:
            SpecError: a row lies outside the motion, or its place among the frames is not known beforehand.
        """
        from stc.transcription.measured import Measured

        return Measured(self.lowering, term, self._table_of_rows)

    def _table_of_rows(self, numbers: NDArray[np.float64]) -> DataRef:
        self.weights.append(WeightTable(len(numbers), fixed=numbers))
        return DataRef("row", len(self.weights) - 1)

    def _plain(self, number: int, term: ObjectiveTerm) -> None:
        first, last = term.range.first, term.range.last
        nodes = self.grid.nodes(term.range)
        parts = self.lowering.lower(term.body, nodes)
        if not parts:
            self._lost(term)
            return
        nodes = self._without_lost_midpoints(nodes, parts)
        weight = sum_weights(nodes, first, last)
        code = node_codes(nodes)
        for body, where in parts:
            share = weight[np.searchsorted(code, node_codes(where))]
            if (share != 1.0).any():
                body = sym(self._table(WeightTable(len(where), fixed=share))) * body
            self.summands.append(Summand(body, where, number))

    def _integral(self, number: int, term: ObjectiveTerm) -> None:
        nodes = self.grid.nodes(term.range)
        parts = self.lowering.lower(term.body, nodes)
        if not parts:
            self._lost(term)
            return
        nodes = self._without_lost_midpoints(nodes, parts)
        which, step, share = quadrature(nodes, term.range.first, term.range.last)
        held = np.sort(np.concatenate([node_codes(p) for _, p in parts]))
        which = self._standing_in(node_codes(nodes), held)[which]
        for body, where in parts:
            at = np.full(len(held), -1)
            at[np.searchsorted(held, node_codes(where))] = np.arange(len(where))
            mine = at[which] >= 0
            node, my_step, my_share = at[which[mine]], step[mine], share[mine]
            support = np.zeros((len(self.lowering.steps.basis), len(where)), np.int64)
            for k, has in enumerate(self.lowering.steps.support):
                support[k, node[has[my_step]]] = 1
            for present, subset in groups(support):
                self._weighted(number, body, where, subset, present, node, my_step, my_share)

    def _weighted(
        self,
        number: int,
        body: Expr,
        where: Nodes,
        subset: IntArray,
        present: IntArray,
        node: IntArray,
        step: IntArray,
        share: NDArray[np.float64],
    ) -> None:
        if not present.any():
            return
        local = np.full(len(where), -1)
        local[subset] = np.arange(len(subset))
        mine = local[node] >= 0
        weights = []
        for k in np.flatnonzero(present):
            use = mine & self.lowering.steps.support[k][step]
            table = WeightTable(
                len(subset), basis=int(k), node=local[node[use]], step=step[use], share=share[use]
            )
            weights.append(sym(self._table(table)) * self.lowering.steps.basis[k])
        self.summands.append(Summand(sum_of(weights) * body, where[subset], number))

    def _without_lost_midpoints(self, nodes: Nodes, parts: Sequence[tuple[Expr, Nodes]]) -> Nodes:
        """The nodes without midpoints at which a term is undefined: it counts at the frames of these steps only."""
        if not self.grid.has_midpoints:
            return nodes
        held = np.concatenate([node_codes(where) for _, where in parts])
        return nodes[~nodes.is_midpoint | np.isin(node_codes(nodes), held)]

    @staticmethod
    def _standing_in(code: IntArray, held: IntArray) -> IntArray:
        """For every node itself if it is defined, else the nearest frame that is. (len(code),)"""
        frames = np.flatnonzero(held % 8 < 4)
        right = np.clip(np.searchsorted(held[frames], code), 0, len(frames) - 1)
        left = np.clip(right - 1, 0, len(frames) - 1)
        closer_left = np.abs(held[frames[left]] - code) < np.abs(held[frames[right]] - code)
        nearest = frames[np.where(closer_left, left, right)]
        itself = np.clip(np.searchsorted(held, code), 0, len(held) - 1)
        return np.where(held[itself] == code, itself, nearest)

    def _table(self, table: WeightTable) -> DataRef:
        self.weights.append(table)
        return DataRef("weight", len(self.weights) - 1)

    def _lost(self, term: ObjectiveTerm) -> None:
        self.mistakes.append(
            Diagnostic(
                "error",
                "this objective term counts on no frame: its derivatives reach outside the motion",
                term.span,
                "use a range farther from the ends, or a larger n",
            )
        )


def node_codes(nodes: Nodes) -> IntArray:
    """Numbers that order nodes in time, one for each. (k,)"""
    return 4 * nodes.position + nodes.side


def highest_orders(problem: Problem, bodies: Sequence[Expr]) -> dict[str, int]:
    """The highest derivative of each variable that statements or jumps use."""
    orders = dict.fromkeys(problem.variables, 0)
    for body in bodies:
        for key in symbols(body):
            if isinstance(key, VariableRef):
                orders[key.name] = max(orders[key.name], key.order)
    for jump in problem.jumps:
        orders[jump.name] = max(orders[jump.name], jump.order)
    return orders
