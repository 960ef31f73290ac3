"""CasADi + IPOPT: one function per frame, mapped over the frames.

P1 and P2 eliminate what is explicit (P2: the accelerations); the chains keep accelerations and torques as unknowns,
tied by inverse dynamics, which is much sparser than eliminating them.  P5 is the lamp's program itself, kernel by
kernel (:mod:`bench.casadi_bridge`).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from bench.peers import problems
from bench.peers.casadi_options import ipopt_options
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    makers = {"P1": _point, "P2": _cart_pole, "P3": _chain, "P4": _chain, "P5": _jump}
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


def weights(n: int, h: float) -> np.ndarray:
    """Of the trapezoidal sum over n + 1 nodes."""
    w = np.full(n + 1, h)
    w[0] = w[-1] = h / 2
    return w


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
    objective = ca.dot(ca.sum1(push**2), ca.DM(weights(n, h)).T)
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
    objective = ca.dot(force**2, ca.DM(weights(n, h)).T)
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
    objective = ca.dot(ca.sum1(torques**2), ca.DM(weights(n, h)).T)
    lower, upper = _boxes(4 * rods, n)
    lower[: 2 * rods, 0] = upper[: 2 * rods, 0] = 0.0
    lower[:rods, n] = upper[:rods, n] = problems.UPRIGHT
    lower[rods : 2 * rods, n] = upper[rods : 2 * rods, n] = 0.0
    guess = np.zeros((4 * rods, n + 1))
    guess[:rods] = np.linspace(0.0, problems.UPRIGHT, n + 1)
    # frame by frame, so that the KKT matrix is banded as it comes
    together = ca.vertcat(ca.vec(ca.vertcat(gaps, laws[:, :-1])), laws[:, -1])
    program = {"x": ca.vec(w), "f": objective, "g": together}
    return program, _arguments(guess, lower, upper), {}


def _jump(case: Case) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    import stc
    from bench import casadi_bridge

    problem, transcription = stc.load(problems.spec_of("P5", 0)).transcription(k=case.n // 60)
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
