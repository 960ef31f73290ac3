"""Multipliers for a point from a method that returns none.

A point without multipliers can be tested for optimality all the same: the multipliers that fit it best solve a linear
least-squares problem with signs,

    minimise |grad f + J^T y + z|   over   y, z of the sign that their active bound gives, zero where no bound is
    active.

Whether the point is optimal then depends on the point alone, and not on the optimizer's own report.
"""

from __future__ import annotations

import numpy as np

from stc.solver.nlp import NLP, Floats, Ints, Mask
from stc.solver.products import at_bounds
from stc.solver.residuals import Assessment, assess, signed_violations

__all__ = ["assess_point", "bounded_least_squares", "stationary_violation"]

SLACKS = (1e-8, 1e-6, 1e-4, 1e-2)
"""Distances to a bound, relative to ``max(1, |bound|)``, below which it is tried as active."""

DENSE_ENTRIES = 2_000_000


def assess_point(nlp: NLP, x: Floats, good_enough: float = 0.0) -> tuple[Floats, Assessment]:
    """The row multipliers (m,) that fit ``x`` (n,) best, and the optimality conditions with them.

    What counts as active is tried from close to far; the choice with the smallest error wins, and the first
    one with an error of at most ``good_enough`` ends the search.
    """
    best: tuple[Floats, Assessment] | None = None
    before: tuple[bytes, bytes] | None = None
    for slack in SLACKS:
        active = _active(nlp, x, slack)
        key = active[0].tobytes(), active[1].tobytes()
        if key == before:
            continue
        before = key
        y = _fit(nlp, x, 1.0, *active)
        judged = assess(nlp, x, y)
        if best is None or judged.optimality < best[1].optimality:
            best = y, judged
        if judged.optimality <= good_enough:
            break
    assert best is not None
    return best


def stationary_violation(nlp: NLP, x: Floats, weights: Floats) -> tuple[float, Floats]:
    """The distance of ``x`` (n,) from a stationary point of the sum of the squared violations, ``weights`` (m,) times
    each.

    Returns:
        The largest entry of that function's gradient that no bound of a variable holds back, relative to the
        largest of its terms, and the signed violation of each row, (m,): positive above the upper bound.  Zero
        error at a positive violation certifies that no point nearby meets all rows.
    """
    _, r = nlp.values(x)
    off = signed_violations(nlp, r)
    off = np.where(np.isfinite(off), off, 0.0)
    _, jac, _ = nlp.derivatives(x, np.zeros(nlp.m), 0.0)
    terms = jac * (weights * weights * off)[nlp.jac_rows]
    slope = np.bincount(nlp.jac_cols, weights=terms, minlength=nlp.n)
    slope[(slope > 0.0) & (x <= nlp.x_lower)] = 0.0
    slope[(slope < 0.0) & (x >= nlp.x_upper)] = 0.0
    largest = float(np.abs(terms).max(initial=0.0))
    return (float(np.abs(slope).max(initial=0.0)) / largest if largest > 0.0 else 0.0), off


def _active(nlp: NLP, x: Floats, slack: float) -> tuple[Mask, Mask, Mask, Mask]:
    """Masks of the rows at their lower bounds and at their upper bounds, and the same for the variables."""
    _, r = nlp.values(x)
    rows = at_bounds(r, nlp.row_lower, nlp.row_upper, slack)
    return *rows, *at_bounds(x, nlp.x_lower, nlp.x_upper, slack)


def _fit(
    nlp: NLP,
    x: Floats,
    factor: float,
    row_low: Mask,
    row_high: Mask,
    x_low: Mask,
    x_high: Mask,
) -> Floats:
    """The least-squares problem for given active sets."""
    y = np.zeros(nlp.m)
    active = np.flatnonzero(row_low | row_high)
    gradient, jac, _ = nlp.derivatives(x, y, factor)
    wanted = np.flatnonzero(~(x_low & x_high))
    if not len(active) or not len(wanted) or not (np.isfinite(gradient).all() and np.isfinite(jac).all()):
        return y
    norm = np.sqrt(np.bincount(nlp.jac_rows, weights=jac * jac, minlength=nlp.m))
    norm = np.where(norm > 0.0, norm, 1.0)
    column = np.full(nlp.m, -1)
    column[active] = np.arange(len(active))
    line = np.full(nlp.n, -1)
    line[wanted] = np.arange(len(wanted))
    use = (column[nlp.jac_rows] >= 0) & (line[nlp.jac_cols] >= 0)
    at_one = np.flatnonzero((x_low | x_high)[wanted])
    rows = np.concatenate([line[nlp.jac_cols[use]], at_one])
    cols = np.concatenate([column[nlp.jac_rows[use]], len(active) + np.arange(len(at_one))])
    values = np.concatenate([jac[use] / norm[nlp.jac_rows[use]], np.ones(len(at_one))])
    signs_low = np.concatenate([row_low[active], x_low[wanted][at_one]])
    signs_high = np.concatenate([row_high[active], x_high[wanted][at_one]])
    lower = np.where(signs_low, -np.inf, 0.0)
    upper = np.where(signs_high, np.inf, 0.0)
    shape = (len(wanted), len(active) + len(at_one))
    solution = bounded_least_squares(rows, cols, values, shape, -gradient[wanted], lower, upper)
    y[active] = solution[: len(active)] / norm[active]
    return y


def bounded_least_squares(
    rows: Ints, cols: Ints, values: Floats, shape: tuple[int, int], rhs: Floats, lower: Floats, upper: Floats
) -> Floats:
    """``min |A s - rhs|`` over ``lower <= s <= upper``, bounds 0 or infinite; A has every entry once."""
    from scipy.optimize import lsq_linear
    from scipy.sparse import csr_array

    matrix = csr_array((values, (rows, cols)), shape=shape)
    if shape[0] * shape[1] > DENSE_ENTRIES:
        answer = lsq_linear(matrix, rhs, (lower, upper), method="trf", lsmr_tol="auto", tol=1e-12)
    else:
        answer = lsq_linear(matrix.toarray(), rhs, (lower, upper), method="bvls", tol=1e-14)
    return np.asarray(answer.x, dtype=float)
