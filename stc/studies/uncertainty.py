"""Standard errors of estimated parameters, from the residuals' Jacobian at the solution.

Where the objective is a sum of squares over the rows of data sets, ``S = sum of r^2``, and the residuals are
independent and of one variance, the parameters' covariance is to first order ``sigma^2 C`` with ``sigma^2 = S/(m -
p)``, m residuals and p degrees of freedom (Bates & Watts 1988, chapter 2). C is the inverse of the Gauss-Newton
matrix J^T J on the directions that the active constraints A leave open: its columns are the dx of

    | -I   J    0  | | r  |   | 0 |
    | J^T  0   A^T | | dx | = | e |
    | 0    A    0  | | y  |   | 0 |

so that the motions of a differential equation need not be eliminated.  Residuals' second derivatives do not enter, as
in most published standard errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stc.errors import UsageError
from stc.problem import CellRef, ConstantRef, ObjectiveTerm, ParameterRef, VariableRef
from stc.records import dataclass
from stc.solution_origin import model_of
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import ONE, Expr, call, div, evaluate, mul, symbols
from stc.transcription.grid import Nodes
from stc.transcription.lower import DataRef, data_values
from stc.transcription.statements import Sorter
from stc.transcription.transcription import Transcription

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

__all__ = ["Uncertainty", "of_solution", "uncertainty"]

#: A multiplier above this share of the largest one holds the solution at its bound.
HELD = 1e-9
#: So near its bound, relative to max(1, the bound), is what such a multiplier holds.
CLOSE = 1e-6
#: A direction that the residuals change less than this with, scaled, is one that they do not determine.
UNDETERMINED = 1e-13
#: Weights that hold all scaled directions, so that C exists.  From the first to the second a variance that the
#: residuals determine stays the same, and any other grows by their ratio: more than :data:`GROWN`.
SOFT, GROWN = (1e-8, 1e-10), 2.0


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """The standard errors of estimated parameters.

    Attributes:
        residuals: number of residuals.
        freedom: residuals less degrees of freedom of the fit.
        deviation: residual standard deviation, sqrt(S/freedom), in the units of the residuals.
        errors: standard error of each parameter; infinite where the data do not determine it, 0 where a bound holds it.
        covariance: of the parameters in this order, (k, k).
    """

    residuals: int
    freedom: int
    deviation: float
    errors: dict[str, float]
    covariance: FloatArray

    def to_dict(self) -> dict[str, Any]:
        """All but the covariance, by name."""
        return {
            "residuals": self.residuals,
            "degrees_of_freedom": self.freedom,
            "residual_standard_deviation": self.deviation,
            "standard_errors": self.errors,
        }


def uncertainty(model: Model, solution: Solution) -> Uncertainty:
    """The standard errors of the parameters of an estimation problem.

    Args:
        model: the spec.
        solution: of it, optimal.

    Raises:
        UsageError: the solution is not optimal, or of another problem; there are no parameters, the objective is not a
            sum of squares over the rows of data sets, or does not have more residuals than the fit has degrees of
            freedom.
    """
    if solution.status != "optimal":
        raise UsageError(f"only an optimal solution has standard errors, and this one is {solution.status}")
    problem, transcription = model.transcription(solution.method, **solution.overrides)
    terms = [(term, squares_in(term.body)) for term in problem.objective]
    if not problem.parameters or not terms:
        raise UsageError("standard errors belong to parameters, and the spec estimates none")
    other = next((term for term, found in terms if not term.rows or not found), None)
    if other is not None:
        raise UsageError(
            f"no standard errors: `{other.text}` is not a square on the rows of data",
            "they follow from squares, as in `[walk]: (q - walk.q)^2;`, each perhaps with a known weight",
        )
    bound = transcription.bind(problem.constants, start=solution.x, check=False)
    if len(solution.x) != bound.n or len(solution.row_multipliers) != bound.m:
        raise UsageError("this solution is of another problem: it has other unknowns and rows")
    residuals, rows, cols, slopes = _residuals(transcription, terms, solution.x)
    free = np.flatnonzero(~held(solution.x, bound.x_lower, bound.x_upper, solution.bound_multipliers))
    values = bound.values(solution.x)[1].copy()
    active = np.flatnonzero(held(values, bound.row_lower, bound.row_upper, solution.row_multipliers))
    count, freedom = len(residuals), len(residuals) - (len(free) - len(active))
    if freedom <= 0:
        unknown = count - freedom
        raise UsageError(
            f"no standard errors: {count} residuals for {unknown} unknowns that only the data determine"
        )
    jacobian = bound.derivatives(solution.x, solution.row_multipliers, 1.0)[1]
    places = np.array([transcription.layout.parameters[name] for name in problem.parameters])
    sparse = _Sparse(bound.n, count, bound.m)
    spread = sparse.covariance(
        (slopes, rows, cols), (jacobian, bound.jac_rows, bound.jac_cols), free, active, places
    )
    variance = float(residuals @ residuals) / freedom
    errors = np.sqrt(variance * np.diag(spread))
    return Uncertainty(
        count,
        freedom,
        float(np.sqrt(variance)),
        dict(zip(problem.parameters, errors.tolist(), strict=True)),
        variance * spread,
    )


def of_solution(solution: Solution) -> Uncertainty:
    """The uncertainty of the parameters of a solution; for one from a file the spec is parsed from the text in it."""
    return uncertainty(model_of(solution), solution)


def squares_in(e: Expr) -> list[Expr]:
    """The expressions whose squares an expression sums; empty if it is not such a sum."""
    if e.op == "add":
        parts = [squares_in(arg) for arg in e.args]
        return [each for part in parts for each in part] if all(parts) else []
    if e.op == "pow" and e.args[1].op == "num" and e.args[1].payload == 2.0:
        return [e.args[0]]
    if e.op == "mul" and e.args[0] is e.args[1]:
        return [e.args[0]]
    if e.op == "mul":
        factors = [arg for arg in e.args if _is_known(arg)]
        if factors:
            rest = e.args[1] if factors[0] is e.args[0] else e.args[0]
            return [mul(call("sqrt", factors[0]), part) for part in squares_in(rest)]
    if e.op == "div" and _is_known(e.args[1]):
        return [mul(call("sqrt", div(ONE, e.args[1])), part) for part in squares_in(e.args[0])]
    return []


def _is_known(e: Expr) -> bool:
    return all(isinstance(key, ConstantRef | CellRef) for key in symbols(e))


def held(
    values: FloatArray, lower: FloatArray, upper: FloatArray, multipliers: FloatArray
) -> NDArray[np.bool_]:
    """The directions that equal bounds, or a bound with a multiplier, fix."""
    pulled = np.abs(multipliers) > HELD * max(1.0, float(np.abs(multipliers).max(initial=0.0)))
    bound = np.where(multipliers > 0.0, upper, lower)
    with np.errstate(invalid="ignore"):
        near = np.abs(values - bound) <= CLOSE * np.maximum(1.0, np.abs(bound))
    return (lower == upper) | (pulled & near)


def _residuals(
    transcription: Transcription, terms: list[tuple[ObjectiveTerm, list[Expr]]], x: FloatArray
) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """The residuals (m,) at a point, and the rows, columns and values of their Jacobian."""
    values, rows, cols, slopes = [], [], [], []
    at = 0
    for e, nodes, given, unknown in _forms(transcription, terms, x):
        size = len(nodes)
        values.append(np.broadcast_to(np.asarray(evaluate(e, given), float), (size,)))
        for key, position in unknown.items():
            slope = np.asarray(evaluate(derivative(e, key), given), float)
            rows.append(at + np.arange(size))
            cols.append(position)
            slopes.append(np.broadcast_to(slope, (size,)))
        at += size
    return np.concatenate(values), np.concatenate(rows), np.concatenate(cols), np.concatenate(slopes)


def _forms(
    transcription: Transcription, terms: list[tuple[ObjectiveTerm, list[Expr]]], x: FloatArray
) -> Iterator[tuple[Expr, Nodes, dict[object, Any], dict[VariableRef | ParameterRef, IntArray]]]:
    """Each residual by decision variables, with its nodes, the values in it, and where its unknowns are."""
    problem, steps, layout = transcription.problem, transcription.steps, transcription.layout
    coefficients = steps.coefficients(problem.constants)
    constants: dict[object, Any] = {ConstantRef(name): value for name, value in problem.constants.items()}
    sorter = Sorter(problem, transcription.grid, transcription.lowering)
    for term, found in terms:
        measured = sorter.measured(term)
        for residual in found:
            for e, nodes in measured.lowered(residual):
                tables = {k: table.values(coefficients) for k, table in enumerate(sorter.weights)}
                given: dict[object, Any] = dict(constants)
                unknown: dict[VariableRef | ParameterRef, IntArray] = {}
                for key in symbols(e):
                    if isinstance(key, VariableRef | ParameterRef):
                        unknown[key] = layout.position(key, nodes)
                        given[key] = x[unknown[key]]
                    elif isinstance(key, DataRef):
                        given[key] = data_values(key, nodes, steps, coefficients, tables)
                yield e, nodes, given, unknown


_Entries = tuple[FloatArray, NDArray[Any], NDArray[Any]]
"""Values, rows and columns of a sparse matrix."""


class _Sparse:
    """The system above, for a program of n unknowns, m rows and the given number of residuals."""

    def __init__(self, n: int, residuals: int, m: int) -> None:
        self.n, self.residuals, self.m = n, residuals, m

    def covariance(
        self, slopes: _Entries, jacobian: _Entries, free: IntArray, active: IntArray, wanted: IntArray
    ) -> FloatArray:
        """The part of C for the unknowns ``wanted``, (k, k).

        Args:
            slopes: Jacobian of the residuals.
            jacobian: that of the rows.
            free: unknowns that no bound holds.
            active: active rows.
        """
        from scipy.sparse import coo_array, csc_array

        j = coo_array((slopes[0], slopes[1:]), (self.residuals, self.n)).tocsc()[:, free]
        a = coo_array((jacobian[0], jacobian[1:]), (self.m, self.n)).tocsr()[active].tocsc()[:, free]
        size = len(free)
        # Unknowns have units of all sizes: columns, then the rows of A, are brought to length 1.
        lengths = np.sqrt(np.asarray((j * j).sum(axis=0) + (a * a).sum(axis=0)).reshape(-1))
        scale = 1.0 / np.where(lengths > 0.0, lengths, 1.0)
        j, a = csc_array(j * scale), csc_array(a * scale)
        norms = np.sqrt(np.asarray((a * a).sum(axis=1)).reshape(-1))
        a = csc_array((1.0 / np.where(norms > 0.0, norms, 1.0))[:, None] * a)
        place = np.full(self.n, -1)
        place[free] = np.arange(size)
        spread = np.zeros((len(wanted), len(wanted)))
        found = [k for k, at in enumerate(wanted) if place[at] >= 0]
        inside = place[wanted[found]]
        inverse = _inverse(j, a, inside, 0.0)
        if inverse is None:  # Something is not determined, or some rows follow from others.
            soft, inverse = (_inverse(j, a, inside, weight) for weight in SOFT)
            assert soft is not None
            assert inverse is not None
            lost = np.diag(inverse) > GROWN * np.diag(soft)
            inverse[lost, :] = inverse[:, lost] = 0.0
            inverse[lost, lost] = np.inf
        spread[np.ix_(found, found)] = inverse * np.outer(scale[inside], scale[inside])
        return 0.5 * (spread + spread.T)


def _inverse(j: Any, a: Any, inside: IntArray, soft: float) -> FloatArray | None:
    """The part of C for some unknowns, (k, k), with every direction held by this weight; None if C does not exist."""
    from scipy.sparse.linalg import splu

    count = j.shape[0]
    matrix = _bordered(j.tocoo(), a.tocoo(), soft)
    try:
        factors = splu(matrix)
    except RuntimeError:  # exactly singular
        return None
    pivots = np.abs(factors.U.diagonal())
    if not soft and pivots.min() < UNDETERMINED * pivots.max():
        return None
    right = np.zeros((len(matrix.indptr) - 1, len(inside)))
    right[count + inside, np.arange(len(inside))] = 1.0
    columns = factors.solve(right)
    columns += factors.solve(right - matrix @ columns)  # what rounding left over
    found: FloatArray = columns[count + inside]
    return found


def _bordered(j: Any, a: Any, soft: float) -> Any:
    """The symmetric matrix of residuals, unknowns and active rows, in SciPy's format of columns.

    Args:
        soft: weight that holds every unknown where it is, and by which rows may be missed.
    """
    from scipy.sparse import coo_array

    count, size = j.shape
    below = count + size
    total = below + a.shape[0]
    diagonal = np.concatenate([-np.ones(count), np.full(size, soft), np.full(a.shape[0], -soft)])
    every = np.arange(total if soft else count)
    rows = [every, j.row, count + j.col, below + a.row, count + a.col]
    cols = [every, count + j.col, j.row, count + a.col, below + a.row]
    values = [diagonal[: len(every)], j.data, j.data, a.data, a.data]
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))
    return coo_array(entries, (total, total)).tocsc()
