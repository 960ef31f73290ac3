"""Crocoddyl with Pinocchio's models: shooting, so an explicit integrator and the end as a penalty.

What differs from the other tools' program is in the note of the table.  The cart's force and the chain's torques
are held over an interval.
"""

from __future__ import annotations

from typing import Any

import crocoddyl
import numpy as np
import pinocchio as pin

from bench.peers import problems
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    return _cart_pole(case) if case.problem == "P2" else _chain(case)


def _hanging(
    model: Any, parent: int, joint: Any, place: Any, name: str, mass: float, centre: float, inertia: float
) -> int:
    index = model.addJoint(parent, joint, place, name)
    body = pin.Inertia(mass, np.array([0.0, 0.0, -centre]), np.diag([1e-12, inertia, 1e-12]))
    model.appendBodyToJoint(index, body, pin.SE3.Identity())
    return int(index)


def _running(state: Any, size: int, weight: float = 2.0) -> Any:
    costs = crocoddyl.CostModelSum(state, size)
    effort = crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelControl(state, size))
    costs.addCost("effort", effort, weight)
    return costs


def _ending(state: Any, size: int, target: np.ndarray, weight: float) -> Any:
    costs = crocoddyl.CostModelSum(state, size)
    residual = crocoddyl.ResidualModelState(state, target, size)
    costs.addCost("end", crocoddyl.CostModelResidual(state, residual), weight)
    return costs


def _cart_pole(case: Case) -> Task:
    h = problems.SWING_TIME / case.n
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -problems.GRAVITY])
    cart = _hanging(model, 0, pin.JointModelPX(), pin.SE3.Identity(), "cart", problems.CART, 0.0, 1e-12)
    # About +y an angle swings the pole towards -x: the target's sign is turned.
    _hanging(
        model, cart, pin.JointModelRY(), pin.SE3.Identity(), "pole", problems.POLE, problems.LENGTH, 1e-12
    )
    state = crocoddyl.StateMultibody(model)
    actuation = crocoddyl.ActuationModelFull(state)
    target = np.array([problems.DISTANCE, -np.pi, 0.0, 0.0])
    limit = np.array([problems.FORCE, 0.0])  # the pole's own joint is not driven
    running = _running(state, 2)
    wide = np.array([problems.TRACK, 1e9, 1e9, 1e9])
    barrier = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(-wide, wide))
    track = crocoddyl.ResidualModelState(state, np.zeros(4), 2)
    running.addCost("track", crocoddyl.CostModelResidual(state, barrier, track), 1e3)
    models = []
    for costs, step in ((running, h), (_ending(state, 2, target, 1e5), 0.0)):
        dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        action = crocoddyl.IntegratedActionModelRK(dynamics, crocoddyl.RKType.four, step)
        action.u_lb, action.u_ub = -limit, limit
        models.append(action)
    problem = crocoddyl.ShootingProblem(np.zeros(4), [models[0]] * case.n, models[1])
    states = list(np.outer(np.linspace(0.0, 1.0, case.n + 1), target))
    controls = [np.zeros(2)] * case.n
    note = "Runge-Kutta, force held over an interval, end by a penalty of 1e5, track by a barrier"
    return _solving(crocoddyl.SolverBoxFDDP, problem, states, controls, target, h, 1e-9, note, case)


def _chain(case: Case) -> Task:
    h, rods = problems.CHAIN_TIME / case.n, case.rods
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -problems.GRAVITY])
    link, place = 0, pin.SE3.Identity()
    inertia = problems.ROD_MASS * problems.ROD_LENGTH**2 / 12.0
    for k in range(rods):
        link = _hanging(
            model,
            link,
            pin.JointModelRY(),
            place,
            f"joint{k}",
            problems.ROD_MASS,
            problems.ROD_LENGTH / 2.0,
            inertia,
        )
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -problems.ROD_LENGTH]))
    state = crocoddyl.StateMultibody(model)
    actuation = crocoddyl.ActuationModelFull(state)
    target = np.zeros(2 * rods)
    target[0] = problems.UPRIGHT  # relative angles
    models = [
        crocoddyl.IntegratedActionModelEuler(
            crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs), step
        )
        for costs, step in ((_running(state, rods), h), (_ending(state, rods, target, 1e6), 0.0))
    ]
    problem = crocoddyl.ShootingProblem(np.zeros(2 * rods), [models[0]] * case.n, models[1])
    states = list(np.outer(np.linspace(0.0, 1.0, case.n + 1), target))
    controls = list(problem.quasiStatic(states[:-1]))
    note = "semi-implicit Euler, torque held over an interval, end by a penalty of 1e6"
    return _solving(crocoddyl.SolverFDDP, problem, states, controls, target, h, 1e-7, note, case)


def _solving(
    method: Any,
    problem: Any,
    states: list[np.ndarray],
    controls: list[np.ndarray],
    target: np.ndarray,
    h: float,
    tolerance: float,
    note: str,
    case: Case,
) -> Task:
    problem.nthreads = 1

    def solve() -> Outcome:
        solver = method(problem)
        solver.th_stop = tolerance
        converged = solver.solve(states, controls, min(case.max_iterations, 500), False)
        u = np.array(solver.us)
        miss = float(np.abs(np.asarray(solver.xs[-1]) - target).max())
        objective = float(h * np.sum(u**2))
        return Outcome(
            objective, int(solver.iter), bool(converged), f"end missed by {miss:.1e}", np.array(solver.xs)
        )

    return Task(solve, note)
