"""The motion of joints that the spec does not tie, along the solved motion of the others.

An untied joint that stays in place in the replay is held there.  The others move freely: at every instant their
accelerations are those at which the generalised force on them equals that of the model (actuators, springs, dampers,
external forces), while the tied joints move as solved.  This combines inverse dynamics of the tied coordinates and
forward dynamics of the untied ones, integrated by the classical Runge-Kutta method.

It is well defined as long as no equality, contact or tendon friction acts between tied and untied joints, since its
force would not be known.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.equalities import constraint_rows
from stc.validate.metrics import FloatArray
from stc.validate.model import joint_names
from stc.validate.progress import steps
from stc.validate.rotations import rate_of_way, turning_dofs

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup

#: Position (nq,) and velocity (nv,) of a model.
State = tuple[FloatArray, FloatArray]

#: A joint that goes no farther than this in the replay, in m, rad or as part of a quaternion, stays where it is.
_STILL = 1e-6

#: MuJoCo's dry friction gives way slowly under all that it holds: a joint that has some stays with as much as this.
_CREEPS = 1e-2

#: The replay is looked at in so many places.
_LOOKED_AT = 200


class UntiedMotion:
    """Positions and velocities of the joints without a ``joint`` line.

    Vectors are the model's own, ``qpos`` and ``qvel``; their tied entries mean nothing.

    Attributes:
        free: (f,) indices in ``qvel`` of the untied coordinates that move.
        stuck: (s,) indices of those that dry friction holds.
        constrained: whether the model's constraints act on these (dry friction, limits, contacts with the world).
        ends: the state in which each step ends.
        coupled: names of the untied joints that constraints join to tied ones; nothing can be said where there are any.
    """

    def __init__(self, setup: Setup, path: FloatArray) -> None:
        """Compute the motion.

        Args:
            setup: the motion and its model.
            path: (steps+1, nq) ``qpos`` along the open-loop replay.
        """
        import mujoco

        self._setup = setup
        self._tied = setup.reference.velocities
        path = path[np.isfinite(path).all(axis=1)]
        self.free, self.stuck = _moving(setup, path)
        self.constrained, self.coupled = _constraints(setup, path, self.free)
        model = setup.model(contacts=False)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self._model, self._data = model, mujoco.MjData(model)
        self._turning = turning_dofs(model)
        self._outer = setup.all_forces
        #: See :meth:`_advanced`, of each whole step.
        self._path: list[list[tuple[float, State]]] = []
        self.ends: list[State] = []
        if not self.coupled:
            self._run()

    def at(self, part: str, index: int) -> State:
        """Position (nq,) and velocity (nv,) at a node: ``before`` or ``after`` a frame, or ``mid`` of a step."""
        if part == "mid":
            return self.in_step(index, np.array([0.5]))[0]
        if (part == "before" and index > 0) or index >= len(self._path):
            return self.ends[index - 1] if index > 0 else self._rest()
        return self._path[index][0][1]

    def in_step(self, step: int, shares: FloatArray) -> list[State]:
        """Positions and velocities at increasing shares of a step."""
        path, found = self._path[step], []
        for target in shares.tolist():
            share, state = path[bisect_right(path, target, key=lambda one: one[0]) - 1]
            found.append(self._advanced(step, state, share, target)[-1][1])
        return found

    def put(self, data: mujoco.MjData, state: State) -> None:
        """Write a state into a simulation, before the tied joints are."""
        data.qpos[:], data.qvel[:] = state

    def acceleration(self, mass: FloatArray, missing: FloatArray) -> FloatArray:
        """(nv,) accelerations of the free coordinates, zero elsewhere.

        Args:
            mass: (nv, nv) the mass matrix.
            missing: (nv,) the model's forces less those of the motion without these accelerations.
        """
        found = np.zeros(len(missing))
        free = self.free
        found[free] = np.linalg.solve(mass[np.ix_(free, free)], missing[free])
        return found

    def _rest(self) -> State:
        return np.array(self._model.qpos0), np.zeros(self._model.nv)

    def _run(self) -> None:
        """All steps in order; tied velocities that jump do not move the free joints."""
        reference, state = self._setup.reference, self._rest()
        for step in steps("untied joints", self._setup.solution.n):
            jump = np.zeros(self._model.nv)
            if step:
                jump[self._tied] = reference.at("after", step)[1] - reference.at("before", step)[1]
            if jump.any() and len(self.free):
                self.put(self._data, state)
                reference.put(self._data, reference.at("after", step)[:2])
                mass = self._mass()
                state = state[0], state[1] + self.acceleration(mass, -mass @ jump)
            path = self._advanced(step, state, 0.0, 1.0)
            state = path[-1][1]
            self._path.append(path)
            self.ends.append(state)

    def _mass(self) -> FloatArray:
        import mujoco

        mujoco.mj_fwdPosition(self._model, self._data)
        mass = np.zeros((self._model.nv, self._model.nv))
        mujoco.mj_fullM(self._model, self._data, mass)
        return mass

    def _advanced(self, step: int, state: State, start: float, end: float) -> list[tuple[float, State]]:
        """The state, and those after each time step to another share of a step, with their shares."""
        import mujoco

        path = [(start, state)]
        if end <= start or not len(self.free):
            return path
        whole = float(np.diff(self._setup.solution.time[step : step + 2])[0])
        parts = max(1, math.ceil(whole * (end - start) / limits.TIME_STEP - 1e-9))
        h = whole * (end - start) / parts
        shares = np.linspace(start, end, 2 * parts + 1)
        tied = self._setup.reference.in_step(step, shares)
        controls, forces = self._setup.controls.in_step(step, shares), self._outer.in_step(step, shares)
        position, velocity = state
        for part in range(parts):
            rates: list[State] = []
            for offset, ahead in ((0, 0.0), (1, 0.5), (1, 0.5), (2, 1.0)):
                q, v, way = position.copy(), velocity.copy(), np.zeros_like(velocity)
                if rates:
                    way = ahead * h * self._only_free(rates[-1][0])
                    mujoco.mj_integratePos(self._model, q, way, 1.0)
                    v = v + ahead * h * rates[-1][1]
                k = 2 * part + offset
                change = self._rate((q, v), [one[k] for one in tied], controls[k], forces[k])
                rates.append((rate_of_way(way, v, self._turning), change))
            mean = [sum(w * r[i] for w, r in zip((1, 2, 2, 1), rates)) / 6.0 for i in range(2)]
            position = position.copy()
            mujoco.mj_integratePos(self._model, position, self._only_free(np.asarray(mean[0])), h)
            velocity = velocity + h * np.asarray(mean[1])
            path.append((float(shares[2 * part + 2]), (position, velocity)))
        return path

    def _only_free(self, velocity: FloatArray) -> FloatArray:
        found = np.zeros_like(velocity)
        found[self.free] = velocity[self.free]
        return found

    def _rate(
        self,
        state: State,
        tied: list[FloatArray],
        control: FloatArray,
        force: FloatArray,
    ) -> FloatArray:
        """(nv,) accelerations of the free coordinates."""
        import mujoco

        model, data = self._model, self._data
        self.put(data, state)
        self._setup.reference.put(data, tied[:2])
        data.ctrl[self._setup.controls.addresses] = control
        self._outer.apply(model, data, force)
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        known = np.zeros(model.nv)
        known[self._tied] = tied[2]
        return self.acceleration(mass, data.qfrc_smooth - mass @ known)


def untied_motion(setup: Setup, path: FloatArray) -> tuple[UntiedMotion | None, str]:
    """The motion of untied joints; None if there are none, or if it is not known, and then the reason.

    Args:
        setup: the motion and its model.
        path: (steps+1, nq) ``qpos`` along the open-loop replay.
    """
    if setup.all_tied or unknown_forces(setup) or not setup.solution.n:
        return None, ""
    found = UntiedMotion(setup, path)
    if found.coupled:
        return None, (
            f"constraints of the model (equalities, contacts, tendons) join {', '.join(found.coupled)}, which have no "
            "`joint` line in the spec, with joints that have one"
        )
    if not all(np.isfinite(np.concatenate(end)).all() for end in found.ends):
        return None, "the joints without a `joint` line leave all bounds"
    return found, ""


def unknown_forces(setup: Setup) -> str:
    """Why the generalised forces of a solved motion are not known, in words; "" if they are."""
    if setup.compiled.na and not (setup.all_tied and setup.knows_activations):
        return "actuators of the model have a state of their own, and the spec does not give all states and joints"
    if not setup.reference.has_acceleration:
        return "the solution does not contain the accelerations of all joints"
    return ""


def _moving(setup: Setup, path: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """Indices in ``qvel`` of untied coordinates: (f,) those that move in the replay, (s,) those that friction holds."""
    model = setup.compiled
    away = np.abs(path - model.qpos0).max(axis=0, initial=0.0)
    tied = set(setup.reference.velocities.tolist())
    free: list[int] = []
    stuck: list[int] = []
    for joint in range(model.njnt):
        dofs = np.flatnonzero(model.dof_jntid == joint)
        begin = int(model.jnt_qposadr[joint])
        end = int(model.jnt_qposadr[joint + 1]) if joint + 1 < model.njnt else model.nq
        dry = bool(model.dof_frictionloss[dofs].any())
        if int(dofs[0]) not in tied and float(away[begin:end].max()) > (_CREEPS if dry else _STILL):
            free += dofs.tolist()
        elif int(dofs[0]) not in tied and dry:
            stuck += dofs.tolist()
    return np.array(free, dtype=np.intp), np.array(stuck, dtype=np.intp)


def _constraints(setup: Setup, path: FloatArray, free: np.ndarray) -> tuple[bool, list[str]]:
    """Whether constraints act on free coordinates along the replay, and the joints that they couple with tied ones."""
    import mujoco

    model = setup.model()
    data = mujoco.MjData(model)
    tied = setup.reference.velocities
    constrained, coupled = False, np.zeros(model.nv, dtype=bool)
    for at in np.unique(np.linspace(0, len(path) - 1, _LOOKED_AT).astype(int)) if len(free) else ():
        data.qpos[:] = path[at]
        mujoco.mj_fwdPosition(model, data)
        if not data.nefc:
            continue
        touched = constraint_rows(model, data, np.arange(data.nefc)) != 0.0
        on_free = touched[:, free].any(axis=1)
        constrained |= bool(on_free.any())
        both = on_free & touched[:, tied].any(axis=1)
        coupled[free] |= touched[both][:, free].any(axis=0)
    titles = joint_names(model)
    names = [titles[model.dof_jntid[dof]] for dof in np.flatnonzero(coupled)]
    return constrained, list(dict.fromkeys(names))
