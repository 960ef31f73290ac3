"""The KKT system as a dense matrix: slow, simple, and the judge of the structured one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.calls import Bound
from stc.solver.kkt.contract import Inertia, KKTSystem, NotFinite
from stc.solver.nlp import Floats, Ints

#: Eigenvalues of the equilibrated matrix below this count as zero.
SINGULAR = 1e-13


def dense_matrix(
    n: int,
    m: int,
    jac_rows: Ints,
    jac_cols: Ints,
    hess_rows: Ints,
    hess_cols: Ints,
    hess_values: Floats,
    jac_values: Floats,
    primal_diagonal: Floats,
    dual_diagonal: Floats,
) -> Floats:
    """The symmetric matrix K, (n + m, n + m), written out."""
    matrix = np.zeros((n + m, n + m))
    matrix[hess_rows, hess_cols] = hess_values
    matrix[hess_cols, hess_rows] = hess_values
    matrix[n + jac_rows, jac_cols] = jac_values
    matrix[jac_cols, n + jac_rows] = jac_values
    diagonal = np.arange(n + m)
    matrix[diagonal, diagonal] += np.concatenate([primal_diagonal, -np.asarray(dual_diagonal)])
    return matrix


def equilibrated(matrix: Floats, sweeps: int = 20) -> tuple[Floats, Floats]:
    """``(S K S, s)`` with the largest entry of every row of S K S near 1 (Ruiz 2001); empty rows keep s = 1."""
    scale = np.ones(matrix.shape[0])
    scaled = matrix.copy()
    for _ in range(sweeps):
        largest = np.abs(scaled).max(axis=1, initial=0.0)
        factor = 1.0 / np.sqrt(np.where(largest > 0.0, largest, 1.0))
        scale *= factor
        scaled = matrix * scale[:, None] * scale
    return scaled, scale


class DenseKKT(KKTSystem):
    """K through its eigenvalue decomposition after equilibration (see ``KKTSystem`` for the meaning of the members).

    Eigenvalues decide the inertia; null directions are left out of solves.
    """

    factorizations = nnz_factor = 0

    def __init__(
        self,
        n: int,
        m: int,
        jac_rows: Ints,
        jac_cols: Ints,
        hess_rows: Ints,
        hess_cols: Ints,
        var_stage: Ints,
        row_stage: Ints,
        held: NDArray[np.bool_] | None = None,
    ) -> None:
        self._allocate(n, m, np.size(hess_rows), np.size(jac_rows))
        self.nnz_factor = (n + m) ** 2
        self._pattern = (
            np.asarray(jac_rows),
            np.asarray(jac_cols),
            np.asarray(hess_rows),
            np.asarray(hess_cols),
        )
        self._solve = Bound.of_python(self._solve_once, ())
        self._solve_both = Bound.of_python(self._solve_twice, ())

    def refactor(self) -> Inertia:
        """See ``KKTSystem.refactor``."""
        self._factorized = False
        values = self.hess, self.jac, self.primal, self.dual
        if not all(np.isfinite(array).all() for array in values):
            raise NotFinite("the KKT matrix has entries that are not finite")
        self.factorizations += 1
        matrix = dense_matrix(self.n, self.m, *self._pattern, *values)
        self._scaled, self._scale = equilibrated(matrix)
        self._eigenvalues, self._vectors = np.linalg.eigh(self._scaled)
        self._factorized = True
        positive = int((self._eigenvalues > SINGULAR).sum())
        negative = int((self._eigenvalues < -SINGULAR).sum())
        return Inertia(positive, negative, self.n + self.m - positive - negative)

    def check_solution(self) -> bool:
        """See ``KKTSystem.check_solution``: there is nothing more careful."""
        self.last_residual = float(self.report[0])
        return False

    def _solve_once(self) -> None:
        self.report[0] = self._solve_for(self.rhs, self.solution)

    def _solve_twice(self) -> None:
        residuals = (
            self._solve_for(self.rhs, self.solution),
            self._solve_for(self.second_rhs, self.second_solution),
        )
        self.report[0] = max(residuals)

    def _solve_for(self, given: Floats, solution: Floats) -> float:
        """Relative residual of the solution that is found."""
        rhs = given * self._scale
        solution[:] = 0.0
        if rhs.size == 0:
            return 0.0
        kept = np.abs(self._eigenvalues) > SINGULAR
        vectors = self._vectors[:, kept]
        for _ in range(3):
            residual = rhs - self._scaled @ solution
            solution += vectors @ ((vectors.T @ residual) / self._eigenvalues[kept])
        residual = rhs - self._scaled @ solution
        norm = np.abs(self._scaled).sum(axis=1).max() * np.abs(solution).max() + np.abs(rhs).max()
        solution *= self._scale
        return float(np.abs(residual).max() / norm) if norm > 0.0 else 0.0
