"""Passive forces: springs, dampers, gravity compensation, and the inertia of drives."""

from __future__ import annotations

from collections.abc import Sequence

from stc.mechanism.forces import Forces, Transmission, Wrench
from stc.mechanism.kinematics import Kinematics
from stc.mechanism.mechanism import Actuator, Joint, Mechanism, Tendon
from stc.mechanism.numbers import Numbers
from stc.mechanism.transmissions import (
    absolute,
    magnitude,
    relative,
    rotation_vector,
    second_rate,
)
from stc.mechanism.tree import WORLD
from stc.mechanism.vectors import scaled
from stc.symbolic.expr import ZERO, Expr, add, is_literal, mul, neg, num, sub


def disabled_passive(mechanism: Mechanism) -> tuple[bool, bool]:
    """Whether the model's options switch off springs, and dampers."""
    off = mechanism.options.disabled
    return "spring" in off, "damper" in off


def springs_and_dampers(
    kinematics: Kinematics, numbers: Numbers, tendons: Sequence[Transmission], gears: Sequence[Expr]
) -> Forces:
    """Forces of the springs and dampers of joints and tendons.

    Parameters
    ----------
    tendons
        The lengths of all tendons.
    gears
        The gear of every actuator, whose damping acts on its joint or tendon.
    """
    mechanism = kinematics.tree.mechanism
    no_springs, no_dampers = disabled_passive(mechanism)
    forces = Forces()
    for index, joint in enumerate(mechanism.joints):
        if not no_springs:
            _joint_spring(forces, joint, kinematics, numbers)
        if not no_dampers:
            damping = numbers.number(joint.damping, "joint", joint.name, "damping")
            linear, poly = _with_drives(mechanism, gears, damping, joint.damping_poly, "joint", index)
            for dof in joint.dofs:
                forces.push(dof, _resistance(kinematics.motion.v[dof], linear, poly))
    for index, (tendon, line) in enumerate(zip(mechanism.tendons, tendons, strict=True)):
        force: Expr = ZERO
        if not no_springs:
            force = _tendon_spring(tendon, line)
        if not no_dampers:
            linear, poly = _with_drives(
                mechanism, gears, num(tendon.damping), tendon.damping_poly, "tendon", index
            )
            force = add(force, _resistance(line.rate, linear, poly))
        if force is not ZERO:
            forces.along(line, force)
    return forces


def gravity_compensation(kinematics: Kinematics, numbers: Numbers) -> list[Wrench]:
    """The forces at the centres of mass of bodies with gravity compensation."""
    tree = kinematics.tree
    mechanism = tree.mechanism
    if all(disabled_passive(mechanism)):
        return []
    wrenches = []
    for index, body in enumerate(mechanism.bodies):
        share = numbers.number(body.gravcomp, "body", body.name, "gravcomp")
        if share is ZERO or tree.frames[index].segment == WORLD:
            continue
        mass = numbers.number(body.mass, "body", body.name, "mass")
        at = tree.frame(index, tree.vector_of(("body", body.name, "com"), body.com))
        wrenches.append(Wrench(at, scaled(neg(mul(mass, share)), kinematics.gravity)))
    return wrenches


def drive_inertia(
    kinematics: Kinematics, numbers: Numbers, tendons: Sequence[Transmission], gears: Sequence[Expr]
) -> Forces:
    """The negative of the forces that armatures need, on degrees of freedom and bodies."""
    mechanism = kinematics.tree.mechanism
    forces = Forces()
    for index, joint in enumerate(mechanism.joints):
        own = numbers.number(joint.armature, "joint", joint.name, "armature")
        inertia = _armature(mechanism, gears, own, "joint", index)
        if inertia is not ZERO:
            for dof in joint.dofs:
                forces.push(dof, neg(mul(inertia, kinematics.motion.a[dof])))
    for index, (tendon, line) in enumerate(zip(mechanism.tendons, tendons, strict=True)):
        inertia = _armature(mechanism, gears, num(tendon.armature), "tendon", index)
        if inertia is not ZERO:
            forces.along(line, neg(mul(inertia, second_rate(tendon, line, kinematics))))
    return forces


def drive_energy(
    kinematics: Kinematics, numbers: Numbers, tendons: Sequence[Transmission], gears: Sequence[Expr]
) -> Expr:
    """The kinetic energy of armatures."""
    mechanism = kinematics.tree.mechanism
    doubled: Expr = ZERO
    for index, joint in enumerate(mechanism.joints):
        own = numbers.number(joint.armature, "joint", joint.name, "armature")
        inertia = _armature(mechanism, gears, own, "joint", index)
        for dof in joint.dofs:
            rate = kinematics.motion.v[dof]
            doubled = add(doubled, mul(inertia, mul(rate, rate)))
    for index, (tendon, line) in enumerate(zip(mechanism.tendons, tendons, strict=True)):
        inertia = _armature(mechanism, gears, num(tendon.armature), "tendon", index)
        doubled = add(doubled, mul(inertia, mul(line.rate, line.rate)))
    return mul(num(0.5), doubled)


def spring_energy(kinematics: Kinematics, numbers: Numbers, tendons: Sequence[Transmission]) -> Expr:
    """The energy that springs of joints and tendons hold."""
    mechanism = kinematics.tree.mechanism
    if disabled_passive(mechanism)[0]:
        return ZERO
    total: Expr = ZERO
    for joint in mechanism.joints:
        stiffness = numbers.number(joint.stiffness, "joint", joint.name, "stiffness")
        for deflection in _deflections(joint, kinematics, numbers):
            total = add(total, _held(deflection, stiffness, joint.stiffness_poly))
    for tendon, line in zip(mechanism.tendons, tendons, strict=True):
        if tendon.stiffness or any(tendon.stiffness_poly):
            total = add(total, _held((_stretch(tendon, line),), num(tendon.stiffness), tendon.stiffness_poly))
    return total


