"""Crocoddyl on the bundled quadruped's hop, in the idiom of its own quadruped examples.

The model file is read by Pinocchio.  Four legs stand, fly and land for as many intervals as the spec says.  Contacts
hold the middles of the spherical feet, with Baumgarte feedback.  Feet that land where the spec's do and at rest,
friction cones, joint ranges and the pose at the end are penalties.  Dampers are left out, since Crocoddyl's models have
none.  So the program is another one than the spec's: times per iteration are what can be compared.
"""

from __future__ import annotations

from typing import Any

import crocoddyl
import mujoco
import numpy as np
import pinocchio as pin

from bench.peers import problems
from bench.peers.task import Case, Outcome, Task
from stc.models import locate

LEGS = ("FL", "FR", "RL", "RR")
DURATION, DISTANCE, FRICTION = 0.8, 0.5, 0.7
#: Weights of the penalties: cone, range, feet at the landing, posture on the way, pose and speed at the end.
CONE, RANGE, LANDING, POSTURE, END = 1e1, 1e3, 1e4, 1e-1, 1e5
#: Of the penalty that draws a landed foot back, 1/s and 1/s^2.
GAINS = np.array([0.0, 50.0])


def build(case: Case, variant: str) -> Task:
    """The hop; ``case.n`` is a multiple of 3."""
    return _Hop(case).task()


