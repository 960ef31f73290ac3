"""The solver's view of a problem.

    minimise    f(x)
    subject to  row_lower <= r(x) <= row_upper
                x_lower   <=   x  <= x_upper

Equal bounds state an equality (or a fixed variable), infinite ones an absent bound.  Multipliers follow one
sign convention everywhere: at a solution ``grad f + J^T y + z = 0`` with ``y >= 0`` where a row is at its upper
bound and ``y <= 0`` where it is at its lower bound; the same for ``z`` and the bounds of the variables.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["NLP", "Floats", "Ints", "Mask"]

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
Mask = NDArray[np.bool_]


class NLP(Protocol):
    """A nonlinear program with sparse exact first and second derivatives."""

    @property
    def n(self) -> int:
        """Number of variables."""

    @property
    def m(self) -> int:
        """Number of rows."""

    @property
    def x0(self) -> Floats:
        """Starting point, (n,)."""

    @property
    def x_lower(self) -> Floats:
        """Lower bounds of the variables, (n,)."""

    @property
    def x_upper(self) -> Floats:
        """Upper bounds of the variables, (n,)."""

    @property
    def row_lower(self) -> Floats:
        """Lower bounds of the rows, (m,)."""

    @property
    def row_upper(self) -> Floats:
        """Upper bounds of the rows, (m,)."""

    @property
    def jac_rows(self) -> Ints:
        """Row of each Jacobian entry, (nnz_J,); every (row, column) occurs once."""

    @property
    def jac_cols(self) -> Ints:
        """Column of each Jacobian entry, (nnz_J,)."""

    @property
    def hess_rows(self) -> Ints:
        """Row of each Hessian entry, (nnz_H,): lower triangle, every entry once."""

    @property
    def hess_cols(self) -> Ints:
        """Column of each Hessian entry, (nnz_H,), at most the row."""

    @property
    def var_stage(self) -> Ints:
        """Elimination group of each variable, (n,)."""

    @property
    def row_stage(self) -> Ints:
        """Elimination group of each row, (m,)."""

    @property
    def row_linear(self) -> Mask:
        """True where a row is an affine function of the variables, (m,)."""

    @property
    def objective_degree(self) -> int:
        """0 constant, 1 affine, 2 quadratic, 3 anything else."""

    @property
    def fixed_curvature(self) -> Mask:
        """True where the variable's entries of the Hessian are the same everywhere, (n,): rows are affine in it, and
        the objective quadratic."""

    def values(self, x: Floats) -> tuple[float, Floats]:
        """Objective and rows at ``x`` (n,): ``(f, r (m,))``; nan or inf where undefined."""

    def derivatives(
        self, x: Floats, multipliers: Floats, objective_factor: float
    ) -> tuple[Floats, Floats, Floats]:
        """Gradient (n,), Jacobian entries (nnz_J,) and the entries (nnz_H,) of the Hessian of
        ``objective_factor * f + multipliers . r``.  The arrays may be buffers that the next call overwrites, and that
        nobody else does.
        """
