"""Anomalies at a point where a solve failed: large residuals, dependent rows, undefined values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.solver.kkt import structured_kkt
from stc.solver.residuals import signed_violations
from stc.transcription.bind import BoundProgram

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

__all__ = ["dependent_rows", "largest_residuals", "undefined_nearby"]

TOLERANCE = 1e-6
ACTIVE = 1e-6
DEPENDENT = 1e-6
SHARE = 1e-2
SHIFT = 1e-10
LOOSE = 1e8
SWEEPS = 4
PROBES = 8
PROBE_SIZE = 1e-2


def largest_residuals(bound: BoundProgram, x: FloatArray, most: int = 100) -> list[tuple[int, float]]:
    """Rows that ``x`` (n,) violates, the worst first, with the violation: positive above the upper bound."""
    _, rows = bound.values(x)
    off = signed_violations(bound, rows)
    with np.errstate(invalid="ignore"):
        near = np.where(off > 0.0, bound.row_upper, bound.row_lower)
    relative = np.where(off == 0.0, 0.0, np.abs(off) / np.maximum(1.0, np.abs(near)))
    relative = np.where(np.isfinite(relative), relative, np.inf)
    order = np.argsort(-relative, kind="stable")[:most]
    return [(int(row), float(off[row])) for row in order if relative[row] > TOLERANCE]


def undefined_nearby(bound: BoundProgram, x: FloatArray, seed: int = 0) -> IntArray:
    """Rows that are undefined a small step from ``x`` (n,), or not differentiable at it, in their own order."""
    _, jac, _ = bound.derivatives(x, np.zeros(bound.m), 0.0)
    wrong = np.zeros(bound.m, bool)
    wrong[bound.jac_rows[~np.isfinite(jac)]] = True
    rng = np.random.default_rng(seed)
    for _ in range(PROBES):
        step = PROBE_SIZE * rng.choice([-1.0, 1.0], len(x)) * np.maximum(1.0, np.abs(x))
        _, rows = bound.values(np.clip(x + step, bound.x_lower, bound.x_upper))
        wrong |= ~np.isfinite(rows)
    return np.flatnonzero(wrong)


def dependent_rows(bound: BoundProgram, x: FloatArray) -> IntArray:
    """Equations and active inequalities whose gradients at ``x`` (n,) are linearly dependent, the heaviest first.

    Inverse iteration on the Gram matrix of the rows, each scaled to length one: a combination of rows that is
    nearly zero shows up as its eigenvector of the smallest eigenvalue.  Takes a few solves with the sparse
    factorisation, so that it works at any size.
    """
    if not bound.m:
        return np.zeros(0, np.int64)
    _, rows = bound.values(x)
    rows = rows.copy()
    _, jac, hess = bound.derivatives(x, np.zeros(bound.m), 0.0)
    if not np.isfinite(jac).all():
        return np.zeros(0, np.int64)
    close = ACTIVE * np.maximum(1.0, np.abs(rows))
    active = (rows >= bound.row_upper - close) | (rows <= bound.row_lower + close)
    jac = jac * (bound.x_lower != bound.x_upper)[bound.jac_cols]
    length = np.sqrt(np.bincount(bound.jac_rows, weights=jac * jac, minlength=bound.m))
    flat = active & (length <= DEPENDENT * max(1.0, float(length.max(initial=0.0))) * 1e-3)
    if flat.any():
        return np.flatnonzero(flat)
    jac = jac / np.where(length > 0.0, length, 1.0)[bound.jac_rows]
    kkt = structured_kkt(
        bound.n,
        bound.m,
        bound.jac_rows,
        bound.jac_cols,
        bound.hess_rows,
        bound.hess_cols,
        bound.var_stage,
        bound.row_stage,
    )
    kkt.factorize(np.zeros_like(hess), jac, np.ones(bound.n), np.where(active, SHIFT, LOOSE))
    v = np.random.default_rng(0).uniform(-1.0, 1.0, bound.m) * active
    for _ in range(SWEEPS):
        norm = float(np.linalg.norm(v))
        if not np.isfinite(norm) or norm == 0.0:
            return np.zeros(0, np.int64)
        v = -kkt.solve(np.zeros(bound.n), v / norm)[1] * active
    v /= max(float(np.linalg.norm(v)), 1e-300)
    combined = np.bincount(bound.jac_cols, weights=jac * v[bound.jac_rows], minlength=bound.n)
    if not np.linalg.norm(combined) <= DEPENDENT:
        return np.zeros(0, np.int64)
    order = np.argsort(-np.abs(v), kind="stable")
    return order[np.abs(v[order]) > SHARE * np.abs(v[order[0]])]
