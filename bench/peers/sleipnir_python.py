"""Sleipnir through its Python package: the same trapezoidal programs."""

from __future__ import annotations

from typing import Any

import numpy as np
from sleipnir.autodiff import cos, sin
from sleipnir.optimization import ExitStatus, Problem, bounds

from bench.peers import problems
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    return {"P1": _point, "P2": _cart_pole}.get(case.problem, _chain)(case)


def _joined(value: Any, rate: Any, n: int, h: float) -> Any:
    """The trapezoidal rule between all nodes."""
    return value[:, 1:] == value[:, :n] + h / 2 * (rate[:, 1:] + rate[:, :n])


def _solving(problem: Any, starts: list[tuple[Any, np.ndarray]], case: Case, effort: Any, h: float) -> Task:
    """Solves for the least integral of the squares of ``effort`` (rows, n + 1)."""
    rows, nodes = effort.shape
    trapezoid = problems.weights(case.n, h)
    objective: Any = 0.0
    for k in range(nodes):
        for row in range(rows):
            objective = objective + trapezoid[k] * (effort[row, k] * effort[row, k])
    problem.minimize(objective)
    count = 0

    def counted(info: Any) -> bool:
        nonlocal count
        count += 1
        return False

    problem.add_callback(counted)

    def solve() -> Outcome:
        nonlocal count
        count = 0
        for unknown, start in starts:
            unknown.set_value(start)
        status = problem.solve(timeout=case.time_limit, max_iterations=case.max_iterations)
        x = np.concatenate([np.asarray(unknown.value()).ravel() for unknown, _ in starts])
        cost = float((effort.value() ** 2 * trapezoid).sum())
        return Outcome(cost, count, status == ExitStatus.SUCCESS, str(status), x)

    return Task(solve)


def _point(case: Case) -> Task:
    n, h = case.n, problems.POINT_TIME / case.n
    problem = Problem()
    place, speed, push = (problem.decision_variable(2, n + 1) for _ in range(3))
    for share, *point in problems.WAYPOINTS:
        frame = round(share * n)
        problem.subject_to(place[:, frame : frame + 1] == np.array([point]).T)
    for frame in (0, n):
        problem.subject_to(speed[:, frame : frame + 1] == np.zeros((2, 1)))
    problem.subject_to(_joined(place, speed, n, h))
    problem.subject_to(_joined(speed, push, n, h))
    starts = [(unknown, np.zeros((2, n + 1))) for unknown in (place, speed, push)]
    return _solving(problem, starts, case, push, h)


def _cart_pole(case: Case) -> Task:
    n, h = case.n, problems.SWING_TIME / case.n
    problem = Problem()
    states, force = problem.decision_variable(4, n + 1), problem.decision_variable(1, n + 1)
    start = np.zeros((4, n + 1))
    start[0] = np.linspace(0.0, problems.DISTANCE, n + 1)
    start[1] = np.linspace(0.0, np.pi, n + 1)
    end = np.array([[problems.DISTANCE], [np.pi], [0.0], [0.0]])
    problem.subject_to(states[:, :1] == np.zeros((4, 1)))
    problem.subject_to(states[:, n : n + 1] == end)
    problem.subject_to(bounds(-problems.TRACK, states[:1, 1:n], problems.TRACK))
    problem.subject_to(bounds(-problems.FORCE, force, problems.FORCE))
    rates = [
        (
            states[2, k],
            states[3, k],
            *problems.cart_pole_accelerations(states[1, k], states[3, k], force[0, k], sin, cos),
        )
        for k in range(n + 1)
    ]
    for k in range(n):
        for row in range(4):
            mean = h / 2 * (rates[k][row] + rates[k + 1][row])
            problem.subject_to(states[row, k + 1] == states[row, k] + mean)
    starts = [(states, start), (force, np.zeros((1, n + 1)))]
    return _solving(problem, starts, case, force, h)


def _chain(case: Case) -> Task:
    n, rods, h = case.n, case.rods, problems.CHAIN_TIME / case.n
    problem = Problem()
    q, v, a, tau = (problem.decision_variable(rods, n + 1) for _ in range(4))
    zero, upright = np.zeros((rods, 1)), np.full((rods, 1), problems.UPRIGHT)
    for value, frame, target in ((q, 0, zero), (v, 0, zero), (q, n, upright), (v, n, zero)):
        problem.subject_to(value[:, frame : frame + 1] == target)
    problem.subject_to(_joined(q, v, n, h))
    problem.subject_to(_joined(v, a, n, h))
    for k in range(n + 1):
        column = [[unknown[i, k] for i in range(rods)] for unknown in (q, v, a)]
        for i, torque in enumerate(problems.chain_torques(*column, sin, cos)):
            problem.subject_to(tau[i, k] == torque)
    nothing = np.zeros((rods, n + 1))
    angles = problems.chain_guess(case.problem, rods, n)
    starts = [(q, angles), (v, nothing), (a, nothing), (tau, nothing)]
    return _solving(problem, starts, case, tau, h)
