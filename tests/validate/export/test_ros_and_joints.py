"""Messages of ROS and tables of joints, read by readers that know nothing of how they were written."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rigid_motions import ball_pendulum, tumbling_box

import stc
from stc.errors import UsageError
from stc.solution import Solution
from stc.validate.export import export, format_of
from stc.validate.setup import prepare


@pytest.fixture(scope="module")
def lamp() -> Solution:
    return stc.load("luxo_poses").solve()


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open() as stream:
        header, *rows = csv.reader(stream)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def test_a_trajectory_is_the_message_of_ros(lamp: Solution, tmp_path: Path) -> None:
    yaml = pytest.importorskip("ruamel.yaml", reason="rosbags, which brings it, is not installed")
    typestore = pytest.importorskip("rosbags.typesys")
    content = yaml.YAML(typ="safe").load(StringIO(export(lamp, "ros", tmp_path / "a.yaml").read_text()))
    store = typestore.get_typestore(typestore.Stores.ROS2_JAZZY)
    kinds = {name.rsplit("/", 1)[1]: kind for name, kind in store.types.items()}
    points = [
        kinds["JointTrajectoryPoint"](
            **{
                name: kinds["Duration"](**value)
                if name == "time_from_start"
                else np.array(value, dtype=np.float64)
                for name, value in point.items()
            }
        )
        for point in content["points"]
    ]
    header = content["header"]
    message = kinds["JointTrajectory"](
        header=kinds["Header"](stamp=kinds["Time"](**header["stamp"]), frame_id=header["frame_id"]),
        joint_names=content["joint_names"],
        points=points,
    )
    name = "trajectory_msgs/msg/JointTrajectory"
    again = store.deserialize_cdr(store.serialize_cdr(message, name), name)
    assert again.joint_names == ["hip", "elbow", "neck"]
    times = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in again.points])
    np.testing.assert_allclose(times, lamp.time, atol=1e-9)
    assert np.all(np.diff(times) > 0)
    for k, (angle, torque) in enumerate((("a1", "u1"), ("a2", "u2"), ("a3", "u3"))):
        for field, wanted in (
            ("positions", lamp[angle]),
            ("velocities", lamp[f"{angle}'"]),
            ("accelerations", lamp[f"{angle}''"]),
            ("effort", lamp[torque]),
        ):
            found = np.array([getattr(point, field)[k] for point in again.points])
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


def test_joints_in_a_table_have_units_and_are_mujocos(lamp: Solution, tmp_path: Path) -> None:
    found = table(export(lamp, "joints", tmp_path / "a.csv", rate=100.0))
    setup = prepare(lamp)
    model, data = setup.model(contacts=False), mujoco.MjData(setup.compiled)
    np.testing.assert_allclose(found["time [s]"], np.append(np.arange(20) / 100, lamp.duration), atol=1e-12)
    names = ["hip", "elbow", "neck"]
    for k in range(0, 20, 5):
        for name in names:
            data.joint(name).qpos[:] = found[f"joint.{name} [rad]"][k]
            data.joint(name).qvel[:] = found[f"joint.{name}' [rad/s]"][k]
            data.joint(name).qacc[:] = found[f"joint.{name}'' [rad/s^2]"][k]
        mujoco.mj_inverse(model, data)
        torques = [found[f"torque.{name} [N m]"][k] for name in names]
        np.testing.assert_allclose(torques, data.qfrc_inverse, atol=1e-2 * np.abs(torques).max())
    assert "actuator.hip [ctrl]" in found


def test_free_and_ball_joints_have_their_parts(tmp_path: Path) -> None:
    box = table(export(tumbling_box(tmp_path), "joints", tmp_path / "box.csv"))
    assert {"joint.root.x [m]", "joint.root.qw [1]", "joint.root.x' [m/s]", "joint.root.wx [rad/s]"} <= set(
        box
    )
    assert {"joint.root.wx' [rad/s^2]", "torque.root.z [N]", "torque.root.wy [N m]"} <= set(box)
    pendulum = ball_pendulum(tmp_path)
    text = export(pendulum, "ros", tmp_path / "p.yaml").read_text()
    assert "# not in here: left/hip, which has several coordinates" in text
    assert '- "elbow"' in text
    with pytest.raises(UsageError, match=r"no motor of .* moves a joint of one coordinate"):
        export(tumbling_box(tmp_path), "ros", tmp_path / "b.yaml")


def test_the_suffix_tells_the_format() -> None:
    wanted = {
        "a.usda": "usd",
        "a.usdc": "usd",
        "b.yaml": "ros",
        "b.YML": "ros",
        "c.csv": "csv",
        "d.glb": "gltf",
    }
    assert {name: format_of(name) for name in wanted} == wanted
    with pytest.raises(UsageError, match="no format has this suffix"):
        format_of("motion.bvh")
