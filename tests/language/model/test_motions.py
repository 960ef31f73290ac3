"""Motions stated by a model obey MuJoCo's equations, and what their pages say."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from stc.problem import ConstantRef, IndexRef
from stc.solution import Solution
from stc.symbolic.expr import evaluate

from .bodies import FEET, load, put, quadruped, residual

HOP = f"""constants: n = 30, T = 0.8, h = T/n, D = 0.4;
{FEET}
  [0, 10]: FL; FR; RL; RR;
  [20, n]: FL; FR; RL; RR;
constraints:
  [0]: keyframe.stand;  rest;
  [n]: keyframe.stand + (D, 0, 0);  rest;
objective: [0, n]: integral(effort);
"""


BENT = ", ".join(f"joint.{leg}h = 1, joint.{leg}k = -2" for leg in ("FL", "FR", "RL", "RR"))


@pytest.fixture(scope="module")
def hop(tmp_path_factory: pytest.TempPathFactory) -> Solution:
    return load(tmp_path_factory.mktemp("hop"), quadruped(), HOP).solve()


def test_a_hop_obeys_the_equations_of_mujoco(hop: Solution) -> None:
    assert hop.status == "optimal"
    assert hop.method == "hermite-simpson"
    assert residual(hop, quadruped(), ("FL", "FR", "RL", "RR")) < 1e-9


def test_a_hop_ends_in_the_pose_that_is_asked_for(hop: Solution) -> None:
    assert hop["joint.root.x"][-1] - hop["joint.root.x"][0] == pytest.approx(0.4, abs=1e-3)
    assert hop["joint.FLh"][-1] == pytest.approx(0.8, abs=1e-2)
    assert hop["joint.RRk"][0] == pytest.approx(-1.6, abs=1e-12)


def test_feet_have_no_force_in_flight_and_stay_in_the_cone(hop: Solution) -> None:
    for foot in ("FL", "FR", "RL", "RR"):
        x, y, z = (hop[f"{foot}_f{axis}"] for axis in "xyz")
        assert np.abs(z[11:20]).max() < 1e-9
        weight = 9.81 * 13.6
        assert (np.hypot(x, y) <= 0.7 * z + 1e-3 * weight).all()
        assert z.min() > -1e-6


@pytest.mark.slow
def test_what_stands_takes_no_impulse_beyond_its_friction_while_a_foot_lands(tmp_path: Path) -> None:
    """A foot is lifted and put down on three others: by Coulomb's law a foot that does not press does not rub."""
    spec = f"""constants: n = 12, T = 1, h = T/n;
    {FEET}
      [0, n]: FR; RL; RR;  [0, 4]: FL;  [8, n]: FL;
    constraints: [0]: keyframe.stand; rest;  [6]: site.FL.z = 0.15;  [n]: keyframe.stand; rest;
    objective: [0, n]: integral(effort);"""
    solution = load(tmp_path, quadruped(), spec).solve()
    assert solution.status == "optimal"
    for foot, end in (("FL", "1"), ("FR", "_impact1"), ("RL", "_impact1"), ("RR", "_impact1")):
        x, y, z = (float(solution[f"{foot}_j{axis}{end}"]) for axis in "xyz")
        assert np.hypot(x, y) <= 0.7 * z + 1e-6


def test_quaternions_stay_unit(hop: Solution) -> None:
    norm = sum(hop[f"joint.root.q{part}"] ** 2 for part in "wxyz")
    assert np.abs(norm - 1.0).max() < 1e-9


def test_a_pose_to_pose_motion_with_its_feet_held_keeps_them(tmp_path: Path) -> None:
    spec = f"""constants: n = 12, T = 0.4, h = T/n;
    {FEET} [0, n]: FL; FR; RL; RR;
    poses: crouch = keyframe.stand grounded, {BENT};
    constraints: [0]: keyframe.stand; rest;  [n]: crouch; rest;
    objective: [0, n]: integral(effort);"""
    solution = load(tmp_path, quadruped(), spec).solve()
    assert solution.status == "optimal"
    assert solution["joint.root.z"][-1] == pytest.approx(0.426 * np.cos(1.0), abs=1e-4)
    assert solution["joint.RLk"][-1] == pytest.approx(-2.0, abs=1e-3)
    assert residual(solution, quadruped(), ("FL", "FR", "RL", "RR")) < 1e-9


