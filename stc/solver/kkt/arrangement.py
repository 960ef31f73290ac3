"""The matrix in elimination order: where each unknown and each given entry goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.records import dataclass
from stc.solver.nlp import Ints

__all__ = [
    "Arrangement",
    "Couplings",
    "arrange",
    "enter_window",
    "sort_by_key",
    "tops_without_leaves",
    "window_targets",
]

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
        kept: which of all entries off the diagonal are in ``first`` and ``second``, (E,), None for all of them.
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
    kept: NDArray[np.intp] | None = None

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
    def size(self) -> int:
        """N = n + m."""
        return self.n + self.m

    @property
    def left_out(self) -> int:
        """How many entries off the diagonal are not in ``first`` and ``second``."""
        return 0 if self.kept is None else self.hess_off.size + self.jac_count - self.kept.size

    def only(self, kept: NDArray[np.intp]) -> Couplings:
        """The same with some entries off the diagonal (numbers, increasing) only; of the whole pattern."""
        return replace(self, first=self.first[kept], second=self.second[kept], kept=kept)


@dataclass(frozen=True)
class Arrangement:
    """Elimination order, and the upper triangle by rows in that order (see stc.solver.kkt.values).

    Attributes:
        order: unknown at each position, (N,); position: its inverse.
        stage_pointers: first position of each stage, (stages + 1,).
        pointers, columns: positions coupled with a later position, (N + 1,) and (E,).
        entry: which coupling each of them is, (E,).
        hess_target, jac_target: where the given entries of H and J go among the values: those left out of the pattern
            behind all others.
    """

    order: Int32s
    position: Int32s
    stage_pointers: Int32s
    pointers: Int32s
    columns: Int32s
    entry: Int32s
    hess_target: Int32s
    jac_target: Int32s


def arrange(couplings: Couplings, stage: Int32s, stages: int, rank: Int32s) -> Arrangement:
    """Order the unknowns by stage and, within a stage, by ``rank`` (N,)."""
    size = couplings.size
    ranks = int(rank.max(initial=0)) + 1
    by_rank, _ = sort_by_key(rank, ranks)
    in_stage, stage_pointers = sort_by_key(stage[by_rank], stages)
    order = by_rank[in_stage]
    position = np.empty(size, dtype=np.int32)
    position[order] = np.arange(size, dtype=np.int32)
    first, second = position[couplings.first], position[couplings.second]
    entry, pointers = sort_by_key(np.minimum(first, second), size)
    target = np.empty(first.size, dtype=np.int32)
    target[entry] = np.arange(size, size + first.size, dtype=np.int32)
    if couplings.kept is not None:
        given = np.empty(first.size + couplings.left_out, dtype=np.int32)
        others = np.ones(given.size, dtype=bool)
        others[couplings.kept] = False
        given[couplings.kept] = target
        given[others] = np.arange(size + first.size, size + given.size, dtype=np.int32)
        target = given
    hess_target = np.empty(couplings.hess_count, dtype=np.int32)
    hess_target[couplings.hess_off] = target[: couplings.hess_off.size]
    hess_target[couplings.hess_diagonal] = position[couplings.hess_variable]
    return Arrangement(
        order,
        position,
        stage_pointers,
        pointers,
        np.maximum(first, second)[entry],
        entry,
        hess_target,
        target[couplings.hess_off.size :].copy(),
    )


def sort_by_key(keys: Int32s, count: int) -> tuple[Int32s, Int32s]:
    """Stable order of ``keys`` (whole numbers below ``count``), and where each key's run starts, (count + 1,)."""
    pointers = np.zeros(count + 1, dtype=np.int32)
    order = np.empty(keys.size, dtype=np.int32)
    _counting_sort(keys.size, np.ascontiguousarray(keys, dtype=np.int32), count, pointers, order)
    return order, pointers


_counting_sort = function("arranging_counting_sort")


def enter_window(arrangement: Arrangement, stages: int) -> tuple[Int32s, Int32s]:
    """Positions by the stage at which they enter the window: pointers (stages + 1,) and positions (N,)."""
    size = arrangement.order.size
    entry = np.empty(size, dtype=np.int32)
    _entry_stages(stages, arrangement.stage_pointers, arrangement.pointers, arrangement.columns, entry)
    entering, pointers = sort_by_key(entry, stages)
    return pointers, entering


_entry_stages = function("arranging_entry_stages")
#: Where the N diagonal entries and those above it go in the window, (N + E,).
window_targets = function("arranging_window_targets")
#: Slots in use at each stage, (stages,), those aside of positions whose ``group`` is negative.
tops_without_leaves = function("arranging_tops_without_leaves")
