"""CasADi + fatrop.  fatrop wants x+ = F(x, u), which the trapezoidal rule becomes by a change of state.

With s = v - (h/2) a and p = q - (h^2/4) a the trapezoidal rule reads

    p+ = p + h s + h^2 a,      s+ = s + h a

so states (p, s), controls a (and forces) give exactly the trapezoidal program, the equations of motion being path
equalities in q = p + (h^2/4) a and v = s + (h/2) a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from bench.peers import problems
from bench.peers.casadi_ipopt import solved
from bench.peers.casadi_options import fatrop_options
from bench.peers.task import Case, Task


@dataclass(frozen=True)
class Motion:
    """A problem of q'' and forces u.

    Attributes:
        size: of q.
        forces: of u.
        seconds: the horizon.
        law: residuals of (q, v, a, u); None where accelerations are free.
        cost: of (a, u), summed over the nodes with trapezoidal weights.
        end: q at the last frame; it starts from 0, at rest at both.
        points: (frame, q) on the way.
        force_limit: on each force.
        limits: (row of q, its bound) on all frames.
        guess: q to begin with, (size, n + 1); None for a straight line to the end.
    """

    size: int
    forces: int
    seconds: float
    law: Any
    cost: Any
    end: Sequence[float]
    points: Sequence[tuple[int, Sequence[float]]] = ()
    force_limit: float = np.inf
    limits: tuple[int, float] | None = None
    guess: np.ndarray | None = None


def build(case: Case, variant: str) -> Task:
    motion = {"P1": _point, "P2": _cart_pole, "P3": _chain, "P3s": _chain, "P4": _chain}[case.problem](case)
    program, arguments, structure = _staged(motion, case.n)
    solver = ca.nlpsol("solver", "fatrop", program, fatrop_options(case, variant, **structure))
    return Task(lambda: solved(solver, arguments))


def _point(case: Case) -> Motion:
    (_, *_), (share, *middle), (_, *end) = problems.WAYPOINTS
    return Motion(
        2,
        0,
        problems.POINT_TIME,
        None,
        lambda a, u: ca.sum1(a**2),
        end,
        points=[(round(share * case.n), middle)],
        guess=np.zeros((2, case.n + 1)),
    )


def _cart_pole(case: Case) -> Motion:
    q, v, a, u = ca.SX.sym("q", 2), ca.SX.sym("v", 2), ca.SX.sym("a", 2), ca.SX.sym("u")
    # Multiplied through by the mass matrix: polynomial, with much smaller derivatives than the explicit form.
    s, c = ca.sin(q[1]), ca.cos(q[1])
    m, l, g = problems.POLE, problems.LENGTH, problems.GRAVITY
    law = ca.vertcat(
        (problems.CART + m) * a[0] + m * l * c * a[1] - m * l * s * v[1] ** 2 - u, c * a[0] + l * a[1] + g * s
    )
    return Motion(
        2,
        1,
        problems.SWING_TIME,
        ca.Function("law", [q, v, a, u], [law]),
        lambda a, u: ca.sum1(u**2),
        (problems.DISTANCE, np.pi),
        force_limit=problems.FORCE,
        limits=(0, problems.TRACK),
    )


def _chain(case: Case) -> Motion:
    q, v, a, u = (ca.SX.sym(name, case.rods) for name in ("q", "v", "a", "u"))
    needed = problems.chain_torques(ca.vertsplit(q), ca.vertsplit(v), ca.vertsplit(a), ca.sin, ca.cos)
    return Motion(
        case.rods,
        case.rods,
        problems.CHAIN_TIME,
        ca.Function("law", [q, v, a, u], [ca.vertcat(*needed) - u]),
        lambda a, u: ca.sum1(u**2),
        [problems.UPRIGHT] * case.rods,
        guess=problems.chain_guess(case.problem, case.rods, case.n),
    )


def _staged(motion: Motion, n: int) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """The program in fatrop's order: per stage its gap to the next one, then its own rows."""
    h, size = motion.seconds / n, motion.size
    controls = size + motion.forces
    y = ca.SX.sym("y", 2 * size + controls)
    p, s, a, u = y[:size], y[size : 2 * size], y[2 * size : 3 * size], y[3 * size :]
    q, v = p + h * h / 4 * a, s + h / 2 * a
    rows = motion.law(q, v, a, u) if motion.law is not None else ca.SX(0, 1)
    law = ca.Function("stage", [y], [rows])
    place = ca.Function("place", [y], [q, v])
    w = ca.MX.sym("w", y.shape[0], n + 1)
    laws = law.map(n + 1)(w) if motion.law is not None else ca.MX(0, n + 1)
    places, speeds = place.map(n + 1)(w)
    p, s, a, u = w[:size, :], w[size : 2 * size, :], w[2 * size : 3 * size, :], w[3 * size :, :]
    gaps = ca.vertcat(
        p[:, 1:] - p[:, :-1] - h * s[:, :-1] - h * h * a[:, :-1], s[:, 1:] - s[:, :-1] - h * a[:, :-1]
    )
    count = int(laws.shape[0])
    at = dict(motion.points)
    parts: list[Any] = []
    lower: list[np.ndarray] = []
    upper: list[np.ndarray] = []
    own: list[int] = []

    def put(expression: Any, low: Any, high: Any) -> None:
        parts.append(expression)
        lower.append(np.atleast_1d(np.asarray(low, float)))
        upper.append(np.atleast_1d(np.asarray(high, float)))

    limited = motion.limits
    zero, nothing = np.zeros(2 * size), np.zeros(count)
    # Runs of stages without rows of their own kind go in as one block: a thousand slices are slow to build.
    special = sorted({0, n, *at})
    for first, last in zip(special, [*special[1:], n + 1]):
        if first < n:
            put(gaps[:, first], zero, zero)
        put(laws[:, first], nothing, nothing)
        extra = count
        if first in (0, n):
            target = np.zeros(size) if first == 0 else np.asarray(motion.end, float)
            put(
                ca.vertcat(places[:, first], speeds[:, first]),
                np.r_[target, 0 * target],
                np.r_[target, 0 * target],
            )
            extra += 2 * size
        else:
            put(places[:, first], at[first], at[first])
            extra += size
            if limited is not None:
                put(places[limited[0], first], -limited[1], limited[1])
                extra += 1
        own.append(extra)
        inner = last - first - 1
        if inner > 0:
            block = [gaps[:, first + 1 : last], laws[:, first + 1 : last]]
            low, high = np.zeros((2 * size + count, inner)), np.zeros((2 * size + count, inner))
            if limited is not None:
                block.append(places[limited[0], first + 1 : last])
                low, high = (
                    np.vstack([low, np.full(inner, -limited[1])]),
                    np.vstack([high, np.full(inner, limited[1])]),
                )
            put(ca.vec(ca.vertcat(*block)), low.ravel("F"), high.ravel("F"))
            own += [count + (limited is not None)] * inner
    lbg, ubg = np.concatenate(lower), np.concatenate(upper)
    low, high = np.full((y.shape[0], n + 1), -np.inf), np.full((y.shape[0], n + 1), np.inf)
    low[3 * size :], high[3 * size :] = -motion.force_limit, motion.force_limit
    guess = np.zeros((y.shape[0], n + 1))
    straight = np.outer(motion.end, np.linspace(0.0, 1.0, n + 1))
    guess[:size] = straight if motion.guess is None else motion.guess
    trapezoid = ca.DM(problems.weights(n, h)).T
    program = {"x": ca.vec(w), "f": ca.dot(motion.cost(a, u), trapezoid), "g": ca.vertcat(*parts)}
    arguments = {
        "x0": guess.ravel("F"),
        "lbx": low.ravel("F"),
        "ubx": high.ravel("F"),
        "lbg": lbg,
        "ubg": ubg,
    }
    structure = {
        "equality": [bool(e) for e in lbg == ubg],
        "structure_detection": "manual",
        "N": n,
        "nx": [2 * size] * (n + 1),
        "nu": [controls] * (n + 1),
        "ng": own,
    }
    return program, arguments, structure
