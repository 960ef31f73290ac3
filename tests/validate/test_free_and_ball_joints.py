"""Motions of free and ball joints are judged as those of hinges and slides are, orientations by angles of rotation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rigid_motions import BALL, BOX, QUATERNION, ball_pendulum, held, made, motion, tumbling_box

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate import ModelError, validate
from stc.validate.certificate import certify
from stc.validate.metrics import Metric
from stc.validate.robustness import robustness
from stc.validate.rotations import angle_between, rotation_between, turned
from stc.validate.steps import step_errors
from stc.validate.verdict import open_setup, run_replays


def values(metrics: list[Metric], name: str) -> dict[str, float]:
    return {metric.subject: metric.value for metric in metrics if metric.name == name}


def test_rotations_are_those_of_mujoco() -> None:
    rng = np.random.default_rng(1)
    start, end = rng.standard_normal((2, 50, 4))
    start, end = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (start, end))
    wanted = np.zeros((50, 3))
    for row, a, b in zip(wanted, start, end):
        mujoco.mju_subQuat(row, b, a)
    found = rotation_between(start, end)
    np.testing.assert_allclose(found, wanted, atol=1e-12)
    np.testing.assert_allclose(angle_between(start, -end), np.linalg.norm(wanted, axis=1), atol=1e-12)
    np.testing.assert_allclose(angle_between(turned(start, found), end), 0.0, atol=1e-7)


def test_deviations_are_those_of_the_models_tangent_space(tmp_path: Path) -> None:
    setup = open_setup(ball_pendulum(tmp_path))
    rng, model = np.random.default_rng(2), setup.compiled
    first, second = rng.standard_normal((2, model.nq))
    for pose in (first, second):
        mujoco.mj_normalizeQuat(model, pose)
    wanted = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, wanted, 1.0, first, second)
    positions, velocities = setup.reference.positions, setup.reference.velocities
    found = setup.reference.deviation(first[positions], second[positions])
    np.testing.assert_allclose(found, wanted[velocities], atol=1e-12)
    back = setup.reference.moved(first[positions], found)
    np.testing.assert_allclose(setup.reference.deviation(back, second[positions]), 0.0, atol=1e-7)


def test_a_tumbling_box_passes(tmp_path: Path) -> None:
    certificate = certify(tumbling_box(tmp_path))
    assert certificate.passed, certificate.headline
    metrics = certificate.report.metrics
    drifts = values(metrics, "open-loop drift, largest")
    assert list(drifts) == ["joint root.x", "joint root.y", "joint root.z", "joint root.rotation"]
    assert drifts["joint root.rotation"] < 1e-9
    assert max(values(metrics, "inverse-dynamics residual").values()) < 1e-12
    assert list(values(metrics, "inverse-dynamics residual"))[3:] == [f"joint root.w{axis}" for axis in "xyz"]


def test_a_ball_joint_with_motors_passes_and_is_tracked_by_a_regulator(tmp_path: Path) -> None:
    certificate = certify(ball_pendulum(tmp_path))
    assert certificate.passed, certificate.headline
    assert certificate.report.tracked_by == "LQR"
    assert max(values(certificate.report.metrics, "feedback share").values()) < 1e-3


def test_a_regulator_brings_a_ball_joint_back(tmp_path: Path) -> None:
    solution = ball_pendulum(tmp_path)
    lines = [
        replace(line, value=_changed(line.value, 0.1)) if line.path == ("y",) else line
        for line in solution.replay
    ]
    replays = run_replays(open_setup(made(tmp_path, _times(solution), lines)))
    (ball, _), tracked = replays.setup.ties, replays.tracked
    assert tracked is not None
    open_loop = ball.distances(replays.open_loop.positions).max()
    assert open_loop > 0.01
    assert ball.distances(tracked.positions).max() < 0.2 * open_loop


def test_the_sign_of_a_quaternion_says_nothing(tmp_path: Path) -> None:
    solution = tumbling_box(tmp_path)
    at = np.arange(solution.n + 1)
    sign, half = np.where(at % 3 == 1, -1.0, 1.0), np.where(at[:-1] % 2, -1.0, 1.0)

    def flipped(channel: Channel | None) -> Channel | None:
        if channel is None or channel.mid is None:
            return None
        return Channel(sign * channel.before, sign * channel.after, half * channel.mid)

    lines = []
    for line in solution.replay:
        if line.path[-1] in QUATERNION:
            value = flipped(line.value)
            assert value is not None
            line = replace(line, value=value, rate=flipped(line.rate))
        lines.append(line)
    certificate = certify(made(tmp_path, _times(solution), lines))
    assert certificate.passed, certificate.headline


def test_drift_of_an_orientation_is_the_angle_of_the_rotation(tmp_path: Path) -> None:
    setup = open_setup(tumbling_box(tmp_path))
    place, orientation = setup.ties[0], setup.ties[3]
    exact = np.concatenate(
        [np.stack([c.before for c in tie.channels(0)], axis=-1) for tie in setup.ties], axis=1
    )
    assert orientation.distances(exact).max() < 1e-7
    about = np.array([0.0, 0.0, 0.03])
    exact[:, 3:] = -turned(exact[:, 3:], np.broadcast_to(about, (len(exact), 3)))
    np.testing.assert_allclose(orientation.distances(exact), 0.03, rtol=1e-9)
    assert place.distances(exact).max() == 0.0
    assert orientation.extent > 3.0  # upside down


def test_each_step_by_itself_is_compared_by_angles(tmp_path: Path) -> None:
    errors = step_errors(open_setup(tumbling_box(tmp_path)))
    assert errors.max() < 1e-6


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("make", [tumbling_box, ball_pendulum])
def test_steps_err_by_their_fourth_power(tmp_path: Path, make: object) -> None:
    drifts = []
    for n in (10, 20):
        solution = make(tmp_path, n)  # type: ignore[operator]
        setup = open_setup(solution)
        shares = np.array([0.3])
        poses = np.array([setup.reference.in_step(k, shares)[0][0] for k in range(n)])
        fine = make(tmp_path, 10 * n)  # type: ignore[operator]
        reference = open_setup(fine).reference
        truth = np.array([reference.at("after", 10 * k + 3)[0] for k in range(n)])
        drifts.append(np.abs(reference.deviation(truth, poses)).max())
    assert drifts[0] / drifts[1] > 2**3.3


@pytest.mark.daily_every(3)
@pytest.mark.parametrize(
    ("make", "right", "wrong", "named"),
    [
        (tumbling_box, '0.05 0.06"', '0.055 0.06"', "body.box.inertia.y were 0.05 instead of 0.055"),
        (ball_pendulum, 'gear="2 0 0"', 'gear="-2 0 0"', "actuator.x.gear were 2 instead of -2"),
        (ball_pendulum, 'gear="0 2 0"', 'gear="0 0 2"', "actuator.y.gear were 0 2 0 instead of 0 0 2"),
        (ball_pendulum, 'armature="0.02"', "", "joint.elbow.armature were 0.02 instead of 0"),
        (ball_pendulum, 'armature="0.01"', "", "joint.left/hip.armature were 0.01 instead of 0"),
        (ball_pendulum, 'damping="0.03"', "", "joint.left/hip.damping were 0.03 instead of 0"),
        (ball_pendulum, 'mass="0.4"', 'mass="0.5"', "body.forearm.mass were 0.4 instead of 0.5"),
        (ball_pendulum, 'pos="0 0 -0.4"', 'pos="0 0 -0.45"', "body.forearm.pos.z were -0.4 instead of -0.45"),
        (ball_pendulum, 'axis="0 1 0.2"', 'axis="0 1 0"', "the axis of joint.elbow were 0 0.980581 0.196116"),
    ],
)
def test_what_is_wrong_in_the_model_is_named(
    tmp_path: Path, make: object, right: str, wrong: str, named: str
) -> None:
    solution = make(tmp_path)  # type: ignore[operator]
    text = (tmp_path / "model.xml").read_text()
    assert right in text
    (tmp_path / "model.xml").write_text(text.replace(right, wrong))
    certificate = certify(solution)
    assert not certificate.passed
    assert named in certificate.headline
    assert "inverse-dynamics residual" in certificate.headline


#: A hinge whose axis is another one than in the equations.
ARM = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="a" pos="0 0 1"><joint name="one" axis="0 0 1"/>
  <inertial pos="0.2 0 0" mass="1" diaginertia="0.01 0.02 0.03"/><body name="b" pos="0.4 0 0">
  <joint name="two" axis="0 1 0"/><inertial pos="0.2 0.05 0" mass="0.5" diaginertia="0.002 0.004 0.005"/></body></body>
  </worldbody><actuator><motor name="one" joint="one"/><motor name="two" joint="two"/></actuator></mujoco>"""


