"""The statements of a model alone: equations of motion, bounds, and replay lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from stc.language.context import Context
from stc.language.model.paths import parts_of
from stc.language.model.scope import ModelScope, path_of
from stc.mechanism.forces import Forces
from stc.problem import ConstantRef, Relation, ReplayChannel, VariableRef
from stc.symbolic.expr import ONE, ZERO, Expr, add, call, mul, num, sub, sum_of, sym

#: How far the corners of dry friction, of height 1, are rounded: Newton's method sees slopes there.
_ROUNDED = 0.3


def equations_of_motion(context: Context, scope: ModelScope, forces: Forces) -> list[Relation]:
    """The equation of each degree of freedom; ``forces`` are those that the spec adds."""
    rows = scope.dynamics.residual(forces.wrenches, forces.on_dofs)
    span = context.span(scope.statement)
    found = []
    for one in scope.coordinates:
        for dof, name in zip(one.joint.dofs, one.freedoms, strict=True):
            text = f"equation of motion of {name}"
            found.append(Relation(rows[dof], ZERO, ZERO, context.everywhere, span, text, name))
    return found


def own_forces(scope: ModelScope, given: Mapping[str, list[Expr]]) -> Iterator[tuple[int, Expr]]:
    """Forces on single degrees of freedom: dry friction, and those of the spec by the coordinate's variable."""
    for one in scope.coordinates:
        for k, (dof, name) in enumerate(zip(one.joint.dofs, one.freedoms, strict=True)):
            if one.friction:
                yield dof, sym(VariableRef(one.friction[k]))
            if name in given:
                yield dof, sum_of(given[name])


def friction_of_tendons(scope: ModelScope) -> Forces:
    """Dry friction along tendons."""
    found = Forces()
    for index, name in scope.tendon_friction.items():
        found.along(scope.dynamics.tendons[index], sym(VariableRef(name)))
    return found


def activations(context: Context, scope: ModelScope) -> Iterator[Relation]:
    """The dynamics of the states of actuators."""
    span = context.span(scope.statement)
    for name, rate in zip(scope.activations, scope.dynamics.activation_rates, strict=True):
        body = sub(sym(VariableRef(name, 1)), rate)
        yield Relation(body, ZERO, ZERO, context.everywhere, span, f"dynamics of {name}")


def bounds(context: Context, scope: ModelScope) -> Iterator[Relation]:
    """Ranges of joints and controls as bounds, ranges of forces as constraints, if the model enables them."""
    where, span = context.everywhere, context.span(scope.statement)

    given = scope.dynamics.actuation()

    def between(body: Expr, ends: Sequence[float], text: str, margin: float = 0.0) -> Relation:
        lower, upper = [
            add(num(end), num(inwards)) if math.isfinite(end) else None
            for end, inwards in zip(ends, (margin, -margin), strict=True)
        ]
        return Relation(body, lower, upper, where, span, text)

    for one in scope.coordinates:
        joint = one.joint
        for name, rate, softness in zip(one.friction, one.rates, joint.friction_softness, strict=False):
            pull = add(sym(replace(rate, order=rate.order + 1)), mul(num(joint.friction_damping), sym(rate)))
            at_bound = joint.frictionloss * softness
            law = mul(num(joint.frictionloss), _clipped(mul(num(1.0 / at_bound), pull)))
            body = add(sym(VariableRef(name)), law)
            yield Relation(body, ZERO, ZERO, where, span, f"{name} acts against the motion")
        if joint.force_limited:
            for dof in joint.dofs:
                yield between(
                    given[dof], joint.force_range, f"range of the actuators' force on joint {joint.name}"
                )
        if not joint.limited:
            continue
        if one.rotation is None:
            name = one.positions[0]
            yield between(sym(VariableRef(name)), joint.bounds, f"range of {name}", joint.margin)
        elif joint.kind == "ball":
            # The angle from the reference is 2 acos(abs(qw)): a bound of qw^2, whichever sign the quaternion has.
            real = sym(VariableRef(one.rotation.quaternion[0]))
            least = math.cos(0.5 * max(0.0, min(joint.bounds[1] - joint.margin, math.pi))) ** 2
            yield Relation(real * real, num(least), None, where, span, f"range of joint {joint.name}")
    for actuator, force in zip(scope.mechanism.actuators, scope.dynamics.actuator_forces, strict=True):
        if not actuator.enabled:
            continue
        for address, limits in zip(actuator.controls, actuator.control_ranges, strict=True):
            if limits is not None:
                name = scope.controls[address]
                yield between(sym(VariableRef(name)), limits, f"range of {name}")
        for address in actuator.activations if actuator.activation_limited else ():
            state = scope.activations[address]
            yield between(sym(VariableRef(state)), actuator.activation_range, f"range of {state}")
        if actuator.force_limited:
            text = f"range of the force of {path_of('actuator', actuator.name)}"
            yield between(force, actuator.force_range, text)
    for index, tendon in enumerate(scope.mechanism.tendons):
        if tendon.limited:
            length = scope.dynamics.tendons[index].length
            yield between(length, tendon.bounds, f"range of tendon {tendon.name}", tendon.margin)
        if tendon.force_limited:
            pulled = scope.dynamics.pull_on_tendon(index)
            text = f"range of the actuators' force on tendon {tendon.name}"
            yield between(pulled, tendon.force_range, text)
        if index in scope.tendon_friction:
            name = scope.tendon_friction[index]
            slip = scope.dynamics.tendons[index].rate
            # Friction along a tendon is unknown: within its bound, and it takes energy.
            force, most = sym(VariableRef(name)), tendon.frictionloss
            yield between(force, (-most, most), f"bound of {name}")
            yield Relation(mul(force, slip), None, ZERO, where, span, f"{name} acts against the motion")


def _clipped(x: Expr) -> Expr:
    """A number clipped to [-1, 1] with rounded corners; the error is half of the rounding there, and less elsewhere."""

    def rounded(y: Expr) -> Expr:
        return call("sqrt", add(mul(y, y), num(_ROUNDED**2)))

    return mul(num(0.5), sub(rounded(add(x, ONE)), rounded(sub(x, ONE))))


def replay_lines(context: Context, scope: ModelScope) -> Iterator[ReplayChannel]:
    """The replay lines of joints, actuators, and numbers of the model that are constants."""
    span = context.span(scope.statement)
    for one in scope.coordinates:
        for name in one.names:
            _, *path = parts_of(name)
            yield ReplayChannel("joint", tuple(path), sym(VariableRef(name)), span)
    for name in (*scope.controls, *scope.activations):
        _, *path = parts_of(name)
        yield ReplayChannel("actuator", tuple(path), sym(VariableRef(name)), span)
    for name in scope.constants:
        usual = None if name in scope.structural else scope.constants[name]
        yield ReplayChannel("set", tuple(parts_of(name)), sym(ConstantRef(name)), span, usual)


__all__ = ["bounds", "equations_of_motion", "replay_lines"]
