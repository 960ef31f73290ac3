"""Motions on the ground and of the free segment: solved from their own files and repeated by MuJoCo.

The quick ones run always; the others with ``pytest -m nightly``.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import mujoco
import numpy as np
import pytest

import stc
from stc.solution import Solution
from stc.testing import assert_physical
from stc.validate import validate
from stc.validate.contact import contact_metrics
from stc.validate.replay import replay
from stc.validate.report import Report
from stc.validate.tracking import proportional
from stc.validate.verdict import open_setup

pytestmark = pytest.mark.slow

FRICTION = 0.6
PROBLEMS = Path(__file__).parent / "problems" / "luxo"
OTHERS = [
    "luxo_hurdle",
    "luxo_step_up",
    "luxo_step_down",
    "luxo_heavy",
    "luxo_moon",
    "luxo_two_jumps",
    "luxo_backflip",
]


def value(report: Report, name: str, subject: str) -> float:
    return next(m.value for m in report.metrics if (m.name, m.subject) == (name, subject))


def largest_joint(report: Report, name: str) -> float:
    return max(m.value for m in report.metrics if m.name == name and m.subject.startswith("joint"))


def solved(name: str) -> Solution:
    found = stc.load(name).solve()
    assert found.status == "optimal"
    return found


@pytest.fixture(scope="module")
def jump() -> Solution:
    return solved("luxo_jump")


def test_the_lamp_jumps_open_loop(jump: Solution, tmp_path: Path) -> None:
    jump.save(tmp_path / "jump.npz")
    report = validate(tmp_path / "jump.npz")
    assert value(report, "open-loop error on the ground, RMS", "base") <= 1e-3
    assert largest_joint(report, "open-loop error on the ground, RMS") <= 5e-3
    assert value(report, "open-loop error on the ground, at the end", "base") <= 1e-3
    assert largest_joint(report, "open-loop error on the ground, at the end") <= 2e-2
    assert value(report, "tracked error on the ground, RMS", "base") <= 1e-3
    assert largest_joint(report, "tracked error on the ground, RMS") <= 1e-3
    for joint in ("hip", "elbow", "neck"):
        assert value(report, "feedback share", f"actuator {joint}") <= 0.02
    assert largest_residual(report) <= 1e-9


def largest_residual(report: Report) -> float:
    return max(m.value for m in report.metrics if m.name == "inverse-dynamics residual")


def check_heavier(motion: Solution) -> None:
    """Tracked with all masses and inertias 1 % larger than the motion was solved for."""
    setup = open_setup(motion)
    feedback = proportional(setup)
    assert feedback is not None
    setup.compiled.body_mass *= 1.01
    setup.compiled.body_inertia *= 1.01
    found = replay(setup, 1e-4, feedback=feedback)
    errors = {m.subject: m.value for m in contact_metrics("tracked", setup, found)}
    assert set(errors) == {"base", "joint pitch", "joint hip", "joint elbow", "joint neck"}
    assert max(errors.values()) <= 5e-3
    assert np.all(found.feedback <= 0.05 * found.total)  # of each motor's own torque, the worst one's too


def test_feedback_holds_the_jump_with_heavier_bodies(jump: Solution) -> None:
    check_heavier(jump)


#: Bodies from the ground upwards.  Neighbours in this order meet in a joint, and the arms pass inside one another.
_ORDER = {"world": 0, "step": 0, "hurdle": 0, "base": 1, "lower_arm": 2, "upper_arm": 3, "head": 4}


def least_distances(motion: Solution) -> dict[tuple[str, str], float]:
    """The least distances between bodies that are not joined, as they are seen, in m; negative where they overlap."""
    setup = open_setup(motion)
    model, found = setup.model(), dict[tuple[str, str], float]()
    data = mujoco.MjData(model)
    bodies = [model.body(int(body)).name for body in model.geom_bodyid]
    pairs = [
        (first, second)
        for first, second in itertools.combinations(range(model.ngeom), 2)
        if _ORDER[bodies[second]] - _ORDER[bodies[first]] > 1
        or (bodies[first], bodies[second]) in {("world", "base"), ("step", "base"), ("hurdle", "base")}
        or (bodies[second], bodies[first]) in {("step", "base"), ("hurdle", "base")}
    ]
    pairs += [
        (second, first)
        for first, second in itertools.combinations(range(model.ngeom), 2)
        if _ORDER[bodies[first]] - _ORDER[bodies[second]] > 1
    ]
    for step in range(motion.n):
        for position, velocity in zip(*setup.reference.in_step(step, np.array([0.0, 0.5]))[:2]):
            setup.reference.put(data, [position, velocity])
            mujoco.mj_kinematics(model, data)
            for pair in pairs:
                first, second = sorted(pair, key=lambda geom: _ORDER[bodies[geom]])
                key = (bodies[first], bodies[second])
                apart = mujoco.mj_geomDistance(model, data, first, second, 0.3, None)
                found[key] = min(apart, found.get(key, np.inf))
    return found


def check_clear(motion: Solution) -> None:
    """Nothing passes through anything, only the foot touches the ground, no joint leaves its range."""
    for (first, second), apart in least_distances(motion).items():
        standing = second == "base" and first in ("world", "step")
        assert apart >= (-2e-4 if standing else 1e-3), (first, second, apart)
    for joint, (lower, upper) in {"a1": (-1.4, 1.4), "a2": (0.15, 2.6), "a3": (-0.5, 2.4)}.items():
        assert lower - 1e-6 <= motion[joint].min() and motion[joint].max() <= upper + 1e-6


def test_nothing_passes_through_anything(jump: Solution) -> None:
    check_clear(jump)


def check_ground(motion: Solution, takeoff: int, touchdown: int) -> None:
    """The ground pushes, never pulls, within its cone; nothing acts in flight; the foot lands gently and stays."""
    stance = np.r_[0:takeoff, touchdown : motion.n + 1]
    up, along, turn = motion["sole_fz"], motion["sole_fx"], motion["sole_my"]
    assert up[stance].min() >= -1e-6
    assert np.all(np.abs(along[stance]) <= FRICTION * up[stance] + 1e-6)
    assert np.all(np.abs(turn[stance]) <= 0.1 * up[stance] + 1e-6)
    assert np.abs(up[takeoff + 1 : touchdown]).max() <= 1e-6
    assert motion["sole_jz1"] >= -1e-8
    assert abs(motion["sole_jx1"]) <= FRICTION * motion["sole_jz1"] + 1e-6
    speed = np.hypot(motion.before["x'"][touchdown], motion.before["z'"][touchdown])
    # The lamp's centre of mass comes down at about g T2/2 = 2 m/s: its legs take two thirds of that off the foot.
    assert speed <= 0.7
    for name in ("x", "z"):
        assert np.ptp(motion[name][:takeoff]) <= 1e-8
        assert np.ptp(motion[name][touchdown:]) <= 1e-8


def test_the_ground_does_only_what_a_ground_can(jump: Solution) -> None:
    check_ground(jump, 40, 72)


def test_in_flight_momentum_changes_by_weight_alone(jump: Solution) -> None:
    masses = [jump.constants[f"m{k}"] for k in range(4)]
    lengths = {name: jump.constants[name] for name in ("lb", "l1", "l2", "d0", "d1", "d2", "d3")}
    p1 = jump["th"] + jump["a1"]
    p2, p3 = p1 + jump["a2"], p1 + jump["a2"] + jump["a3"]
    hip = jump["z"] + lengths["lb"] * np.cos(jump["th"])
    elbow = hip + lengths["l1"] * np.cos(p1)
    neck = elbow + lengths["l2"] * np.cos(p2)
    heights = [
        jump["z"] + lengths["d0"] * np.cos(jump["th"]),
        hip + lengths["d1"] * np.cos(p1),
        elbow + lengths["d2"] * np.cos(p2),
        neck + lengths["d3"] * np.cos(p3),
    ]
    centre = sum(m * z for m, z in zip(masses, heights)) / sum(masses)
    time, flight = jump.time[40:73], centre[40:73]
    parabola = np.polyfit(time, flight, 2)
    assert 2 * parabola[0] == pytest.approx(-jump.constants["g"], rel=1e-4)
    assert np.abs(np.polyval(parabola, time) - flight).max() <= 1e-5  # the error of the transcription


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", ["segment_to_pose", "segment_flip", "segment_swing"])
def test_the_segment_goes_where_it_should(name: str, tmp_path: Path) -> None:
    solved(name).save(tmp_path / "segment.npz")
    report = validate(tmp_path / "segment.npz")
    assert report.passed, [m for m in report.metrics if m.verdict == "fail"]
    if name != "segment_swing":
        for joint in ("x", "z"):
            assert value(report, "open-loop drift, largest", f"joint {joint}") <= 2e-7


@pytest.mark.nightly
@pytest.mark.parametrize("name", OTHERS)
def test_other_jumps_are_repeated_by_the_simulator(name: str) -> None:
    motion = solved(name)
    report = assert_physical(motion).report
    assert largest_residual(report) <= 1e-9
    check_clear(motion)
    assert value(report, "tracked error on the ground, RMS", "base") <= 5e-3
    assert largest_joint(report, "tracked error on the ground, RMS") <= 5e-3
    for joint in ("hip", "elbow", "neck"):
        assert value(report, "feedback share", f"actuator {joint}") <= 0.05


@pytest.mark.nightly
@pytest.mark.parametrize(("method", "least"), [("hermite-simpson", 3.3), ("trapezoidal", 1.8)])
def test_steps_converge_with_their_order_in_every_phase(jump: Solution, method: str, least: float) -> None:
    """The solved contact forces act in place of the floor; each phase starts from the solved state."""
    drifts, last = [], jump
    for k in (2, 4, 8):
        last = stc.load("luxo_jump").solve(k=k, method=method, warm_start=last)
        assert last.status == "optimal"
        setup = open_setup(last)
        motion = replay(setup, 1e-4, external=True)
        phases = [slice(1, 20 * k + 1), slice(20 * k + 1, 36 * k + 1), slice(36 * k + 1, 60 * k + 1)]
        drifts.append(
            [
                max(
                    float(np.abs(motion.positions[phase, tie.position] - tie.line.value.before[phase]).max())
                    for tie in setup.ties
                )
                for phase in phases
            ]
        )
    orders = np.log2(np.array(drifts[1]) / np.array(drifts[2]))
    assert orders.min() >= least


@pytest.mark.parametrize("name", ["luxo_crouch", "luxo_thrown"])
def test_central_differences_converge_in_stance_and_in_flight(name: str) -> None:
    """Over a jump they have no order to show: a torque that jumps would straddle two frames."""
    drifts, last = [], None
    for n in (20, 40, 80):
        last = stc.load(PROBLEMS / f"{name}.stc").solve(n=n, warm_start=last)
        assert last.status == "optimal" and last.method == "central"
        setup = open_setup(last)
        motion = replay(setup, external=True)
        drifts.append(
            max(np.abs(motion.positions[:, t.position] - t.line.value.before).max() for t in setup.ties)
        )
    assert np.log2(drifts[1] / drifts[2]) >= 1.8
