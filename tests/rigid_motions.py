"""Motions of models with free and ball joints, integrated finely by MuJoCo: solutions that no solver made."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np
from closed_form_motions import solution_of

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel, FloatArray

#: Controls, all of the model's, as a function of time.
Controls = Callable[[float], Sequence[float]]

#: Longest step of the integration, in s.
FINE = 5e-4

PLACE, QUATERNION, TURNING = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), ("wx", "wy", "wz")

#: A box whose middle axis of inertia is unstable: it turns over and over.
BOX = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="box" pos="0 0 1">
  <freejoint name="root"/><inertial pos="0 0 0" mass="2" diaginertia="0.02 0.05 0.06"/>
  <geom type="box" size="0.2 0.12 0.08" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""

#: A pendulum on a ball joint, its rod bent so that no axis of it is a principal one, with a forearm.
BALL = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="rod" pos="0 0 1">
  <joint name="left/hip" type="ball" damping="0.03" armature="0.01"/>
  <inertial pos="0.03 0 -0.2" mass="1" fullinertia="0.02 0.022 0.004 0.001 0.003 -0.002"/>
  <body name="forearm" pos="0 0 -0.4"><joint name="elbow" axis="0 1 0.2" armature="0.02"/>
    <inertial pos="0.1 0 0" mass="0.4" diaginertia="0.001 0.003 0.004"/></body></body></worldbody>
  <actuator><motor name="x" joint="left/hip" gear="2 0 0"/><motor name="y" joint="left/hip" gear="0 2 0"/>
  <motor name="z" joint="left/hip" gear="0 0 2"/>
  <position name="servo" joint="elbow" kp="5"/></actuator></mujoco>"""


def pull(t: float) -> list[float]:
    """Controls of the pendulum."""
    return [0.8 * np.sin(4 * t), 1.2 * np.cos(3 * t) - 0.5, 0.1 * np.sin(6 * t), 0.6 * np.sin(3 * t)]