BOX = """<mujoco><worldbody><body name="box"><freejoint name="root"/>
  <geom type="box" size=".1 .2 .3" mass="2"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_a_thrown_box_flies_along_a_parabola_and_keeps_its_angular_momentum(
    tmp_path: Path, method: str
) -> None:
    spec = f"""constants: n = 40, T = 1, h = T/n;
    method: {method};
    constraints:
      [0]: keyframe.reference; joint.root.x' = 2; joint.root.y'; joint.root.z' = 3;
           joint.root.wx = 0.5; joint.root.wy = 3; joint.root.wz = 0.4;"""
    model = load(tmp_path, BOX, spec)
    solution = model.solve()
    assert solution.violation < 1e-8
    t = solution.time
    assert np.abs(solution["joint.root.x"] - 2 * t).max() < 1e-2
    assert np.abs(solution["joint.root.z"] - (3 * t - 4.905 * t**2)).max() < 2e-2
    inertia = 2.0 / 3.0 * np.array([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2])
    momentum = []
    for k in (1, 20, 39):
        w, x, y, z = (solution[f"joint.root.q{part}"][k] for part in "wxyz")
        spin = inertia * [solution[f"joint.root.w{axis}"][k] for axis in "xyz"]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        momentum.append(turn @ spin)
    spread = np.abs(np.array(momentum) - momentum[0]).max() / np.linalg.norm(momentum[0])
    assert spread < (1e-5 if method == "hermite-simpson" else 3e-2)


BALL = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="bob" pos="0 0 1">
  <joint name="hip" type="ball" damping="0.05"/>
  <geom type="capsule" fromto="0 0 0 .1 0 -.4" size=".03" mass="1"/></body>
  </worldbody><actuator>
  <motor name="x" joint="hip" gear="1 0 0"/><motor name="y" joint="hip" gear="0 1 0"/>
  <motor name="z" joint="hip" gear="0 0 1"/>
  </actuator></mujoco>"""


def test_a_ball_joint_turns_where_it_is_told(tmp_path: Path) -> None:
    spec = """constants: n = 30, T = 1, h = T/n;
    constraints: [0]: keyframe.reference; rest;  [n]: keyframe.reference turned 2 about (0, 1, 1); rest;
    objective: [0, n]: integral(effort);"""
    solution = load(tmp_path, BALL, spec).solve()
    assert solution.status == "optimal"
    assert residual(solution, BALL) < 1e-9
    assert abs(2.0 * np.arccos(abs(solution["joint.hip.qw"][-1]))) == pytest.approx(2.0, abs=1e-9)


