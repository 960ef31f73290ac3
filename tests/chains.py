"""Chains of rods in a plane, written in several ways, and Newton and Euler's equations for them."""

from __future__ import annotations

import numpy as np

from stc.trajectory import FloatArray

MASS, LENGTH, INERTIA, GRAVITY = 0.5, 0.4, 0.012, 9.81

WAYS = ("points", "in place", "velocities", "definitions")
"""Positions as definitions that are primed; written out in parentheses that are primed; velocities written out;
positions, velocities and energies as definitions."""


def chain(rods: int, relative: bool, way: str = "points") -> str:
    """A chain hanging from a pivot with a torque on every coordinate.

    ``relative``: each angle is measured from the rod before instead of from the vertical.
    """
    every = range(1, rods + 1)
    angle = {k: "+".join(f"q{i}" for i in range(1, k + 1)) if relative else f"q{k}" for k in every}
    rate = {k: angle[k].replace("+", "'+") + "'" for k in every}
    coordinates, torques = (", ".join(f"{name}{k}" for k in every) for name in "qu")
    lines = [
        f"constants: n = 4, m = {MASS}, l = {LENGTH}, I = {INERTIA}, g = {GRAVITY};",
        f"variables: {coordinates}, {torques};",
        "method: trapezoidal;",
        "definitions: h = 0.1;",
    ]
    energies = []
    for k in every:
        if way in ("points", "definitions"):
            x, z, p = (f"X{k - 1} +", f"Z{k - 1}", f"p{k - 1} +") if k > 1 else ("", "", "")
            lines.append(
                f"p{k} = {p if relative else ''} q{k}; x{k} = {x} l/2*sin(p{k}); z{k} = {z} - l/2*cos(p{k});"
            )
            lines.append(f"X{k} = {x} l*sin(p{k}); Z{k} = {z} - l*cos(p{k});")
            position, velocity = (f"x{k}", f"z{k}", f"p{k}"), (f"x{k}'", f"z{k}'", f"p{k}'")
        else:
            arms = [(i, "l" if i < k else "l/2") for i in range(1, k + 1)]
            x, z = (
                " ".join(f"{sign} {arm}*{function}({angle[i]})" for i, arm in arms)
                for sign, function in (("+", "sin"), ("-", "cos"))
            )
            position = x.removeprefix("+"), z, angle[k]
            if way == "in place":
                velocity = f"({position[0]})'", f"({z})'", f"({angle[k]})'"
            else:
                x, z = (
                    " + ".join(f"{arm}*{function}({angle[i]})*({rate[i]})" for i, arm in arms)
                    for function in ("cos", "sin")
                )
                velocity = f"({x})", f"({z})", f"({rate[k]})"
        if way == "definitions":
            lines.append(f"vx{k} = {velocity[0]}; vz{k} = {velocity[1]}; w{k} = {velocity[2]};")
            lines.append(f"E{k} = m/2*(vx{k}^2 + vz{k}^2) + I/2*w{k}^2;")
            energies.append(f"E{k} - m*g*z{k}")
        else:
            x, z, w = velocity
            energies.append(f"m/2*({x}^2 + {z}^2) + I/2*{w}^2 - m*g*({position[1]})")
    lines.append("lagrangian:")
    lines += [f"  {energy};" for energy in energies]
    lines.append("forces: " + " ".join(f"q{k}: u{k};" for k in every))
    lines.append("objective: [0, n]: integral(" + " + ".join(f"u{k}^2" for k in every) + ");")
    return "\n".join(lines) + "\n"


def joint_torques(angle: FloatArray, rate: FloatArray, acceleration: FloatArray) -> FloatArray:
    """The couple in every joint for a motion of the rods, from Newton's and Euler's laws. (rods,)

    The arguments (rods,) are angles from the vertical and their derivatives; a couple acts from rod k-1 on rod k.
    """
    outwards = np.array([np.sin(angle), -np.cos(angle)])
    across = np.array([np.cos(angle), np.sin(angle)])
    ends = LENGTH * (acceleration * across - rate**2 * outwards)
    centres = np.cumsum(ends, axis=1) - ends / 2
    needed = MASS * (centres + np.array([[0.0], [GRAVITY]]))
    found = np.zeros(len(angle) + 1)
    force = np.zeros(2)
    for k in reversed(range(len(angle))):
        arm = LENGTH / 2 * outwards[:, k]
        further, force = force, force + needed[:, k]
        # the joints' forces, at both ends, turn the rod about its centre
        turning = _moment(-arm, force) - _moment(arm, further)
        found[k] = INERTIA * acceleration[k] - turning + found[k + 1]
    return found[:-1]


def _moment(arm: FloatArray, force: FloatArray) -> float:
    return float(arm[0] * force[1] - arm[1] * force[0])
