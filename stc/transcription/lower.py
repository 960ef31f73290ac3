"""From the expressions of a spec to expressions of decision variables, one for each kind of node.

Lowering replaces, in this order, ranged definitions by the piece that holds, derivatives by differences
(central) or by unknowns of their own, ``i`` and ``t`` by data of the node.  Nodes on which the result has the
same form share one expression; what differs between them (positions in the decision vector, data) is a table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.problem import DefinitionRef, IndexRef, Problem, TimeRef, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import Expr, substitute, sum_of, sym, symbols
from stc.time_derivatives import one_sided, time_derivative
from stc.transcription.grid import Grid, IntArray, Nodes
from stc.transcription.layout import Layout
from stc.transcription.rotations import without_angular_accelerations
from stc.transcription.schemes import difference, stencil_reach
from stc.transcription.steps import Steps


@dataclass(frozen=True, slots=True)
class DataRef:
    """A number that differs from node to node.

    ``kind``: ``index`` (i), ``elapsed`` (share of basis function ``item`` in t), ``step`` (share of basis
    function ``item`` in the step after frame ``scale*i + shift``), ``weight`` (entry ``item`` of the
    quadrature tables of an objective term), ``row`` (that entry's number for the row that the node is for).
    """

    kind: str
    item: int = 0
    scale: Fraction | int = 1
    shift: Fraction | int = 0

    def __repr__(self) -> str:
        # Operands are ordered by their text: it must not depend on how a number is held.
        return f"DataRef({self.kind}, {self.item}, {self.scale}, {self.shift})"


def definition_value(problem: Problem, ref: DefinitionRef, piece: int) -> Expr:
    body = time_derivative(problem.definitions[ref.name][piece].body, ref.order, problem.rotations)
    return one_sided(body, ref.side) if ref.side else body


def groups(signature: NDArray[np.int64]) -> Iterator[tuple[IntArray, IntArray]]:
    """Split the columns of a (rows, k) table into classes of equal columns: (column, indices) pairs."""
    if signature.shape[1] == 0:
        return
    if signature.shape[0] == 0 or (signature == signature[:, :1]).all():
        yield signature[:, 0], np.arange(signature.shape[1])
        return
    values, inverse = np.unique(signature, axis=1, return_inverse=True)
    inverse = inverse.reshape(-1)
    for k in range(values.shape[1]):
        yield values[:, k], np.flatnonzero(inverse == k)


class Expander:
    """Replaces ranged definitions by the pieces that hold."""

    def __init__(self, problem: Problem, grid: Grid) -> None:
        self.problem, self.grid = problem, grid

    def __call__(self, body: Expr, nodes: Nodes) -> Iterator[tuple[Expr, Nodes]]:
        """Yield (expression without definitions, its nodes)."""
        refs = [k for k in symbols(body) if isinstance(k, DefinitionRef)]
        if not refs or not len(nodes):
            yield body, nodes
            return
        table = []
        for ref in refs:
            at = nodes
            if ref.side:
                wanted = {"before": 1, "after": 2}[ref.side]
                at = Nodes(nodes.position, np.where(nodes.side > 0, wanted, 0))
            found = self.grid.pieces(list(self.problem.definitions[ref.name]), at, of_steps=ref.name == "h")
            if ref.name == "h":  # there is no step after the last frame: h means the last one there
                found = np.where(found < 0, found.max(initial=0), found)
            table.append(found)
        for choice, which in groups(np.array(table)):
            if (choice < 0).any():
                continue
            pieces = {
                ref: definition_value(self.problem, ref, int(k)) for ref, k in zip(refs, choice, strict=True)
            }
            yield from self(substitute(body, pieces), nodes[which])


@dataclass(frozen=True, slots=True)
class Stencil:
    """The points of a central difference, per node.

    ``first`` (k,): offset in frames of its first point; ``count`` (k,): number of steps it spans;
    ``supports``: per step and basis function (k,) whether the step has it.
    """

    first: IntArray
    count: IntArray
    supports: list[list[IntArray]]

    def signature(self) -> list[IntArray]:
        """Rows that are equal at two nodes exactly where the difference has the same form."""
        return [self.first, self.count, *(row for step in self.supports for row in step)]


class Lowering:
    """The meaning of expressions at nodes.

    Attributes:
        known_forms: of expressions at all nodes, which :mod:`stc.transcription.recover` keeps here.
    """

    def __init__(self, problem: Problem, grid: Grid, layout: Layout, steps: Steps) -> None:
        self.problem, self.grid, self.layout, self.steps = problem, grid, layout, steps
        self.expand = Expander(problem, grid)
        self.known_forms: dict[Any, Any] = {}
        self.central = grid.method == "central"

    def lower(self, body: Expr, nodes: Nodes) -> list[tuple[Expr, Nodes]]:
        """(expression of decision variables, constants and data; its nodes) for each form it takes.

        Nodes at which a derivative or an index would reach outside the motion are dropped.
        """
        result = []
        for expanded, at in self.expand(body, nodes):
            if self.central and self.problem.rotations:
                expanded = without_angular_accelerations(expanded, self.problem.rotations)
            refs = [k for k in symbols(expanded) if isinstance(k, VariableRef)]
            keep = np.ones(len(at), bool)
            if any(r.scale != 0 and (r.scale, r.shift) != (1, 0) for r in refs):
                keep &= ~at.is_midpoint  # a statement with a relative index holds on frames alone
            for ref in refs:
                reach = stencil_reach(ref.order) if self.central and ref.order > 1 else 0
                keep &= self.layout.reachable(ref, at, reach)
            if self.central and self.grid.n < 1 and any(r.order for r in refs):
                keep[:] = False
            at = at[keep]
            for different, where in (
                self._differences(expanded, at, refs) if self.central else [(expanded, at)]
            ):
                if len(where):
                    result.append((self.with_data(different), where))
        return result

    def _differences(self, body: Expr, nodes: Nodes, refs: Sequence[VariableRef]) -> list[tuple[Expr, Nodes]]:
        """Central differences for every derivative, per class of nodes with the same stencils and steps."""
        refs = [r for r in refs if r.order]
        if not refs or not len(nodes):
            return [(body, nodes)] if len(nodes) else []
        stencils = [self._stencil(ref, nodes) for ref in refs]
        signature = [row for stencil in stencils for row in stencil.signature()]
        result = []
        for _, which in groups(np.array(signature, np.int64)):
            node = which[0]  # any node of the class
            mapping: dict[object, Expr] = {}
            for ref, stencil in zip(refs, stencils, strict=True):
                first, count = int(stencil.first[node]), int(stencil.count[node])
                steps = [
                    self.step([int(s[node]) for s in stencil.supports[k]], ref.scale, ref.shift + first + k)
                    for k in range(count)
                ]
                mapping[ref] = difference(ref, range(first, first + count + 1), steps)
            result.append((substitute(body, mapping), nodes[which]))
        return result

    def _stencil(self, ref: VariableRef, nodes: Nodes) -> Stencil:
        """The stencil of a derivative at every node: one-sided at the ends for first derivatives."""
        n = self.grid.n
        if ref.scale.denominator == 1:
            target = int(ref.scale) * nodes.frame + int(ref.shift)
        else:
            target = np.array([int(ref.scale * int(p) / 2 + ref.shift) for p in nodes.position], np.int64)
        if ref.order == 1:
            span = min(2, n)
            first = np.where(target == 0, 0, np.where(target == n, -span, -1))
            count = np.where((target == 0) | (target == n), span, 2)
        else:
            reach = stencil_reach(ref.order)
            first, count = np.full(len(nodes), -reach), np.full(len(nodes), 2 * reach)
        supports = []
        for k in range(int(count.max())):
            step = np.clip(target + first + k, 0, n - 1)
            supports.append(
                [np.where(k < count, has[step], False).astype(np.int64) for has in self.steps.support]
            )
        return Stencil(first, count, supports)

    def step(self, present: Sequence[int], scale: Fraction | int, shift: Fraction | int) -> Expr:
        """The step after frame ``scale*i + shift``, given which basis functions it has."""
        terms = []
        for k, phi in enumerate(self.steps.basis):
            if not present[k]:
                continue
            if self.steps.plain[k]:
                terms.append(phi)
            else:
                terms.append(sym(DataRef("step", k, scale, shift)) * phi)
        return sum_of(terms)

    def with_data(self, body: Expr) -> Expr:
        """``i`` and ``t`` replaced by data of the node."""
        keys = symbols(body)
        mapping: dict[object, Expr] = {}
        if any(isinstance(k, IndexRef) for k in keys):
            mapping[IndexRef()] = sym(DataRef("index"))
        if any(isinstance(k, TimeRef) for k in keys):
            mapping[TimeRef()] = sum_of(
                [sym(DataRef("elapsed", k)) * phi for k, phi in enumerate(self.steps.basis)]
            )
        return substitute(body, mapping) if mapping else body

    def link_groups(self, nodes: Nodes) -> Iterator[tuple[Expr, Nodes]]:
        """The step's length as an expression, per class of steps; ``nodes`` has one node a step."""
        if not len(nodes):
            return
        for present, which in groups(self.steps.support.astype(np.int64)):
            shift = Fraction(-1, 2) if self.grid.has_midpoints else Fraction(0)
            yield self.step(present.tolist(), 1, shift), nodes[which]


def data_values(
    ref: DataRef,
    nodes: Nodes,
    steps: Steps,
    coefficients: NDArray[np.float64],
    weights: Mapping[int, NDArray[np.float64]],
) -> NDArray[np.float64]:
    """The numbers of a :class:`DataRef`. (k,)"""
    if ref.kind == "index":
        return nodes.position / 2.0
    if ref.kind == "elapsed":
        return steps.elapsed(coefficients, nodes)[ref.item]
    if ref.kind == "step":
        at = np.rint(float(ref.scale) * nodes.position / 2.0 + float(ref.shift)).astype(np.int64)
        return coefficients[ref.item, np.clip(at, 0, max(steps.n - 1, 0))]
    if ref.kind == "row":
        assert nodes.row is not None
        return weights[ref.item][nodes.row]
    return weights[ref.item]
