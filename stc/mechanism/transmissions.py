"""The lengths along which forces act: joints, tendons, and sites, with the actuators' gear."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from stc.mechanism.forces import Transmission, Wrench
from stc.mechanism.kinematics import Kinematics
from stc.mechanism.mechanism import Actuator, Tendon
from stc.mechanism.tree import WORLD, Frame
from stc.mechanism.vectors import (
    ORIGIN,
    Matrix,
    Vector,
    cross,
    dot,
    minus,
    negative,
    plus,
    product,
    rotation_of,
    scaled,
    times,
    transposed,
)
from stc.symbolic.expr import ONE, ZERO, Expr, add, call, div, mul, neg, num, sub, sum_of

#: Added to squares before their root is taken, so that it has a derivative at 0: an error of 1e-10 there.
TINY = 1e-20


def magnitude(v: Sequence[Expr]) -> Expr:
    """The length of a vector, off by 1e-10 at most, with derivatives at 0."""
    return call("sqrt", add(dot(v, v), num(TINY)))


def absolute(x: Expr) -> Expr:
    """The absolute value, off by 1e-10 at most, with derivatives at 0."""
    return call("sqrt", add(mul(x, x), num(TINY)))


def rotation_vector(quaternion: Sequence[Expr]) -> Vector:
    """The axis of a unit quaternion's rotation times its angle, which is below pi."""
    w, x, y, z = quaternion
    sine = magnitude((x, y, z))
    return scaled(div(mul(num(2.0), call("atan", div(sine, w))), sine), (x, y, z))


def rotation_vector_of(turn: Matrix) -> Vector:
    """The axis of a rotation matrix times the angle, which is below pi."""
    half = num(0.5)
    axial = scaled(
        half, (sub(turn[2][1], turn[1][2]), sub(turn[0][2], turn[2][0]), sub(turn[1][0], turn[0][1]))
    )
    sine = magnitude(axial)
    cosine = mul(half, sub(add(add(turn[0][0], turn[1][1]), turn[2][2]), ONE))
    return scaled(div(call("atan2", sine, cosine), sine), axial)


def relative(quaternion: Sequence[Expr], reference: Sequence[float]) -> tuple[Expr, Expr, Expr, Expr]:
    """The product of a reference's conjugate and a quaternion."""
    a, b, c, d = [num(value) for value in reference]
    w, x, y, z = quaternion
    return (
        sum_of([mul(a, w), mul(b, x), mul(c, y), mul(d, z)]),
        sum_of([mul(a, x), neg(mul(b, w)), neg(mul(c, z)), mul(d, y)]),
        sum_of([mul(a, y), mul(b, z), neg(mul(c, w)), neg(mul(d, x))]),
        sum_of([mul(a, z), neg(mul(b, y)), mul(c, x), neg(mul(d, w))]),
    )


def tendon_line(tendon: Tendon, kinematics: Kinematics, sites: Sequence[Frame]) -> Transmission:
    """A tendon's length.

    Raises:
        ValueError: it wraps around geoms.
    """
    if tendon.kind == "fixed":
        return _fixed(tendon, kinematics)
    length: Expr = ZERO
    pulls: list[Wrench] = []
    divisor = 1.0
    for first, second in zip(tendon.path, tendon.path[1:]):
        if first.kind == "pulley":
            divisor = first.parameter
            continue
        if second.kind == "pulley":
            continue
        if first.kind != "site" or second.kind != "site":
            raise ValueError(f"tendon {tendon.name} wraps around a geom")
        share = num(1.0 / divisor)
        here, there = sites[first.index], sites[second.index]
        if here.segment == there.segment:
            way = minus(there.at, here.at)
            length = add(length, mul(share, call("sqrt", dot(way, way))))
            continue
        way = minus(kinematics.place_of(there), kinematics.place_of(here))
        distance = call("sqrt", dot(way, way))
        length = add(length, mul(share, distance))
        along = scaled(div(share, distance), way)
        pulls += [Wrench(there, along), Wrench(here, negative(along))]
    return Transmission(length, _power(kinematics, pulls), {}, tuple(pulls))


def _fixed(tendon: Tendon, kinematics: Kinematics) -> Transmission:
    joints = kinematics.tree.mechanism.joints
    moments: dict[int, Expr] = {}
    length: Expr = ZERO
    for step in tendon.path:
        joint, share = joints[step.index], num(step.parameter)
        length = add(length, mul(share, kinematics.motion.q[joint.qpos]))
        moments[joint.dof] = add(moments.get(joint.dof, ZERO), share)
    return Transmission(length, _along(kinematics, moments), moments)


def second_rate(tendon: Tendon, line: Transmission, kinematics: Kinematics) -> Expr:
    """The second derivative of a tendon's length by time."""
    if tendon.kind == "fixed":
        return sum_of([mul(share, kinematics.motion.a[dof]) for dof, share in line.moments.items()])
    total: Expr = ZERO
    for there, here in zip(line.pulls[::2], line.pulls[1::2]):
        way = minus(kinematics.place_of(there.frame), kinematics.place_of(here.frame))
        distance = call("sqrt", dot(way, way))
        speed = minus(kinematics.velocity_of(there.frame), kinematics.velocity_of(here.frame))
        felt = minus(kinematics.acceleration_of(there.frame), kinematics.acceleration_of(here.frame))
        along = dot(there.force, speed)
        # With a share s of the way w: s (|w|)'' = u . w'' + (s^2 w'.w' - (u . w')^2) / (s |w|), where u = s w / |w|.
        share_squared = dot(there.force, there.force)
        share = call("sqrt", share_squared)
        turned = sub(mul(share_squared, dot(speed, speed)), mul(along, along))
        total = add(total, add(dot(there.force, felt), div(turned, mul(share, distance))))
    return total


