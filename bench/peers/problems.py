"""Numbers, equations and texts of the problems; nothing of any tool.

P1  a point through three waypoints, least acceleration: a quadratic problem
P2  cart-pole swing-up of [Kelly2017], bounds on cart and force
P3  a chain of five rods, hanging to upright in half a second, least torque: absolute angles, inverse dynamics
P3s the same from a guess that swings: P3 has dozens of optima, and from its own guess, a straight line, tools end at
    different ones; from this one, with 50 and 200 intervals, most end at the same
P4  the same of 2, 10 and 20 rods
P5  a lamp on a flat foot jumps: six coordinates, phases of fixed length, a plastic landing; inverse dynamics
P6  the lamp's jump of the bundled specs, ``luxo_jump``
P7  the hop of a quadruped from its model file, in space, of the bundled specs: ``quadruped_hop``
P8  the jump of a humanoid, likewise: ``humanoid_jump``

All use the trapezoidal rule (P6 to P8: Hermite-Simpson) with n intervals: q and q' are continuous and linear in
between averages of q' and q''.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

SPECS = Path(__file__).resolve().parent / "specs"

#: The problems that are bundled specs.
BUNDLED = {"P6": "luxo_jump", "P7": "quadruped_hop", "P8": "humanoid_jump"}

Function = Callable[[Any], Any]

# P1
POINT_TIME = 2.0
#: Share of the horizon, x, y.
WAYPOINTS = ((0.0, 0.0, 0.0), (0.5, 1.0, 1.0), (1.0, 2.0, 0.0))

# P2
CART, POLE, LENGTH, GRAVITY = 1.0, 0.3, 0.5, 9.81
SWING_TIME, DISTANCE, TRACK, FORCE = 2.0, 1.0, 2.0, 20.0

# P3 and P4
ROD_MASS, ROD_LENGTH, CHAIN_TIME = 0.5, 0.5, 0.5
UPRIGHT = math.pi
#: Of P3s: what is added to the straight line of each angle, a sum of sines of one, two and three half waves.
SWING = (
    (0.2, -0.8, 0.2),
    (-2.5, -0.3, 0.4),
    (2.3, -0.2, -0.2),
    (-0.5, -1.1, -0.4),
    (1.4, 0.0, -0.1),
)

# P5: base, lower arm, upper arm, head; from the sole up
LAMP_MASS = (1.0, 0.25, 0.25, 0.6)
LAMP_INERTIA = (0.0034083333333333344, 0.0016422756891745437, 0.0016422756891745437, 0.0016516092001062825)
#: From a joint to the centre of mass of the body above it, and to the next joint.
LAMP_CENTRE = (0.015, 0.14, 0.14, 0.07155771905424202)
LAMP_LENGTH = (0.03, 0.28, 0.28, 0.0)
LAMP_POSE = (-0.7339498748935395, 1.5, 1.0)
LAMP_RANGES = ((-1.6, 1.6), (0.15, 2.6), (-0.5, 2.4))
#: Lengths of push, flight and landing, and their shares of the intervals.
JUMP_TIMES, JUMP_SHARES = (0.35, 0.30, 0.45), (5, 4, 6)
JUMP_DISTANCE, FOOT, REACH, FRICTION = 0.4, 0.1, 0.08, 0.6
LAMP_TORQUE, LAMP_RATE, PITCH = 15.0, 20.0, 1.0
#: Weights of accelerations of joints and of changes of torques.
WHIP, TURNS = 1e-5, 1e-4


def weights(n: int, h: float) -> np.ndarray:
    """Of the trapezoidal sum over n + 1 nodes."""
    w = np.full(n + 1, h)
    w[0] = w[-1] = h / 2
    return w


def cart_pole_accelerations(
    angle: Any, rate: Any, force: Any, sin: Function, cos: Function
) -> tuple[Any, Any]:
    """Of cart and pole; the pole hangs at angle 0."""
    s, c = sin(angle), cos(angle)
    inertia = CART + POLE * (1.0 - c * c)
    swing = LENGTH * POLE * s * rate * rate
    cart = (swing + force + POLE * GRAVITY * c * s) / inertia
    pole = -(swing * c + force * c + (CART + POLE) * GRAVITY * s) / (LENGTH * inertia)
    return cart, pole


def chain_torques(
    q: Sequence[Any], v: Sequence[Any], a: Sequence[Any], sin: Function, cos: Function
) -> list[Any]:
    """Torques at the joints of a chain of rods, by Newton and Euler from the pivot out and back: O(rods).

    Angles are absolute, from hanging; the acceleration of gravity enters as that of the pivot.
    """
    inertia = ROD_MASS * ROD_LENGTH**2 / 12.0
    outer: list[tuple[Any, Any, Any, Any]] = []
    x, y = 0.0, GRAVITY
    for angle, rate, acceleration in zip(q, v, a):
        s, c = sin(angle), cos(angle)
        along = ROD_LENGTH * (c * acceleration - s * rate * rate)
        up = ROD_LENGTH * (s * acceleration + c * rate * rate)
        outer.append((s, c, ROD_MASS * (x + along / 2.0), ROD_MASS * (y + up / 2.0)))
        x, y = x + along, y + up
    torques = []
    force_x = force_y = torque = 0.0
    for (s, c, own_x, own_y), acceleration in zip(reversed(outer), reversed(a)):
        torque = (
            torque
            + ROD_LENGTH * (c * force_x + s * force_y)
            + inertia * acceleration
            + ROD_LENGTH / 2.0 * (c * own_x + s * own_y)
        )
        force_x, force_y = force_x + own_x, force_y + own_y
        torques.append(torque)
    return torques[::-1]


def lamp_forces(
    q: Sequence[Any], v: Sequence[Any], a: Sequence[Any], sin: Function, cos: Function
) -> list[Any]:
    """Generalised forces on x, z, pitch and the three joints of the lamp, (6,), by Newton and Euler: O(bodies).

    Joint angles are relative, from upright, forward positive.
    """
    angle, rate, turning = q[2], v[2], a[2]
    ax, az = a[0], a[1] + GRAVITY
    bodies: list[tuple[Any, Any, Any, Any, Any]] = []
    for k in range(4):
        if k:
            angle, rate, turning = angle + q[2 + k], rate + v[2 + k], turning + a[2 + k]
        s, c = sin(angle), cos(angle)
        along, down = c * turning - s * rate * rate, s * turning + c * rate * rate
        centre = LAMP_CENTRE[k]
        force_x = LAMP_MASS[k] * (ax + centre * along)
        force_z = LAMP_MASS[k] * (az - centre * down)
        bodies.append((s, c, force_x, force_z, LAMP_INERTIA[k] * turning))
        ax, az = ax + LAMP_LENGTH[k] * along, az - LAMP_LENGTH[k] * down
    sum_x = sum_z = torque = 0.0
    torques = []
    for k in reversed(range(4)):
        s, c, force_x, force_z, spin = bodies[k]
        lever, centre = LAMP_LENGTH[k], LAMP_CENTRE[k]
        torque = torque + spin + lever * (c * sum_x - s * sum_z) + centre * (c * force_x - s * force_z)
        sum_x, sum_z = sum_x + force_x, sum_z + force_z
        torques.append(torque)
    return [sum_x, sum_z, *torques[::-1]]


def chain_guess(problem: str, rods: int, n: int) -> np.ndarray:
    """Angles to begin with, (rods, n + 1)."""
    s = np.linspace(0.0, 1.0, n + 1)
    angles = np.tile(UPRIGHT * s, (rods, 1))
    if problem == "P3s":
        waves = np.sin(math.pi * np.outer(np.arange(1, len(SWING[0]) + 1), s))
        angles += np.array(SWING) @ waves
    return angles


def chain_spec(rods: int, swing: Sequence[Sequence[float]] = ()) -> str:
    """P3 or P4 in this project's language, stated as :func:`chain_torques` does it; for ``swing`` see SWING."""
    every = range(1, rods + 1)

    def each(text: str, separator: str = " ") -> str:
        return separator.join(text.replace("#", str(k)) for k in every)

    lines = [
        f"# chain of {rods} rods, hanging to upright, least torque squared",
        "constants: n = 50, T = 0.5, h = T/n, m = 0.5, l = 0.5, g = 9.81, I = m*l^2/12;",
        f"variables: {each('q#', ', ')}, {each('tau#', ', ')};",
        "method: trapezoidal;",
        "definitions:",
    ]
    for k in every:
        ax, ay = (f"Ax{k - 1}", f"Ay{k - 1}") if k > 1 else ("0", "g")
        lines += [
            f"  bx{k} = l*(cos(q{k})*q{k}'' - sin(q{k})*q{k}'^2);  by{k} = l*(sin(q{k})*q{k}'' + cos(q{k})*q{k}'^2);",
            f"  Fx{k} = m*({ax} + bx{k}/2);  Fy{k} = m*({ay} + by{k}/2);  "
            f"Ax{k} = {ax} + bx{k};  Ay{k} = {ay} + by{k};",
        ]
    for k in reversed(every):
        own = f"I*q{k}'' + l/2*(cos(q{k})*Fx{k} + sin(q{k})*Fy{k})"
        if k == rods:
            lines.append(f"  M{k} = {own};  Gx{k} = Fx{k};  Gy{k} = Fy{k};")
            continue
        above = f"M{k + 1} + l*(cos(q{k})*Gx{k + 1} + sin(q{k})*Gy{k + 1})"
        lines.append(f"  M{k} = {above} + {own};  Gx{k} = Fx{k} + Gx{k + 1};  Gy{k} = Fy{k} + Gy{k + 1};")
    guesses = []
    for k in every:
        waves = swing[k - 1] if swing else ()
        terms = [f" + {wave}*sin({j}*pi*t/T)" for j, wave in enumerate(waves, 1)]
        guesses.append(f"q{k} = pi*t/T{''.join(terms)};")
    at_rest, at_end = each("q#; q#';"), each("q# = pi; q#';")
    lines += [
        f"guess: {' '.join(guesses)}",
        "constraints:",
        f"  [0, n]: {each('M# = tau#;')}",
        f"  [0]: {at_rest}",
        f"  [n]: {at_end}",
        f"objective: [0, n]: integral({each('tau#^2', ' + ')});",
    ]
    return "\n".join(lines) + "\n"


def constants_of(problem: str, n: int) -> dict[str, int]:
    """Those that give the text so many intervals (P5: a multiple of 15; P6: of 60; P7 and P8 have their own number)."""
    if problem in ("P7", "P8"):
        return {}
    return {"k": n // 60} if problem == "P6" else {"n": n}


def spec_of(problem: str, rods: int) -> str:
    """The text, or the bundled name, of a problem in this project's language."""
    if problem in ("P3", "P3s", "P4"):
        return chain_spec(rods, SWING if problem == "P3s" else ())
    if problem in BUNDLED:
        return BUNDLED[problem]
    return (SPECS / f"{problem.lower()}.stc").read_text(encoding="utf-8")
