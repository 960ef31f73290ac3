"""Products with long vectors and sparse matrices in coordinate form, compiled, on one thread.

BLAS is not asked for dot products: it wakes its threads for vectors of ten thousand entries, which takes longer than
the product and keeps the other core from those who need it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.codegen.native import f64, f64s, i64, i64s, native
from stc.solver.nlp import Floats

Indices = NDArray[np.int64]

__all__ = ["inner", "least_error", "norm", "symmetric_times", "times"]


def inner(a: Floats, b: Floats) -> float:
    """``a.b``."""
    return float(np.einsum("i,i", a, b))


def norm(a: Floats) -> float:
    """Euclidean length."""
    return float(np.sqrt(np.einsum("i,i", a, a)))


def times(rows: Indices, cols: Indices, values: Floats, v: Floats, size: int) -> Floats:
    """Matrix times vector, (size,); the entries are ``values`` (k,) at ``rows``, ``cols`` (k,)."""
    out = np.zeros(size)
    if rows.size:
        _times(rows.size, rows, cols, np.ascontiguousarray(values), np.ascontiguousarray(v), out)
    return out


def symmetric_times(rows: Indices, cols: Indices, values: Floats, v: Floats, size: int) -> Floats:
    """The same for a symmetric matrix of which the lower triangle is given."""
    out = np.zeros(size)
    if rows.size:
        _symmetric_times(rows.size, rows, cols, np.ascontiguousarray(values), np.ascontiguousarray(v), out)
    return out


@native
def _times(count: i64, rows: i64s, cols: i64s, values: f64s, v: f64s, out: f64s) -> None:
    for e in range(count):
        out[rows[e]] += values[e] * v[cols[e]]


@native
def _symmetric_times(count: i64, rows: i64s, cols: i64s, values: f64s, v: f64s, out: f64s) -> None:
    for e in range(count):
        i, j = rows[e], cols[e]
        out[i] += values[e] * v[j]
        if i != j:
            out[j] += values[e] * v[i]


def least_error(
    centring: Floats,
    taus: Floats,
    gap: Floats,
    z: Floats,
    gap_affine: Floats,
    gap_centring: Floats,
    z_affine: Floats,
    z_centring: Floats,
    dual: float,
    primal: float,
) -> int:
    """The centring parameter whose step is predicted to leave the smallest squared error.

    Args:
        centring: those to choose from, (k,).
        taus: fraction to the bounds for each, (k,).
        gap, z: gaps and their multipliers, (gaps,).
        gap_affine, gap_centring: a step changes the gaps by ``gap_affine + sigma * gap_centring``.
        z_affine, z_centring: the same for the multipliers.
        dual, primal: squared error of the other conditions, of which whole steps leave nothing.

    Returns:
        Index of the best one.
    """
    return _least_error(
        centring.size, gap.size, centring, taus, gap, z, gap_affine, gap_centring, z_affine, z_centring, dual, primal
    )  # fmt: skip


@native(fast=True)
def _least_error(
    count: i64, gaps: i64, centring: f64s, taus: f64s, gap: f64s, z: f64s, gap_affine: f64s, gap_centring: f64s,
    z_affine: f64s, z_centring: f64s, dual: f64, primal: f64,
) -> i64:  # fmt: skip
    best = 0
    least = 0.0
    for k in range(count):
        sigma = centring[k]
        fall, fall_z = 1e-300, 1e-300
        for i in range(gaps):
            fall = max(fall, -(gap_affine[i] + sigma * gap_centring[i]) / gap[i])
            fall_z = max(fall_z, -(z_affine[i] + sigma * z_centring[i]) / z[i])
        a, b = min(1.0, taus[k] / fall), min(1.0, taus[k] / fall_z)
        error = 0.0
        for i in range(gaps):
            product = (gap[i] + a * (gap_affine[i] + sigma * gap_centring[i])) * (
                z[i] + b * (z_affine[i] + sigma * z_centring[i])
            )
            error += product * product
        error = error / gaps + (1.0 - b) ** 2 * dual + (1.0 - a) ** 2 * primal
        if k == 0 or error < least:
            best = k
            least = error
    return best
