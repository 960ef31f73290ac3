"""Forces of actuators, gain * input + bias along a transmission, and the dynamics of their states."""

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
    if actuator.gain == "pid":
        return _controller_force(actuator, line, controls, activations)
    if actuator.gain == "dcmotor":
        return _motor_force(actuator, line, controls, activations)
    given = activations[actuator.activations[-1]] if actuator.activations else controls[actuator.controls[0]]
    if line.period and _is_servo(actuator):
        given = _nearest(given, line)
    gain = _affine(actuator.gain, actuator.gain_parameters, line)
    return add(mul(gain, given), _affine(actuator.bias, actuator.bias_parameters, line))


def activation_rates(
    actuator: Actuator, line: Transmission, controls: Sequence[Expr], activations: Sequence[Expr]
) -> dict[int, Expr]:
    """The time derivatives of an actuator's states, by their addresses; an empty one where it has none.

    Raises:
        ValueError: the dynamics cannot be stated.
    """
    if not actuator.enabled:  # what its states do does not matter
        return dict.fromkeys(actuator.activations, ZERO)
    if not actuator.activations:
        return {}
    state = actuator.activations[-1]
    if actuator.dynamics == "pid":
        return {state: sub(_wanted_place(actuator, line, controls), line.length)}
    if actuator.dynamics == "dcmotor":
        return _motor_rates(actuator, line, controls, activations)
    control = controls[actuator.controls[0]]
    if actuator.dynamics == "integrator":
        return {state: control}
    if actuator.dynamics in ("filter", "filterexact"):
        constant = max(_SHORTEST, actuator.dynamics_parameters[0])
        return {state: div(sub(control, activations[state]), num(constant))}
    raise ValueError(f"actuator {actuator.name} has dynamics {actuator.dynamics}")


def _input(actuator: Actuator, name: str, controls: Sequence[Expr]) -> Expr:
    """One of the controls of a controller or an electric motor; 0 if it does not have this control."""
    if name not in actuator.inputs:
        return ZERO
    return controls[actuator.controls[actuator.inputs.index(name)]]


def _wanted_place(actuator: Actuator, line: Transmission, controls: Sequence[Expr]) -> Expr:
    wanted = _input(actuator, "pos", controls)
    return _nearest(wanted, line) if line.period else wanted


def _controller_force(
    actuator: Actuator, line: Transmission, controls: Sequence[Expr], activations: Sequence[Expr]
) -> Expr:
    """kp (desired position - length) + kv (desired rate - rate) + ki (the integral of the first) + a feed-forward
    force.
    """
    _, minus_kp, minus_kv, *_ = actuator.bias_parameters
    force = _affine(actuator.bias, actuator.bias_parameters, line)
    force = sub(force, mul(num(minus_kp), _wanted_place(actuator, line, controls)))
    force = sub(force, mul(num(minus_kv), _input(actuator, "vel", controls)))
    force = add(force, _input(actuator, "ff", controls))
    if actuator.activations:
        force = add(force, mul(num(actuator.gain_parameters[0]), activations[actuator.activations[-1]]))
    return force


#: Where MuJoCo keeps the numbers of electric motors.
_RESISTANCE, _MOTOR_CONSTANT, _KP, _KI, _KD = 0, 1, 4, 5, 6


def _motor_voltage(
    actuator: Actuator, line: Transmission, controls: Sequence[Expr], activations: Sequence[Expr]
) -> Expr:
    """The voltage of the motor's own controller plus the control in volts."""
    numbers = actuator.gain_parameters
    raw = _input(actuator, "voltage", controls)
    if not {"pos", "vel", "ff"} & set(actuator.inputs):
        return raw
    torque = mul(num(numbers[_KP]), sub(_input(actuator, "pos", controls), line.length))
    torque = add(torque, mul(num(numbers[_KD]), sub(_input(actuator, "vel", controls), line.rate)))
    torque = add(torque, _input(actuator, "ff", controls))
    if numbers[_KI] > 0.0:
        torque = add(torque, mul(num(numbers[_KI]), activations[actuator.activations[0]]))
    drive = mul(num(numbers[_RESISTANCE] / numbers[_MOTOR_CONSTANT]), torque)
    return add(add(drive, mul(num(numbers[_MOTOR_CONSTANT]), line.rate)), raw)


def _motor_force(
    actuator: Actuator, line: Transmission, controls: Sequence[Expr], activations: Sequence[Expr]
) -> Expr:
    """The motor constant times the current, and cogging."""
    constant = num(actuator.gain_parameters[_MOTOR_CONSTANT])
    if actuator.dynamics_parameters[0] > 0.0:
        current = activations[actuator.activations[-1]]
    else:
        current = _settled_current(actuator, line, controls, activations)
    size, poles, phase, *_ = actuator.bias_parameters
    cogging = mul(num(size), call("sin", add(mul(num(poles), line.length), num(phase))))
    return add(mul(constant, current), cogging)


def _settled_current(
    actuator: Actuator, line: Transmission, controls: Sequence[Expr], activations: Sequence[Expr]
) -> Expr:
    """The steady current at a voltage, without the back EMF."""
    numbers = actuator.gain_parameters
    induced = mul(num(numbers[_MOTOR_CONSTANT]), line.rate)
    driving = sub(_motor_voltage(actuator, line, controls, activations), induced)
    return div(driving, num(max(_SHORTEST, numbers[_RESISTANCE])))


def _motor_rates(
    actuator: Actuator, line: Transmission, controls: Sequence[Expr], activations: Sequence[Expr]
) -> dict[int, Expr]:
    """The rates of the integral of the position error, if there is one, and of the current, if it has dynamics."""
    rates: dict[int, Expr] = {}
    if actuator.gain_parameters[_KI] > 0.0:
        rates[actuator.activations[0]] = sub(_input(actuator, "pos", controls), line.length)
    constant = actuator.dynamics_parameters[0]
    if constant > 0.0:
        state = actuator.activations[-1]
        settled = _settled_current(actuator, line, controls, activations)
        rates[state] = div(sub(settled, activations[state]), num(constant))
    return rates


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
    """Whether MuJoCo treats the input of an actuator as an angle."""
    return (
        actuator.gain == "fixed"
        and actuator.bias == "affine"
        and actuator.gain_parameters[0] == -actuator.bias_parameters[1]
        and actuator.dynamics in ("none", "integrator")
    )


def _nearest(given: Expr, line: Transmission) -> Expr:
    """The angle nearest to the present one among those that differ from a given one by whole turns."""
    share = num(3.141592653589793 / line.period)
    off = call("atan", call("tan", mul(share, sub(given, line.length))))
    return add(line.length, div(off, share))
