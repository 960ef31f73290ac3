"""Generalised forces by the recursive Newton-Euler method, as expressions.

The motion of the segments determines the forces and torques that they need.  These are summed from the outermost
segment inwards, and their components along the joints are the generalised forces [Featherstone 2008, chapter 5].
"""

from __future__ import annotations

from collections.abc import Iterable

from stc.mechanism.forces import Wrench
from stc.mechanism.kinematics import Kinematics
from stc.mechanism.tree import WORLD, Segment
from stc.mechanism.vectors import (
    ORIGIN,
    Matrix,
    Vector,
    cross,
    dot,
    minus,
    plus,
    scaled,
    times,
    vector,
)
from stc.symbolic.expr import ZERO, Expr, add, mul, sub


def inverse_dynamics(kinematics: Kinematics, wrenches: Iterable[Wrench] = ()) -> list[Expr]:
    """The generalised force on every degree of freedom that the motion needs, besides the wrenches.

    This is M a + c - J^T f in the order of ``qvel``, with gravity in c.
    """
    loads = [_load(segment, kinematics, index) for index, segment in enumerate(kinematics.tree.segments)]
    for segment, (force, torque) in _in_segments(kinematics, wrenches).items():
        needed, turning = loads[segment]
        loads[segment] = minus(needed, force), minus(turning, torque)
    return _gathered(kinematics, loads)


def generalised_forces(kinematics: Kinematics, wrenches: Iterable[Wrench]) -> list[Expr]:
    """J^T f: the generalised forces of the wrenches."""
    loads = [(ORIGIN, ORIGIN)] * len(kinematics.tree.segments)
    for segment, load in _in_segments(kinematics, wrenches).items():
        loads[segment] = load
    return _gathered(kinematics, loads)


def _in_segments(kinematics: Kinematics, wrenches: Iterable[Wrench]) -> dict[int, tuple[Vector, Vector]]:
    """The sums of wrenches by segment, at its origin and in its axes."""
    forces: dict[int, dict[Vector, Vector]] = {}
    torques: dict[int, Vector] = {}
    found: dict[int, tuple[Vector, Vector]] = {}
    for wrench in wrenches:
        segment = wrench.frame.segment
        if segment == WORLD:
            continue
        if wrench.in_segment:
            turning = plus(wrench.torque, cross(wrench.frame.at, wrench.force))
            force, torque = found.get(segment, (ORIGIN, ORIGIN))
            found[segment] = plus(force, wrench.force), plus(torque, turning)
            continue
        places, at = forces.setdefault(segment, {}), wrench.frame.at
        places[at] = plus(places.get(at, ORIGIN), wrench.force)
        torques[segment] = plus(torques.get(segment, ORIGIN), wrench.torque)
    for segment, pulls in forces.items():
        force, torque = found.get(segment, (ORIGIN, ORIGIN))
        torque = plus(torque, kinematics.to_segment(segment, torques[segment]))
        for at, pull in pulls.items():
            own = kinematics.to_segment(segment, pull)
            force, torque = plus(force, own), plus(torque, cross(at, own))
        found[segment] = force, torque
    return found


def _load(segment: Segment, kinematics: Kinematics, index: int) -> tuple[Vector, Vector]:
    """The force, and the torque about its origin, that a segment's motion needs, in its axes."""
    inertia = segment.effective
    field, moved = kinematics.turning(index).field, kinematics.felt(index)
    force = plus(scaled(inertia.mass, moved), times(field, inertia.first))
    return force, plus(_turned(field, inertia.second), cross(inertia.first, moved))


def _turned(field: Matrix, second: Matrix) -> Vector:
    """The sum of m x (field x) over a body, from its second moments of mass."""

    def part(i: int, j: int) -> Expr:
        total: Expr = ZERO
        for k in range(3):
            total = add(total, sub(mul(field[i][k], second[k][j]), mul(field[j][k], second[k][i])))
        return total

    return part(2, 1), part(0, 2), part(1, 0)


def _gathered(kinematics: Kinematics, loads: list[tuple[Vector, Vector]]) -> list[Expr]:
    """Loads summed from the outermost segment inwards, and their components along the joints."""
    tree = kinematics.tree
    found: list[Expr] = [ZERO] * tree.mechanism.n_freedoms
    for index in reversed(range(len(tree.segments))):
        segment = tree.segments[index]
        turn, at = kinematics.locals[index]
        force, torque = loads[index]
        d, kind = segment.joint.dof, segment.joint.kind
        if kind == "hinge":
            found[d] = dot(vector(segment.axis), torque)
        elif kind == "slide":
            found[d] = dot(vector(segment.axis), force)
        elif kind == "ball":
            found[d : d + 3] = torque
        else:
            found[d : d + 3] = times(turn, force)
            found[d + 3 : d + 6] = torque
        if segment.parent != WORLD:
            outer, about = loads[segment.parent]
            carried = times(turn, force)
            loads[segment.parent] = (
                plus(outer, carried),
                plus(about, plus(times(turn, torque), cross(at, carried))),
            )
    return found
