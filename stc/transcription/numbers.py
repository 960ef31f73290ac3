"""Values of expressions of constants and node data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from stc.problem import ConstantRef, ParameterRef, VariableRef
from stc.symbolic.expr import Expr, evaluate, evaluate_all, symbols
from stc.transcription.grid import Nodes
from stc.transcription.layout import Layout
from stc.transcription.lower import DataRef, data_values
from stc.transcription.statements import Statements
from stc.transcription.steps import Steps

FloatArray = NDArray[np.float64]


class Numbers:
    """Evaluates expressions of constants and node data for given constants."""

    def __init__(
        self, statements: Statements, steps: Steps, coefficients: FloatArray, constants: Mapping[str, float]
    ) -> None:
        self.steps, self.coefficients = steps, coefficients
        self.weights = {k: table.values(coefficients) for k, table in enumerate(statements.weights)}
        self.constants: dict[object, float] = {ConstantRef(name): value for name, value in constants.items()}
        self._known: dict[Expr, np.float64] = {}

    def data(self, ref: DataRef, nodes: Nodes) -> FloatArray:
        return data_values(ref, nodes, self.steps, self.coefficients, self.weights)

    def at(self, e: Expr, nodes: Nodes) -> FloatArray:
        """The value of ``e`` at every node. (k,)"""
        value = self.value(e, nodes)
        return np.full(len(nodes), value) if np.ndim(value) == 0 else np.asarray(value)

    def evaluate(self, expressions: Iterable[Expr]) -> None:
        """Evaluate expressions that have the same value at all nodes, together, for later calls of :meth:`value`."""
        new = dict.fromkeys(e for e in expressions if e not in self._known and not _of_data(e))
        values = evaluate_all(list(new), self.constants)
        self._known.update({e: np.float64(value) for e, value in zip(new, values, strict=True)})

    def value(self, e: Expr, nodes: Nodes) -> np.float64 | FloatArray:
        """The value of ``e``: one number if it is the same at all nodes, otherwise one for each, (k,)."""
        known = self._known.get(e)
        if known is not None:
            return known
        data = _of_data(e)
        if data:
            given: dict[object, float | FloatArray] = {
                **self.constants,
                **{key: self.data(key, nodes) for key in data},
            }
            return np.broadcast_to(np.asarray(evaluate(e, given), float), (len(nodes),))
        found = self._known[e] = np.float64(evaluate(e, self.constants))
        return found

    def of_unknowns(self, e: Expr, nodes: Nodes, layout: Layout, x: FloatArray) -> FloatArray:
        """The value of ``e`` at every node of a decision vector ``x`` (layout.size,). (k,)"""
        given: dict[object, float | FloatArray] = dict(self.constants)
        for key in symbols(e):
            if isinstance(key, VariableRef | ParameterRef):
                given[key] = x[layout.position(key, nodes)]
            elif isinstance(key, DataRef):
                given[key] = self.data(key, nodes)
        return np.broadcast_to(np.asarray(evaluate(e, given), float), (len(nodes),))


def _of_data(e: Expr) -> list[DataRef]:
    """The data of nodes that an expression refers to."""
    return [key for key in symbols(e) if isinstance(key, DataRef)]