@functools.cache
def integrated(
    text: str, start: tuple[tuple[float, ...], ...], controls: Controls | None, n: int, duration: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Positions, velocities, accelerations and controls of a model at frames and midpoints in turn."""
    model = mujoco.MjModel.from_xml_string(text)
    times = np.linspace(0.0, duration, 2 * n + 1)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start
    found: list[list[FloatArray]] = [[], [], [], []]

    def forward(t: float) -> None:
        if controls is not None:
            data.ctrl[:] = controls(t)
        mujoco.mj_forward(model, data)

    for k, t in enumerate(times):
        forward(t)
        for rows, values in zip(found, (data.qpos, data.qvel, data.qacc, data.ctrl)):
            rows.append(values.copy())
        if k + 1 == len(times):
            break
        parts = math.ceil((times[k + 1] - t) / FINE - 1e-9)
        h = (times[k + 1] - t) / parts
        for part in range(parts):
            q, v, now = data.qpos.copy(), data.qvel.copy(), t + part * h
            rates: list[tuple[FloatArray, FloatArray]] = []
            for share in (0.0, 0.5, 0.5, 1.0):
                data.qpos[:], data.qvel[:] = q, v
                if rates:
                    data.qpos[:] += share * h * rates[-1][0]
                    data.qvel[:] += share * h * rates[-1][1]
                forward(now + share * h)
                rates.append((rate_of_pose(model, data.qpos, data.qvel), data.qacc.copy()))
            speed, change = (sum(w * r[i] for w, r in zip((1, 2, 2, 1), rates)) / 6.0 for i in range(2))
            data.qpos[:], data.qvel[:] = q + h * speed, v + h * change
            mujoco.mj_normalizeQuat(model, data.qpos)
    q, v, a, u = (np.array(rows) for rows in found)
    return q, v, a, u


def rate_of_pose(model: mujoco.MjModel, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
    """(nq,) the time derivative of ``qpos``, quaternions' being q (0, w) / 2: plain numbers in space."""
    found = []
    for joint in range(model.njnt):
        kind, at, dof = (int(array[joint]) for array in (model.jnt_type, model.jnt_qposadr, model.jnt_dofadr))
        if kind == int(mujoco.mjtJoint.mjJNT_FREE):
            found.append(qvel[dof : dof + 3])
            at, dof = at + 3, dof + 3
        if kind >= int(mujoco.mjtJoint.mjJNT_SLIDE):
            found.append(qvel[dof : dof + 1])
        else:
            found.append(quaternion_rate(qpos[None, at : at + 4], qvel[None, dof : dof + 3])[0])
    return np.concatenate(found)


def quaternion_rate(quaternion: FloatArray, turning: FloatArray) -> FloatArray:
    """(k, 4) the time derivative of quaternions (k, 4), given angular velocities along the body's own axes (k, 3)."""
    found = np.zeros_like(quaternion)
    for row, q, w in zip(found, quaternion, turning):
        mujoco.mju_mulQuat(row, q, np.array([0.0, *w]))
    return 0.5 * found


def joint_lines(model: mujoco.MjModel, q: FloatArray, v: FloatArray, a: FloatArray) -> list[ReplayChannel]:
    """The ``joint`` lines of positions, velocities and accelerations at frames and midpoints in turn."""
    lines = []
    for joint in range(model.njnt):
        name, kind = model.joint(joint).name, int(model.jnt_type[joint])
        at, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        if kind >= int(mujoco.mjtJoint.mjJNT_SLIDE):
            lines.append(
                ReplayChannel("joint", (name,), *(_nodes(x) for x in (q[:, at], v[:, dof], a[:, dof])))
            )
            continue
        if kind == int(mujoco.mjtJoint.mjJNT_FREE):
            for k, part in enumerate(PLACE):
                values = q[:, at + k], v[:, dof + k], a[:, dof + k]
                lines.append(ReplayChannel("joint", (name, part), *(_nodes(x) for x in values)))
            at, dof = at + 3, dof + 3
        turns = q[:, at : at + 4]
        rates = quaternion_rate(turns, v[:, dof : dof + 3])
        for k, part in enumerate(QUATERNION):
            lines.append(ReplayChannel("joint", (name, part), _nodes(turns[:, k]), _nodes(rates[:, k])))
        for k, part in enumerate(TURNING):
            lines.append(ReplayChannel("joint", (name, part), _nodes(v[:, dof + k]), _nodes(a[:, dof + k])))
    return lines


def motion(
    folder: Path,
    text: str,
    start: tuple[Sequence[float], Sequence[float]],
    controls: Controls | None = None,
    n: int = 40,
    duration: float = 0.8,
) -> Solution:
    """A hermite-simpson solution of the motion of a model, whose file is written into the folder."""
    (folder / "model.xml").write_text(text)
    model = mujoco.MjModel.from_xml_string(text)
    times = np.linspace(0.0, duration, 2 * n + 1)
    q, v, a, u = integrated(text, (tuple(start[0]), tuple(start[1])), controls, n, duration)
    lines = joint_lines(model, q, v, a)
    lines += [ReplayChannel("actuator", (model.actuator(k).name,), _nodes(u[:, k])) for k in range(model.nu)]
    return made(folder, times, lines)


def made(folder: Path, times: FloatArray, lines: Sequence[ReplayChannel]) -> Solution:
    """A solution with these lines; ``times`` are those of frames and midpoints in turn."""
    trajectories = {(line.name, 0): line.value for line in lines}
    return solution_of(
        "hermite-simpson",
        times[::2],
        trajectories,
        lines,
        "model.xml",
        directory=str(folder),
        violation=0.0,
        optimality=0.0,
    )


def tumbling_box(folder: Path, n: int = 40) -> Solution:
    """A box thrown with a rotation about its unstable axis."""
    return motion(folder, BOX, ([0, 0, 1, 1, 0, 0, 0], [1, -0.5, 3, 0.1, 9, 0.05]), n=n)


def ball_pendulum(folder: Path, n: int = 40) -> Solution:
    """A pendulum of a ball joint and a hinge, driven by motors and a position servo."""
    return motion(folder, BALL, ([0.9, 0.3, -0.3, 0.1, 0.4], [0.5, -1, 0.2, 0.3]), pull, n)


def held(value: float, n: int) -> Channel:
    """One number at all nodes."""
    return Channel.smooth(np.full(n + 1, value), np.full(n, value))


def _nodes(values: FloatArray) -> Channel:
    return Channel.smooth(values[::2], values[1::2])
