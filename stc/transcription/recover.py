"""From decision vectors back to values at the nodes of the motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import Expr, evaluate, sym, symbols
from stc.time_derivatives import time_derivative
from stc.trajectory import Channel
from stc.transcription.grid import AFTER, BEFORE, Grid, IntArray, Nodes
from stc.transcription.layout import Layout
from stc.transcription.lower import DataRef, Lowering, data_values
from stc.transcription.steps import Steps

FloatArray = NDArray[np.float64]

#: Where, besides the sides of frames, expressions are wanted.
MIDPOINTS = -1


@dataclass(frozen=True, slots=True)
class Form:
    """An expression at some nodes, in terms of the decision vector.

    Attributes:
        body: expression of decision variables, constants and data.
        nodes: the nodes, (k,).
        positions: of each variable, (k,).
        data: the numbers of nodes that it refers to.
    """

    body: Expr
    nodes: Nodes
    positions: dict[VariableRef, IntArray]
    data: tuple[DataRef, ...]


def forms_of(lowering: Lowering, body: Expr, where: int) -> list[Form]:
    """The forms of an expression at all frames, on the side ``where``, or at all midpoints; cached."""
    known: dict[tuple[Expr, int], list[Form]] = lowering.known_forms
    if (body, where) not in known:
        grid, layout = lowering.grid, lowering.layout
        if where == MIDPOINTS:
            nodes = Nodes(2 * np.arange(grid.n) + 1, np.zeros(grid.n, np.int64))
        else:
            nodes = Nodes(2 * np.arange(grid.n + 1), np.where(grid.jump, where, 0))
        found = []
        for lowered, at in lowering.lower(body, nodes):
            keys = symbols(lowered)
            positions = {key: layout.position(key, at) for key in keys if isinstance(key, VariableRef)}
            data = tuple(key for key in keys if isinstance(key, DataRef))
            found.append(Form(lowered, at, positions, data))
        known[body, where] = found
    return known[body, where]


class Recovery:
    """Evaluates trajectories, and any expression of the spec, from a decision vector."""

    def __init__(
        self,
        problem: Problem,
        grid: Grid,
        layout: Layout,
        steps: Steps,
        lowering: Lowering,
        constants: Mapping[str, float],
        x: FloatArray,
    ) -> None:
        self.problem, self.grid, self.layout, self.steps, self.lowering = (
            problem,
            grid,
            layout,
            steps,
            lowering,
        )
        self.x = x
        self.parameters = {name: float(x[p]) for name, p in layout.parameters.items()}
        self._values: dict[object, float | FloatArray] = {ConstantRef(k): v for k, v in constants.items()}
        self._values.update({ParameterRef(k): v for k, v in self.parameters.items()})
        self.coefficients = steps.coefficients(constants)
        numbers = {k: v for k, v in self._values.items() if isinstance(v, float | int)}
        self.lengths = steps.lengths(self.coefficients, numbers)
        # In more digits: 100 steps of 0.04 s are 4 s and not more, which other programs refuse as beyond it.
        sums = np.cumsum(self.lengths, dtype=np.longdouble)
        self.time: FloatArray = np.concatenate([[0.0], sums]).astype(np.float64)

    def trajectories(self) -> dict[tuple[str, int], Channel]:
        """Node values per (variable, order): the unknowns, and under central the differences."""
        found: dict[tuple[str, int], Channel] = {}
        for name, order, before, after, middle in self.layout.slots():
            mid = self.x[middle] if len(middle) else None
            found[name, order] = Channel(self.x[before], self.x[after], mid)
        turning = [name for rotation in self.problem.rotations for name in rotation.quaternion]
        for name in turning:
            rate = self.rate(sym(VariableRef(name)))
            if rate is not None:
                found[name, 1] = rate
        if self.grid.method == "central" and self.grid.n > 0:
            for name in self.problem.variables:
                for order in (1,) if name in turning else (1, 2):
                    body = sym(VariableRef(name, order))
                    channel = self.channel(body)
                    if np.isfinite(channel.before).any():
                        found[name, order] = channel
        return found

    def derived(self) -> frozenset[tuple[str, int]]:
        """The trajectories that are computed from unknowns: the rates of quaternions."""
        return frozenset((name, 1) for r in self.problem.rotations for name in r.quaternion)

    def channel(self, body: Expr) -> Channel:
        """An expression of the spec at every node; where central differences do not reach, the nearest frame's value.

        Returns:
            A channel of n+1 frame values before and after, and n midpoint values for hermite-simpson.
        """
        n = self.grid.n
        before = self._filled(body, BEFORE, n + 1)
        after = self._filled(body, AFTER, n + 1) if self.grid.any_jump else before
        mid = self._filled(body, MIDPOINTS, n) if self.grid.has_midpoints else None
        held = np.flatnonzero(np.isfinite(before))
        channel = Channel(before, after, mid)
        if self.grid.method == "central" and 0 < len(held) <= n:
            return channel.held_outside(int(held[0]), int(held[-1]))
        return channel

    def _filled(self, body: Expr, where: int, count: int) -> FloatArray:
        """Values at all frames, of the side ``where``, or at all midpoints; nan without values. (count,)"""
        into = np.full(count, np.nan)
        for form in forms_of(self.lowering, body, where):
            if form.body.op == "sym" and form.body.payload in form.positions:
                into[form.nodes.frame] = self.x[form.positions[form.body.payload]]
                continue
            values = dict(self._values)
            for key, position in form.positions.items():
                values[key] = self.x[position]
            for datum in form.data:
                values[datum] = data_values(datum, form.nodes, self.steps, self.coefficients, {})
            into[form.nodes.frame] = np.asarray(evaluate(form.body, values), float)
        return into

    def rate(self, body: Expr, order: int = 1) -> Channel | None:
        """A total time derivative of an expression at every node; None where an unknown of it is missing."""
        slope = time_derivative(body, order, self.problem.rotations)
        for key in symbols(slope):
            if (
                isinstance(key, VariableRef)
                and self.grid.method != "central"
                and key.order > self.layout.order[key.name]
            ):
                return None
        return self.channel(slope)

    def number(self, body: Expr) -> float:
        """An expression of constants and parameters as a number."""
        return float(evaluate(body, {**self._values, IndexRef(): 0.0, TimeRef(): 0.0}))