LOOP = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
  <body name="a"><joint name="a" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 .3" size=".02" mass="1"/>
    <body name="b" pos="0 0 .3"><joint name="b" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .4 0 0" size=".02" mass="1"/></body></body>
  <body name="c" pos=".4 0 0"><joint name="c" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 .3" size=".02" mass="1"/></body>
  </worldbody><equality><connect name="pin" body1="b" body2="c" anchor=".4 0 0"/></equality>
  <actuator><motor name="a" joint="a"/></actuator></mujoco>"""


def test_a_closed_loop_stays_closed(tmp_path: Path) -> None:
    spec = """constants: n = 30, T = 0.6, h = T/n;
    constraints: [0]: keyframe.reference; rest;  [n]: joint.a = 0.7; joint.a';
    objective: [0, n]: integral(effort);"""
    solution = load(tmp_path, LOOP, spec).solve()
    assert solution.status == "optimal"
    a, b, c = (solution[f"joint.{name}"] for name in "abc")
    # A parallelogram: the crank and the rocker turn alike, the coupler does not turn.
    assert np.abs(a - c).max() < 1e-6
    assert np.abs(a + b).max() < 1e-6


STATEFUL = """<mujoco><option gravity="0 0 0"/><worldbody><body>
  <joint name="x" type="slide" axis="1 0 0" frictionloss="0.2"/>
  <geom size=".1" mass="1"/></body></worldbody><actuator>
  <general name="lag" joint="x" dyntype="filter" dynprm="0.1" gainprm="5"
  ctrlrange="-1 1" ctrllimited="true"/></actuator></mujoco>"""


def test_activations_lag_and_dry_friction_is_mujocos(tmp_path: Path) -> None:
    spec = """constants: n = 40, T = 1.5, h = T/n;
    constraints: [0]: joint.x; joint.x'; actuator.lag.activation;  [n]: joint.x = 1; joint.x';
    objective: [0, n]: integral(actuator.lag^2);"""
    solution = load(tmp_path, STATEFUL, spec).solve()
    assert solution.status == "optimal"
    act, control = solution["actuator.lag.activation"], solution["actuator.lag"]
    assert np.abs(solution["actuator.lag.activation'"] - (control - act) / 0.1).max() < 1e-8
    rub = solution["joint.x.friction"]
    assert np.abs(solution["joint.x''"] - 5 * act - rub).max() < 1e-8
    model = mujoco.MjModel.from_xml_string(STATEFUL)
    data = mujoco.MjData(model)
    states = [solution[f"joint.x{primes}"] for primes in ("", "'", "''")]
    for k, (place, speed, acceleration) in enumerate(zip(*states, strict=True)):
        data.qpos[0], data.qvel[0], data.qacc[0] = place, speed, acceleration
        mujoco.mj_inverse(model, data)
        assert rub[k] == pytest.approx(float(data.qfrc_constraint[0]), abs=0.2 * 0.16)
    moving = solution["joint.x'"] > 0.1
    assert moving.sum() > 20
    assert np.abs(rub[moving] + 0.2).max() < 0.02 * 0.2


def test_a_mass_of_the_model_is_a_constant_of_the_spec(tmp_path: Path) -> None:
    spec = """constants: n = 20, T = 2, h = T/n;
    constraints: [0]: joint.x; joint.x'; actuator.lag.activation; [n]: joint.x = 1; joint.x';
    objective: [0, n]: integral(actuator.lag^2);"""
    model = load(tmp_path, STATEFUL.replace("<body>", '<body name="cart">'), spec)
    light, heavy = model.solve(), model.solve(constants={"body.cart.mass": 2.0})
    assert heavy.status == "optimal"
    assert heavy.objective > 1.5 * light.objective
    force = 5 * heavy["actuator.lag.activation"] + heavy["joint.x.friction"]
    assert np.abs(2.0 * heavy["joint.x''"] - force).max() < 1e-8


def test_a_number_that_is_zero_in_the_model_can_be_set(tmp_path: Path) -> None:
    spec = """constants: n = 20, T = 2, h = T/n;
    constraints: [0]: joint.x; joint.x'; actuator.lag.activation; [n]: joint.x = 1; joint.x';
    objective: [0, n]: integral(actuator.lag^2);"""
    model = load(tmp_path, STATEFUL, spec)
    light = model.solve()
    damped = model.solve(constants={"joint.x.damping": 0.5})
    assert damped.status == "optimal"
    assert damped.objective > light.objective
    force = 5 * damped["actuator.lag.activation"] + damped["joint.x.friction"]
    assert np.abs(damped["joint.x''"] + 0.5 * damped["joint.x'"] - force).max() < 1e-8
    assert {line.path for line in damped.replay if line.kind == "set"} >= {("joint", "x", "damping")}


TROT = f"""constants: n = 8, T = 0.3, h = T/n, v = 0.8;
{FEET}
  [0, 3]: FL; RR;
  [5, n]: FR; RL;
