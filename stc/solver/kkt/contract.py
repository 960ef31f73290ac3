"""What every factorisation of the KKT system offers.

    K = [ H + diag(p)    J^T     ]     n variables
        [ J             -diag(d) ]     m rows

The sparsity of H (lower triangle) and J is given once, the values again at every factorisation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from stc.core.calls import Bound
from stc.solver.nlp import Floats

__all__ = ["COARSE", "FINE", "Inertia", "KKTSystem", "NotFinite", "check_ended"]

#: The relative residual that iterative refinement aims at, and one that is enough for a step far from a solution, or
#: for one that is corrected.
FINE = 1e-13
COARSE = 1e-10
#: What a factorisation in the core returns where there are no factors.
NOT_FINITE, NO_MEMORY = 2, 3


class NotFinite(ValueError):
    """The matrix has entries that are not finite."""


def check_ended(ended: int) -> None:
    """Raise what a factorisation in the core has ended with, if it has made no factors.

    Raises:
        NotFinite: the matrix has entries that are not finite.
        MemoryError: there is no memory for the factors.
    """
    if ended == NOT_FINITE:
        raise NotFinite("the KKT matrix has entries that are not finite")
    if ended == NO_MEMORY:
        raise MemoryError("there is no memory for the factors of a linear system")


class Inertia(NamedTuple):
    """How many eigenvalues of a symmetric matrix are positive, negative and (numerically) zero."""

    positive: int
    negative: int
    zero: int


class KKTSystem(ABC):
    """A factorisation of K for one sparsity and many values.

    Implementations are built with
    ``(n, m, jac_rows, jac_cols, hess_rows, hess_cols, var_stage, row_stage, held)``: the sizes; the row and
    column of each entry of J, (nnz_J,), and of the lower triangle of H, (nnz_H,), every entry once; the elimination
    group of each variable, (n,), and row, (m,), groups being eliminated in increasing order; and which variables
    never move, (n,), their entries of J and H being zero: none when left out.

    Callers write into its arrays and read from them, without copies:

        kkt.hess[:] = ...; kkt.jac[:] = ...; kkt.primal[:] = ...; kkt.dual[:] = ...
        inertia = kkt.refactor()
        kkt.rhs[:] = ...
        kkt.solve_call()           # one call of machine code, which can be part of a chain
        kkt.check_solution()
        kkt.solution               # dx, dy

    ``factorize`` and ``solve`` do so with what they are given.

    Attributes:
        hess, jac, primal, dual: values of H (nnz_H,), J (nnz_J,), p (n,) and d (m,). All arrays stay the same objects
            as long as the system lives.
        rhs, solution: what to solve for, and what ``solve_call`` found, (n + m,).
        second_rhs, second_solution: the same for what else ``solve_both_call`` solves for.
        report: what solves tell: the relative residual (see ``last_residual``), (1,).
        accuracy: the relative residual that solves are content with, (1,): ``FINE`` after each factorisation.
        inertia: what ``attempt_call`` found, (3,).
        factorizations: how many matrices have been factorised so far.
        nnz_factor: entries stored for the last factorisation.
        last_residual: ``|K s - b| / (|K| |s| + |b|)`` of the last solve, in the maximum norm and row by row scaling
            of K.
    """

    _solve: Bound
    _solve_both: Bound

    def _allocate(
        self, n: int, m: int, hess_count: int, jac_count: int, further: int = 0
    ) -> dict[str, Floats]:
        """Its arrays.

        H, J, p and d are one after the other in ``given``, and behind them 1 and -1.

        Returns:
            The vectors with room for so many ``further`` unknowns behind their own ones.
        """
        self.n, self.m = n, m
        sizes = hess_count, jac_count, n, m
        self.given = np.concatenate([np.zeros(sum(sizes)), [1.0, -1.0]])
        self.hess, self.jac, self.primal, self.dual, _ = np.split(self.given, np.cumsum(sizes))
        names = "rhs", "solution", "second_rhs", "second_solution"
        vectors = {name: np.zeros(n + m + further) for name in names}
        self.rhs, self.solution, self.second_rhs, self.second_solution = (
            vectors[name][: n + m] for name in names
        )
        self.report, self.accuracy = np.zeros(1), np.full(1, FINE)
        self.inertia = np.zeros(3, dtype=np.int64)
        self.last_residual = 0.0
        self._factorized = False
        return vectors

    @property
    @abstractmethod
    def factorizations(self) -> int: ...

    @property
    @abstractmethod
    def nnz_factor(self) -> int: ...

    @abstractmethod
    def refactor(self) -> Inertia:
        """Factorise what is in the arrays; see ``factorize``.

        Raises:
            NotFinite: a value is not finite.
        """

    @property
    def attempt_call(self) -> Bound | None:
        """``refactor`` as one call of machine code for matrices like the last one, where all goes as it did there.

        Its result is 0 then, and ``solve_call`` and ``solve_both_call`` stay as they are. Other results are what
        ``resume`` takes. None where there is no such call; valid until ``refactor``, ``resume`` or ``check_solution``.

        It is for those who can only use the inertia (n, m, 0): any other may be found before the factorisation is
        complete. ``inertia`` is then wrong in the same direction, and there is nothing to solve with.
        """
        return None

    def resume(self, ended: int) -> Inertia:
        """``refactor``, after ``attempt_call`` has ended with this result, not 0."""
        return self.refactor()

    @property
    def solve_call(self) -> Bound:
        """The call that solves for ``rhs``, iterative refinement included; valid until the next factorisation.

        Raises:
            ValueError: nothing has been factorised.
        """
        if not self._factorized:
            raise ValueError("factorize before solving")
        return self._solve

    @property
    def solve_both_call(self) -> Bound:
        """The same for ``rhs`` and ``second_rhs``, in less time than two solves take.

        ``report`` tells of the one that is less accurate.
        """
        if not self._factorized:
            raise ValueError("factorize before solving")
        return self._solve_both

    @abstractmethod
    def check_solution(self) -> bool:
        """After a solve: where the residual is doubtful, factorise more carefully and solve for ``rhs`` again.

        Returns:
            Whether that was done: ``solution`` and the calls are new then.
        """

    def factorize(
        self, hess_values: Floats, jac_values: Floats, primal_diagonal: Floats, dual_diagonal: Floats
    ) -> Inertia:
        """Factorise K for these values of H (nnz_H,), J (nnz_J,), p (n,) and d (m,).

        Returns:
            The inertia of K.  A singular or hardly regular K has zeros in it, and can still be solved with: the
            solution is then finite, and exact only where the right-hand side lies in the range of K.

        Raises:
            NotFinite: a value is not finite.
            ValueError: an array has the wrong size.
        """
        own = self.hess, self.jac, self.primal, self.dual
        names = "hess_values", "jac_values", "primal_diagonal", "dual_diagonal"
        given = hess_values, jac_values, primal_diagonal, dual_diagonal
        for mine, array, name in zip(own, given, names, strict=True):
            _check_size(array, mine.size, name)
        for mine, array in zip(own, given, strict=True):
            mine[:] = array
        return self.refactor()

    def solve(self, rhs_x: Floats, rhs_y: Floats) -> tuple[Floats, Floats]:
        """Solve ``K [dx; dy] = [rhs_x; rhs_y]`` with iterative refinement; new arrays (n,) and (m,).

        Raises:
            ValueError: nothing has been factorised, or an array has the wrong size.
        """
        call, n = self.solve_call, self.primal.size
        _check_size(rhs_x, n, "rhs_x")
        _check_size(rhs_y, self.dual.size, "rhs_y")
        self.rhs[:n] = rhs_x
        self.rhs[n:] = rhs_y
        call()
        self.check_solution()
        return self.solution[:n].copy(), self.solution[n:].copy()


def _check_size(array: Floats, size: int, name: str) -> None:
    if np.shape(array) != (size,):
        raise ValueError(f"{name} has shape {np.shape(array)}, expected ({size},)")
