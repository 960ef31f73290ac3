"""The optimality conditions of a problem as stated, without any scaling or barrier."""

from __future__ import annotations

from typing import Any

import numpy as np

from stc.core.calls import chain
from stc.core.functions import function
from stc.core.structures import structure
from stc.records import dataclass
from stc.solver.evaluator import Scaling, Stated, evaluator_of
from stc.solver.form_cache import once
from stc.solver.nlp import NLP, Floats, Mask
from stc.solver.options import Options
from stc.solver.products import ROUNDED, multiplier_scale, term_sums
from stc.solver.scaled_problem import relative_violation

__all__ = [
    "Assessment", "Judge", "assess", "holds", "is_met_but_for_rounding", "rows_missed", "signed_violations",
]  # fmt: skip


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
        self._z, of = np.zeros(nlp.n), _own
        program = structure("program")(
            n=nlp.n, m=nlp.m, jac_entries=len(nlp.jac_rows), jac_rows=of(nlp.jac_rows, np.int64),
            jac_cols=of(nlp.jac_cols, np.int64), x_lower=of(nlp.x_lower), x_upper=of(nlp.x_upper),
            row_lower=of(nlp.row_lower), row_upper=of(nlp.row_upper),
        )  # fmt: skip
        self._point = structure("primal_dual")(
            nlp=program, x=ev.x, y=ev.y, z=self._z, r=ev.r, gradient=ev.gradient, jac=ev.jac,
            lagrangian=np.zeros(nlp.n),
        )  # fmt: skip
        self._conditions = function("conditions_state").bind(self._point, 0)
        self._call = chain([ev.values_call, ev.derivatives_call, self._conditions])

    def __call__(self, x: Floats, y: Floats, z: Floats | None = None) -> Assessment:
        """See :func:`assess`."""
        ev = self._evaluator
        ev.x[:], ev.y[:], ev.weight[0] = x, y, 1.0
        self._z[:] = 0.0 if z is None else z
        self._conditions.set("given", z is not None)
        self._call()
        p = self._point
        scale = multiplier_scale(p.multipliers, ev.x.size + ev.y.size)
        size = max(1.0, p.largest_gradient, p.largest_term, p.largest_multiplier, scale)
        violation = p.violation if p.violation == p.violation else np.inf
        error = max(p.stationarity, p.complementarity) / size
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
    """Whether all rows and bounds are met at ``x`` (n,) within ``tolerance``, or for rows to within rounding.

    A row of terms ``J_ri x_i`` changes by a unit in the last place of the largest of them from one point that can be
    written down to the next: none of these may be nearer.
    """
    missed = rows_missed(nlp, x, tolerance)
    return not missed.any() and bool(np.all(relative_violation(x, nlp.x_lower, nlp.x_upper) <= tolerance))


def rows_missed(nlp: NLP, x: Floats, tolerance: float) -> Mask:
    """(m,) whether a row is violated by more than ``tolerance`` and by more than rounding; true for all rows if a term
    is not finite.
    """
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


def _own(values: Any, dtype: Any = float) -> Any:
    """Values as an array of the type and layout that functions of the core take."""
    return np.ascontiguousarray(values, dtype)
