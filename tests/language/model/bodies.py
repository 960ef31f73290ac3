"""Small models for the tests of specs with a model, and MuJoCo's word on motions that were solved with them."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np

import stc
from stc.solution import Solution


def quadruped() -> str:
    """A robot with a free trunk, twelve motors and four feet of points."""
    legs = ""
    for leg, x, y in (("FL", 1, 1), ("FR", 1, -1), ("RL", -1, 1), ("RR", -1, -1)):
        legs += f"""
        <body name="{leg}hip" pos="{0.19 * x} {0.047 * y} 0"><joint name="{leg}a" axis="1 0 0" range="-.8 .8"/>
          <geom type="cylinder" size=".046 .02" mass=".6" contype="0" conaffinity="0"/>
          <body name="{leg}thigh" pos="0 {0.08 * y} 0"><joint name="{leg}h" axis="0 1 0" range="-1.5 3"/>
            <geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass="1.1"/>
            <body name="{leg}calf" pos="0 0 -.213"><joint name="{leg}k" axis="0 1 0" range="-2.7 -.85"/>
              <geom type="capsule" fromto="0 0 0 0 0 -.193" size=".02" mass=".2"/>
              <site name="{leg}" pos="0 0 -.213"/></body></body></body>"""
    motors = "".join(
        f'<motor name="{leg}{joint}" joint="{leg}{joint}" gear="30" ctrlrange="-1 1"/>'
        for leg in ("FL", "FR", "RL", "RR")
        for joint in "ahk"
    )
    stand = f"0 0 {0.426 * math.cos(0.8)!r} 1 0 0 0 " + "0 .8 -1.6 " * 4
    return f"""<mujoco model="quadruped"><compiler autolimits="true" angle="radian"/>
      <default><joint armature=".01" damping=".1"/></default>
      <worldbody><geom name="floor" type="plane" size="5 5 1"/>
        <body name="trunk" pos="0 0 .3"><freejoint name="root"/>
          <geom type="box" size=".19 .05 .055" mass="6"/>{legs}</body>
      </worldbody><actuator>{motors}</actuator><keyframe><key name="stand" qpos="{stand}"/></keyframe></mujoco>"""


FEET = """contact:
  FL = point(site.FL), friction = 0.7;   FR = point(site.FR), friction = 0.7;
  RL = point(site.RL), friction = 0.7;   RR = point(site.RR), friction = 0.7;
"""


def load(folder: Path, model: str, spec: str, **constants: float) -> stc.Model:
    """A spec whose model is the given text, in a folder."""
    (folder / "robot.xml").write_text(model, encoding="utf-8")
    (folder / "motion.stc").write_text(f'model: "robot.xml";\n{spec}', encoding="utf-8")
    return stc.load(folder / "motion.stc", **constants)


def residual(solution: Solution, model: str, feet: tuple[str, ...] = ()) -> float:
    """The largest error of the equations of motion at the nodes, as a share of the largest force that MuJoCo finds.

    Constraints are off; the forces of contacts act at sites of their names.
    """
    m = mujoco.MjModel.from_xml_string(model)
    d = mujoco.MjData(m)
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    known = solution.trajectories
    error, largest = 0.0, 0.0
    sides = ["before", "after"] + (["mid"] if solution.method == "hermite-simpson" else [])
    for side in sides:
        for frame in range(solution.n):

            def value(name: str, order: int = 0, side: str = side, frame: int = frame) -> float:
                return float(getattr(known[name, order], side)[frame])

            put(m, d, value)
            acceleration = d.qacc.copy()
            mujoco.mj_inverse(m, d)
            needed = d.qfrc_inverse.copy()
            for a in range(m.nu):
                name = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_ACTUATOR, a)
                d.ctrl[a] = value(f"actuator.{name}")
            mujoco.mj_forward(m, d)
            given = d.qfrc_actuator.copy()
            for foot in feet:
                along = np.zeros((3, m.nv))
                mujoco.mj_jacSite(m, d, along, None, m.site(foot).id)
                given += along.T @ [value(f"{foot}_f{axis}") for axis in "xyz"]
            error = max(error, float(np.abs(needed - given).max()))
            largest = max(largest, float(np.abs(needed).max()))
            d.qacc[:] = acceleration
    return error / largest


def put(m: mujoco.MjModel, d: mujoco.MjData, value: object) -> None:
    """Set position, velocity and acceleration from ``value(name, order)``."""
    assert callable(value)
    for j in range(m.njnt):
        name = f"joint.{mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_JOINT, j)}"
        q, v, kind = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j]), int(m.jnt_type[j])
        if kind in (2, 3):
            d.qpos[q], d.qvel[v], d.qacc[v] = (value(name, order) for order in (0, 1, 2))
            continue
        if kind == 0:
            for k, axis in enumerate("xyz"):
                d.qpos[q + k], d.qvel[v + k], d.qacc[v + k] = (
                    value(f"{name}.{axis}", order) for order in (0, 1, 2)
                )
            q, v = q + 3, v + 3
        d.qpos[q : q + 4] = [value(f"{name}.q{part}") for part in "wxyz"]
        for k, axis in enumerate("xyz"):
            d.qvel[v + k], d.qacc[v + k] = value(f"{name}.w{axis}"), value(f"{name}.w{axis}", 1)
