"""Where motions of models start: what is held is where it belongs, what is not falls or turns."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from .bodies import FEET, load, quadruped
from .test_motions import BOX, HOP


class Guess:
    """The values at the frames that a spec's motion starts from."""

    def __init__(self, folder: Path, model: str, spec: str, **constants: float) -> None:
        problem, transcription = load(folder, model, spec).transcription()
        self.x = transcription.guess({**problem.constants, **constants})
        self.layout, self.n = transcription.layout, problem.n

    def __call__(self, name: str, order: int = 0) -> np.ndarray:
        return self.x[self.layout.before[:, self.layout.column[name, order]]]


def test_what_nothing_holds_starts_by_falling_and_turns_to_where_equations_say(tmp_path: Path) -> None:
    spec = """constants: n = 10, T = 0.5, h = T/n;
    constraints: [0]: keyframe.reference + (0, 0, 3) turned 3 about x; rest;
      [n]: joint.root.qx; joint.root.qy; joint.root.qz; joint.root.x = 0.2;"""
    start = Guess(tmp_path, BOX, spec)
    t = np.linspace(0.0, 0.5, 11)
    assert start("joint.root.z") == pytest.approx(3.0 - 0.5 * 9.81 * t**2)
    assert start("joint.root.x") == pytest.approx(0.4 * t)
    assert start("joint.root.qw") ** 2 == pytest.approx(np.cos(1.5 - 3.0 * t) ** 2)
    assert start("joint.root.wx")[1:] == pytest.approx(-6.0)  # at rest in the first frame
    assert start("joint.root.wy")[1:] == pytest.approx(0.0, abs=1e-12)
    assert start("joint.root.z", 1)[1:-1] == pytest.approx(-9.81 * t[1:-1])


def feet(start: Guess, frame: int) -> np.ndarray:
    """Where MuJoCo has the quadruped's feet in a frame of a guess. (4, 3)"""
    model = mujoco.MjModel.from_xml_string(quadruped())
    data = mujoco.MjData(model)
    root = [start(f"joint.root.{part}")[frame] for part in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    names = [model.joint(k).name for k in range(1, model.njnt)]
    data.qpos[:] = [*root, *(start(f"joint.{name}")[frame] for name in names)]
    mujoco.mj_kinematics(model, data)
    return data.site_xpos.copy()


@pytest.mark.parametrize("D", [0.2, 0.3])  # the second is another constant, not another spec
def test_feet_start_where_they_stand(tmp_path: Path, D: float) -> None:
    start = Guess(tmp_path, quadruped(), HOP.replace("D = 0.4", "D = 0.2"), D=D)
    begin = feet(start, 0)
    assert begin[:, 2] == pytest.approx(0.0, abs=1e-6)
    for frame in range(11):
        assert feet(start, frame) == pytest.approx(begin, abs=1e-5)
    for frame in range(20, 31):
        assert feet(start, frame) == pytest.approx(begin + [D, 0.0, 0.0], abs=1e-5)
    assert np.ptp(start("joint.root.x")) == pytest.approx(D, abs=1e-6)  # the trunk goes ahead all the same


def test_feet_out_of_reach_leave_the_way_between_poses_as_it_is(tmp_path: Path) -> None:
    spec = f"""constants: n = 8, T = 0.4, h = T/n;
    {FEET} [0, n]: FL at 5, 0;
    constraints: [0]: keyframe.stand; rest;"""
    start = Guess(tmp_path, quadruped(), spec)
    assert start("joint.FLk") == pytest.approx(-1.6)
    assert start("joint.root.x") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_a_steady_turn_starts_with_its_angular_velocity(tmp_path: Path, method: str) -> None:
    spec = f"""constants: n = 6, T = 0.5, h = T/n;
    method: {method};
    constraints: [0]: keyframe.reference; [n]: keyframe.reference turned 2 about (0, 3, 4);"""
    start = Guess(tmp_path, BOX, spec)
    for axis, share in (("x", 0.0), ("y", 0.6), ("z", 0.8)):
        assert start(f"joint.root.w{axis}") == pytest.approx(4.0 * share, abs=1e-12)


def test_what_an_equality_holds_to_the_world_does_not_fall(tmp_path: Path) -> None:
    hung = BOX.replace(
        "</worldbody>", '</worldbody><equality><connect body1="box" anchor="0 0 0.5"/></equality>'
    )
    spec = "constants: n = 10, T = 0.5, h = T/n; constraints: [0]: keyframe.reference; rest;"
    assert Guess(tmp_path, hung, spec)("joint.root.z") == pytest.approx(0.0, abs=1e-9)


def test_a_pose_alone_is_kept_however_its_quaternion_is_rounded(tmp_path: Path) -> None:
    """The product of some unit quaternions with themselves is a little below 1."""
    spec = "constants: n = 4, T = 0.5, h = T/n; constraints: [0]: keyframe.reference; rest;"
    for angles in ("70.843 53.417 42.192", "10 20 30", "-41 7 100"):
        turned = BOX.replace('name="box"', f'name="box" euler="{angles}"')
        model = mujoco.MjModel.from_xml_string(turned)
        start = Guess(tmp_path, turned, spec)
        for k, part in enumerate("wxyz"):
            assert start(f"joint.root.q{part}") == pytest.approx(model.qpos0[3 + k], abs=1e-9)


def test_a_somersault_about_a_hinge_starts_in_the_air_alone(tmp_path: Path) -> None:
    """Feet that stand flat keep the body upright; half way through the flight it is upside down."""
    model = """<mujoco><worldbody><geom name="floor" type="plane" size="2 2 .1"/><body name="body" pos="0 0 .3">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <joint name="pitch" type="hinge" axis="0 1 0"/><geom size=".1" mass="1"/>
      <body name="leg"><joint name="leg" type="slide" axis="0 0 1"/>
      <geom name="foot" type="box" size=".1 .1 .05" pos="0 0 -.25" mass=".1"/></body></body></worldbody></mujoco>"""
    spec = """constants: n = 12, T = 1.2, h = T/n;
    contact: foot = foot(geom.foot), friction = 0.7; [0, 4]: foot; [8, n]: foot;
    poses: end = keyframe.reference, joint.pitch = -2*pi;
    constraints: [0]: keyframe.reference; rest;  [n]: end; rest;"""
    pitch = Guess(tmp_path, model, spec)("joint.pitch")
    assert pitch[:5] == pytest.approx(0.0, abs=1e-6)
    assert pitch[6] == pytest.approx(-np.pi, abs=1e-6)
    assert pitch[8:] == pytest.approx(-2.0 * np.pi, abs=1e-6)
