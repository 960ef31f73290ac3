"""A pendulum of closed form, as a MuJoCo model and as solutions made by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from closed_form_motions import Curve, nodes, solution_of

from stc.solution import ReplayChannel, Solution
from stc.trajectory import FloatArray

MASS, LENGTH, GRAVITY = 1.3, 0.7, 9.8
INERTIA = MASS * LENGTH**2 + 1e-9

#: The angle is zero hanging down; positive swings towards positive x.
MODEL = f"""
<mujoco>
  <option gravity="0 0 -{GRAVITY}"/>
  <worldbody>
    <body name="rod">
      <inertial pos="0 0 -{LENGTH}" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="pivot" type="hinge" axis="0 -1 0"/>
      <geom name="bob" type="sphere" size="0.1" pos="0 0 -{LENGTH}"/>
      <site name="tip" pos="0 0 -{2 * LENGTH}"/>
    </body>
    {{more}}
  </worldbody>
  <actuator><motor name="torque" joint="pivot"/></actuator>
</mujoco>
"""


def pendulum(
    folder: Path,
    time: FloatArray,
    angle: list[Curve],
    torque: Curve | None,
    lines: dict[str, Curve] | None = None,
    method: str = "hermite-simpson",
    more: str = "",
) -> Solution:
    """A solution from the angle (with its two derivatives), the motor's torque and further replay lines.

    ``lines`` are written as in a spec: ``{"apply site.tip.fx": curve}``.
    """
    (folder / "pendulum.xml").write_text(MODEL.format(more=more))
    q = [nodes(method, time, curve) for curve in angle]
    replay = [ReplayChannel("joint", ("pivot",), *q)]
    if torque is not None:
        replay.append(ReplayChannel("actuator", ("torque",), nodes(method, time, torque)))
    for written, curve in (lines or {}).items():
        kind, path = written.split(" ", 1)
        replay.append(ReplayChannel(kind, tuple(path.split(".")), nodes(method, time, curve)))
    trajectories = {("q", order): channel for order, channel in enumerate(q)}
    return solution_of(method, time, trajectories, replay, "pendulum.xml", directory=str(folder))


def held(angle: float) -> list[Curve]:
    """Standing still at an angle."""
    return [lambda t: 0 * t + angle, lambda t: 0 * t, lambda t: 0 * t]


def weight(angle: float) -> float:
    """The torque that holds the pendulum at an angle."""
    return MASS * GRAVITY * LENGTH * float(np.sin(angle))
