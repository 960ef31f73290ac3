"""Forces of a surrounding medium at rest or in a steady wind, by MuJoCo's two models.

MuJoCo's documentation ("Fluid forces") states both.  A body of which no geom has a ``fluidshape`` is a box with its
inertia; else each such geom is an ellipsoid.  The inertia of the medium that moves along is part of neither: MuJoCo
leaves out what depends on accelerations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from stc.mechanism.forces import Wrench
from stc.mechanism.kinematics import Kinematics
from stc.mechanism.mechanism import Body, Geom
from stc.mechanism.numbers import Numbers
from stc.mechanism.transmissions import TINY, absolute, magnitude
from stc.mechanism.tree import WORLD, Frame
from stc.mechanism.vectors import Vector, cross, dot, minus, negative, plus, scaled, times, transposed, vector
from stc.symbolic.expr import Expr, add, call, div, mul, num, sub, sum_of

#: MuJoCo's ``mjMINVAL``.
_LEAST = 1e-15


def resistance(kinematics: Kinematics, numbers: Numbers, geoms: Sequence[Frame]) -> list[Wrench]:
    """The forces of the medium on all bodies that move.

    Parameters
    ----------
    geoms
        The frames of all geoms.
    """
    tree = kinematics.tree
    mechanism, options = tree.mechanism, tree.mechanism.options
    if not options.density and not options.viscosity:
        return []
    density, viscosity = [
        numbers.number(value, "option", name)
        for name, value in (("density", options.density), ("viscosity", options.viscosity))
    ]
    found = []
    for index, body in enumerate(mechanism.bodies):
        if tree.frames[index].segment == WORLD or body.mass < _LEAST:
            continue
        shaped = [k for k, geom in enumerate(mechanism.geoms) if geom.body == index and geom.fluid]
        for k in shaped:
            frame = geoms[k]
            v, w = _motion(kinematics, frame)
            force, torque = _on_ellipsoid(mechanism.geoms[k], density, viscosity, v, w)
            found.append(_wrench(frame, force, torque))
        if not shaped:
            com = tree.vector_of(("body", body.name, "com"), body.com)
            frame = tree.frame(index, com, body.inertia_quat)
            v, w = _motion(kinematics, frame)
            box = _box(body, numbers, tree.vector_of(("body", body.name, "inertia"), body.inertia))
            force, torque = _on_box(box, density, viscosity, v, w)
            found.append(_wrench(frame, force, torque))
    return found


def _motion(kinematics: Kinematics, frame: Frame) -> tuple[Vector, Vector]:
    """The velocity of a frame relative to the medium, and its angular velocity, in its own axes."""
    segment = frame.segment
    back, rate = transposed(frame.turn), kinematics.rate(segment)
    wind = vector(kinematics.tree.mechanism.options.wind)
    above = kinematics.to_segment(segment, minus(kinematics.base_velocity(segment), wind))
    own = plus(kinematics.velocity(segment), cross(rate, frame.at))
    return times(back, plus(above, own)), times(back, rate)


def _wrench(frame: Frame, force: Vector, torque: Vector) -> Wrench:
    return Wrench(frame, times(frame.turn, force), times(frame.turn, torque), in_segment=True)


# --- a box ----------------------------------------------------------------------------------------------------------


def _box(body: Body, numbers: Numbers, moments: Vector) -> list[Expr]:
    """The edges of the box of a body's mass that has its inertia."""
    mass = numbers.number(body.mass, "body", body.name, "mass")
    edges = []
    for k in range(3):
        spread = sub(add(moments[(k + 1) % 3], moments[(k + 2) % 3]), moments[k])
        above = sub(spread, num(_LEAST))  # the larger of the spread and MuJoCo's least number, rounded
        kink = call("sqrt", add(mul(above, above), num((1e-5 * _LEAST) ** 2)))
        edge = call("sqrt", div(mul(num(3.0), add(add(spread, num(_LEAST)), kink)), mass))
        edges.append(numbers.derive(edge, "body", body.name, "edge", "xyz"[k]))
    return edges


