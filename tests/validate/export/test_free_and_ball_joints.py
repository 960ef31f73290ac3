"""Free and ball joints go into other programs' files, and are shown."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from rigid_motions import ball_pendulum, tumbling_box

from stc.validate.export import controls, gltf, keyframes
from stc.validate.verdict import open_setup
from stc.viewer.motion import Motion


def test_keyframes_hold_the_quaternions(tmp_path: Path) -> None:
    solution = tumbling_box(tmp_path)
    setup, path = open_setup(solution), tmp_path / "keys.xml"
    keyframes.write(setup, path)
    model = mujoco.MjModel.from_xml_path(str(path))
    wanted = np.array([setup.reference.at("before", k)[0] for k in range(solution.n + 1)])
    np.testing.assert_allclose(model.key_qpos, wanted, atol=1e-12)


def test_a_motion_of_a_free_joint_is_written_as_gltf(tmp_path: Path) -> None:
    gltf.write(open_setup(tumbling_box(tmp_path)), tmp_path / "box.glb")
    assert (tmp_path / "box.glb").read_bytes()[:4] == b"glTF"


def test_gains_play_a_ball_joint(tmp_path: Path) -> None:
    setup = open_setup(ball_pendulum(tmp_path))
    found = controls.sequence(setup, 1e-3)
    model = setup.model()
    model.opt.timestep = float(found["timestep"])
    data, way = mujoco.MjData(model), np.zeros(model.nv)
    data.qpos[:], data.qvel[:] = found["qpos"][0], found["qvel"][0]
    for k, control in enumerate(found["ctrl"]):
        mujoco.mj_differentiatePos(model, way, 1.0, data.qpos, found["qpos"][k])
        data.ctrl[:] = control + found["gain"][k] @ np.concatenate([way, found["qvel"][k] - data.qvel])
        mujoco.mj_step(model, data)
    mujoco.mj_differentiatePos(model, way, 1.0, data.qpos, found["qpos"][-1])
    assert np.abs(way).max() < 0.01


def test_the_viewer_shows_torques_of_a_ball_joint(tmp_path: Path) -> None:
    solution = ball_pendulum(tmp_path)
    shown = Motion(solution)
    middle = float(solution.time[20])
    np.testing.assert_allclose(np.linalg.norm(shown.state(middle).qpos[:4]), 1.0, rtol=1e-12)
    assert shown.solved_forces(middle, np.zeros(3))
