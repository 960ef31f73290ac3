"""The pattern of a KKT system: which unknowns couple."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.records import dataclass
from stc.solver.nlp import Ints

__all__ = ["Couplings", "sort_by_key"]

Int32s = NDArray[np.int32]


@dataclass(frozen=True)
class Couplings:
    """The pattern of K: variables are the unknowns 0 to n - 1, rows n to n + m - 1.

    Attributes:
        n, m: numbers of variables and rows.
        first, second: the two unknowns of every entry off the diagonal: first those of H, then those of J.
        hess_off: which entries of H are off the diagonal, in order.
        hess_diagonal: which are on it, and of which variable (hess_variable).
        hess_count, jac_count: how many entries H and J have.
    """

    n: int
    m: int
    first: Int32s
    second: Int32s
    hess_off: NDArray[np.intp]
    hess_diagonal: NDArray[np.intp]
    hess_variable: Int32s
    hess_count: int
    jac_count: int

    @staticmethod
    def of(n: int, m: int, jac_rows: Ints, jac_cols: Ints, hess_rows: Ints, hess_cols: Ints) -> Couplings:
        """From the patterns of J and of the lower triangle of H."""
        jac_rows, jac_cols, hess_rows, hess_cols = (
            np.asarray(given).astype(np.int32) for given in (jac_rows, jac_cols, hess_rows, hess_cols)
        )
        hess_off = np.flatnonzero(hess_rows != hess_cols)
        hess_diagonal = np.flatnonzero(hess_rows == hess_cols)
        return Couplings(
            n,
            m,
            np.concatenate([hess_rows[hess_off], n + jac_rows]).astype(np.int32),
            np.concatenate([hess_cols[hess_off], jac_cols]),
            hess_off,
            hess_diagonal,
            hess_rows[hess_diagonal],
            hess_rows.size,
            jac_rows.size,
        )

    @property
    def sources(self) -> NDArray[np.intp]:
        """Where each entry off the diagonal is among the values of H and then J."""
        return np.concatenate([self.hess_off, self.hess_count + np.arange(self.jac_count)])

    @property
    def size(self) -> int:
        """N = n + m."""
        return self.n + self.m


def sort_by_key(keys: Int32s, count: int) -> tuple[Int32s, Int32s]:
    """Stable order of ``keys`` (whole numbers below ``count``), and where each key's run starts, (count + 1,)."""
    pointers = np.zeros(count + 1, dtype=np.int32)
    order = np.empty(keys.size, dtype=np.int32)
    _counting_sort(keys.size, np.ascontiguousarray(keys, dtype=np.int32), count, pointers, order)
    return order, pointers


_counting_sort = function("arranging_counting_sort")