def _on_box(
    box: Sequence[Expr], density: Expr, viscosity: Expr, v: Vector, w: Vector
) -> tuple[Vector, Vector]:
    """The force and the torque on a box: Stokes' law for a sphere of its size, and drag of each face."""
    diameter = mul(num(1.0 / 3.0), sum_of(box))
    slow = mul(mul(num(3.0 * math.pi), diameter), viscosity)
    turning = mul(mul(num(math.pi), mul(diameter, mul(diameter, diameter))), viscosity)
    forces, torques = [], []
    for k in range(3):
        own, next_, last = box[k], box[(k + 1) % 3], box[(k + 2) % 3]
        face = mul(num(0.5), mul(next_, last))
        fourth = mul(own, add(_power(next_, 4), _power(last, 4)))
        drag = add(slow, mul(mul(density, face), absolute(v[k])))
        forces.append(mul(drag, v[k]))
        twist = add(turning, mul(mul(density, mul(num(1.0 / 64.0), fourth)), absolute(w[k])))
        torques.append(mul(twist, w[k]))
    return negative((forces[0], forces[1], forces[2])), negative((torques[0], torques[1], torques[2]))


def _power(x: Expr, exponent: int) -> Expr:
    found = x
    for _ in range(exponent - 1):
        found = mul(found, x)
    return found


# --- an ellipsoid ---------------------------------------------------------------------------------------------------


def _semiaxes(geom: Geom) -> tuple[float, float, float]:
    x, y, z = geom.size
    if geom.kind == "sphere":
        return x, x, x
    if geom.kind in ("capsule", "cylinder"):
        return x, x, y + (x if geom.kind == "capsule" else 0.0)
    return x, y, z


def _on_ellipsoid(geom: Geom, density: Expr, viscosity: Expr, v: Vector, w: Vector) -> tuple[Vector, Vector]:
    """The force and the torque on a geom: medium that turns along, the lifts of Magnus and Kutta, drag.

    MuJoCo's own formulas, with its names in parentheses.
    """
    share, blunt, slender, angular, kutta, magnus = geom.fluid[:6]
    along, around = vector(geom.fluid[6:9]), vector(geom.fluid[9:12])  # (virtual_mass, virtual_inertia)
    size = _semiaxes(geom)
    _, middle, most = sorted(size)
    pi = math.pi

    # the medium that moves along has momentum
    momentum = _each(along, v)
    force = cross(momentum, w)
    torque = plus(cross(momentum, v), cross(_each(around, w), w))

    force = plus(force, scaled(num(magnus * 4.0 / 3.0 * pi * size[0] * size[1] * size[2]), cross(w, v)))

    # the projected area, and the angle of the velocity to its normal; squares of areas in units of the largest
    squares = [(size[1] * size[2]) ** 2, (size[2] * size[0]) ** 2, (size[0] * size[1]) ** 2]
    unit = max(squares)
    normal = _each(vector([square / unit for square in squares]), v)
    projected = add(dot(normal, v), num(TINY))  # (proj_num)
    fourth = add(dot(normal, normal), num(TINY))  # (proj_denom)
    speed = magnitude(v)
    area = mul(num(pi * math.sqrt(unit)), call("sqrt", div(fourth, projected)))
    cosine = div(projected, mul(speed, fourth))
    lift = mul(num(kutta), mul(cosine, area))
    force = plus(force, scaled(lift, cross(cross(normal, v), v)))

    drag = mul(speed, add(mul(num(blunt - slender), area), num(slender * pi * most * middle)))
    force = minus(force, scaled(drag, v))

    moments = [8.0 / 15.0 * pi * size[k] * max(size[(k + 1) % 3], size[(k + 2) % 3]) ** 4 for k in range(3)]
    largest = 8.0 / 15.0 * pi * middle * most**4
    turned = _each(vector([angular * own + slender * (largest - own) for own in moments]), w)
    torque = minus(torque, scaled(call("sqrt", add(dot(turned, turned), num((1e-10 * largest) ** 2))), w))

    diameter = 2.0 / 3.0 * sum(size)
    force = minus(scaled(density, force), scaled(mul(num(3.0 * pi * diameter), viscosity), v))
    torque = minus(scaled(density, torque), scaled(mul(num(pi * diameter**3), viscosity), w))
    return scaled(num(share), force), scaled(num(share), torque)


def _each(u: Vector, v: Vector) -> Vector:
    """The vector of the products of corresponding entries."""
    return mul(u[0], v[0]), mul(u[1], v[1]), mul(u[2], v[2])
