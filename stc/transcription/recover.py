"""From decision vectors back to values at the nodes of the motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.rates import time_derivative
from stc.symbolic.expr import Expr, evaluate, sym, symbols
from stc.trajectory import Channel
from stc.transcription.grid import AFTER, BEFORE, Grid, Nodes
from stc.transcription.layout import Layout
from stc.transcription.lower import Lowering, data_values
from stc.transcription.steps import Steps

FloatArray = NDArray[np.float64]


class Recovery:
    """Reads trajectories, and any expression of the spec, off a decision vector."""

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
        self.time: FloatArray = np.concatenate([[0.0], np.cumsum(self.lengths)])

    def trajectories(self) -> dict[tuple[str, int], Channel]:
        """Node values per (variable, order): the unknowns, and under central the differences."""
        found: dict[tuple[str, int], Channel] = {}
        for name, order, before, after, middle in self.layout.slots():
            mid = self.x[middle] if len(middle) else None
            found[name, order] = Channel(self.x[before], self.x[after], mid)
        if self.grid.method == "central" and self.grid.n > 0:
            for name in self.problem.variables:
                for order in (1, 2):
                    body = sym(VariableRef(name, order))
                    channel = self.channel(body)
                    if np.isfinite(channel.before).any():
                        found[name, order] = channel
        return found

    def channel(self, body: Expr) -> Channel:
        """An expression of the spec at every node; where central clips it, the nearest frame's value.

        Returns:
            A channel of n+1 frame values before and after, and n midpoint values for hermite-simpson.
        """
        n = self.grid.n
        before, after = np.full(n + 1, np.nan), np.full(n + 1, np.nan)
        mid = np.full(n, np.nan) if self.grid.has_midpoints else None
        frames = 2 * np.arange(n + 1)
        for side, into in ((BEFORE, before), (AFTER, after)):
            nodes = Nodes(frames, np.where(self.grid.jump, side, 0))
            self._fill(body, nodes, into)
        if mid is not None:
            self._fill(body, Nodes(2 * np.arange(n) + 1, np.zeros(n, np.int64)), mid)
        held = np.flatnonzero(np.isfinite(before))
        channel = Channel(before, after, mid)
        if self.grid.method == "central" and 0 < len(held) <= n:
            return channel.held_outside(int(held[0]), int(held[-1]))
        return channel

    def _fill(self, body: Expr, nodes: Nodes, into: FloatArray) -> None:
        for lowered, where in self.lowering.lower(body, nodes):
            values = dict(self._values)
            for key in symbols(lowered):
                if isinstance(key, VariableRef):
                    values[key] = self.x[self.layout.position(key, where)]
                elif key not in values:
                    values[key] = data_values(key, where, self.steps, self.coefficients, {})
            into[where.frame] = np.asarray(evaluate(lowered, values), float)

    def rate(self, body: Expr, order: int = 1) -> Channel | None:
        """A total time derivative of an expression at every node; None where an unknown of it is missing."""
        slope = time_derivative(body, order)
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
