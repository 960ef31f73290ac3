"""Vectors and matrices of expressions in three dimensions.

Zeros, ones and signs are simplified as the expressions are built, by the rules of :mod:`stc.symbolic`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from stc.symbolic.expr import ZERO, Expr, add, mul, neg, num, sub

Vector = tuple[Expr, Expr, Expr]
Matrix = tuple[Vector, Vector, Vector]

ORIGIN: Vector = (ZERO, ZERO, ZERO)


def vector(values: Iterable[float]) -> Vector:
    """A vector of numbers."""
    x, y, z = [num(value) for value in values]
    return x, y, z


def matrix(rows: Iterable[Iterable[float]]) -> Matrix:
    """A matrix of numbers."""
    x, y, z = [vector(row) for row in rows]
    return x, y, z


IDENTITY: Matrix = matrix([[1, 0, 0], [0, 1, 0], [0, 0, 1]])


def plus(u: Vector, v: Vector) -> Vector:
    return add(u[0], v[0]), add(u[1], v[1]), add(u[2], v[2])


def minus(u: Vector, v: Vector) -> Vector:
    return sub(u[0], v[0]), sub(u[1], v[1]), sub(u[2], v[2])


def negative(u: Vector) -> Vector:
    return neg(u[0]), neg(u[1]), neg(u[2])


def scaled(s: Expr, v: Vector) -> Vector:
    return mul(s, v[0]), mul(s, v[1]), mul(s, v[2])


def dot(u: Sequence[Expr], v: Sequence[Expr]) -> Expr:
    return add(add(mul(u[0], v[0]), mul(u[1], v[1])), mul(u[2], v[2]))


def cross(u: Vector, v: Vector) -> Vector:
    return (
        sub(mul(u[1], v[2]), mul(u[2], v[1])),
        sub(mul(u[2], v[0]), mul(u[0], v[2])),
        sub(mul(u[0], v[1]), mul(u[1], v[0])),
    )


def transposed(a: Matrix) -> Matrix:
    return (a[0][0], a[1][0], a[2][0]), (a[0][1], a[1][1], a[2][1]), (a[0][2], a[1][2], a[2][2])


def times(a: Matrix, v: Vector) -> Vector:
    """The product of a matrix and a vector."""
    return dot(a[0], v), dot(a[1], v), dot(a[2], v)


def product(a: Matrix, b: Matrix) -> Matrix:
    """The product of two matrices."""
    x, y, z = transposed(b)
    p, q, r = a
    return (
        (dot(p, x), dot(p, y), dot(p, z)),
        (dot(q, x), dot(q, y), dot(q, z)),
        (dot(r, x), dot(r, y), dot(r, z)),
    )


def rotation_of(quaternion: Sequence[Expr]) -> Matrix:
    """The rotation matrix of a unit quaternion with its real part first."""
    w, x, y, z = quaternion
    two = num(2.0)

    def off(a: Expr, b: Expr, c: Expr, d: Expr) -> tuple[Expr, Expr]:
        left, right = mul(a, b), mul(c, d)
        return mul(two, add(left, right)), mul(two, sub(left, right))

    xy, yx = off(x, y, w, z)
    xz, zx = off(x, z, w, y)
    yz, zy = off(y, z, w, x)
    xx, yy, zz = mul(x, x), mul(y, y), mul(z, z)
    one = num(1.0)
    return (
        (sub(one, mul(two, add(yy, zz))), yx, xz),
        (xy, sub(one, mul(two, add(xx, zz))), zy),
        (zx, yz, sub(one, mul(two, add(xx, yy)))),
    )


def rotation_about(axis: Sequence[float], sine: Expr, cosine: Expr) -> Matrix:
    """The rotation about a coordinate axis, forwards or backwards: ``axis`` has one entry, 1 or -1, that is not 0."""
    k = next(index for index in range(3) if abs(axis[index]) == 1.0)
    s = sine if axis[k] > 0 else neg(sine)
    rows = [[ZERO] * 3 for _ in range(3)]
    i, j = (k + 1) % 3, (k + 2) % 3
    rows[k][k] = num(1.0)
    rows[i][i] = rows[j][j] = cosine
    rows[i][j], rows[j][i] = neg(s), s
    (a, b, c), (d, e, f), (g, h, l) = rows
    return (a, b, c), (d, e, f), (g, h, l)
