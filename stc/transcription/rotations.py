"""The relations between unit quaternions and angular velocities in each transcription.

The rate of an orientation q, a unit quaternion (w, x, y, z), with the angular velocity w in the rotated frame is
q' = q (0, w) / 2.  Four components of this equation and a unit norm would be one equation too many in each step.
Therefore the norm is constrained at every node, and only three components of the method's link of q' are used: those
tangential to the unit sphere, the vector part of conj(r) times the link, where r is an orientation within the step.
The fourth component, along r, is determined by the norm.  ::

    stepping         vec(conj(q0) q1) = h/2 w1
    trapezoidal      vec(conj(q0) q1) = h/4 (w0 + w1)
    hermite-simpson  vec(conj(qm) (q1 - q0 - h/6 (q0' + 4 qm' + q1'))) = 0
                     vec(conj(qm) (qm - (q0 + q1)/2 - h/8 (q0' - q1'))) = 0
    central          w = 2 vec(conj(q) q'),  w' = 2 vec(conj(q) q'')

For a motion of class C^5 the residual of the full link has the method's own order.  The residual of its projections is
not larger, so that each method keeps its order (one, two, four and two).  With ``central`` an angular velocity is a
function of the orientations around its frame, as velocities are of positions; its derivatives follow, since
vec(conj(q') q') = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from stc.problem import Rotation, VariableRef
from stc.symbolic.expr import ONE, ZERO, Expr, neg, sub, substitute, sum_of, sym, symbols
from stc.time_derivatives import quaternion_product, time_derivative

HALF = Fraction(1, 2)


def norm_row(rotation: Rotation) -> Expr:
    """An expression that is 0 for a quaternion of unit length."""
    return sum_of([c * c for c in _quaternion(rotation)]) - ONE


def rotation_links(method: str, rotation: Rotation, h: Expr) -> list[Expr]:
    """The equations (= 0) between an orientation and its angular velocity over a step of length h.

    They stand where those of :func:`stc.transcription.schemes.links` do: for hermite-simpson on the step's midpoint,
    else on the frame before it.
    """
    if method == "stepping":
        turned = _from(_quaternion(rotation, Fraction(0)), _quaternion(rotation, Fraction(1)))[1:]
        return [t - 0.5 * h * w for t, w in zip(turned, _velocity(rotation, Fraction(1)), strict=True)]
    if method == "trapezoidal":
        q0, q1 = _quaternion(rotation, Fraction(0)), _quaternion(rotation, Fraction(1))
        w0, w1 = _velocity(rotation, Fraction(0)), _velocity(rotation, Fraction(1))
        turned = _from(q0, q1)[1:]
        return [t - 0.25 * h * (a + b) for t, a, b in zip(turned, w0, w1, strict=True)]
    qm = _quaternion(rotation)
    # Everything as seen from the midpoint's orientation, which is then the identity.
    a, b = _from(qm, _quaternion(rotation, -HALF)), _from(qm, _quaternion(rotation, HALF))
    rate_a = quaternion_product(a, [ZERO, *_velocity(rotation, -HALF)])
    rate_b = quaternion_product(b, [ZERO, *_velocity(rotation, HALF)])
    rate_m = [ZERO, *_velocity(rotation)]
    whole = [
        b[k] - a[k] - (h / 12.0) * (rate_a[k] + 4.0 * rate_m[k] + rate_b[k])  # q' is half of each
        for k in (1, 2, 3)
    ]
    middle = [0.5 * (a[k] + b[k]) + (h / 16.0) * (rate_a[k] - rate_b[k]) for k in (1, 2, 3)]
    return [*whole, *middle]


def velocity_rows(rotation: Rotation) -> list[Expr]:
    """The rows (= 0) of central differences: each angular velocity is that of the orientations around it."""
    return [
        sub(sym(VariableRef(name)), rate)
        for name, rate in zip(rotation.velocity, _rates_of_orientation(rotation), strict=True)
    ]


def without_angular_accelerations(body: Expr, rotations: Sequence[Rotation]) -> Expr:
    """For central differences: derivatives of angular velocities replaced by those of the orientation."""
    turning = {name: (rotation, k) for rotation in rotations for k, name in enumerate(rotation.velocity)}
    changes: dict[object, Expr] = {}
    for key in symbols(body):
        if isinstance(key, VariableRef) and key.order and key.name in turning:
            rotation, k = turning[key.name]
            plain = time_derivative(_rates_of_orientation(rotation)[k], key.order)
            places: dict[object, Expr] = {
                one: sym(VariableRef(one.name, one.order, key.scale, key.shift, key.side))
                for one in symbols(plain)
                if isinstance(one, VariableRef)
            }
            changes[key] = substitute(plain, places)
    return substitute(body, changes) if changes else body


def _rates_of_orientation(rotation: Rotation) -> list[Expr]:
    """2 vec(conj(q) q') with the derivatives of the quaternion's components."""
    rates = [sym(VariableRef(name, 1)) for name in rotation.quaternion]
    return [2.0 * c for c in _from(_quaternion(rotation), rates)[1:]]


def _quaternion(rotation: Rotation, shift: Fraction | int = 0) -> list[Expr]:
    return [sym(VariableRef(name, 0, 1, shift)) for name in rotation.quaternion]


def _velocity(rotation: Rotation, shift: Fraction | int = 0) -> list[Expr]:
    return [sym(VariableRef(name, 0, 1, shift)) for name in rotation.velocity]


def _from(a: Sequence[Expr], b: Sequence[Expr]) -> list[Expr]:
    """conj(a) b: the rotation from orientation a to b, relative to a."""
    return quaternion_product([a[0], *(neg(c) for c in a[1:])], b)