def test_a_swapped_axis_is_named(tmp_path: Path) -> None:
    start = ([0.0, 0.3], [1.0, 0.5])
    solution = motion(tmp_path, ARM, start, lambda t: [np.cos(3 * t), 1.5 + np.sin(4 * t)], n=80)
    assert certify(solution).passed
    (tmp_path / "model.xml").write_text(ARM.replace('"two" axis="0 1 0"', '"two" axis="1 0 0"'))
    assert "the axis of joint.two were 0 1 0 instead of 1 0 0" in certify(solution).headline


def test_a_missing_part_is_named(tmp_path: Path) -> None:
    solution = tumbling_box(tmp_path)
    lines = [line for line in solution.replay if line.path[-1] not in ("qz", "wx")]
    with pytest.raises(ModelError, match=r"joint root: the replay section lacks its \.qz, \.wx"):
        validate(made(tmp_path, _times(solution), lines))


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (("root",), r"a free joint has several coordinates: write its \.x, \.y"),
        (("root", "pitch"), r"a free joint has several coordinates"),
        (("rout", "x"), r"the model has no joint rout\.x"),
    ],
)
def test_a_path_that_is_no_part_is_told_of(tmp_path: Path, path: tuple[str, ...], message: str) -> None:
    solution = tumbling_box(tmp_path)
    lines = [*solution.replay, replace(solution.replay[0], path=path)]
    with pytest.raises(ModelError, match=message):
        validate(made(tmp_path, _times(solution), lines))


