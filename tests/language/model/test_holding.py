"""What a model holds stays where it is: loops, feet and hands, by MuJoCo's kinematics."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from stc.errors import SpecError
from stc.solution import Solution
from stc.validate import validate

from .bodies import FEET, load, put, quadruped, residual

#: A crank, a coupler and a rocker, all of different lengths.
FOUR_BAR = """<mujoco><worldbody>
  <body name="a"><joint name="a" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 .2" size=".02" mass="1"/>
    <body name="b" pos="0 0 .2"><joint name="b" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .4 0 .1" size=".02" mass="1"/></body></body>
  <body name="c" pos=".4 0 0"><joint name="c" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 .3" size=".02" mass="1"/></body>
  </worldbody><equality><connect name="pin" body1="b" body2="c" anchor=".4 0 .1"/></equality>
  <actuator><motor name="a" joint="a"/></actuator></mujoco>"""

#: The crank turns.
TURN = """constants: n = 60, T = 0.8, h = T/n, turn = 2*pi;
constraints: [0]: keyframe.reference; rest;  [n]: joint.a = turn; joint.a';
objective: [0, n]: integral(effort);
"""
#: The coupler keeps its direction; the rocker stands still and leaves the loop open.
COUPLER = "guess: [0, n]: joint.a = turn*i/n; joint.b = -turn*i/n;"

#: A swing that nothing is left to choose in.
SWING = """constants: n = 20, T = 0.3, h = T/n;
method: {method};
constraints: [0]: keyframe.reference; rest;  [0, n]: actuator.a = 2*sin(8*t);
guess: [0, n]: joint.a = 0.5*(i/n)^2; joint.b = -0.5*(i/n)^2; joint.c = 0.5*(i/n)^2;
"""


def gaps(solution: Solution, model: str, side: str = "before") -> np.ndarray:
    """How far apart the ends of a loop are, by MuJoCo's own rows."""
    m = mujoco.MjModel.from_xml_string(model)
    d = mujoco.MjData(m)
    found = []
    for k in range(solution.n):
        put(m, d, lambda name, order=0, k=k: float(getattr(solution.trajectories[name, order], side)[k]))
        mujoco.mj_fwdPosition(m, d)
        equality = d.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        found.append(float(np.abs(d.efc_pos[equality]).max()))
    return np.array(found)


def sites(solution: Solution, model: str, name: str, side: str = "before") -> np.ndarray:
    """(n+1, 3) where a site is at the frames."""
    m = mujoco.MjModel.from_xml_string(model)
    d = mujoco.MjData(m)
    found = []
    for k in range(solution.n + (side != "mid")):
        put(m, d, lambda name, order=0, k=k: float(getattr(solution.trajectories[name, order], side)[k]))
        mujoco.mj_kinematics(m, d)
        found.append(d.site(name).xpos.copy())
    return np.array(found)


@pytest.mark.parametrize(("guess", "turn"), [(COUPLER, 2 * np.pi), ("", 0.5 * np.pi)])
def test_a_four_bar_stays_closed_whatever_its_guess(tmp_path: Path, guess: str, turn: float) -> None:
    solution = load(tmp_path, FOUR_BAR, TURN + guess).solve(turn=turn)
    assert solution.status == "optimal"
    assert gaps(solution, FOUR_BAR).max() < 1e-9
    assert gaps(solution, FOUR_BAR, "mid").max() < 1e-3


