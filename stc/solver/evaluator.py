"""Evaluation of a scaled problem between fixed arrays, in calls that machine code can make.

:meth:`NLP.values` and :meth:`NLP.derivatives` take and return arrays, which costs more than small problems take to
evaluate.  An :class:`Evaluator` reads its point from one set of arrays and leaves the scaled numbers in another;
its two calls have no arguments, and :func:`stc.core.calls.chain` joins them with whatever comes before and after.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from stc.core.calls import Bound
from stc.core.structures import Structure, structure
from stc.records import dataclass, field
from stc.solver.nlp import NLP, Floats, Ints, Mask

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "Evaluable", "Evaluator", "Part", "PartlyEvaluable", "Scaling", "Stated", "evaluator_of", "python_evaluator",
    "status_of",
]  # fmt: skip

Indices = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Scaling:
    """``objective * f(x * variable)`` with rows ``row * r(x * variable)``.

    Derivatives by variables that are not ``live`` are 0, as are those of rows that are not ``bounded``.

    Attributes:
        variable: factor that turns scaled variables into those as stated, (n,).
        row: factor of each row, (m,).
        objective: factor of the objective.
        live: variables that may change, (n,) bool.
        bounded: rows that have a bound, (m,) bool.
    """

    variable: Floats
    row: Floats
    objective: float
    live: Mask
    bounded: Mask
    _known: list[tuple[Ints, Ints, Floats]] = field(default_factory=list, repr=False, compare=False)

    @classmethod
    def none(cls, n: int, m: int) -> Scaling:
        """Everything as stated."""
        return cls(np.ones(n), np.ones(m), 1.0, np.ones(n, bool), np.ones(m, bool))

    def gradient(self) -> Floats:
        """Factors of the objective's gradient, (n,)."""
        return self.objective * self._columns()

    def jacobian(self, rows: Ints, cols: Ints) -> Floats:
        """Factors of Jacobian entries, (k,), to be read only: the same array for the same entries."""
        return self._factors(rows, cols, lambda: self.row * self.bounded)

    def hessian(self, rows: Ints, cols: Ints) -> Floats:
        """Factors of the entries of the Lagrangian's Hessian, (k,), as above."""
        return self._factors(rows, cols, self._columns)

    def _factors(self, rows: Ints, cols: Ints, of_rows: Callable[[], Floats]) -> Floats:
        for known_rows, known_cols, known in self._known:
            if known_rows is rows and known_cols is cols:
                return known
        factors: Floats = of_rows()[rows] * self._columns()[cols]
        self._known[:] = [*self._known[-1:], (rows, cols, factors)]  # those of both matrices
        return factors

    def _columns(self) -> Floats:
        return self.variable * self.live


@dataclass(frozen=True, slots=True)
class Part:
    """Some of a program's variables and rows, which make a program of their own.

    Attributes:
        x: what the other variables are, (n,).
        cols, rows: which ones they are, (k,) each.
        jac, hess: which entries of the Jacobian and of the Hessian have row and column among them, (k,) each.
        jac_rows, jac_cols, hess_rows, hess_cols: where these are in the program that the part makes, (k,) each.
    """

    x: Floats
    cols: Indices
    rows: Indices
    jac: Indices
    hess: Indices
    jac_rows: Indices
    jac_cols: Indices
    hess_rows: Indices
    hess_cols: Indices

    @classmethod
    def of(cls, nlp: NLP, x: Floats, variables: Mask, rows: Mask) -> Part:
        """The part of a program with these variables (n,) and rows (m,); other variables are fixed at ``x`` (n,)."""
        new_col = (np.cumsum(variables) - 1).astype(np.int32)
        new_row = (np.cumsum(rows) - 1).astype(np.int32)
        jac = _which(rows[nlp.jac_rows] & variables[nlp.jac_cols])
        hess = _which(variables[nlp.hess_rows] & variables[nlp.hess_cols])
        return cls(
            x, _which(variables), _which(rows), jac, hess,
            new_row[nlp.jac_rows[jac]], new_col[nlp.jac_cols[jac]],
            new_col[nlp.hess_rows[hess]], new_col[nlp.hess_cols[hess]],
        )  # fmt: skip

    def alike(self, other: Part) -> bool:
        """Whether another part of the same program has the same variables and rows."""
        return np.array_equal(self.cols, other.cols) and np.array_equal(self.rows, other.rows)


def _which(wanted: Mask) -> Indices:
    return np.flatnonzero(wanted).astype(np.int32)


