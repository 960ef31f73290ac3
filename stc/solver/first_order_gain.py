"""Estimates how far the objective can still fall, from the errors of the first-order conditions."""

from __future__ import annotations

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.products import ROUNDED, term_sums

__all__ = ["possible_gain", "slopes_left"]


def possible_gain(nlp: NLP, x: Floats, y: Floats, z: Floats) -> float:
    """First-order estimate of the change of the objective from ``x`` (n,) to the solution, relative to ``max(1, |f|)``.

    Sums the error of every condition times the way to where it would hold: multipliers times the distances to
    their bounds, and slopes times the sizes of the variables, but for what rounding leaves of a slope's terms.
    Unlike a residual it does not depend on units, and it sees when large multipliers make a residual look small.
    """
    f, r = nlp.values(x)
    away_r = np.where(y > 0.0, nlp.row_upper - r, r - nlp.row_lower)
    away_x = np.where(z > 0.0, nlp.x_upper - x, x - nlp.x_lower)
    # A multiplier without a bound on its side is an error of the slope, which counts below.
    gain = float(np.abs(y * np.where(np.isfinite(away_r), away_r, 0.0)).sum())
    gain += float(np.abs(z * np.where(np.isfinite(away_x), away_x, 0.0)).sum())
    gain += float(slopes_left(nlp, x, y, z) @ np.abs(x))
    return gain / max(1.0, abs(f))


def slopes_left(nlp: NLP, x: Floats, y: Floats, z: Floats) -> Floats:
    """The sizes of the Lagrangian's slopes at ``x`` (n,), (n,), but for what rounding may leave of their terms."""
    gradient, jac, hess = nlp.derivatives(x, y, 1.0)
    slopes = np.abs(gradient + np.bincount(nlp.jac_cols, weights=jac * y[nlp.jac_rows], minlength=nlp.n) + z)
    # A gradient that varies has terms of the size of H x, for all we know: differences over short steps cancel.
    terms = term_sums(nlp.jac_cols, nlp.jac_rows, jac, y, nlp.n) + np.abs(z)
    terms += term_sums(nlp.hess_rows, nlp.hess_cols, hess, x, nlp.n)
    across = np.where(nlp.hess_rows != nlp.hess_cols, hess, 0.0)
    terms += term_sums(nlp.hess_cols, nlp.hess_rows, across, x, nlp.n)
    return np.maximum(slopes - ROUNDED / 4.0 * terms, 0.0)
