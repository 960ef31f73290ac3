"""Open-loop replay: start the model where the solution starts, apply its forces, and see where it goes.

The classical Runge-Kutta method of fourth order steps over MuJoCo's own forward dynamics, with the forces
evaluated at the times of its stages; MuJoCo's ``mj_step`` would hold them over a step.  Every frame step of
the solution is cut into a whole number of equal time steps, so that forces are smooth inside each of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from stc.errors import UsageError
from stc.solution import Solution
from stc.validate import limits
from stc.validate.forces import Controls
from stc.validate.metrics import FloatArray
from stc.validate.model import Tie
from stc.validate.outputs import Output

if TYPE_CHECKING:
    import mujoco

#: A state larger than this, in m, rad or per second, is no motion any more; MuJoCo draws the same line.
_BROKEN = 1e10

#: ``rk4`` steps as described above; the others are MuJoCo's own, the control being that of the step's middle.
INTEGRATORS = ("rk4", "euler", "implicit", "implicitfast")


@dataclass(slots=True)
class Replay:
    """What the simulation did.

    Attributes:
        integrator: one of :data:`INTEGRATORS`.
        time_step: longest time step taken, in seconds.
        steps: number of time steps.
        positions: (n+1, nq) MuJoCo's ``qpos`` at the frames, NaN once the simulation has broken down.
        velocities: (n+1, nv) MuJoCo's ``qvel`` at the frames.
        outputs: (n+1, k) the compared outputs at the frames.
        broke_at: time of the frame by which the state had left all bounds, or None.
    """

    integrator: str
    time_step: float
    steps: int
    positions: FloatArray
    velocities: FloatArray
    outputs: FloatArray
    broke_at: float | None = field(default=None)


def set_start(data: mujoco.MjData, ties: list[Tie]) -> None:
    """Put every tied joint where the solution starts, with the solution's own velocity."""
    for tie in ties:
        assert tie.line.rate is not None  # checked when the joints were tied
        data.qpos[tie.position] = tie.line.value.after[0]
        data.qvel[tie.velocity] = tie.line.rate.after[0]


def replay(
    model: mujoco.MjModel,
    solution: Solution,
    ties: list[Tie],
    controls: Controls,
    outputs: list[Output],
    time_step: float = limits.TIME_STEP,
    integrator: str = "rk4",
) -> Replay:
    """Simulate the whole motion open loop.

    Args:
        model: the model with the spec's numbers in it; its time step is changed.
        solution: gives the times of the frames.
        ties: joints to start.
        controls: forces over time.
        outputs: what to record at the frames besides the joints.
        time_step: longest time step, in seconds.
        integrator: one of :data:`INTEGRATORS`.

    Raises:
        UsageError: an unknown integrator, or a time step that is not positive.
    """
    import mujoco

    if integrator not in INTEGRATORS:
        raise UsageError(f"unknown integrator {integrator!r}; known are {', '.join(INTEGRATORS)}")
    if not time_step > 0.0:
        raise UsageError(f"the time step of the replay must be positive, not {time_step:g}")
    if integrator != "rk4":
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data = mujoco.MjData(model)
    set_start(data, ties)
    advance = _runge_kutta if integrator == "rk4" else _mujoco_step
    n = solution.n
    result = Replay(
        integrator,
        0.0,
        0,
        np.full((n + 1, model.nq), math.nan),
        np.full((n + 1, model.nv), math.nan),
        np.full((n + 1, len(outputs)), math.nan),
    )
    _record(model, data, outputs, result, 0)
    for frame, duration in enumerate(np.diff(solution.time)):
        parts = max(limits.SUBSTEPS, math.ceil(duration / time_step - 1e-9))
        model.opt.timestep = duration / parts
        result.time_step = max(result.time_step, model.opt.timestep)
        result.steps += parts
        shares = np.arange(2 * parts + 1) / (2 * parts)
        signal = controls.in_step(frame, shares)
        for part in range(parts):
            advance(model, data, controls.addresses, signal[2 * part : 2 * part + 3])
        state = np.concatenate([data.qpos, data.qvel])
        if not np.all(np.abs(state) < _BROKEN):
            result.broke_at = float(solution.time[frame + 1])
            break
        _record(model, data, outputs, result, frame + 1)
    return result


def _record(
    model: mujoco.MjModel, data: mujoco.MjData, outputs: list[Output], result: Replay, frame: int
) -> None:
    result.positions[frame] = data.qpos
    result.velocities[frame] = data.qvel
    if outputs:
        import mujoco

        mujoco.mj_forward(model, data)
        result.outputs[frame] = [output.read(model, data) for output in outputs]


def _runge_kutta(
    model: mujoco.MjModel, data: mujoco.MjData, addresses: np.ndarray, controls: FloatArray
) -> None:
    """One time step of the classical Runge-Kutta method; ``controls`` (3, k) at its start, middle and end.

    Positions move along velocities by ``mj_integratePos``, as MuJoCo's own Runge-Kutta does, so that
    quaternions stay on their sphere.
    """
    from mujoco import mj_forward, mj_integratePos

    h = model.opt.timestep
    start, qpos, qvel, act = data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()
    velocity, acceleration, activation = np.zeros(model.nv), np.zeros(model.nv), np.zeros(model.na)
    for stage, (share, weight) in enumerate(((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6))):
        if stage:
            ahead = share * h
            rate, change, act_rate = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
            data.time = start + ahead
            data.qpos[:] = qpos
            mj_integratePos(model, data.qpos, rate, ahead)
            data.qvel[:] = qvel + ahead * change
            data.act[:] = act + ahead * act_rate
        data.ctrl[addresses] = controls[int(2 * share)]
        mj_forward(model, data)
        if not stage:
            data.qacc_warmstart[:] = data.qacc
        velocity += weight * data.qvel
        acceleration += weight * data.qacc
        activation += weight * data.act_dot
    data.time = start + h
    data.qpos[:] = qpos
    mj_integratePos(model, data.qpos, velocity, h)
    data.qvel[:] = qvel + h * acceleration
    data.act[:] = act + h * activation


def _mujoco_step(
    model: mujoco.MjModel, data: mujoco.MjData, addresses: np.ndarray, controls: FloatArray
) -> None:
    """One of MuJoCo's own steps, the control of the step's middle held."""
    from mujoco import mj_step

    data.ctrl[addresses] = controls[1]
    mj_step(model, data)
