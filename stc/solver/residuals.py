"""The optimality conditions of a problem as stated, without any scaling or barrier."""

from __future__ import annotations

import numpy as np

from stc.core.calls import chain
from stc.records import dataclass
from stc.solver.conditions import STATED, stated_conditions
from stc.solver.evaluator import Scaling, Stated, evaluator_of
from stc.solver.form_cache import once
from stc.solver.kernels import multiplier_scale
from stc.solver.nlp import NLP, Floats, Mask
from stc.solver.options import Options
from stc.solver.products import ROUNDED, term_sums
from stc.solver.scaled_problem import relative_violation

__all__ = [
    "Assessment",
    "Judge",
    "assess",
    "holds",
    "is_met_but_for_rounding",
    "rows_missed",
    "signed_violations",
]


@dataclass(frozen=True, slots=True)
class Assessment:
    """How well a point satisfies the optimality conditions.

    Attributes:
        objective: its objective.
        violation: largest violation of a row or bound, each relative to ``max(1, |bound|)``.
        optimality: largest of stationarity and complementarity, relative to the largest term in them
            and to the mean multiplier.
        bound_multipliers: what balances the Lagrangian's gradient at active bounds, (n,).
    """

    objective: float
    violation: float
    optimality: float
    bound_multipliers: Floats


class Judge:
    """Holds points against the conditions of one program, all in one call.

    Programs that are solved again and again have one with their keeper; nobody else may evaluate the program meanwhile.
    """

    def __init__(self, nlp: NLP) -> None:
        ev = nlp.as_stated() if isinstance(nlp, Stated) else evaluator_of(nlp, Scaling.none(nlp.n, nlp.m))
        self._evaluator = ev
        self._z, self._out = np.zeros(nlp.n), np.zeros(STATED)
        self._conditions = stated_conditions.bind(
            nlp.n, nlp.m, len(nlp.jac_rows), 0, ev.x, ev.y, self._z, ev.r, ev.gradient,
            np.ascontiguousarray(nlp.jac_rows, np.int32), np.ascontiguousarray(nlp.jac_cols, np.int32), ev.jac,
            _own(nlp.x_lower), _own(nlp.x_upper), _own(nlp.row_lower), _own(nlp.row_upper), np.zeros(nlp.n), self._out,
        )  # fmt: skip
        self._given = self._conditions.position("given")
        self._call = chain([ev.values_call, ev.derivatives_call, self._conditions])

    def __call__(self, x: Floats, y: Floats, z: Floats | None = None) -> Assessment:
        """See :func:`assess`."""
        ev = self._evaluator
        ev.x[:], ev.y[:], ev.weight[0] = x, y, 1.0
        self._z[:] = 0.0 if z is None else z
        self._conditions.integers[self._given] = z is not None
        self._call()
        stationarity, complementarity, violation, steepest, term, largest, total = self._out.tolist()
        size = max(1.0, steepest, term, largest, multiplier_scale(total, ev.x.size + ev.y.size))
        violation = violation if violation == violation else np.inf
        error = max(stationarity, complementarity) / size
        return Assessment(float(ev.f[0]), violation, error, self._z.copy())


def assess(nlp: NLP, x: Floats, y: Floats, z: Floats | None = None) -> Assessment:
    """Evaluate the conditions at ``x`` (n,) with row multipliers ``y`` (m,), in the user's units.

    Without ``z`` (n,) the multipliers of the bounds are those that leave the smallest error: the negative
    gradient of the Lagrangian where it pushes against a bound nearby.
    """
    return once(Judge, nlp)(x, y, z)


def holds(nlp: NLP, x: Floats, judged: Assessment, options: Options) -> bool:
    """Whether a point ``x`` (n,), assessed, is feasible and stationary within the tolerances."""
    if not judged.optimality <= options.unscaled_tolerance:
        return False
    tolerance = options.feasibility_tolerance
    return judged.violation <= tolerance or is_met_but_for_rounding(nlp, x, tolerance)


def is_met_but_for_rounding(nlp: NLP, x: Floats, tolerance: float) -> bool:
    """Whether all rows and bounds are met at ``x`` (n,) within ``tolerance``, or rows as far as they can be told.

    A row of terms ``J_ri x_i`` changes by a unit in the last place of the largest of them from one point that can be
    written down to the next: none of these may be nearer.
    """
    missed = rows_missed(nlp, x, tolerance)
    return not missed.any() and bool(np.all(relative_violation(x, nlp.x_lower, nlp.x_upper) <= tolerance))


def rows_missed(nlp: NLP, x: Floats, tolerance: float) -> Mask:
    """Which rows are not, (m,); all where terms have no size."""
    _, r = nlp.values(x)
    _, jac, _ = nlp.derivatives(x, np.zeros(nlp.m), 1.0)
    terms = term_sums(nlp.jac_rows, nlp.jac_cols, jac, x, nlp.m)
    if not np.isfinite(terms).all():
        return np.ones(nlp.m, bool)
    missed = relative_violation(r, nlp.row_lower, nlp.row_upper)
    bound = np.maximum(1.0, np.abs(np.where(r < nlp.row_lower, nlp.row_lower, nlp.row_upper)))
    return np.asarray(missed > np.maximum(tolerance, ROUNDED * terms / bound))


def signed_violations(nlp: NLP, r: Floats) -> Floats:
    """How far rows of the values ``r`` (m,) are outside their bounds, (m,): positive above the upper one."""
    return np.maximum(r - nlp.row_upper, 0.0) - np.maximum(nlp.row_lower - r, 0.0)


def _own(values: Floats) -> Floats:
    """As compiled functions take them."""
    return np.ascontiguousarray(values, dtype=float)