def test_joints_without_a_name_are_called_by_their_bodies(tmp_path: Path) -> None:
    solution = tumbling_box(tmp_path)
    (tmp_path / "model.xml").write_text(BOX.replace(' name="root"', ""))
    lines = [replace(line, path=("box", *line.path[1:])) for line in solution.replay]
    assert certify(made(tmp_path, _times(solution), lines)).passed


def test_a_ball_joint_beyond_its_angle_is_found(tmp_path: Path) -> None:
    limited = BALL.replace('type="ball"', 'type="ball" range="0 1" limited="true"')
    solution = ball_pendulum(tmp_path)
    (tmp_path / "model.xml").write_text(limited.replace("<option", '<compiler angle="radian"/><option'))
    beyond = values(validate(solution).metrics, "joint beyond its range")
    quaternion = np.array([np.r_[c.value.before, c.value.after, c.value.mid] for c in _quaternion(solution)])
    assert beyond["joint left/hip"] == pytest.approx(2 * np.arccos(np.abs(quaternion[0]).min()) - 1, rel=1e-6)


def test_an_orientation_that_jumps_is_found(tmp_path: Path) -> None:
    solution = tumbling_box(tmp_path)
    lines = list(solution.replay)
    quaternion = _quaternion(solution)
    after = np.stack([line.value.after for line in quaternion], axis=-1)
    after[20:] = turned(after[20:], np.broadcast_to([0.01, 0.0, 0.0], after[20:].shape[:1] + (3,)))
    for k, line in enumerate(quaternion):
        mid = line.value.mid
        assert mid is not None
        lines[lines.index(line)] = replace(line, value=Channel(line.value.before, after[:, k], mid))
    found = validate(made(tmp_path, _times(solution), lines))
    assert values(found.metrics, "jump of position")["joint root.rotation"] == pytest.approx(0.01, rel=1e-6)


