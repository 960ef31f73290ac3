"""CasADi + IPOPT: one function per frame, mapped over the frames.

P1 and P2 eliminate what is explicit (P2: the accelerations); the chains keep accelerations and torques as unknowns,
tied by inverse dynamics, which is much sparser than eliminating them, and so does P5, where contact forces are
unknowns, too.  P6 to P8 are the bundled
specs' programs themselves, kernel by kernel (:mod:`bench.casadi_bridge`).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from bench.peers import problems
from bench.peers.casadi_options import ipopt_options
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    makers = {"P1": _point, "P2": _cart_pole, "P5": _jump}
    makers |= dict.fromkeys(("P3", "P3s", "P4"), _chain)
    makers |= dict.fromkeys(problems.BUNDLED, _bundled)
    program, arguments, more = makers[case.problem](case)
    solver = ca.nlpsol("solver", "ipopt", program, ipopt_options(case, variant, **more))
    return Task(lambda: solved(solver, arguments))


def solved(solver: Any, arguments: dict[str, Any]) -> Outcome:
    """Calls a solver of CasADi's."""
    answer = solver(**arguments)
    stats = solver.stats()
    return Outcome(
        float(answer["f"]),
        int(stats["iter_count"]),
        bool(stats["success"]),
        str(stats.get("return_status", "")),
        np.asarray(answer["x"]).ravel(),
    )


def trapezoidal_gaps(value: Any, rate: Any, h: float) -> Any:
    """Defects of rows of nodes: each column less its predecessor, less the mean of their rates."""
    return value[:, 1:] - value[:, :-1] - h / 2 * (rate[:, 1:] + rate[:, :-1])