def _held(deflection: tuple[Expr, ...], stiffness: Expr, poly: Sequence[float]) -> Expr:
    """The integral of (k + p0 x + p1 x^2) x by the deflection."""
    if stiffness is ZERO and not any(poly):
        return ZERO
    squared: Expr = ZERO
    for entry in deflection:
        squared = add(squared, mul(entry, entry))
    total = mul(mul(num(0.5), stiffness), squared)
    if any(poly):
        x = deflection[0] if len(deflection) == 1 else magnitude(deflection)
        total = add(total, mul(mul(num(poly[0] / 3.0), squared), x))
        total = add(total, mul(num(poly[1] / 4.0), mul(squared, squared)))
    return total


def _deflections(joint: Joint, kinematics: Kinematics, numbers: Numbers) -> list[tuple[Expr, ...]]:
    """The deflection of a joint's spring: a number for one degree of freedom, or vectors in three dimensions."""
    q, rest = kinematics.motion.q, joint.spring_reference
    if joint.kind in ("hinge", "slide"):
        return [(sub(q[joint.qpos], numbers.number(rest[0], "joint", joint.name, "springref")),)]
    found: list[tuple[Expr, ...]] = []
    first = joint.qpos
    if joint.kind == "free":
        found.append(tuple([sub(q[first + k], num(rest[k])) for k in range(3)]))
        first, rest = first + 3, rest[3:]
    found.append(rotation_vector(relative(q[first : first + 4], rest)))
    return found


def _joint_spring(forces: Forces, joint: Joint, kinematics: Kinematics, numbers: Numbers) -> None:
    stiffness = numbers.number(joint.stiffness, "joint", joint.name, "stiffness")
    if stiffness is ZERO and not any(joint.stiffness_poly):
        return
    dof = joint.dof
    for deflection in _deflections(joint, kinematics, numbers):
        along = deflection[0] if len(deflection) == 1 else ZERO
        if len(deflection) > 1 and any(joint.stiffness_poly):
            along = magnitude(deflection)
        rate = _polynomial(stiffness, joint.stiffness_poly, along)
        for entry in deflection:
            forces.push(dof, neg(mul(rate, entry)))
            dof += 1


def _stretch(tendon: Tendon, line: Transmission) -> Expr:
    """The distance of a tendon's length from the range in which its spring is slack."""
    low, high = tendon.spring_range
    below, above = sub(line.length, num(low)), sub(line.length, num(high))
    if low == high:
        return below
    # min(below, 0) + max(above, 0)
    kinks = sub(absolute(above), absolute(below))
    return mul(num(0.5), add(add(below, above), kinks))


def _tendon_spring(tendon: Tendon, line: Transmission) -> Expr:
    if not tendon.stiffness and not any(tendon.stiffness_poly):
        return ZERO
    stretch = _stretch(tendon, line)
    return neg(mul(stretch, _polynomial(num(tendon.stiffness), tendon.stiffness_poly, stretch)))


def _polynomial(linear: Expr, poly: Sequence[float], x: Expr) -> Expr:
    """linear + p0 x + p1 x^2."""
    total = linear
    if poly[0]:
        total = add(total, mul(num(poly[0]), x))
    if poly[1]:
        total = add(total, mul(num(poly[1]), mul(x, x)))
    return total


def _resistance(v: Expr, linear: Expr, poly: Sequence[Expr]) -> Expr:
    """-v (linear + p0 abs(v) + p1 v^2)."""
    total = linear
    if not is_literal(poly[0], 0.0):
        total = add(total, mul(poly[0], absolute(v)))
    if not is_literal(poly[1], 0.0):
        total = add(total, mul(poly[1], mul(v, v)))
    return neg(mul(total, v))


def _drives(mechanism: Mechanism, kind: str, index: int) -> list[tuple[int, Actuator]]:
    """The actuators that act on a joint or tendon."""
    kinds = ("joint", "jointinparent") if kind == "joint" else ("tendon",)
    return [
        (number, actuator)
        for number, actuator in enumerate(mechanism.actuators)
        if actuator.target == index and actuator.transmission in kinds
    ]


def _with_drives(
    mechanism: Mechanism, gears: Sequence[Expr], damping: Expr, poly: Sequence[float], kind: str, index: int
) -> tuple[Expr, list[Expr]]:
    """The damping of a joint or tendon with that of its actuators."""
    linear, higher = damping, [num(value) for value in poly]
    for number, actuator in _drives(mechanism, kind, index):
        if actuator.damping or any(actuator.damping_poly):
            squared = mul(gears[number], gears[number])
            linear = add(linear, mul(num(actuator.damping), squared))
            higher = [
                add(own, mul(num(more), squared))
                for own, more in zip(higher, actuator.damping_poly, strict=True)
            ]
    return linear, higher


def _armature(mechanism: Mechanism, gears: Sequence[Expr], own: Expr, kind: str, index: int) -> Expr:
    """The armature of a joint or tendon with that of its actuators."""
    for number, actuator in _drives(mechanism, kind, index):
        if actuator.armature:
            own = add(own, mul(num(actuator.armature), mul(gears[number], gears[number])))
    return own