@pytest.mark.parametrize(("method", "order"), [("hermite-simpson", 4), ("trapezoidal", 2), ("central", 2)])
def test_methods_keep_their_order_on_a_closed_loop(tmp_path: Path, method: str, order: int) -> None:
    model = load(tmp_path, FOUR_BAR, SWING.format(method=method))
    fine = load(tmp_path, FOUR_BAR, SWING.format(method="hermite-simpson")).solve(n=320)
    errors = []
    for n in (40, 80):
        solution = model.solve(n=n)
        assert solution.status == "optimal"
        assert gaps(solution, FOUR_BAR).max() < 1e-9
        errors.append(float(np.abs(solution["joint.a"] - fine["joint.a"][:: 320 // n]).max()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4)


def test_feet_stay_while_the_trunk_is_moved_about(tmp_path: Path) -> None:
    spec = f"""constants: n = 16, T = 0.6, h = T/n;
    {FEET} [0, n]: FL; FR; RL; RR;
    constraints: [0]: keyframe.stand; rest;  [n]: rest;
      [n/4]: joint.root.x = 0.03;  [n/2]: joint.root.y = 0.03;  [3*n/4]: joint.root.z = 0.25;
    objective: [0, n]: integral(effort + 1e-3*joint.*''^2);"""
    solution = load(tmp_path, quadruped(), spec).solve()
    assert solution.status == "optimal"
    for foot in ("FL", "FR", "RL", "RR"):
        start = sites(solution, quadruped(), foot)[0]
        assert np.abs(sites(solution, quadruped(), foot) - start).max() < 1e-8
        assert np.abs(sites(solution, quadruped(), foot, "mid") - start).max() < 1e-3
    assert residual(solution, quadruped(), ("FL", "FR", "RL", "RR")) < 1e-9


GYMNAST = """<mujoco><worldbody>
  <body name="arms" pos="0 0 2"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <joint name="swing" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.6" size=".04" mass="8"/>
    <site name="grip" pos="0 0 0"/>
    <body name="legs" pos="0 0 -.6"><joint name="hip" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -.8" size=".06" mass="30"/></body></body>
  </worldbody><actuator><motor name="hip" joint="hip"/></actuator></mujoco>"""


def test_hands_stay_on_the_bar(tmp_path: Path) -> None:
    """On few frames, where the bar once sank by more than half a metre."""
    spec = """constants: n = 16, T = 1.4, h = T/n;
    contact: hands = pin(site.grip);  [0, n]: hands at 0, 0, 2;
    constraints: [0]: keyframe.reference; rest;  [n]: joint.swing = 1.5;
    objective: [0, n]: integral(1e-4*effort + 1e-3*joint.*''^2);"""
    solution = load(tmp_path, GYMNAST, spec).solve()
    assert solution.status == "optimal"
    assert np.abs(sites(solution, GYMNAST, "grip") - [0, 0, 2]).max() < 1e-9
    assert np.abs(sites(solution, GYMNAST, "grip", "mid") - [0, 0, 2]).max() < 1e-2


#: Two feet on the ends of a beam.
BEAM = """<mujoco><worldbody><geom type="plane" size="5 5 .1"/>
  <body name="beam"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <joint name="tilt" axis="0 1 0"/><geom type="box" size=".5 .05 .05" mass="3"/>
    <site name="left" pos="-.5 0 0"/><site name="right" pos=".5 0 0"/></body>
  </worldbody></mujoco>"""


def test_what_stands_bears_its_part_of_another_ones_impact(tmp_path: Path) -> None:
    """A beam on one foot comes down on the other: both impulses together stop it, as they do in closed form."""
    spec = """constants: n = 20, T = 0.2, h = T/n;
    contact:
      left = point(site.left), friction = 2;  right = point(site.right), friction = 2;
      [0, n]: left at 0;  [n/2, n]: right;
    constraints: [0]: joint.tilt'; [n/2]: joint.tilt = 0;
    guess: [0, n]: joint.x = 0.5;"""
    solution = load(tmp_path, BEAM, spec).solve()
    assert solution.status == "optimal"
    spin = solution.trajectories["joint.tilt", 1]
    assert spin.before[10] > 0.1
    assert abs(spin.after[10]) < 1e-5
    # The moment of inertia about the standing foot, times the speed, over the distance; the rest by momentum.
    inertia = 3.0 / 12.0 * (1.0**2 + 0.1**2)
    landing = (inertia + 3.0 * 0.5**2) * spin.before[10]
    assert solution["right_jz1"] == pytest.approx(landing, rel=1e-4)
    assert solution["left_jz_impact1"] == pytest.approx(3.0 * 0.5 * spin.before[10] - landing, rel=1e-4)


#: The same loop on a table that turns, so that it moves in a plane, and the plane with it.
ON_A_TABLE = """<mujoco><option timestep="1e-3" integrator="RK4"/>
  <default><joint damping=".05"/><geom contype="0" conaffinity="0"/></default><worldbody>
  <body name="table" pos="0 0 1"><joint name="table" axis="0 0 1"/><geom type="box" size=".3 .1 .02" mass="2"/>
    <body name="a" pos="-.2 0 0"><joint name="a" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 .2" size=".01" mass=".2"/>
      <body name="b" pos="0 0 .2"><joint name="b" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 .4 0 .1" size=".01" mass=".3"/></body></body>
    <body name="c" pos=".2 0 0"><joint name="c" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 .3" size=".01" mass=".2"/></body></body></worldbody>
  <equality><connect name="pin" body1="b" body2="c" anchor=".4 0 .1"/></equality>
  <actuator><motor name="table" joint="table"/><motor name="a" joint="a"/></actuator></mujoco>"""


@pytest.mark.parametrize("turned", [0.4, np.pi / 2, 2.5])
def test_a_loop_in_a_plane_that_turns_bears_nothing_across_it(tmp_path: Path, turned: float) -> None:
    """Whichever way the plane is, which no axis of the world tells; MuJoCo repeats the motion with its own link."""
    spec = """constants: n = 30, T = 1, h = T/n, turned = {turned};
        constraints: [0]: keyframe.reference; rest;  [n]: joint.table = turned; joint.a = 0.5; rest;
        objective: [0, n]: integral(effort);
        replay: set option.solref.time = 0.0005;"""
    solution = load(tmp_path, ON_A_TABLE, spec.format(turned=turned)).solve()
    assert solution.status == "optimal"
    assert solution.iterations < 100
    assert gaps(solution, ON_A_TABLE).max() < 1e-9
    x, y = solution["equality.pin.fx"], solution["equality.pin.fy"]
    angle = solution["joint.table"]
    assert np.abs(np.cos(angle) * y - np.sin(angle) * x).max() < 1e-9 * np.abs([x, y]).max()
    report = validate(solution)
    assert report.passed, [str(m) for m in report.metrics if m.verdict == "fail"]


#: A double pendulum, in a plane that may be tilted, and what ties its tip.
_TIED = """<mujoco><worldbody><site name="here" pos="{at}"/><body name="post" pos="0 0 2"/>
  <body name="arm" euler="{tilt}"><joint name="a" axis="0 1 0" damping=".1"/>
  <geom type="capsule" fromto="0 0 0 .5 0 0" size=".03"/>
  <body name="tip" pos=".5 0 0"><joint name="b" axis="0 1 0" damping=".1"/><site name="end" pos=".4 0 0"/>
  <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03"/></body></body></worldbody>
  <equality>{ties}</equality></mujoco>"""
_AT = '<connect name="tie" site1="end" site2="here"/>'


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("at", "tilt", "ties", "said"),
    [
        (".6 0 .3", "0 0 0", _AT, ""),
        (".6 .2 .3", "0 0 0", _AT, "is 0.2 m or rad off in a direction in which no joint moves what it ties"),
        (".6 -.2 0", "30 0 0", _AT, "off in a direction in which no joint moves what it ties"),
        (".7 0 .8", "0 0 0", _AT, r"cannot hold: the nearest pose that was found is 0\..* m or rad off"),
        ("0 0 0", "0 0 0", '<weld name="tie" body1="post" relpose="0 0 3 1 0 0 0"/>', "is 5 m or rad off"),
    ],
)
def test_a_tie_that_no_pose_satisfies_is_told(
    tmp_path: Path, at: str, tilt: str, ties: str, said: str
) -> None:
    """A circle of 0.9 m around the origin is what the tip reaches; across its plane nothing moves it."""
    model = _TIED.format(at=at, tilt=tilt, ties=ties)
    spec = "constants: n = 4, T = 0.1, h = T/n; constraints: [0]: rest;"
    if "cannot" in said:
        with pytest.raises(SpecError, match=said):
            load(tmp_path, model, spec).problem()
        return
    warnings = load(tmp_path, model, spec).problem().warnings
    assert [bool(re.search(said, str(warning))) for warning in warnings] == ([True] if said else [])


#: A body on four legs that turn about the vertical and bend at the shoulder, as gymnasium's ant; or have a knee, too.
SPIDER = """<mujoco><worldbody><geom name="floor" type="plane" size="2 2 .1"/>
  <body name="body" pos="0 0 .4"><freejoint name="root"/><geom type="box" size=".1 .1 .05" mass="3"/>{legs}</body>
  </worldbody></mujoco>"""
SPIDER_LEG = """<body name="leg{k}" pos="{x} {y} 0"><joint name="yaw{k}" axis="0 0 1"/>
  <joint name="pitch{k}" axis="{ax} {ay} 0"/><geom type="capsule" fromto="0 0 0 {x} {y} 0" size=".02" mass=".2"/>
  <body name="shin{k}" pos="{x} {y} 0">{knee}<geom type="capsule" fromto="0 0 0 {x} {y} -.3" size=".02" mass=".2"/>
  <geom name="foot{k}" size=".03" pos="{x} {y} -.37" mass=".1"/></body></body>"""


@pytest.mark.parametrize("knees", [False, True])
def test_a_flight_from_feet_that_lift_nothing_is_told(tmp_path: Path, knees: bool) -> None:
    """By MuJoCo's Jacobians: on held feet legs of two joints do not raise the centre of mass, those of three do."""
    corners = [(0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1)]
    legs = "".join(
        SPIDER_LEG.format(k=k, x=x, y=y, ax=-y, ay=x, knee=f'<joint axis="{-y} {x} 0"/>' if knees else "")
        for k, (x, y) in enumerate(corners)
    )
    model = SPIDER.format(legs=legs)
    spec = """constants: n = 10, T = 1, h = T/n;
contact: for k in 0..3: c{k} = point(geom.foot{k}), friction = 0.7;
  [0, 4]: c0; c1; c2; c3;  [6, n]: c0; c1; c2; c3;
constraints: [0]: keyframe.reference; rest;  [n]: keyframe.reference; rest;
objective: [0, n]: integral(joint.yaw0'^2);
"""
    warnings = [str(one) for one in load(tmp_path, model, spec).problem().warnings]
    m = mujoco.MjModel.from_xml_string(model)
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)
    feet, centre = np.zeros((12, m.nv)), np.zeros((3, m.nv))
    for k in range(4):
        place = d.geom(f"foot{k}").xpos - [0.0, 0.0, 0.03]
        mujoco.mj_jac(m, d, feet[3 * k : 3 * k + 3], None, place, m.body(f"shin{k}").id)
    mujoco.mj_jacSubtreeCom(m, d, centre, 1)
    _, sizes, ways = np.linalg.svd(feet)
    lifts = np.abs(ways[int((sizes > 1e-9).sum()) :] @ centre[2]).max() > 1e-9
    assert lifts == knees
    assert any("lift the centre of mass" in one for one in warnings) == (not lifts)


#: A wrist on an arm; its file draws it where the weld to the world is open by an angle.
WRIST = """<mujoco><worldbody><body name="arm" pos="0 0 1"><joint name="a" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03" mass="1"/>
  <body name="hand" pos="0 0 -.5"><joint name="b" axis="0 1 0"/><geom type="box" size=".1 .05 .05" mass=".5"/>
  <body name="tool" pos=".2 0 0"><joint name="c" axis="1 0 0"/><joint name="d" axis="0 0 1"/>
  <geom size=".04" mass=".2"/></body></body></body><body name="frame"/></worldbody>
  <equality><weld body1="frame" body2="tool" relpose="{x} 0 {z} {w} 0 {y} 0"/></equality>
  <actuator><motor name="a" joint="a"/></actuator></mujoco>"""


@pytest.mark.parametrize("angle", [0.5, 1.8, 2.9])
def test_a_weld_that_is_drawn_open_is_closed(tmp_path: Path, angle: float) -> None:
    """Turned by more than a right angle as well, where the sine of the angle falls."""
    x, z = 0.2 * np.cos(angle), 0.5 - 0.2 * np.sin(angle)
    text = WRIST.format(x=x, z=z, w=np.cos(angle / 2), y=np.sin(angle / 2))
    page = "constants: n = 10, T = 1, h = T/n; constraints: [0]: rest; objective: [0, n]: integral(effort);"
    solution = load(tmp_path, text, page).solve()
    assert solution.status == "optimal"
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = [solution[f"joint.{name}"][0] for name in "abcd"]
    mujoco.mj_forward(model, data)
    assert np.abs(data.efc_pos[:6]).max() < 1e-6