class _Hop:
    """The robot, its feet and its poses, from which the actions of the hop are made."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.step = DURATION / case.n
        file = str(locate("quadruped.xml"))
        self.drawn = mujoco.MjModel.from_xml_path(file)
        self.model = pin.buildModelFromMJCF(file)
        self.model.names[1] = "root_joint"  # by this name Crocoddyl knows the joint that has no motors
        self.model.gravity.linear = np.array([0.0, 0.0, -problems.GRAVITY])
        self.feet = [self._foot(leg) for leg in LEGS]
        self.state = crocoddyl.StateMultibody(self.model)
        self.actuation = crocoddyl.ActuationModelFloatingBase(self.state)
        self.size = self.actuation.nu
        self.stand = np.concatenate([self._keyframe(), np.zeros(self.model.nv)])
        self.end = self.stand.copy()
        self.end[0] += DISTANCE
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, self.stand[: self.model.nq])
        self.places = [data.oMf[foot].translation.copy() for foot in self.feet]

    def _foot(self, leg: str) -> int:
        """A frame in the middle of a leg's foot, whose joint is at the origin of its body."""
        place = pin.SE3(np.eye(3), np.asarray(self.drawn.geom(f"{leg}_foot").pos))
        joint = self.model.getJointId(f"{leg}_knee")
        frame = pin.Frame(
            f"{leg}_tip", joint, self.model.frames[0].parentFrame, place, pin.FrameType.OP_FRAME
        )
        return int(self.model.addFrame(frame))

    def _keyframe(self) -> np.ndarray:
        return np.asarray(self.model.referenceConfigurations["stand"]).copy()

    def _state_cost(self, costs: Any, target: np.ndarray, weights: np.ndarray, weight: float) -> None:
        residual = crocoddyl.ResidualModelState(self.state, target, self.size)
        activation = crocoddyl.ActivationModelWeightedQuad(weights)
        costs.addCost("state", crocoddyl.CostModelResidual(self.state, activation, residual), weight)

    def _ranges(self, costs: Any) -> None:
        nv = self.model.nv
        lower, upper = np.full(2 * nv, -1e9), np.full(2 * nv, 1e9)
        lower[6:nv], upper[6:nv] = self.model.lowerPositionLimit[7:], self.model.upperPositionLimit[7:]
        bounds = crocoddyl.ActivationBounds(lower, upper)
        zero = np.concatenate([pin.neutral(self.model), np.zeros(nv)])
        residual = crocoddyl.ResidualModelState(self.state, zero, self.size)
        barrier = crocoddyl.ActivationModelQuadraticBarrier(bounds)
        costs.addCost("ranges", crocoddyl.CostModelResidual(self.state, barrier, residual), RANGE)

    def _land(self, costs: Any) -> None:
        """Feet at their places, at rest: what Crocoddyl's examples call a pseudo-impulse."""
        for leg, foot, place in zip(LEGS, self.feet, self.places, strict=True):
            target = place + np.array([DISTANCE, 0.0, 0.0])
            there = crocoddyl.ResidualModelFrameTranslation(self.state, foot, target, self.size)
            costs.addCost(f"{leg} place", crocoddyl.CostModelResidual(self.state, there), LANDING)
            still = crocoddyl.ResidualModelFrameVelocity(
                self.state, foot, pin.Motion.Zero(), pin.LOCAL_WORLD_ALIGNED, self.size
            )
            linear = crocoddyl.ActivationModelWeightedQuad(np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
            costs.addCost(f"{leg} speed", crocoddyl.CostModelResidual(self.state, linear, still), LANDING)

    def _action(self, stands: bool, lands: bool = False, last: bool = False) -> Any:
        contacts = crocoddyl.ContactModelMultiple(self.state, self.size)
        costs = crocoddyl.CostModelSum(self.state, self.size)
        if stands:
            for leg, foot in zip(LEGS, self.feet, strict=True):
                contact = crocoddyl.ContactModel3D(
                    self.state, foot, np.zeros(3), pin.LOCAL_WORLD_ALIGNED, self.size, GAINS
                )
                contacts.addContact(leg, contact)
                cone = crocoddyl.FrictionCone(np.eye(3), FRICTION, 4, False)
                barrier = crocoddyl.ActivationModelQuadraticBarrier(
                    crocoddyl.ActivationBounds(cone.lb, cone.ub)
                )
                residual = crocoddyl.ResidualModelContactFrictionCone(self.state, foot, cone, self.size)
                costs.addCost(f"{leg} cone", crocoddyl.CostModelResidual(self.state, barrier, residual), CONE)
        if lands:
            self._land(costs)
        nv = self.model.nv
        if last:
            self._state_cost(costs, self.end, np.ones(2 * nv), END)
        else:
            effort = crocoddyl.ResidualModelControl(self.state, self.size)
            costs.addCost("effort", crocoddyl.CostModelResidual(self.state, effort), 2.0)
            legs = np.concatenate([np.zeros(6), np.ones(nv - 6), 1e-3 * np.ones(nv)])
            self._state_cost(costs, self.stand, legs, POSTURE)
            self._ranges(costs)
        dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(
            self.state, self.actuation, contacts, costs, 0.0, True
        )
        dynamics.armature = np.concatenate([np.zeros(6), self.model.armature[6:]])
        return crocoddyl.IntegratedActionModelEuler(dynamics, 0.0 if last else self.step)

    def task(self) -> Task:
        third = self.case.n // 3
        stance, flight = self._action(stands=True), self._action(stands=False)
        actions = [stance] * third + [flight] * third + [self._action(stands=True, lands=True)]
        actions += [stance] * (self.case.n - len(actions))
        problem = crocoddyl.ShootingProblem(self.stand, actions, self._action(stands=True, last=True))
        problem.nthreads = 1
        states = [self.stand] * (len(actions) + 1)
        controls = list(problem.quasiStatic(states[:-1]))

        def solve() -> Outcome:
            solver = crocoddyl.SolverFDDP(problem)
            solver.th_stop = 1e-6
            converged = solver.solve(states, controls, min(self.case.max_iterations, 500), False)
            miss = float(np.abs(self.state.diff(np.asarray(solver.xs[-1]), self.end)).max())
            objective = float(self.step * sum(float(u @ u) for u in solver.us))
            status = f"end missed by {miss:.1e}"
            return Outcome(objective, int(solver.iter), bool(converged), status, np.array(solver.xs))

        return Task(solve, "explicit Euler, cones, ranges and end by penalties, no dampers")
