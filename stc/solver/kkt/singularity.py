"""Small pivots under suspicion: is the matrix singular there?

Rounding errors pass from pivot to pivot, so what is zero in exact arithmetic may be left as a number far above the
rounding unit.  The vector z with L^T z = e_k has

    K z = L D e_k        z^T K z = d_k

so a small pivot with a long z belongs to a tiny eigenvalue: d_k / |z|^2 estimates it, and |K z| / |z|, formed with K
itself and not with what elimination left of it, bounds it.

A matrix may be singular to working precision, and its small pivots right in their leading digits all the same: what
elimination leaves is exact for entries that are off by some rounding units of |L| |D| |L|^T (N. J. Higham, Accuracy and
Stability of Numerical Algorithms, 2002, section 11.1), which moves d_k by as many units of |z|^T |L| |D| |L|^T |z|.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native, sqrt
from stc.solver.kkt.pivots import NEGATIVE, PIVOTS, POSITIVE, ZERO
from stc.solver.kkt.values import residual

__all__ = ["confirm_zeros"]

#: Pivots of the equilibrated matrix below this are suspected ...
SUSPECT = 1e-8
#: ... this many of them at most,
CHECKS = 24
#: and zero when the estimate of the eigenvalue is no more than this ...
NULL = 1e-13
#: ... and its bound no more than this.
BOUND = 1e-10
#: The rounding unit.
UNIT = 2.0**-53


@native
def _find_null_vector(
    k: i64, value_at: i64, p: i64, q: i64, size: i64, pivots: i32s, starts: i32s, indices: i32s, factors: f64s,
    inverse: f64s, columns: i32s, values: f64s, z: f64s,
) -> f64:  # fmt: skip
    """Solve L^T z = e_p, or e_p + e_q where there is a ``q``, of pivot ``k``.

    Returns:
        |z|^T |L| |D| |L|^T |z|, summed over the pivots before ``k``.
    """
    for i in range(size):
        z[i] = 0.0
    z[p] = 1.0
    if q >= 0:
        z[q] = 1.0
    noise = 0.0
    upper = values[size:]
    for back in range(k):
        e = k - 1 - back
        one = pivots[2 * e]
        other = pivots[2 * e + 1]
        length = starts[2 * e + 1]
        total = 0.0
        terms = 0.0
        a = inverse[3 * e]
        if length < 0:
            own = columns[starts[2 * e] :]
            column = upper[starts[2 * e] :]
            for i in range(-1 - length):
                value = column[i] * z[own[i]]
                total -= value
                terms += fabs(value)
            total *= a
            terms = terms * fabs(a) + fabs(total)
            z[one] = total
            noise += terms * terms / fabs(a)
            continue
        value_at -= length
        if other >= 0:
            value_at -= length
        own = indices[starts[2 * e] :]
        column = factors[value_at:]
        if other < 0:
            for i in range(length):
                value = column[i] * z[own[i]]
                total -= value
                terms += fabs(value)
            terms += fabs(total)
            noise += terms * terms / fabs(a)
        else:
            total_other = 0.0
            terms_other = 0.0
            for i in range(length):
                value = column[i] * z[own[i]]
                value_other = column[length + i] * z[own[i]]
                total -= value
                terms += fabs(value)
                total_other -= value_other
                terms_other += fabs(value_other)
            terms += fabs(total)
            terms_other += fabs(total_other)
            b = inverse[3 * e + 1]
            c = inverse[3 * e + 2]
            weighted = (
                terms * (fabs(c) * terms + 2.0 * fabs(b) * terms_other) + fabs(a) * terms_other * terms_other
            )
            noise += weighted / fabs(a * c - b * b)
            z[other] = total_other
        z[one] = total
    return noise


@native
def _is_null(
    k: i64, value_at: i64, p: i64, d: f64, size: i64, pivots: i32s, starts: i32s, indices: i32s, factors: f64s,
    inverse: f64s, pointers: i32s, columns: i32s, values: f64s, zeros: f64s, z: f64s, image: f64s,
) -> i64:  # fmt: skip
    """Whether position ``p`` of pivot ``k``, with diagonal entry ``d`` in D, stands for an eigenvalue zero."""
    _find_null_vector(k, value_at, p, -1, size, pivots, starts, indices, factors, inverse, columns, values, z)
    square = 0.0
    for i in range(size):
        square += z[i] * z[i]
    if fabs(d) > NULL * square:
        return 0
    bound = residual(size, pointers, columns, values, zeros, z, image) / sqrt(square)
    return bound <= BOUND


@native
def confirm_zeros(
    size: i64,
    variables: i64,
    replacement: f64,
    certain: f64s,
    order: i32s,
    pointers: i32s,
    columns: i32s,
    values: f64s,
    pivots: i32s,
    starts: i32s,
    indices: i32s,
    factors: f64s,
    inverse: f64s,
    zeros: f64s,
    z: f64s,
    image: f64s,
    counts: i64s,
) -> None:
    """Count pivots as zero, and replace them, where the matrix is singular to working precision.

    Not those that are ``certain[0]`` times as large as the noise in them. The other arguments are those of
    ``factorize`` in stc.solver.kkt.elimination and what it left; ``zeros`` (N,) is zero, ``z`` and ``image`` (N,) are
    work space.
    """
    checks = 0
    value_at = 0
    for k in range(counts[PIVOTS]):
        p = pivots[2 * k]
        q = pivots[2 * k + 1]
        own_at = value_at
        value_at += max(starts[2 * k + 1], 0)
        if q >= 0:
            value_at += starts[2 * k + 1]
        a = inverse[3 * k]
        b = inverse[3 * k + 1] if q >= 0 else 0.0
        c = inverse[3 * k + 2] if q >= 0 else 0.0
        total = fabs(a) + fabs(b) + fabs(c)
        if total - total != 0.0:  # overflowed
            counts[NEGATIVE] -= 1
            counts[ZERO] += 1
            continue
        largest = max(max(fabs(a), fabs(b)), fabs(c))
        if q < 0:
            if largest * SUSPECT <= 1.0:
                continue
        elif largest > SUSPECT * fabs(a * c - b * b):  # D = [[c, -b], [-b, a]] / (a c - b^2)
            continue
        if checks >= CHECKS:
            return
        checks += 1
        d = 1.0 / a if q < 0 else largest / (a * c - b * b)
        null = 1
        for which in range(1 if q < 0 else 2):
            if null != 0:
                null = _is_null(
                    k, own_at, p if which == 0 else q, d, size, pivots, starts, indices, factors, inverse,
                    pointers, columns, values, zeros, z, image,
                )  # fmt: skip
        if null != 0:
            noise = _find_null_vector(
                k, own_at, p, q, size, pivots, starts, indices, factors, inverse, columns, values, z
            )
            noise += fabs(d) if q < 0 else 4.0 * fabs(d)
            null = fabs(d) <= certain[0] * UNIT * noise
        if null == 0:
            continue
        inverse[3 * k] = 1.0 / (replacement if order[p] < variables else -replacement)
        if q < 0:
            counts[POSITIVE if d > 0.0 else NEGATIVE] -= 1
            counts[ZERO] += 1
        else:
            if a * c < b * b:
                counts[POSITIVE] -= 1
                counts[NEGATIVE] -= 1
            else:
                counts[POSITIVE if a > 0.0 else NEGATIVE] -= 2
            counts[ZERO] += 2
            inverse[3 * k + 1] = 0.0
            inverse[3 * k + 2] = 1.0 / (replacement if order[q] < variables else -replacement)
