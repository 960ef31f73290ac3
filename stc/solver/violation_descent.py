"""Whether a violation that seems to be stationary falls after all.

Restoration holds slopes against a tolerance, in the scale of the problem.  Where rows hold large and small
coefficients, as those of fine differences do, a variable's slope may be below it though the variable alone meets its
rows: its entries are as small.  Relative to these entries its slope is as steep as can be.
"""

from __future__ import annotations

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.residuals import signed_violations

__all__ = ["nearer_point", "weighted_violations"]

STEEP = 1e-2
"""Slope of a variable, relative to the sum of the magnitudes of its terms, that rounding errors do not leave."""
FALLEN = 0.9
SHARES = (1.0, 0.125)
"""Shares of the steps tried: those of variables in one row each are right as they are, others too long."""


def nearer_point(nlp: NLP, x: Floats, y: Floats, weights: Floats) -> Floats | None:
    """A point with a smaller sum of violations than ``x`` (n,), or None where none is found.

    Each variable whose slope is steep goes where it would meet the rows that pull at it, in the least-squares sense.

    Args:
        y: subgradient of the sum of the weighted violations, times the weights, (m,): multipliers of the rows in a
            minimum of it.
        weights: of the rows' violations, (m,).
    """
    off, total = weighted_violations(nlp, x, weights)
    _, jac, _ = nlp.derivatives(x, np.zeros(nlp.m), 0.0)
    if not np.isfinite(total) or not np.isfinite(jac).all():
        return None
    pulls = jac * y[nlp.jac_rows]
    slope = np.bincount(nlp.jac_cols, weights=pulls, minlength=nlp.n)
    terms = np.bincount(nlp.jac_cols, weights=np.abs(pulls), minlength=nlp.n)
    scaled = jac * weights[nlp.jac_rows]
    square = np.bincount(nlp.jac_cols, weights=scaled * scaled, minlength=nlp.n)
    wanted = np.bincount(nlp.jac_cols, weights=scaled * (weights * off)[nlp.jac_rows], minlength=nlp.n)
    steep = (np.abs(slope) > STEEP * terms) & (square > 0.0)
    step = np.zeros(nlp.n)
    step[steep] = -wanted[steep] / square[steep]
    for share in SHARES:
        new = np.clip(x + share * step, nlp.x_lower, nlp.x_upper)
        if weighted_violations(nlp, new, weights)[1] < FALLEN * total:
            return new
    return None


def weighted_violations(nlp: NLP, x: Floats, weights: Floats) -> tuple[Floats, float]:
    """The signed violation of each row, (m,), positive above its upper bound, and the weighted sum of their sizes."""
    r = nlp.values(x)[1]
    off = signed_violations(nlp, r)
    total = float((weights * np.abs(off)).sum())
    return off, total if total == total else np.inf
