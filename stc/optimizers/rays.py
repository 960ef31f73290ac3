"""Recognises an unbounded objective from a feasible point and a direction in which to look."""

from __future__ import annotations

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.products import term_sums
from stc.solver.scaled_problem import relative_violation

__all__ = ["falls_without_limit"]

LENGTHS = tuple(10.0**k for k in range(1, 13))
PROPORTION = 0.5
RELATIVE = 1e-8
FAR = -1e6


def falls_without_limit(nlp: NLP, x: Floats, origin: Floats, feasibility: float) -> bool:
    """True if the objective decreases, at least in proportion to the distance, along a ray of feasible points.

    Tried are the ray from ``origin`` through the feasible point ``x`` (n,), and the one along the negative
    gradient, both moved inside the bounds of the variables.  Each goes far beyond anything that a problem can mean.
    """
    downhill = -nlp.derivatives(x, np.zeros(nlp.m), 0.0)[0]
    return any(
        _falls(nlp, x, direction, feasibility) for direction in (x - origin, downhill) if direction.any()
    )


def _falls(nlp: NLP, x: Floats, direction: Floats, feasibility: float) -> bool:
    direction = direction / np.abs(direction).max()
    start, _ = nlp.values(x)
    last, drop = start, 0.0
    size = max(1.0, float(np.abs(x).max(initial=0.0)))
    for length in LENGTHS:
        beyond = np.clip(x + length * size * direction, nlp.x_lower, nlp.x_upper)
        f, rows = nlp.values(beyond)
        if np.isnan(f) or not last - f > max(0.0, PROPORTION * drop):
            return False
        off = relative_violation(rows, nlp.row_lower, nlp.row_upper)
        _, jac, _ = nlp.derivatives(beyond, np.zeros(nlp.m), 0.0)
        terms = term_sums(nlp.jac_rows, nlp.jac_cols, jac, beyond, nlp.m)
        if np.any(off > feasibility + RELATIVE * terms):
            return False
        if np.isneginf(f):
            return last < FAR * max(1.0, abs(start))
        last, drop = f, last - f
    return last < FAR * max(1.0, abs(start))
