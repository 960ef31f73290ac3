"""Forces of actuators: gain * input + bias along a transmission, and the states that follow their controls."""

from __future__ import annotations

from collections.abc import Sequence

from stc.mechanism.forces import Transmission
from stc.mechanism.mechanism import Actuator
from stc.symbolic.expr import ZERO, Expr, add, call, div, mul, num, sub

#: MuJoCo's smallest time constant of a filter.
_SHORTEST = 1e-15


def actuator_force(
    actuator: Actuator, line: Transmission, controls: Sequence[Expr], activations: Sequence[Expr]
) -> Expr:
    """The force of an actuator before its gear, inside its limits: MuJoCo's ``actuator_force``.

    Parameters
    ----------
    controls, activations
        Of the whole model.
    """
    if not actuator.enabled:
        return ZERO
    given = activations[actuator.activations[-1]] if actuator.activations else controls[actuator.controls[0]]
    if line.period and _is_servo(actuator):
        given = _nearest(given, line)
    gain = _affine(actuator.gain, actuator.gain_parameters, line)
    return add(mul(gain, given), _affine(actuator.bias, actuator.bias_parameters, line))


def activation_rates(
    actuator: Actuator, controls: Sequence[Expr], activations: Sequence[Expr]
) -> dict[int, Expr]:
    """The time derivatives of an actuator's states, by their addresses; an empty one where it has none.

    Raises:
        ValueError: the dynamics cannot be stated.
    """
    if not actuator.enabled:  # what its states do does not matter
        return dict.fromkeys(actuator.activations, ZERO)
    if not actuator.activations:
        return {}
    state, control = actuator.activations[-1], controls[actuator.controls[0]]
    if actuator.dynamics == "integrator":
        return {state: control}
    if actuator.dynamics in ("filter", "filterexact"):
        constant = max(_SHORTEST, actuator.dynamics_parameters[0])
        return {state: div(sub(control, activations[state]), num(constant))}
    raise ValueError(f"actuator {actuator.name} has dynamics {actuator.dynamics}")


def _affine(kind: str, parameters: Sequence[float], line: Transmission) -> Expr:
    """A gain or a bias.

    Raises:
        ValueError: it cannot be stated.
    """
    if kind == "none":
        return ZERO
    if kind == "fixed":
        return num(parameters[0])
    if kind == "affine":
        of_length = mul(num(parameters[1]), line.length)
        return add(add(num(parameters[0]), of_length), mul(num(parameters[2]), line.rate))
    raise ValueError(f"an actuator with {kind}")


def _is_servo(actuator: Actuator) -> bool:
    """Whether MuJoCo takes an actuator for one whose input is an angle."""
    return (
        actuator.gain == "fixed"
        and actuator.bias == "affine"
        and actuator.gain_parameters[0] == -actuator.bias_parameters[1]
        and actuator.dynamics in ("none", "integrator")
    )


def _nearest(given: Expr, line: Transmission) -> Expr:
    """Of the angles that are the same as a given one, the nearest to the present one."""
    share = num(3.141592653589793 / line.period)
    off = call("atan", call("tan", mul(share, sub(given, line.length))))
    return add(line.length, div(off, share))
