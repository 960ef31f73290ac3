"""The form of a problem that the iteration works on.

    minimise    f(x)
    subject to  r(x) - s = 0,     w = (x, s),     sign * (w[index] - bound) >= 0

Every row has an activity ``s``: a slack between the row's bounds, or the constant right-hand side of an
equality.  Bounds of variables and of slacks are then one list of nonnegative *gaps* with one multiplier each,
and the Lagrangian is ``f + y.(r - s) - z.gap``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

import numpy as np

from stc.core.calls import Bound
from stc.core.functions import function
from stc.core.structures import Structure, structure
from stc.solver.constants import EQUALITY, IGNORED, INEQUALITY
from stc.solver.evaluator import Evaluator
from stc.solver.kkt.couplings import sort_by_key
from stc.solver.kkt.reuse import StructuredKKT
from stc.solver.nlp import Floats, Ints, Mask
from stc.solver.products import Indices, symmetric_times, times

if TYPE_CHECKING:
    from stc.solver.iterate import Iterate
    from stc.solver.kkt.contract import KKTSystem

__all__ = ["Formulation", "linear_system_of", "summed"]

#: From so many gaps on, as motions have them, each of them matters little.
MANY_GAPS = 100


def summed(index: Ints, values: Floats, size: int) -> Floats:
    """Entry k is the sum of the values whose index is k, (size,)."""
    return cast("Floats", np.bincount(index, weights=values, minlength=size))


T = TypeVar("T")


def linear_system_of(kkt: KKTSystem) -> Structure:
    """The arrays of a system for functions of the core (``linear_system`` in ``iteration.h``)."""
    return structure("linear_system")(
        hess=kkt.hess, jac=kkt.jac, primal=kkt.primal, dual=kkt.dual, rhs=kkt.rhs, second_rhs=kkt.second_rhs,
        solution=kkt.solution, second_solution=kkt.second_solution, report=kkt.report, accuracy=kkt.accuracy,
        inertia=kkt.inertia,
    )  # fmt: skip


class Formulation(ABC):
    """Sizes, bounds and sparsity, with the products that they imply.  Subclasses evaluate functions.

    Attributes:
        n, m: numbers of variables and rows; ``n + m`` entries in ``w``.
        lower, upper: bounds of ``w``, (n + m,); infinite for held variables, equalities and ignored rows.
        held: variables that the bounds fix, (n,).
        held_value: their values, (n,); 0 elsewhere.
        equality: rows whose bounds agree, (m,).
        target: the right-hand side of equalities, (m,); 0 elsewhere.
        ignored: rows without any bound, (m,).
        index, sign, bound: the gaps, (gaps,) each.
        convex: variables whose curvature is the objective's alone, and where on the Hessian's diagonal it is, (k,)
            each.
        objective_unit: the objective that is 1 in the user's terms.
        linear: whether all rows are known to be linear.
        quadratic_objective: whether the objective is known to bend the same everywhere.
        extra_diagonal: constant added to the Hessian's diagonal, (n,), or None.
        kkt: the linear algebra for this sparsity.
        stated_limits: of rows and of variables: which ones, the limits, and the factors that turn
            ``limit - value`` into a violation in the user's terms.
    """

    n: int
    m: int
    kkt: KKTSystem
    convex: tuple[Indices, Indices] = np.zeros(0, np.int64), np.zeros(0, np.int64)
    objective_unit: float = 1.0
    linear: bool = False
    quadratic_objective: bool = False
    extra_diagonal: Floats | None = None
    stated_limits: tuple[Indices, Floats, Floats, Indices, Floats, Floats]

    def _set_bounds(self, x_lower: Floats, x_upper: Floats, row_lower: Floats, row_upper: Floats) -> None:
        n, m = self.n, self.m
        self.held = x_lower == x_upper
        self.held_value = np.where(self.held, x_lower, 0.0)
        self.equality = row_lower == row_upper
        self.target = np.where(self.equality, row_lower, 0.0)
        self.ignored = np.isneginf(row_lower) & np.isposinf(row_upper)
        constant = np.concatenate([self.held, self.equality])
        self.lower = np.where(constant, -np.inf, np.concatenate([x_lower, row_lower]))
        self.upper = np.where(constant, np.inf, np.concatenate([x_upper, row_upper]))
        below, above = np.flatnonzero(np.isfinite(self.lower)), np.flatnonzero(np.isfinite(self.upper))
        self.index: Ints = np.concatenate([below, above])
        self.sign = np.concatenate([np.ones(below.size), -np.ones(above.size)])
        self.bound = np.concatenate([self.lower[below], self.upper[above]])
        self.gaps = self.index.size
        self.many_gaps = self.gaps >= MANY_GAPS
        self.inequality: Mask = ~(self.equality | self.ignored)
        self.free: Mask = ~self.held
        self.any_held = bool(self.held.any())
        self.any_equality = bool(self.equality.any())
        self.any_inequality = bool(self.inequality.any())
        self.any_ignored = bool(self.ignored.any())
        self.moving = np.concatenate([self.free, self.inequality])  # entries of w that the iteration changes
        self.size = n + m
        # The same for compiled passes.
        self.free_factor, self.moving_factor = self.free.astype(float), self.moving.astype(float)
        self.held_factor, self.equality_factor = self.held.astype(float), self.equality.astype(float)
        self.kind = np.where(self.equality, EQUALITY, np.where(self.ignored, IGNORED, INEQUALITY)).astype(
            np.int32
        )

    @cached_property
    def _kept(self) -> dict[object, Any]:
        return {}

    def keep(self, make: Callable[[Self], T]) -> T:
        """What ``make`` makes for this form, made once: for one user at a time."""
        if make not in self._kept:
            self._kept[make] = make(self)
        return cast("T", self._kept[make])

    @cached_property
    def attached_kkt(self) -> KKTSystem:
        """``kkt`` without the wrapper that it may have: the system itself is called more quickly."""
        return self.kkt.system if isinstance(self.kkt, StructuredKKT) else self.kkt

    @cached_property
    def linear_system(self) -> Structure:
        """The arrays of ``attached_kkt`` for functions of the core."""
        return linear_system_of(self.attached_kkt)

    @abstractmethod
    def evaluator(self) -> Evaluator:
        """Functions and derivatives at fixed addresses."""

    def watch_call(self, it: Iterate, violation: Floats, stated: Floats) -> Bound:
        """The call that notes what the iterate is in the user's terms: the ``violation`` (1,), and the objective,
        ``stated`` (1,), where a factor does not tell."""
        return self.violation_call(it.w, it.r, violation)

    def violation_call(self, x: Floats, r: Floats, out: Floats) -> Bound:
        """The call that leaves in ``out`` (1,) the largest violation in the user's terms."""
        row_index, row_limits, row_units, x_index, x_limits, x_units = self.stated_limits
        return function("point_overstepped").bind(
            row_index.size, row_index, row_limits, row_units, r, x_index.size, x_index, x_limits, x_units, x, out
        )  # fmt: skip

    @cached_property
    def structure(self) -> Structure:
        """The form for functions of the core (``formulation`` in ``iteration.h``)."""
        n = self.n
        extra = np.zeros(n) if self.extra_diagonal is None else self.extra_diagonal
        order, start = sort_by_key(self.jac_cols.astype(np.int32), n)
        slacked = np.flatnonzero(self.inequality[self.jac_rows])
        diagonal = np.flatnonzero(self.hess_rows == self.hess_cols)
        variable, entry = self.convex
        return structure("formulation")(
            n=n, m=self.m, size=self.size, gaps=self.gaps, jac_entries=self.jac_rows.size,
            hess_entries=self.hess_rows.size, slack_entries=slacked.size, diagonal_entries=diagonal.size,
            convex_entries=entry.size, moving_entries=max(1, int(self.moving.sum())), many_gaps=self.many_gaps,
            any_equality=self.any_equality, objective_unit=self.objective_unit, index=self.index, sign=self.sign,
            bound=self.bound, lower=self.lower, upper=self.upper, kind=self.kind, free=self.free_factor,
            moving=self.moving_factor, extra_diagonal=extra, jac_rows=self.jac_rows, jac_cols=self.jac_cols,
            hess_rows=self.hess_rows, hess_cols=self.hess_cols, column_start=start, column_entry=order,
            column_row=self.jac_rows[order].astype(np.int32), slack_entry=slacked, diagonal_entry=diagonal,
            convex_entry=entry, convex_variable=variable,
        )  # fmt: skip

    def _set_pattern(self, jac_rows: Ints, jac_cols: Ints, hess_rows: Ints, hess_cols: Ints) -> None:
        self.jac_rows = np.ascontiguousarray(jac_rows, dtype=np.int64)
        self.jac_cols = np.ascontiguousarray(jac_cols, dtype=np.int64)
        self.hess_rows = np.ascontiguousarray(hess_rows, dtype=np.int64)
        self.hess_cols = np.ascontiguousarray(hess_cols, dtype=np.int64)

    @abstractmethod
    def values(self, x: Floats) -> tuple[float, Floats]:
        """Objective and rows (m,) at ``x`` (n,)."""

    @abstractmethod
    def user_variables(self, x: Floats) -> Floats:
        """Variables in the user's terms, owned by the caller."""

    # -- products ----------------------------------------------------------------------------------------------

    def jacobian_times(self, jac: Floats, v: Floats) -> Floats:
        """``J v``, (m,)."""
        return times(self.jac_rows, self.jac_cols, jac, v, self.m)

    def hessian_times(self, hess: Floats, v: Floats) -> Floats:
        """``H v``, (n,), from the lower triangle."""
        product = symmetric_times(self.hess_rows, self.hess_cols, hess, v, self.n)
        if self.extra_diagonal is not None:
            product += self.extra_diagonal * v
        return product

    def scatter(self, values: Floats) -> Floats:
        """Sum of ``sign * values`` over the gaps of each entry of ``w``, (n + m,)."""
        return summed(self.index, self.sign * values, self.size)

    def gap(self, w: Floats) -> Floats:
        """Distance of ``w`` to each bound, (gaps,); positive inside."""
        return self.sign * (w[self.index] - self.bound)

    def residual(self, r: Floats, w: Floats) -> Floats:
        """``r - s``, (m,); zero for ignored rows."""
        c = r - w[self.n :]
        if self.any_ignored:
            c[self.ignored] = 0.0
        return c
