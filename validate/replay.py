"""Replay: simulate the model from the solution's initial state with the solution's forces.

The classical Runge-Kutta method of fourth order steps over MuJoCo's own forward dynamics, with the forces
evaluated at the times of its stages; MuJoCo's ``mj_step`` would hold them over a step.  Every frame step of
the solution is cut into a whole number of equal time steps, so that forces are smooth inside each of them.

A replay is open loop or tracked.  In a tracked replay a feedback law (:mod:`stc.validate.tracking`) adds a correction
to the controls, constant over each time step, which depends on the deviation from the solved motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stc.errors import UsageError
from stc.records import dataclass, field
from stc.validate import limits
from stc.validate.dynamics import SmoothDynamics
from stc.validate.grips import grips
from stc.validate.metrics import FloatArray
from stc.validate.progress import steps
from stc.validate.rotations import rate_of_way, turning_dofs

if TYPE_CHECKING:
    import mujoco

    from stc.validate.contact_meter import ContactMeter
    from stc.validate.forces import OuterForces
    from stc.validate.setup import Setup
    from stc.validate.tracking import Feedback

#: Told after every time step where the simulation is, at its start too; returning True ends the replay there.
Watcher = Callable[["mujoco.MjData"], bool | None]

#: A state larger than this, in m, rad or per second, is no motion any more; MuJoCo draws the same line.
_BROKEN = 1e10

#: Dampers make time steps shorter by this factor at most, and are looked at in so many frames.
_FINEST, _LOOKED_AT = 64, 8

#: Runge and Kutta's method is stable up to time steps so many times as long as that in which dampers slow a joint.
_STABLE = 2.5

#: ``rk4`` steps as described above; the others are MuJoCo's own, the control being that of the step's middle.
INTEGRATORS = ("rk4", "euler", "implicit", "implicitfast")


@dataclass(slots=True)
class Replay:
    """The result of a simulation.

    Attributes:
        integrator: one of :data:`INTEGRATORS`.
        time_step: longest time step taken, in seconds.
        positions: (n+1, nq) MuJoCo's ``qpos`` at the frames, NaN once the simulation has broken down.
        velocities: (n+1, nv) MuJoCo's ``qvel`` at the frames.
        outputs: (n+1, k) the compared outputs at the frames.
        time: (steps+1,) times of the time steps, in seconds.
        path: (steps+1, nq) ``qpos`` at these times.
        broke_at: time of the frame by which the state had left all bounds, or None.
        feedback: (actuators,) integral of the feedback's absolute value per driven actuator.
        total: (actuators,) integral of the whole control's absolute value.
        corrections: (n, actuators) integral of the feedback during each frame step, with its sign.
    """

    integrator: str
    time_step: float
    positions: FloatArray
    velocities: FloatArray
    outputs: FloatArray
    time: FloatArray
    path: FloatArray
    broke_at: float | None = None
    feedback: FloatArray = field(default_factory=lambda: np.zeros(0))
    total: FloatArray = field(default_factory=lambda: np.zeros(0))
    corrections: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def steps(self) -> int:
        """Number of time steps."""
        return len(self.time) - 1


class Stepping(NamedTuple):
    """How the replays of a motion step.

    Attributes:
        time_step: longest time step with the model's contacts, in seconds.
        without_contacts: the same without them.
        integrator: one of :data:`INTEGRATORS`.
    """

    time_step: float
    without_contacts: float
    integrator: str


def stepping_for(setup: Setup, longest: float = limits.TIME_STEP, wanted: str = "rk4") -> Stepping:
    """The time steps of replays, no longer than ``longest``, and their integrator.

    Contacts and equalities are as stiff as the step is short, so a model's own is not exceeded.  Nor is the time in
    which dampers slow a joint, since Runge and Kutta's method is stable up to 2.8 times that.  Where dampers are so
    stiff that even the shortest step exceeds it, as in hands whose light fingers have the damping of an arm, MuJoCo's
    implicit integrator takes its place.
    """
    rate = _fastest_decay(setup)

    def step(most: float) -> float:
        return most if rate * most <= 1.0 else max(1.0 / rate, most / _FINEST)

    own = min(longest, float(setup.compiled.opt.timestep))
    without_contacts = step(own if setup.compiled.neq else longest)
    time_step = step(own) if len(setup.contact) else without_contacts
    stiff = wanted == "rk4" and rate * time_step > _STABLE
    return Stepping(time_step, without_contacts, "implicitfast" if stiff else wanted)


def _fastest_decay(setup: Setup) -> float:
    """The highest rate, per second, at which dampers and actuators slow the model along the solved motion."""
    dynamics, found = SmoothDynamics(setup.model()), 0.0
    for frame in np.unique(np.linspace(0, setup.solution.n, _LOOKED_AT).astype(int)):
        setup.put(dynamics.data, "after", int(frame))
        dynamics.data.ctrl[setup.controls.addresses] = setup.controls.at("after", int(frame))
        found = max(found, dynamics.decay())
    return found


def replay(
    setup: Setup,
    time_step: float = limits.TIME_STEP,
    integrator: str = "rk4",
    *,
    feedback: Feedback | None = None,
    external: bool = False,
    every_step: bool = False,
    watcher: Watcher | None = None,
    meter: ContactMeter | None = None,
) -> Replay:
    """Simulate the whole motion.

    Args:
        setup: the motion and its model.
        time_step: longest time step, in seconds.
        integrator: one of :data:`INTEGRATORS`.
        feedback: the feedback law; None replays open loop.
        external: apply the solved contact forces and switch the model's own contacts off.  Where the solution
            jumps, at impacts above all, the simulation goes on from the solved state: the error of the steps is
            measured phase by phase.
        every_step: go on from the solved state at every frame: the error of each step is measured alone.
        watcher: is called during the replay and may end it early; later frames are NaN.
        meter: integrates the contact forces.

    Raises:
        UsageError: an unknown integrator, or a time step that is not positive.
    """
    import mujoco

    if integrator not in INTEGRATORS:
        raise UsageError(f"unknown integrator {integrator!r}; known are {', '.join(INTEGRATORS)}")
    if not time_step > 0.0:
        raise UsageError(f"the time step of the replay must be positive, not {time_step:g}")
    model = setup.model(contacts=not external)
    if integrator != "rk4":
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    simulation = _Simulation(setup, model, integrator, feedback, external, meter)
    if every_step:
        simulation.restarts = set(range(setup.solution.n))
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # a simulation that goes astray ends before its numbers do
        return simulation.run(time_step, watcher)


#: Of the classical Runge-Kutta method: the share of the step at which a stage is, its weight, and the instant of the
#: step, of start, middle and end, whose controls it takes.
_STAGES = ((0.0, 1 / 6, 0), (0.5, 1 / 3, 1), (0.5, 1 / 3, 1), (1.0, 1 / 6, 2))


class _Simulation:
    """One replay in progress."""

    def __init__(
        self,
        setup: Setup,
        model: mujoco.MjModel,
        integrator: str,
        feedback: Feedback | None,
        external: bool,
        meter: ContactMeter | None,
    ) -> None:
        import mujoco

        self.setup, self.model, self.feedback = setup, model, feedback
        self.meter = meter if meter is not None and meter.columns else None
        self.frame = 0
        self.what = "replay with feedback" if feedback else "replay, contact forces" if external else "replay"
        self.restarts = set(setup.solution.frames_that_jump()) if external else set()
        self.forces: OuterForces = setup.all_forces if external else setup.applied
        self.data = data = mujoco.MjData(model)
        # MuJoCo's own memory, looked up once: to ask for it takes as long as an operation on it.
        self.arrays = data.qpos, data.qvel, data.qacc, data.ctrl, data.act, data.act_dot
        self.time_step = 0.0
        self.grips = [] if external else grips(setup)
        self.turning = turning_dofs(model)
        self.advance = self._runge_kutta if integrator == "rk4" else self._mujoco_step
        n, outputs = setup.solution.n, len(setup.outputs)
        self.result = Replay(
            integrator,
            0.0,
            np.full((n + 1, model.nq), math.nan),
            np.full((n + 1, model.nv), math.nan),
            np.full((n + 1, outputs), math.nan),
            np.zeros(0),
            np.zeros((0, model.nq)),
            feedback=np.zeros(len(setup.controls)),
            total=np.zeros(len(setup.controls)),
            corrections=np.zeros((n, len(setup.controls))),
        )

    def run(self, time_step: float, watcher: Watcher | None) -> Replay:
        setup, model, data, result = self.setup, self.model, self.data, self.result
        solution = setup.solution
        setup.put(data, "after", 0)
        self._record(0)
        times, path = [float(solution.time[0])], [data.qpos.copy()]
        data.time = times[0]
        stopped = watcher is not None and bool(watcher(data))
        durations = np.diff(solution.time)
        for frame in steps(self.what, solution.n):
            duration = durations[frame]
            if stopped:
                break
            self.frame = frame
            for grip in self.grips:
                data.eq_active[grip.equality] = grip.on[frame]
            if frame in self.restarts:
                setup.put(data, "after", frame)
            parts = max(limits.SUBSTEPS, math.ceil(duration / time_step - 1e-9))
            self.time_step = h = model.opt.timestep = float(duration) / parts
            result.time_step = max(result.time_step, h)
            shares = np.arange(2 * parts + 1) / (2 * parts)
            controls = setup.controls.in_step(frame, shares)
            forces = self.forces.in_step(frame, shares)
            law = None if self.feedback is None else self.feedback.in_step(frame, shares[: 2 * parts : 2])
            for part in range(parts):
                now = slice(2 * part, 2 * part + 3)
                control = controls[now]
                if law is not None:
                    correction = law.correction(part, data.qpos, data.qvel)
                    control = control + correction
                    result.corrections[frame] += h * correction
                    result.feedback += h * np.abs(correction)
                    result.total += h * np.abs(control[1])
                self.advance(control, forces[now])
                times.append(float(solution.time[frame]) + (part + 1) * h)
                path.append(data.qpos.copy())
                if watcher is not None and watcher(data):
                    stopped = True
                    break
            if stopped:
                break
            if not np.all(np.abs(np.concatenate([data.qpos, data.qvel])) < _BROKEN):
                result.broke_at = float(solution.time[frame + 1])
                break
            self._record(frame + 1)
        result.time, result.path = np.array(times), np.array(path)
        return result

    def _record(self, frame: int) -> None:
        data, result = self.data, self.result
        result.positions[frame] = data.qpos
        result.velocities[frame] = data.qvel
        if self.setup.outputs:
            import mujoco

            mujoco.mj_forward(self.model, data)
            result.outputs[frame] = [output.read(self.model, data) for output in self.setup.outputs]

    def _runge_kutta(self, controls: FloatArray, forces: FloatArray) -> None:
        """One time step of the classical Runge-Kutta method.

        Positions move by ``mj_integratePos``, so that quaternions stay on their sphere.

        Args:
            controls: (3, k) at the start, middle and end of the step.
            forces: (3, k) of the outer forces.
        """
        from mujoco import mj_forward, mj_integratePos

        model, data, addresses = self.model, self.data, self.setup.controls.addresses
        qpos, qvel, qacc, ctrl, act, act_dot = self.arrays
        h = self.time_step
        start, pose, speed, activation = data.time, qpos.copy(), qvel.copy(), act.copy()
        velocity = acceleration = activity = np.zeros(())
        rate, meter, turning, apply = speed, self.meter, self.turning, self.forces.apply
        for stage, (share, weight, instant) in enumerate(_STAGES):
            if stage:
                ahead = share * h
                way = ahead * rate
                data.time = start + ahead
                qpos[:] = pose
                mj_integratePos(model, qpos, way, 1.0)
                qvel[:] = speed + ahead * qacc
                if len(act):
                    act[:] = activation + ahead * act_dot
            ctrl[addresses] = controls[instant]
            apply(model, data, forces[instant])
            mj_forward(model, data)
            if meter is not None:
                meter.add(self.frame, model, data, weight * h)
            if stage:
                rate = rate_of_way(way, qvel, turning) if len(turning) else qvel.copy()
            else:
                data.qacc_warmstart[:] = qacc
            velocity = velocity + weight * rate
            acceleration = acceleration + weight * qacc
            if len(act):
                activity = activity + weight * act_dot
        data.time = start + h
        qpos[:] = pose
        mj_integratePos(model, qpos, velocity, h)
        qvel[:] = speed + h * acceleration
        if len(act):
            act[:] = activation + h * activity

    def _mujoco_step(self, controls: FloatArray, forces: FloatArray) -> None:
        """One of MuJoCo's own steps, the control and forces of the step's middle held."""
        from mujoco import mj_step

        self.data.ctrl[self.setup.controls.addresses] = controls[1]
        self.forces.apply(self.model, self.data, forces[1])
        mj_step(self.model, self.data)
        if self.meter is not None:
            self.meter.add(self.frame, self.model, self.data, self.model.opt.timestep)
