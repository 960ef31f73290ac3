"""The optimality conditions of a problem as stated, without any scaling or barrier."""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.iterate import multiplier_scale
from stc.solver.nlp import NLP, Floats
from stc.solver.scaled_problem import relative_violation

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
    f, r = nlp.values(x)
    gradient, jac, _ = nlp.derivatives(x, y, 1.0)
    terms = jac * y[nlp.jac_rows]
    lagrangian = gradient + np.bincount(nlp.jac_cols, weights=terms, minlength=nlp.n)
    if z is None:
        room = np.where(lagrangian > 0.0, x - nlp.x_lower, nlp.x_upper - x)
        held = nlp.x_lower == nlp.x_upper
        z = np.where(held | (room < 1.0), -lagrangian, 0.0)
    multipliers = multiplier_scale(float(np.abs(y).sum() + np.abs(z).sum()), nlp.m + nlp.n)
    size = max(1.0, _largest(gradient), _largest(terms), _largest(z), multipliers)
    stationarity = _largest(lagrangian + z)
    slack_x = np.where(z > 0.0, nlp.x_upper - x, x - nlp.x_lower)
    slack_r = np.where(y > 0.0, nlp.row_upper - r, r - nlp.row_lower)
    complementarity = max(
        _largest(z * np.clip(slack_x, 0.0, 1.0)) if nlp.n else 0.0,
        _largest(y * np.clip(slack_r, 0.0, 1.0)) if nlp.m else 0.0,
    )
    violation = max(
        float(relative_violation(r, nlp.row_lower, nlp.row_upper).max(initial=0.0)),
        float(relative_violation(x, nlp.x_lower, nlp.x_upper).max(initial=0.0)),
    )
    return Assessment(float(f), violation, max(stationarity, complementarity) / size, z)


def _largest(v: Floats) -> float:
    return float(np.abs(v).max(initial=0.0))