constraints: [0, n]: periodic mirrored + (v*T, 0, 0);
objective: [0, n]: integral(effort + 1e-2*joint.*''^2);
"""


def test_half_a_trot_ends_as_the_mirror_image_of_its_beginning(tmp_path: Path) -> None:
    solution = load(tmp_path, quadruped(), TROT).solve()
    assert solution.status == "optimal"
    assert residual(solution, quadruped(), ("FL", "FR", "RL", "RR")) < 1e-9
    place = {axis: solution[f"joint.root.{axis}"] for axis in "xyz"}
    assert place["x"][-1] - place["x"][0] == pytest.approx(0.8 * 0.3)
    assert place["y"][-1] == pytest.approx(-place["y"][0])
    for left, right in (("FL", "FR"), ("RL", "RR")):
        for joint, sign in (("a", -1.0), ("h", 1.0), ("k", 1.0)):
            for order in (0, 1):
                here, there = (solution.trajectories[f"joint.{leg}{joint}", order] for leg in (left, right))
                assert here.before[-1] == pytest.approx(sign * there.after[0], abs=1e-8)


def started(tmp_path: Path, spec: str, name: str) -> np.ndarray:
    """Where a variable starts from at every frame, (n+1,)."""
    problem = load(tmp_path, quadruped(), spec).problem()
    known = {ConstantRef(key): value for key, value in problem.constants.items()}
    found = np.full(problem.n + 1, np.nan)
    for guess in problem.guesses:
        if guess.name == name:
            for frame in range(guess.range.first, guess.range.last + 1):
                found[frame] = float(evaluate(guess.body, {**known, IndexRef(): float(frame)}))
    return found


def test_the_way_from_pose_to_pose_leads_through_a_guessed_one(tmp_path: Path) -> None:
    spec = f"""constants: n = 12, T = 0.4, h = T/n;
    poses: crouch = keyframe.stand, {BENT};
    constraints: [0]: keyframe.stand; rest;  [n]: keyframe.stand; rest;
    guess: [4]: crouch;"""
    knee = started(tmp_path, spec, "joint.FLk")
    assert knee[:5] == pytest.approx(np.linspace(-1.6, -2.0, 5))
    assert knee[4:] == pytest.approx(np.linspace(-2.0, -1.6, 9))


def test_a_side_without_a_counterpart_is_told(tmp_path: Path) -> None:
    sides = "".join(
        f'<body name="{name}"><joint name="{name}" axis="0 1 0"/><geom size=".1"/></body>'
        for name in ("hip_L", "hip_R", "left_arm", "lever")
    )
    text = f"<mujoco><worldbody><body><freejoint/><geom size='.1'/>{sides}</body></worldbody></mujoco>"
    spec = (
        "constants: n = 8, h = 0.1; constraints: [0, n]: periodic mirrored; objective: [0, n]: integral(0);"
    )
    (told,) = load(tmp_path, text, spec).problem().warnings
    assert "`left_arm` has no counterpart" in told.message


def test_a_mirrored_motion_starts_from_a_pose_and_its_mirror_image(tmp_path: Path) -> None:
    spec = """constants: n = 10, T = 0.4, h = T/n;
    poses: stride = keyframe.stand, joint.FLh = 1.2, joint.RRa = 0.2;
    constraints: [0, n]: periodic mirrored + (0.3, 0, 0);
    guess: [0]: stride;"""
    assert started(tmp_path, spec, "joint.FRh") == pytest.approx(np.linspace(0.8, 1.2, 11))
    assert started(tmp_path, spec, "joint.RLa") == pytest.approx(np.linspace(0.0, -0.2, 11))
    assert started(tmp_path, spec, "joint.root.x") == pytest.approx(np.linspace(0.0, 0.3, 11))


def test_a_periodic_motion_without_a_pose_starts_in_the_first_keyframe(tmp_path: Path) -> None:
    spec = "constants: n = 10, T = 0.4, h = T/n; constraints: [0, n]: periodic + (0.3, 0, 0);"
    assert started(tmp_path, spec, "joint.FLk") == pytest.approx(-1.6)
    assert started(tmp_path, spec, "joint.root.x") == pytest.approx(np.linspace(0.0, 0.3, 11))


#: Stops that push before the end of a range: of a slide, of a ball joint and of a tendon.
STOPS = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
  <body><joint name="s" type="slide" axis="1 0 0" limited="true" range="-1 1" margin="0.1"/>
    <geom size=".1" mass="1"/></body>
  <body pos="0 1 0"><joint name="b" type="ball" limited="true" range="0 1" margin="0.1"/>
    <geom type="box" size=".1 .2 .3" mass="1"/></body>
  <body pos="0 2 0"><joint name="t" type="slide" axis="1 0 0"/><geom size=".1" mass="1"/></body></worldbody>
  <tendon><fixed name="rope" limited="true" range="-1 1" margin="0.1"><joint joint="t" coef="2"/></fixed></tendon>
  <actuator><motor joint="s" name="s"/><motor joint="b" name="b" gear="1 0 0"/><motor joint="t" name="t"/></actuator>
</mujoco>"""


def test_no_stop_of_the_model_pushes_within_the_ranges_of_a_spec(tmp_path: Path) -> None:
    spec = """constants: n = 20, T = 1, h = T/n;
    constraints: [0]: keyframe.reference; rest;
    guess: joint.b.qx = 0.3*t;
    objective: [0, n]: integral(1e-3*effort);  [n]: -joint.s - joint.t - joint.b.qx;"""
    solution = load(tmp_path, STOPS, spec).solve()
    assert solution.status == "optimal"
    m = mujoco.MjModel.from_xml_string(STOPS)
    d = mujoco.MjData(m)
    for k in range(solution.n + 1):
        put(m, d, lambda name, order=0, k=k: float(solution.trajectories[name, order].before[k]))
        d.qvel[:] = 0.0
        mujoco.mj_forward(m, d)
        assert np.abs(d.qfrc_constraint).max(initial=0.0) < 1e-6
    # All of the ranges that the stops leave is used.
    assert solution["joint.s"][-1] == pytest.approx(0.9, abs=1e-6)
    assert solution["joint.t"][-1] == pytest.approx(0.45, abs=1e-6)
    assert 2.0 * np.arcsin(solution["joint.b.qx"][-1]) == pytest.approx(0.9, abs=1e-6)
