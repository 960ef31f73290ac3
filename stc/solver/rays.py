"""Recognises an unbounded objective from a feasible point and a direction in which to look."""

from __future__ import annotations

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.scaled_problem import relative_violation

__all__ = ["falls_without_limit"]

LENGTHS = tuple(10.0**k for k in range(1, 13))
PROPORTION = 0.5
RELATIVE = 1e-8


def falls_without_limit(nlp: NLP, x: Floats, origin: Floats, feasibility: float) -> bool:
    """True when the objective keeps falling, in proportion to the way at least, along a ray of feasible points.

    Tried are the ray from ``origin`` through the feasible point ``x`` (n,), and the one along the negative
    gradient, both moved inside the bounds of the variables.  Each goes far beyond anything that a problem can mean.
    """
    gradient, _, _ = nlp.derivatives(x, np.zeros(nlp.m), 0.0)
    return any(
        _falls(nlp, x, direction, feasibility) for direction in (x - origin, -gradient.copy()) if direction.any()
    )


def _falls(nlp: NLP, x: Floats, direction: Floats, feasibility: float) -> bool:
    direction = direction / np.abs(direction).max()
    last, _ = nlp.values(x)
    before = last
    size = max(1.0, float(np.abs(x).max(initial=0.0)))
    for length in LENGTHS:
        beyond = np.clip(x + length * size * direction, nlp.x_lower, nlp.x_upper)
        f, rows = nlp.values(beyond)
        rows = rows.copy()
        if not np.isfinite(f):
            return bool(f == -np.inf and before < -1e15)
        _, jac, _ = nlp.derivatives(beyond, np.zeros(nlp.m), 0.0)
        terms = np.bincount(nlp.jac_rows, weights=np.abs(jac * beyond[nlp.jac_cols]), minlength=nlp.m)
        off = relative_violation(rows, nlp.row_lower, nlp.row_upper)
        if np.any(off > feasibility + RELATIVE * terms):
            return False
        drop = last - f
        if not drop > 0.0 or (before < last and drop < PROPORTION * 10.0 * (last - before) * 0.1):
            return False
        before, last = last, f
    return last < -1e6 * max(1.0, abs(nlp.values(x)[0]))