@dataclass(slots=True)
class Evaluator:
    """A scaled problem's numbers, and the calls that renew them.

    ``values_call()`` reads ``x`` and writes ``f``, ``r`` and ``values_status``; ``derivatives_call()`` reads ``x``,
    ``y`` and ``weight`` and writes the others.  Nobody else writes to what they write to.

    Attributes:
        x: scaled variables, (n,).
        y: scaled multipliers, (m,).
        weight: factor of the scaled objective in the Lagrangian's Hessian, (1,); 1 at first.
        f: scaled objective, (1,).
        r: scaled rows, (m,).
        values_status: 0 where ``f`` and all of ``r`` are finite, else nan, (1,).
        gradient: of the scaled objective, (n,).
        jac: scaled Jacobian entries, (nnz_J,).
        hess: scaled entries of the Hessian of ``weight * f + y . r``, (nnz_H,).
        derivatives_status: 0 where ``gradient``, ``jac`` and ``hess`` are finite, else nan, (1,).
    """

    x: Floats
    y: Floats
    weight: Floats
    f: Floats
    r: Floats
    values_status: Floats
    gradient: Floats
    jac: Floats
    hess: Floats
    derivatives_status: Floats
    values_call: Bound
    derivatives_call: Bound

    def structure(self) -> Structure:
        """The arrays for functions of the core (``evaluation`` in ``iteration.h``)."""
        return structure("evaluation")(
            x=self.x, y=self.y, f=self.f, r=self.r, gradient=self.gradient, jac=self.jac, hess=self.hess,
            values_status=self.values_status, derivatives_status=self.derivatives_status,
        )  # fmt: skip

    @classmethod
    def allocate(cls, n: int, m: int, jac_entries: int, hess_entries: int) -> Evaluator:
        """The arrays, zero; the calls do nothing yet."""
        nothing, zeros = Bound.of_python(lambda: None, ()), np.zeros
        return cls(
            x=zeros(n), y=zeros(m), weight=np.ones(1), f=zeros(1), r=zeros(m), values_status=zeros(1),
            gradient=zeros(n), jac=zeros(jac_entries), hess=zeros(hess_entries), derivatives_status=zeros(1),
            values_call=nothing, derivatives_call=nothing,
        )  # fmt: skip


@runtime_checkable
class Evaluable(Protocol):
    """A problem with evaluators of its own."""

    def evaluator(self, scaling: Scaling) -> Evaluator:
        """The evaluator for one scaling: its arrays, and the calls that fill them."""


@runtime_checkable
class PartlyEvaluable(Protocol):
    """A problem that brings evaluators of its parts, too."""

    def part_evaluator(self, scaling: Scaling, part: Part) -> Evaluator:
        """Arrays and calls for one scaling of the program that the part makes."""


@runtime_checkable
class Stated(Protocol):
    """A problem that evaluates itself as stated, unscaled, by an evaluator that others may use for a moment."""

    def as_stated(self) -> Evaluator:
        """The evaluator; its numbers are those of the last evaluation, by whomsoever."""


def evaluator_of(nlp: NLP, scaling: Scaling) -> Evaluator:
    """A problem's own evaluator, or one made of its ``values`` and ``derivatives``."""
    if isinstance(nlp, Evaluable):
        return nlp.evaluator(scaling)
    return python_evaluator(nlp, scaling)


def status_of(*parts: Floats) -> float:
    """0 where all numbers are finite, else nan."""
    with np.errstate(all="ignore"):
        return sum(float((0.0 * part).sum()) for part in parts)


def python_evaluator(nlp: NLP, scaling: Scaling) -> Evaluator:
    """An evaluator for any problem, whose calls go through Python."""
    result = Evaluator.allocate(nlp.n, nlp.m, len(nlp.jac_rows), len(nlp.hess_rows))
    of_gradient = scaling.gradient()
    of_jac = scaling.jacobian(nlp.jac_rows, nlp.jac_cols)
    of_hess = scaling.hessian(nlp.hess_rows, nlp.hess_cols)

    def values() -> None:
        f, r = nlp.values(result.x * scaling.variable)
        with np.errstate(all="ignore"):
            result.f[0] = scaling.objective * f
            np.multiply(scaling.row, r, out=result.r)
        result.values_status[0] = status_of(result.f, result.r)

    def derivatives() -> None:
        parts = nlp.derivatives(
            result.x * scaling.variable,
            result.y * scaling.row,
            float(result.weight[0]) * scaling.objective,
        )
        with np.errstate(all="ignore"):
            into = (result.gradient, result.jac, result.hess)
            for part, factors, out in zip(parts, (of_gradient, of_jac, of_hess), into, strict=True):
                np.multiply(part, factors, out=out)
        result.derivatives_status[0] = status_of(*into)

    result.values_call = Bound.of_python(values, ())
    result.derivatives_call = Bound.of_python(derivatives, ())
    return result
