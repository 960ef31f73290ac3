"""The time from one frame to the next, and the time of every node.

Steps may differ between frames and may depend on parameters (free durations).  All of them are written over a
small basis of expressions free of ``i``::

    h[s] = sum over k of  A[k, s] * phi[k]

A piece of the step's definition that does not mention ``i`` is a basis function of its own with ``A = 1``; one
that mentions ``i`` but no parameter is a number per step (``phi = 1``); one that mentions both must be linear
in the parameters (``phi`` is the parameter).  Times and quadrature weights are sums of steps and so are linear
in the same basis.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from stc.errors import Diagnostic, SpecError
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import ONE, ZERO, Expr, evaluate, substitute, sym, symbols
from stc.transcription.grid import Grid, IntArray, Nodes

Expand = Callable[[Expr, Nodes], Iterable[tuple[Expr, Nodes]]]
FloatArray = NDArray[np.float64]


class Steps:
    """The steps of a motion over their basis.

    Attributes:
        basis: the expressions ``phi`` of constants and parameters.
        parameters: those in the basis, each once.
        support: (len(basis), n) bool, the basis functions of each step; it does not depend on the values of constants.
    """

    def __init__(self, problem: Problem, grid: Grid, expand: Expand) -> None:
        self.n = grid.n
        self.basis: list[Expr] = []
        self._coefficients: list[tuple[Expr, IntArray]] = []
        self._last: tuple[tuple[tuple[str, float], ...], FloatArray] | None = None
        rows: list[NDArray[np.bool_]] = []

        def add(phi: Expr, coefficient: Expr, steps: IntArray) -> None:
            if phi in self.basis:
                k = self.basis.index(phi)
            else:
                k = len(self.basis)
                self.basis.append(phi)
                rows.append(np.zeros(self.n, bool))
            rows[k][steps] = True
            self._coefficients.append((coefficient, np.concatenate([[k], steps])))

        for piece, nodes in expand(problem.step, grid.step_nodes()) if self.n else ():
            steps = nodes.frame
            keys = symbols(piece)
            parameters = [k for k in keys if isinstance(k, ParameterRef)]
            if not any(isinstance(k, IndexRef) for k in keys):
                add(piece, ONE, steps)
            elif not parameters:
                add(ONE, piece, steps)
            else:
                rest = substitute(piece, dict.fromkeys(parameters, ZERO))
                for key in parameters:
                    slope = derivative(piece, key)
                    if any(isinstance(k, ParameterRef) for k in symbols(slope)):
                        raise SpecError(
                            [
                                Diagnostic(
                                    "error",
                                    "a step that depends on i must be linear in the parameters",
                                    None,
                                    "give ranges of frames a definition of h each, or make h linear",
                                )
                            ]
                        )
                    add(sym(key), slope, steps)
                if rest is not ZERO:
                    add(ONE, rest, steps)
        self.support = np.array(rows, bool).reshape(len(self.basis), self.n)
        basic = dict.fromkeys(key for phi in self.basis for key in symbols(phi))
        self.parameters = [key for key in basic if isinstance(key, ParameterRef)]
        self.free = bool(self.parameters)
        self.plain = np.array(
            [
                all(c is ONE for c, where in self._coefficients if where[0] == k)
                for k in range(len(self.basis))
            ],
            bool,
        )

    def coefficients(self, constants: Mapping[str, float]) -> FloatArray:
        """``A`` (len(basis), n) for these constants; not to be written to, the last one is kept."""
        given = tuple(constants.items())
        if self._last is not None and self._last[0] == given:
            return self._last[1]
        result = np.zeros((len(self.basis), self.n))
        values: dict[object, float] = {ConstantRef(name): value for name, value in constants.items()}
        for expression, where in self._coefficients:
            k, steps = int(where[0]), where[1:]
            result[k, steps] = evaluate(expression, {**values, IndexRef(): steps.astype(float)})
        result.flags.writeable = False
        self._last = given, result
        return result

    def lengths(self, coefficients: FloatArray, values: Mapping[object, float]) -> FloatArray:
        """The length of every step (n,) for numeric constants and parameters (keys are symbols)."""
        phi = np.array([float(evaluate(e, dict(values))) for e in self.basis])
        return phi @ coefficients if len(phi) else np.zeros(self.n)

    def implied(
        self, coefficients: FloatArray, constants: Mapping[object, float]
    ) -> dict[str, tuple[float, float]]:
        """Bounds on parameters that make those steps positive that are linear in a single parameter.

        Args:
            coefficients: (len(basis), n), see :meth:`coefficients`.
            constants: values by symbol.
        """
        ranges: dict[str, tuple[float, float]] = {}
        for parameter in self.parameters:
            others = set(self.parameters) - {parameter}
            at_zero, rise, strange = np.zeros(self.n), np.zeros(self.n), np.zeros(self.n, bool)
            for phi, coefficient in zip(self.basis, coefficients, strict=True):
                slope = derivative(phi, parameter)
                if not others.isdisjoint(symbols(phi)) or parameter in symbols(slope):
                    strange |= coefficient != 0.0
                    continue
                at_zero += float(evaluate(phi, {**constants, parameter: 0.0})) * coefficient
                rise += float(evaluate(slope, dict(constants))) * coefficient
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                limit = 0.0 - at_zero / rise
            usual = ~strange & np.isfinite(limit)
            low = float(limit[usual & (rise > 0.0)].max(initial=-np.inf))
            high = float(limit[usual & (rise < 0.0)].min(initial=np.inf))
            ranges[parameter.name] = low, high
        return ranges

    def elapsed(self, coefficients: FloatArray, nodes: Nodes) -> FloatArray:
        """The elapsed amount of each basis function at each node (len(basis), k): time = phi @ elapsed."""
        total = np.concatenate([np.zeros((len(self.basis), 1)), np.cumsum(coefficients, axis=1)], axis=1)
        at = total[:, nodes.frame]
        middle = nodes.is_midpoint
        if middle.any():
            at[:, middle] += 0.5 * coefficients[:, nodes.frame[middle]]
        return at