def test_perturbed_replays_turn_ball_joints(tmp_path: Path) -> None:
    found = robustness(open_setup(ball_pendulum(tmp_path)), 4, kinds=("none", "start"))
    still, start = found.envelopes
    assert still.joints.max() < 1e-3
    assert np.all(np.isfinite(start.joints)) and start.joints.max() > still.joints.max()


#: A box that stands on four points of its body, of which the model tells by no site.
STANDING = """<mujoco><option gravity="0 0 -9.81" timestep="0.001"/><worldbody>
  <geom name="floor" type="plane" size="5 5 0.1" solref="0.004 1"/>
  <body name="box" pos="0 0 0.1"><freejoint name="root"/>
    <geom name="box" type="box" size="0.2 0.15 0.1" mass="4" solref="0.004 1"/></body></worldbody></mujoco>"""


def standing(folder: Path, lines: list[ReplayChannel], n: int = 20) -> Solution:
    """The box at rest under these forces."""
    (folder / "model.xml").write_text(STANDING)
    pose = dict(zip(("x", "y", "z", *QUATERNION), (0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0)))
    still = held(0.0, n)
    joints = [
        ReplayChannel("joint", ("root", part), held(value, n), still, still) for part, value in pose.items()
    ]
    joints += [ReplayChannel("joint", ("root", part), still, still) for part in ("wx", "wy", "wz")]
    return made(folder, np.linspace(0.0, 0.4, 2 * n + 1), [*joints, *lines])


def force(path: tuple[str, ...], value: float, n: int = 20) -> ReplayChannel:
    return ReplayChannel("contact", path, held(value, n))


def test_a_box_on_four_points_of_its_body_passes(tmp_path: Path) -> None:
    corners = [("0.2", "0.15"), ("0.2", "-0.15"), ("-0.2", "0.15"), ("-0.2", "-0.15")]
    lines = [
        force(("body", "box", x, y, "-0.1", part), 9.81 * (part == "fz"))
        for x, y in corners
        for part in FORCE
    ]
    certificate = certify(standing(tmp_path, lines))
    assert certificate.passed, certificate.headline


FORCE = ("fx", "fy", "fz")


def test_the_middle_of_a_sole_is_its_lower_face(tmp_path: Path) -> None:
    level = {"fx": 0.0, "fy": 0.0, "fz": 4 * 9.81, "mx": 0.0, "my": 0.0, "mz": 0.0}
    lines = [force(("geom", "box", part), value) for part, value in level.items()]
    certificate = certify(standing(tmp_path, lines))
    assert certificate.passed, certificate.headline


def test_a_point_beyond_the_sole_is_found(tmp_path: Path) -> None:
    lines = [
        force(("body", "box", "0.3", "0", "-0.1", "fz"), 4 * 9.81),
        force(("body", "box", "my"), 4 * 9.81 * 0.3),
    ]
    found = validate(standing(tmp_path, lines))
    assert (
        max(values(found.metrics, "inverse-dynamics residual").values()) < 1e-9
    )  # the forces do balance ...
    lines = lines[:1]
    found = validate(standing(tmp_path, lines))
    residual = values(found.metrics, "inverse-dynamics residual")
    assert residual["joint root.wy"] == pytest.approx(0.3, rel=1e-6)  # ... and without the moment they do not


def _quaternion(solution: Solution) -> list[ReplayChannel]:
    return [line for line in solution.replay if line.path[-1] in QUATERNION]


def _times(solution: Solution) -> np.ndarray:
    return np.linspace(solution.time[0], solution.time[-1], 2 * solution.n + 1)


def _changed(channel: Channel, by: float) -> Channel:
    assert channel.mid is not None
    return Channel.smooth(channel.before + by, channel.mid + by)
