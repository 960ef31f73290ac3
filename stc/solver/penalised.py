"""A program whose complementary products are a penalty of the objective instead of rows.

    minimise f(x) + weight * sum of a_k(x) b_k(x)    subject to the other rows, a_k >= 0 and b_k >= 0 among them

Where the products are nothing at a solution, and the weight is finite, that is a solution of the program with the rows,
with the weight as the multiplier of each (the exact l1 penalty; S. Leyffer, G. Lopez-Calva and J. Nocedal, Interior
methods for mathematical programs with complementarity constraints, SIAM J. Optim. 17, 2006).  Unlike the rows, whose
gradients depend on those of the sides wherever they hold, the penalty takes no constraint qualification away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.calls import chain
from stc.core.functions import function
from stc.solver.convexity import Bending
from stc.solver.evaluator import Evaluator, Scaling, evaluator_of
from stc.solver.form_cache import Keeper
from stc.solver.nlp import NLP, Floats, Ints
from stc.solver.pairs import Pairs
from stc.solver.report import Start

__all__ = ["Penalised"]


class Penalised:
    """``nlp`` with its complementary products in the objective: :class:`stc.solver.nlp.NLP`.

    With ``room`` the products remain rows, each of which may be as large as that (Scholtes 2001).

    Attributes:
        whole: the program with rows for the products.
        weight: of the penalty.
        kept: which of its rows are left, (m,).
    """

    def __init__(self, nlp: NLP, pairs: Pairs, weight: float, room: float | None = None) -> None:
        self.whole, self.weight = nlp, weight
        self.keeper = Keeper()
        left = np.ones(nlp.m, bool)
        left[pairs.product] = room is not None
        self._product = np.flatnonzero(~left)
        self.kept = np.flatnonzero(left)
        self.n, self.m = nlp.n, self.kept.size
        self.x0 = np.asarray(nlp.x0, float)
        self.x_lower, self.x_upper = nlp.x_lower, nlp.x_upper
        self.row_lower, self.row_upper = nlp.row_lower[self.kept], nlp.row_upper[self.kept]
        if room is not None:
            self.row_upper[pairs.product] += room
        of_kept = left[nlp.jac_rows]
        self._jac, self._product_jac = np.flatnonzero(of_kept), np.flatnonzero(~of_kept)
        self.jac_rows = (np.cumsum(left) - 1)[nlp.jac_rows[self._jac]].astype(np.int32)
        self.jac_cols = np.ascontiguousarray(nlp.jac_cols[self._jac], np.int32)
        self._product_cols = nlp.jac_cols[self._product_jac].astype(np.int64)
        self.hess_rows, self.hess_cols = nlp.hess_rows, nlp.hess_cols
        self.var_stage, self.row_stage = nlp.var_stage, nlp.row_stage[self.kept]
        self.row_linear = nlp.row_linear[self.kept]
        self.objective_degree = 3  # nothing is known of what bends down
        self.fixed_curvature = nlp.fixed_curvature.copy()
        self.fixed_curvature[self._product_cols] = False
        self._stated: Evaluator | None = None

    def hold(self, indices: Ints, limits: Floats) -> None:
        """Make equations of bounds: ``limits`` (k,) at ``indices`` (k,) of the whole program's variables and rows."""
        of_rows = indices >= self.n
        rows = np.searchsorted(self.kept, indices[of_rows] - self.n)
        self.row_lower[rows] = self.row_upper[rows] = limits[of_rows]
        self.x_lower, self.x_upper = self.x_lower.copy(), self.x_upper.copy()
        at = indices[~of_rows]
        self.x_lower[at] = self.x_upper[at] = limits[~of_rows]

    def row_bends(self) -> NDArray[np.int8]:
        """See :class:`stc.solver.convexity.Bending`."""
        whole = self.whole
        return (whole.row_bends() if isinstance(whole, Bending) else np.zeros(whole.m, np.int8))[self.kept]

    def all_multipliers(self, y: Floats) -> Floats:
        """The multipliers of all rows of the program, (m,), from those of the remaining rows, ``y``."""
        whole = np.empty(self.whole.m)
        whole[self.kept], whole[self._product] = y, self.weight
        return whole

    def start(self, start: Start) -> Start:
        """A start of the whole program, as it concerns this one."""
        y = start.row_multipliers
        return Start(start.x, None if y is None else y[self.kept], start.bound_multipliers)

    def values(self, x: Floats) -> tuple[float, Floats]:
        """See :class:`NLP`."""
        stated = self.as_stated()
        stated.x[:] = x
        stated.values_call()
        return float(stated.f[0]), stated.r

    def derivatives(
        self, x: Floats, multipliers: Floats, objective_factor: float
    ) -> tuple[Floats, Floats, Floats]:
        """See :class:`NLP`."""
        stated = self.as_stated()
        stated.x[:], stated.y[:], stated.weight[0] = x, multipliers, objective_factor
        stated.derivatives_call()
        return stated.gradient, stated.jac, stated.hess

    def as_stated(self) -> Evaluator:
        """See :class:`stc.solver.evaluator.Stated`."""
        if self._stated is None:
            self._stated = self.evaluator(Scaling.none(self.n, self.m))
        return self._stated

    def evaluator(self, scaling: Scaling) -> Evaluator:
        """See :class:`stc.solver.evaluator.Evaluable`: the whole program's, and what makes this one of it."""
        whole = self.whole
        row, bounded = np.full(whole.m, self.weight * scaling.objective), np.ones(whole.m, bool)
        row[self.kept], bounded[self.kept] = scaling.row, scaling.bounded
        inner = evaluator_of(whole, Scaling(scaling.variable, row, scaling.objective, scaling.live, bounded))
        own = Evaluator.allocate(self.n, self.m, self._jac.size, self.hess_rows.size)
        own.x, own.weight, own.hess = inner.x, inner.weight, inner.hess
        own.values_status, own.derivatives_status = inner.values_status, inner.derivatives_status
        count = self._product.size
        take_values = function("elastic_take_values").bind(
            self.m, self.kept, count, self._product, inner.f, inner.r, own.f, own.r
        )
        give_multipliers = function("elastic_give_multipliers").bind(
            self.m, self.kept, count, self._product, own.y, own.weight, inner.y
        )
        take_derivatives = function("elastic_take_derivatives").bind(
            self.n, self._jac.size, self._jac, self._product_jac.size, self._product_jac, self._product_cols,
            inner.gradient, inner.jac, own.gradient, own.jac,
        )  # fmt: skip
        own.values_call = chain([inner.values_call, take_values])
        own.derivatives_call = chain([give_multipliers, inner.derivatives_call, take_derivatives])
        return own