def _boxes(rows: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full((rows, n + 1), -np.inf), np.full((rows, n + 1), np.inf)


def _arguments(guess: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> dict[str, Any]:
    return {
        "x0": guess.ravel("F"),
        "lbx": lower.ravel("F"),
        "ubx": upper.ravel("F"),
        "lbg": 0.0,
        "ubg": 0.0,
    }


def _point(case: Case) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    n, h = case.n, problems.POINT_TIME / case.n
    w = ca.MX.sym("w", 6, n + 1)
    place, speed, push = w[:2, :], w[2:4, :], w[4:, :]
    gaps = ca.vertcat(trapezoidal_gaps(place, speed, h), trapezoidal_gaps(speed, push, h))
    objective = ca.dot(ca.sum1(push**2), ca.DM(problems.weights(n, h)).T)
    lower, upper = _boxes(6, n)
    for share, *point in problems.WAYPOINTS:
        frame = round(share * n)
        lower[:2, frame] = upper[:2, frame] = point
    for frame in (0, n):
        lower[2:4, frame] = upper[2:4, frame] = 0.0
    guess = np.zeros((6, n + 1))  # what the spec's missing guess means
    program = {"x": ca.vec(w), "f": objective, "g": ca.vec(gaps)}
    # A quadratic problem: IPOPT need not evaluate what never changes.
    return (
        program,
        _arguments(guess, lower, upper),
        {"ipopt.hessian_constant": "yes", "ipopt.jac_c_constant": "yes"},
    )


def _cart_pole(case: Case) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    n, h = case.n, problems.SWING_TIME / case.n
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    rates = [x[2], x[3], *problems.cart_pole_accelerations(x[1], x[3], u, ca.sin, ca.cos)]
    frame = ca.Function("frame", [x, u], [ca.vertcat(*rates)])
    w = ca.MX.sym("w", 5, n + 1)
    states, force = w[:4, :], w[4, :]
    gaps = trapezoidal_gaps(states, frame.map(n + 1)(states, force), h)
    objective = ca.dot(force**2, ca.DM(problems.weights(n, h)).T)
    lower, upper = _boxes(5, n)
    lower[0], upper[0] = -problems.TRACK, problems.TRACK
    lower[4], upper[4] = -problems.FORCE, problems.FORCE
    lower[:4, 0] = upper[:4, 0] = 0.0
    lower[:4, n] = upper[:4, n] = problems.DISTANCE, np.pi, 0.0, 0.0
    guess = np.zeros((5, n + 1))
    guess[0] = np.linspace(0.0, problems.DISTANCE, n + 1)
    guess[1] = np.linspace(0.0, np.pi, n + 1)
    program = {"x": ca.vec(w), "f": objective, "g": ca.vec(gaps)}
    return program, _arguments(guess, lower, upper), {}


def _chain(case: Case) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    n, rods, h = case.n, case.rods, problems.CHAIN_TIME / case.n
    q, v, a, tau = (ca.SX.sym(name, rods) for name in ("q", "v", "a", "tau"))
    parts = (ca.vertsplit(q), ca.vertsplit(v), ca.vertsplit(a))
    needed = problems.chain_torques(*parts, ca.sin, ca.cos)
    frame = ca.Function("frame", [q, v, a, tau], [ca.vertcat(*needed) - tau])
    w = ca.MX.sym("w", 4 * rods, n + 1)
    angles, rates, accelerations, torques = ca.vertsplit(w, rods)
    gaps = ca.vertcat(trapezoidal_gaps(angles, rates, h), trapezoidal_gaps(rates, accelerations, h))
    laws = frame.map(n + 1)(angles, rates, accelerations, torques)
    objective = ca.dot(ca.sum1(torques**2), ca.DM(problems.weights(n, h)).T)
    lower, upper = _boxes(4 * rods, n)
    lower[: 2 * rods, 0] = upper[: 2 * rods, 0] = 0.0
    lower[:rods, n] = upper[:rods, n] = problems.UPRIGHT
    lower[rods : 2 * rods, n] = upper[rods : 2 * rods, n] = 0.0
    guess = np.zeros((4 * rods, n + 1))
    guess[:rods] = problems.chain_guess(case.problem, rods, n)
    # frame by frame, so that the KKT matrix is banded as it comes
    together = ca.vertcat(ca.vec(ca.vertcat(gaps, laws[:, :-1])), laws[:, -1])
    program = {"x": ca.vec(w), "f": objective, "g": together}
    return program, _arguments(guess, lower, upper), {}


def _cone(force: Any) -> list[tuple[Any, float, float]]:
    """Rows, with their bounds, that keep rows fx, fz, my of a force on the sole inside friction and foot."""
    return [
        (sign * force[k, :] - most * force[1, :], -np.inf, 0.0)
        for k, most in ((0, problems.FRICTION), (2, problems.REACH))
        for sign in (1.0, -1.0)
    ]


#: What IPOPT does best with on P5.
_JUMP_OPTIONS = {"ipopt.mu_strategy": "adaptive"}


def _jump(case: Case) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Phase by phase; of each frame x, z, pitch and joints, their rates, accelerations, torques, contact."""
    q, v, a, u, f = (ca.SX.sym(name, size) for name, size in zip("qvauf", (6, 6, 6, 3, 3)))
    inertial = problems.lamp_forces(*(ca.vertsplit(part) for part in (q, v, a)), ca.sin, ca.cos)
    balance = ca.Function("balance", [q, v, a, u, f], [ca.vertcat(*inertial) - ca.vertcat(f, u)])
    # M(q) dv, of a jump of the rates dv
    impulse = ca.Function("impulse", [q, v, a], [ca.vertcat(*inertial)])
    start = np.array([0.0, 0.0, 0.0, *problems.LAMP_POSE])
    weight = sum(problems.LAMP_MASS) * problems.GRAVITY
    holding = impulse(start, np.zeros(6), np.zeros(6)).full().ravel()[3:]
    phases, objective = [], 0.0
    rows: list[tuple[Any, float, float]] = []
    guesses, lowers, uppers = [], [], []
    for phase, (time, share) in enumerate(zip(problems.JUMP_TIMES, problems.JUMP_SHARES)):
        n = case.n * share // sum(problems.JUMP_SHARES)
        h, grounded = time / n, phase != 1
        w = ca.MX.sym(f"w{phase}", 24, n + 1)
        places, rates, accelerations, torques, contact = ca.vertsplit(w, [0, 6, 12, 18, 21, 24])
        lower, upper = _boxes(24, n)
        for joint, (least, most) in enumerate(problems.LAMP_RANGES):
            lower[3 + joint], upper[3 + joint] = least, most
        lower[9:12], upper[9:12] = -problems.LAMP_RATE, problems.LAMP_RATE
        lower[18:21], upper[18:21] = -problems.LAMP_TORQUE, problems.LAMP_TORQUE
        guess = np.zeros((24, n + 1))
        guess[:6], guess[18:21] = start[:, None], holding[:, None]
        share_of_flight = np.linspace(0.0, 1.0, n + 1)
        if grounded:
            guess[22] = weight
            lower[12:15] = upper[12:15] = 0.0
            lower[22] = 0.0
            rows += _cone(contact)
        else:
            guess[0] = problems.JUMP_DISTANCE * share_of_flight
            guess[1] = 0.4 * share_of_flight * (1.0 - share_of_flight)
            guess[6] = problems.JUMP_DISTANCE / time
            guess[7] = 0.4 * (1.0 - 2.0 * share_of_flight) / time
            lower[21:] = upper[21:] = 0.0
            lower[2], upper[2] = -problems.PITCH, problems.PITCH
            lower[:3, n] = upper[:3, n] = problems.JUMP_DISTANCE, 0.0, 0.0
            upper[7, n] = 0.0
            tip = problems.FOOT * ca.sin(places[2, 1:-1])
            rows.append((ca.vertcat(places[1, 1:-1] + tip, places[1, 1:-1] - tip), 0.0, np.inf))
        if phase == 0:
            lower[:6, 0] = upper[:6, 0] = start
            lower[6:12, 0] = upper[6:12, 0] = 0.0
        if phase == 2:
            guess[0] = problems.JUMP_DISTANCE
            lower[6:9, 0] = upper[6:9, 0] = 0.0
            lower[3:6, n] = upper[3:6, n] = start[3:]
            lower[9:12, n] = upper[9:12, n] = 0.0
        gaps = trapezoidal_gaps(places, rates, h), trapezoidal_gaps(rates, accelerations, h)
        rows += [(ca.vertcat(*gaps), 0.0, 0.0)]
        rows += [(balance.map(n + 1)(places, rates, accelerations, torques, contact), 0.0, 0.0)]
        effort = ca.sum1(torques**2) + problems.WHIP * ca.sum1(accelerations[3:, :] ** 2)
        turns = ca.sumsqr(torques[:, 1:] - torques[:, :-1])
        objective += ca.dot(effort, ca.DM(problems.weights(n, h)).T) + problems.TURNS / h * turns
        phases.append(w)
        guesses.append(guess.ravel("F"))
        lowers.append(lower.ravel("F"))
        uppers.append(upper.ravel("F"))
    push, flight, landing = phases
    blow = ca.MX.sym("blow", 3)
    rows.append((flight[:12, 0] - push[:12, -1], 0.0, 0.0))
    rows.append((landing[:6, 0] - flight[:6, -1], 0.0, 0.0))
    touching, change = landing[:6, 0], landing[6:12, 0] - flight[6:12, -1]
    none = np.zeros(6)
    passed = impulse(touching, none, change) - impulse(touching, none, none)
    rows.append((passed - ca.vertcat(blow, np.zeros(3)), 0.0, 0.0))
    rows += _cone(blow)
    arguments = {
        "x0": np.concatenate([*guesses, [0.0, 0.5, 0.0]]),
        "lbx": np.concatenate([*lowers, [-np.inf, 0.0, -np.inf]]),
        "ubx": np.concatenate([*uppers, np.full(3, np.inf)]),
        "lbg": np.concatenate([np.full(row.numel(), least) for row, least, _ in rows]),
        "ubg": np.concatenate([np.full(row.numel(), most) for row, _, most in rows]),
    }
    together = ca.vertcat(*(ca.vec(row) for row, _, _ in rows))
    unknowns = ca.vertcat(*(ca.vec(w) for w in phases), blow)
    return {"x": unknowns, "f": objective, "g": together}, arguments, _JUMP_OPTIONS


def _bundled(case: Case) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    import stc
    from bench import casadi_bridge

    constants = problems.constants_of(case.problem, case.n)
    problem, transcription = stc.load(problems.spec_of(case.problem, 0)).transcription(**constants)
    bound = transcription.bind(problem.constants)
    w, f, g = casadi_bridge.program(bound)
    arguments = {
        "x0": bound.x0,
        "lbx": bound.x_lower,
        "ubx": bound.x_upper,
        "lbg": bound.row_lower,
        "ubg": bound.row_upper,
    }
    return {"x": w, "f": f, "g": g}, arguments, {}
