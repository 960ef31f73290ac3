"""A program near one of its points: what is active there, which multipliers balance a gradient, and where forces lead.

Unknowns have units of all sizes: each is divided by what it is of the order of, and each row by the length of its
gradient, before anything is added up or factorised.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.studies.uncertainty import held
from stc.transcription.bind import BoundProgram

__all__ = ["Tangent"]

FloatArray = NDArray[np.float64]

#: Of the Hessian's typical diagonal, and of the rows: keeps systems regular where unknowns or rows are idle.
_REGULAR = 1e-9


class Tangent:
    """The active constraints of a program at a point.

    Parameters
    ----------
    bound
        The program.
    x
        (n,) the point.
    multipliers
        (m,) of the rows and (n,) of the bounds there, which tell what inequalities hold.
    sizes
        (n,) what each unknown is of the order of.
    """

    def __init__(
        self,
        bound: BoundProgram,
        x: FloatArray,
        multipliers: tuple[FloatArray, FloatArray],
        sizes: FloatArray,
    ) -> None:
        from scipy.sparse import coo_array, diags_array

        self.bound, self.x, self.sizes = bound, x, sizes
        of_rows, of_bounds = multipliers
        self.free = np.flatnonzero(~held(x, bound.x_lower, bound.x_upper, of_bounds))
        values = bound.values(x)[1].copy()
        self.active = np.flatnonzero(held(values, bound.row_lower, bound.row_upper, of_rows))
        jacobian = bound.derivatives(x, np.zeros(bound.m), 1.0)[1].copy()
        whole = coo_array((jacobian, (bound.jac_rows, bound.jac_cols)), (bound.m, bound.n)).tocsr()
        rows = (whole[self.active] @ diags_array(sizes)).tocsc()[:, self.free]
        norms = np.sqrt(np.asarray((rows * rows).sum(axis=1)).reshape(-1))
        self._norms = np.where(norms > 0.0, norms, 1.0)
        self._rows = (diags_array(1.0 / self._norms) @ rows).tocsc()

    def scaled(self, gradients: FloatArray) -> FloatArray:
        """Gradients (n,) or (n, k) by the unknowns that are free, each by its size."""
        return np.asarray((gradients.T * self.sizes).T[self.free])

    def balanced(self, gradient: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The row multipliers (m,) that balance a gradient (n,) best, and the scaled remainder of the gradient."""
        from scipy.sparse import block_array, diags_array
        from scipy.sparse.linalg import splu

        count, size = self._rows.shape
        system = block_array(
            [
                [diags_array(np.ones(size)), self._rows.T],
                [self._rows, diags_array(np.full(count, -_REGULAR))],
            ]
        ).tocsc()
        found = splu(system).solve(np.append(self.scaled(gradient), np.zeros(count)))
        multipliers = np.zeros(self.bound.m)
        multipliers[self.active] = -found[size:] / self._norms
        return multipliers, found[:size]

    def moves(self, multipliers: FloatArray, gradients: FloatArray) -> FloatArray:
        """(n, k) the Newton steps of the solution if each of k gradients is added to that of the objective.

        Parameters
        ----------
        multipliers
            (m,) of the rows, in the Hessian of the Lagrangian.
        gradients
            Of what is added.
        """
        from scipy.sparse import block_array, coo_array, diags_array
        from scipy.sparse.linalg import splu

        bound, free = self.bound, self.free
        hessian = bound.derivatives(self.x, multipliers, 1.0)[2].copy()
        lower: Any = coo_array((hessian, (bound.hess_rows, bound.hess_cols)), (bound.n, bound.n)).tocsc()
        lower = diags_array(self.sizes) @ lower @ diags_array(self.sizes)
        whole = (lower + lower.T - diags_array(lower.diagonal())).tocsc()[free][:, free]
        typical = float(np.median(np.abs(whole.diagonal()))) or 1.0
        count = len(self.active)
        system = block_array(
            [
                [whole + diags_array(np.full(len(free), _REGULAR * typical)), self._rows.T],
                [self._rows, diags_array(np.full(count, -_REGULAR / typical))],
            ]
        ).tocsc()
        right = np.vstack([-self.scaled(gradients), np.zeros((count, gradients.shape[1]))])
        found = np.zeros((bound.n, gradients.shape[1]))
        found[free] = self.sizes[free, None] * splu(system).solve(right)[: len(free)]
        return found