def transmission(
    actuator: Actuator,
    kinematics: Kinematics,
    gear: Sequence[Expr],
    sites: Sequence[Frame],
    tendons: Sequence[Transmission],
) -> Transmission:
    """The transmission of an actuator.

    Raises:
        ValueError: its kind of transmission cannot be stated.
    """
    kind = actuator.transmission
    if kind in ("joint", "jointinparent"):
        return _joint(actuator, kinematics, gear)
    if kind == "tendon":
        return tendons[actuator.target].geared(gear[0])
    if kind == "site":
        if actuator.reference < 0:
            return _site(kinematics, sites[actuator.target], gear)
        return _between(kinematics, sites[actuator.target], sites[actuator.reference], gear, actuator)
    if kind == "slidercrank":
        crank, slider = sites[actuator.target], sites[actuator.reference]
        return _slider_crank(kinematics, crank, slider, actuator.crank_length).geared(gear[0])
    if not actuator.enabled:
        return Transmission(ZERO, ZERO, {})
    raise ValueError(f"actuator {actuator.name} acts by {kind}")


def _along(kinematics: Kinematics, moments: Mapping[int, Expr]) -> Expr:
    return sum_of([mul(moment, kinematics.motion.v[dof]) for dof, moment in moments.items()])


def _power(kinematics: Kinematics, pulls: Iterable[Wrench]) -> Expr:
    """The power of wrenches."""
    total: Expr = ZERO
    for pull in pulls:
        if pull.frame.segment == WORLD:
            continue
        if pull.force != ORIGIN:
            total = add(total, dot(pull.force, kinematics.velocity_of(pull.frame)))
        if pull.torque != ORIGIN:
            total = add(total, dot(pull.torque, kinematics.rate_of(pull.frame)))
    return total


def _joint(actuator: Actuator, kinematics: Kinematics, gear: Sequence[Expr]) -> Transmission:
    joint = kinematics.tree.mechanism.joints[actuator.target]
    q, d = kinematics.motion.q, joint.dof
    in_parent = actuator.transmission == "jointinparent"
    if joint.kind in ("hinge", "slide"):
        moments = {d: gear[0]}
        return Transmission(mul(gear[0], q[joint.qpos]), _along(kinematics, moments), moments)
    turn = q[joint.qpos + (3 if joint.kind == "free" else 0) :][:4]
    about: Vector = (gear[3], gear[4], gear[5]) if joint.kind == "free" else (gear[0], gear[1], gear[2])
    if in_parent:
        about = times(transposed(rotation_of(turn)), about)
    length: Expr = ZERO
    period = 0.0
    if joint.kind == "free":
        moments = dict(enumerate([*gear[:3], *about], d))
    else:
        moments = dict(enumerate(about, d))
        length = dot(rotation_vector(turn), about)
        period = 2.0 * 3.141592653589793 * sum(value * value for value in actuator.gear[:3]) ** 0.5
    return Transmission(length, _along(kinematics, moments), moments, (), period)


def _site(kinematics: Kinematics, site: Frame, gear: Sequence[Expr]) -> Transmission:
    axes = kinematics.axes_of(site)
    force = times(axes, (gear[0], gear[1], gear[2]))
    torque = times(axes, (gear[3], gear[4], gear[5]))
    pulls = (Wrench(site, force, torque),)
    return Transmission(ZERO, _power(kinematics, pulls), {}, pulls)


def _between(
    kinematics: Kinematics, site: Frame, reference: Frame, gear: Sequence[Expr], actuator: Actuator
) -> Transmission:
    """Between two sites, in the axes of the second: motions of both together do not count."""
    axes = kinematics.axes_of(reference)
    pull: Vector = (gear[0], gear[1], gear[2])
    twist: Vector = (gear[3], gear[4], gear[5])
    way = minus(kinematics.place_of(site), kinematics.place_of(reference))
    length: Expr = ZERO
    pulls: list[Wrench] = []
    if pull != ORIGIN:
        length = dot(times(transposed(axes), way), pull)
        force = times(axes, pull)
        pulls += [Wrench(site, force), Wrench(reference, negative(force))]
        common = kinematics.common(site.segment, reference.segment)
        if common != WORLD:
            held = Frame(common, site.turn, ORIGIN)
            pulls.append(Wrench(held, ORIGIN, negative(cross(way, force))))
    if twist != ORIGIN:
        between = product(transposed(axes), kinematics.axes_of(site))
        length = add(length, dot(rotation_vector_of(between), twist))
        torque = times(axes, twist)
        pulls += [Wrench(site, ORIGIN, torque), Wrench(reference, ORIGIN, negative(torque))]
    period = 0.0
    if pull == ORIGIN:
        period = 2.0 * 3.141592653589793 * sum(value * value for value in actuator.gear[3:]) ** 0.5
    return Transmission(length, _power(kinematics, pulls), {}, tuple(pulls), period)


def _slider_crank(kinematics: Kinematics, crank: Frame, slider: Frame, rod: float) -> Transmission:
    """The distance along the slider's axis to the end of a rod from the crank's pin."""
    axes = transposed(kinematics.axes_of(slider))
    axis = axes[2]
    way = minus(kinematics.place_of(crank), kinematics.place_of(slider))
    along = dot(way, axis)
    root = call("sqrt", sub(add(mul(along, along), num(rod * rod)), dot(way, way)))
    short = sub(ONE, div(along, root))
    by_way = plus(scaled(short, axis), scaled(div(ONE, root), way))
    by_axis = scaled(short, way)
    pulls = (Wrench(crank, by_way), Wrench(slider, negative(by_way), cross(axis, by_axis)))
    return Transmission(sub(along, root), _power(kinematics, pulls), {}, pulls)
