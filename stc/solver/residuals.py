"""The optimality conditions of a problem as stated, without any scaling or barrier."""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.conditions import STATED, stated_conditions
from stc.solver.nlp import NLP, Floats
from stc.solver.passes import multiplier_scale

__all__ = ["Assessment", "assess"]


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


def assess(nlp: NLP, x: Floats, y: Floats, z: Floats | None = None) -> Assessment:
    """Evaluate the conditions at ``x`` (n,) with row multipliers ``y`` (m,), in the user's units.

    Without ``z`` (n,) the multipliers of the bounds are those that leave the smallest error: the negative
    gradient of the Lagrangian where it pushes against a bound nearby.
    """
    n, m = nlp.n, nlp.m
    f, r = nlp.values(x)
    gradient, jac, _ = nlp.derivatives(x, y, 1.0)
    chosen = np.zeros(n) if z is None else _own(z)
    out = np.zeros(STATED)
    stated_conditions(
        n, m, len(jac), int(z is not None), _own(x), _own(y), chosen, _own(r), _own(gradient),
        np.ascontiguousarray(nlp.jac_rows, np.int32), np.ascontiguousarray(nlp.jac_cols, np.int32), _own(jac),
        _own(nlp.x_lower), _own(nlp.x_upper), _own(nlp.row_lower), _own(nlp.row_upper), np.zeros(n), out,
    )  # fmt: skip
    stationarity, complementarity, violation, steepest, term, largest, total = out.tolist()
    size = max(1.0, steepest, term, largest, multiplier_scale(total, m + n))
    violation = violation if violation == violation else np.inf
    return Assessment(float(f), violation, max(stationarity, complementarity) / size, chosen)


def _own(values: Floats) -> Floats:
    """As compiled functions take them."""
    return np.ascontiguousarray(values, dtype=float)
