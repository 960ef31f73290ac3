"""Statements on the rows of a data set: the motion between the frames, at the time of each row.

The value of a variable at the time of a row is read from the transcription's own curve (:mod:`stc.trajectory`), as a
solution between its frames: under hermite-simpson a parabola for the highest derivative in use, whose integrals the
lower ones are; under trapezoidal a line for that one; under central a cubic with the velocities of the differences.
On such a curve a value is a sum of the unknowns of one step, each with a weight that depends on the row's place in
the step and on the step's length alone. So a statement on rows is one on steps, with these weights as data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.data_sets import TIME
from stc.errors import Diagnostic, SpecError
from stc.problem import CellRef, ConstantRef, ObjectiveTerm, TimeRef, VariableRef
from stc.symbolic.expr import Expr, substitute, sum_of, sym, symbols
from stc.time_derivatives import rate_with
from stc.trajectory import Channel, Places, curves, horner, places
from stc.transcription.grid import AFTER, Nodes
from stc.transcription.lower import DataRef, Lowering
from stc.transcription.schemes import HALF

FloatArray = NDArray[np.float64]

#: So far outside the motion, as a share of its duration, rounding of a row's time is forgiven.
FORGIVEN = 1e-9


class Measured:
    """Expressions on the rows of a data set that have all numbers of a term.

    Args:
        lowering: lowering of the problem.
        term: a sum over rows.
        table: function that makes node data from a number for each row, (rows,).

    Attributes:
        rows: the numbers of those rows, (m,), in the order of time.
        nodes: the node of each, (m,).

    Raises:
        SpecError: a row lies outside the motion; where rows lie among the frames depends on an unknown.
    """

    def __init__(
        self, lowering: Lowering, term: ObjectiveTerm, table: Callable[[FloatArray], DataRef]
    ) -> None:
        self.lowering, self.term, self._table = lowering, term, table
        self.data = lowering.problem.data[term.rows]
        self._known: dict[object, Expr] = {}
        self._rate = rate_with(lowering.problem.rotations)
        keys = symbols(term.body)
        columns = {key.column for key in keys if isinstance(key, CellRef)}
        self.moves = any(isinstance(key, VariableRef) and key.scale != 0 for key in keys)
        if self.moves or TimeRef() in keys:
            columns.add(TIME)
        count = self.data.rows
        complete = np.ones(count, bool)
        for column in columns:
            complete &= np.isfinite(self.data.columns[column])
        self.rows = np.flatnonzero(complete)
        if not self.rows.size:
            self._fail("no row has all numbers that this needs", "empty cells are left out, row by row")
        zeros = np.zeros(count)
        self.where, self.length = (
            Places(np.zeros(count, np.intp), zeros, np.zeros(count, np.intp), zeros),
            zeros,
        )
        if self.moves:
            self._locate()
        step = np.asarray(self.where.step[self.rows], np.int64)
        if lowering.grid.has_midpoints and lowering.grid.n:
            position, side = 2 * step + 1, np.zeros(len(step), np.int64)
        else:
            position, side = 2 * step, np.where(lowering.grid.jump[step], AFTER, 0).astype(np.int64)
        self.nodes = Nodes(position, side, self.rows)

    def _fail(self, message: str, hint: str) -> None:
        raise SpecError([Diagnostic("error", message, self.term.span, hint)])

    def _locate(self) -> None:
        """Find the step of each row."""
        steps, problem = self.lowering.steps, self.lowering.problem
        if steps.free:
            free = " and ".join(f"`{key.name}`" for key in steps.parameters)
            self._fail(
                f"the time from one frame to the next depends on {free}, so that the position of a row among the "
                "frames is not known",
                "the times of measurements are known: make the step a constant, as in `T = 2, h = T/n`",
            )
        constants = problem.constants
        values: dict[object, float] = {ConstantRef(name): value for name, value in constants.items()}
        lengths = steps.lengths(steps.coefficients(constants), values)
        frames = np.concatenate([[0.0], np.cumsum(lengths)])
        time = self.data.columns[TIME]
        outside = np.maximum(-time, time - frames[-1])[self.rows]
        if outside.max() > FORGIVEN * frames[-1]:
            row = int(self.rows[int(np.argmax(outside))])
            self._fail(
                f"{self.data.place(row)} is at t = {time[row]:g} s, and the motion goes from 0 to {frames[-1]:g} s",
                "let the frames reach as far as the measurements do, or leave the row out",
            )
        # in the order of time, so that rows of a step stand beside each other
        self.rows = self.rows[np.argsort(time[self.rows], kind="stable")]
        instants = np.where(np.isfinite(time), np.clip(time, 0.0, frames[-1]), 0.0)
        self.where = places(frames, instants, "before")
        self.length = lengths[self.where.step] if len(lengths) else np.zeros(len(time))

    def lowered(self, body: Expr) -> Iterator[tuple[Expr, Nodes]]:
        """An expression in terms of decision variables, constants and node data, with its nodes, for each form that it
        has.
        """
        grid = self.lowering.grid
        mapping: dict[object, Expr] = {}
        for key in symbols(body):
            if isinstance(key, CellRef):
                mapping[key] = self._number(key, self.data.columns[key.column])
            elif isinstance(key, TimeRef):
                mapping[key] = self._number(key, self.data.columns[TIME])
            elif isinstance(key, VariableRef) and key.scale != 0 and grid.n:
                mapping[key] = self._on_curve(key)
        found = substitute(body, mapping)
        if grid.method != "central":
            yield found, self.nodes
            return
        held = 0
        for form, nodes in self.lowering.lower(found, self.nodes):
            held += len(nodes)
            yield form, nodes
        if held < len(self.nodes):
            self._fail(
                "under central differences this has no value near the ends of the motion",
                "measure the variable or its first derivative, or choose `method: hermite-simpson;`",
            )

    def _number(self, key: object, numbers: FloatArray) -> Expr:
        if key not in self._known:
            self._known[key] = sym(self._table(np.where(np.isfinite(numbers), numbers, 0.0)))
        return self._known[key]

    def _on_curve(self, ref: VariableRef) -> Expr:
        """A variable or its derivative at a row's time, as a sum of unknowns of the row's step."""
        if ref not in self._known:
            terms = []
            turning = any(ref.name in rotation.quaternion for rotation in self.lowering.problem.rotations)
            for unknown, weight in self._weights(ref, turning):
                at_node = sym(unknown)
                if turning and unknown.order:  # what changes a quaternion is not an unknown of its own
                    at_node = self._rate(replace(unknown, order=0))
                weight = np.where(np.isfinite(weight), weight, 0.0)
                used = weight[self.rows]
                if (used == 1.0).all():
                    terms.append(at_node)
                elif used.any():
                    terms.append(sym(self._table(weight)) * at_node)
            self._known[ref] = sum_of(terms)
        return self._known[ref]

    def _weights(self, ref: VariableRef, turning: bool) -> Iterator[tuple[VariableRef, FloatArray]]:
        """The unknowns of a step and their weights, each (rows,), in a value on the curve.

        The curve is linear in the values at the nodes: a weight is the curve of a motion that is 1 at one of them.
        """
        grid = self.lowering.grid
        top = self.lowering.layout.order[ref.name]
        if turning or grid.method == "central":
            top = max(1, ref.order)
        first = -HALF if grid.has_midpoints else 0 * HALF
        places_in_step = [first, first + 1, first + HALF][: 3 if grid.has_midpoints else 2]
        count = len(self.length)
        nothing, steps = np.zeros(1), np.zeros(count, np.intp)
        for order in range(top + 1):
            for corner, shift in enumerate(places_in_step):
                orders = {}
                for k in range(top + 1):
                    of = [float(k == order and corner == c) for c in range(3)]
                    middle = nothing + of[2] if grid.has_midpoints else None
                    orders[k] = Channel.smooth([of[0], of[1]], middle)
                curve = curves(grid.method, orders, steps, self.length)[ref.order]
                yield VariableRef(ref.name, order, 1, shift), horner(curve, self.where.share)
