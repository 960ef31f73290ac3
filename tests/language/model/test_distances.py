"""`distance(geom.A, geom.B)` and points in bodies, against MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from stc.errors import SpecError
from stc.problem import ConstantRef, VariableRef
from stc.solution import Solution
from stc.symbolic.expr import evaluate

from .bodies import load, put, quadruped

START = "constants: n = 20, T = 1, h = T/n, d = 0.05;\n"


def least_distance(solution: Solution, model: str, first: str, second: str) -> float:
    """MuJoCo's least distance of two geoms at the nodes of a motion."""
    m = mujoco.MjModel.from_xml_string(model)
    d = mujoco.MjData(m)
    found = np.inf
    for side in ("before", "mid"):
        for frame in range(solution.n):

            def value(name: str, order: int = 0, side: str = side, frame: int = frame) -> float:
                return float(getattr(solution.trajectories[name, order], side)[frame])

            put(m, d, value)
            mujoco.mj_kinematics(m, d)
            distance = mujoco.mj_geomDistance(m, d, m.geom(first).id, m.geom(second).id, 5.0, np.zeros(6))
            found = min(found, distance)
    return float(found)


def carriage(post: str, load: str, turn: str = '<joint name="r" axis="1 0 0"/>') -> str:
    """A body that can be moved past a post, and turned."""
    slides = "".join(
        f'<joint name="{n}" type="slide" axis="{a}"/>' for n, a in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"))
    )
    motors = "".join(f'<motor name="f{n}" joint="{n}"/>' for n in "xyz")
    about = "".join(
        f'<motor name="t{n}" joint="r" gear="{a}"/>' for n, a in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"))
    )
    return f"""<mujoco><option gravity="0 0 0"/><worldbody><geom name="post" {post}/>
      <body pos="-1 .02 0">{slides}{turn}<geom name="load" {load} mass="1"/></body></worldbody>
      <actuator>{motors}{about if "ball" in turn else '<motor name="t" joint="r"/>'}</actuator></mujoco>"""


PASSING = f"""{START}constraints:
  [0]: keyframe.reference; rest;
  [n]: keyframe.reference + (2, 0, 0); rest;
  {{}}
objective: [0, n]: integral(effort);"""
BALL = '<joint name="r" type="ball"/>'
POSTS = {
    "capsules": carriage(
        'type="capsule" fromto="0 0 -.5 0 0 .5" size=".1"', 'type="capsule" size=".05" fromto="0 -.4 .1 0 .4 -.1"'
    ),
    "boxes": carriage('type="box" size=".1 .2 .3" euler="10 20 30"', 'type="box" size=".3 .1 .05"', BALL),
    "a sphere and a box": carriage('type="box" size=".1 .2 .3" euler="10 20 30"', 'type="sphere" size=".1"'),
    "spheres": carriage('type="sphere" size=".2"', 'type="sphere" size=".1"'),
}  # fmt: skip


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", POSTS)
def test_a_load_passes_a_post_at_the_distance_that_is_asked_for(tmp_path: Path, name: str) -> None:
    """The straight way leads through the post; the way around touches the distance, and MuJoCo measures it."""
    spec = PASSING.format("[0, n]: distance(geom.load, geom.post) >= d;")
    solution = load(tmp_path, POSTS[name], spec).solve()
    assert solution.status == "optimal"
    assert least_distance(solution, POSTS[name], "load", "post") == pytest.approx(0.05, abs=1e-5)


def test_boxes_may_touch(tmp_path: Path) -> None:
    """At the distance 0 the direction keeps its length, without which nothing would be stated."""
    spec = PASSING.format("[0, n]: distance(geom.load, geom.post) >= 0;")
    solution = load(tmp_path, POSTS["boxes"], spec).solve()
    assert solution.status == "optimal"
    assert least_distance(solution, POSTS["boxes"], "load", "post") == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    "statement",
    [
        "[0, n]: gap >= d;",
        "[0, n]: -2*gap <= -2*d;",
        "[0, n]: 0.05 <= gap <= 5;",
        "[0, n]: gap - d + 0*joint.x >= 0;",
    ],
)
def test_ways_to_write_it(tmp_path: Path, statement: str) -> None:
    spec = PASSING.format(statement) + "definitions: gap = distance(geom.load, geom.post);"
    solution = load(tmp_path, POSTS["capsules"], spec).solve()
    assert solution.status == "optimal"
    assert least_distance(solution, POSTS["capsules"], "load", "post") == pytest.approx(0.05, abs=1e-5)


def test_elsewhere_it_is_a_lower_bound(tmp_path: Path) -> None:
    """Within a function no unknowns are added, and the motion keeps a little farther off."""
    spec = PASSING.format("[0, n]: exp(distance(geom.load, geom.post)) >= exp(d);")
    model = load(tmp_path, POSTS["capsules"], spec)
    assert not [name for name in model.problem().variables if name.startswith("distance")]
    solution = model.solve()
    assert solution.status == "optimal"
    assert 0.05 - 1e-6 < least_distance(solution, POSTS["capsules"], "load", "post") < 0.08


def test_a_box_keeps_its_corners_off_a_slope(tmp_path: Path) -> None:
    """Planes have known directions: a row for each corner, no unknowns."""
    model = carriage('type="plane" size="1 1 1" pos="0 0 -.6" euler="0 -20 0"', 'type="box" size=".3 .1 .05"')
    spec = PASSING.format(
        "[0, n]: distance(geom.load, geom.post) >= d; [n/2]: joint.x = 0.8; joint.z = -0.4;"
    )
    loaded = load(tmp_path, model, spec)
    assert not [name for name in loaded.problem().variables if name.startswith("distance")]
    solution = loaded.solve()
    assert least_distance(solution, model, "load", "post") >= 0.05 - 1e-6


LEGS = """<mujoco><option gravity="0 0 0"/><default><joint armature=".05"/></default><worldbody>
  <body name="l" pos="0 .1 1"><joint name="lx" axis="1 0 0"/><joint name="ly" axis="0 1 0"/>
    <geom name="left" type="capsule" fromto="0 0 0 0 0 -.8" size=".05" mass="1"/></body>
  <body name="r" pos="0 -.1 1"><joint name="rx" axis="1 0 0"/><joint name="ry" axis="0 1 0"/>
    <geom name="right" type="capsule" fromto="0 0 0 0 0 -.8" size=".05" mass="1"/></body></worldbody>
  <actuator><motor name="lx" joint="lx"/><motor name="ly" joint="ly"/><motor name="rx" joint="rx"/>
  <motor name="ry" joint="ry"/></actuator></mujoco>"""


def test_crossed_legs_change_places_without_passing_through_one_another(tmp_path: Path) -> None:
    spec = f"""{START}
constraints:
  [0]: joint.lx = -0.4; joint.rx = 0.4; joint.ly = -0.4; joint.ry = 0.4; rest;
  [n]: joint.lx = -0.4; joint.rx = 0.4; joint.ly = 0.4; joint.ry = -0.4; rest;
  [0, n]: {{}};
objective: [0, n]: integral(effort);"""
    through = load(tmp_path, LEGS, spec.format("joint.lx <= 3")).solve()
    assert least_distance(through, LEGS, "left", "right") < -0.05
    around = load(tmp_path, LEGS, spec.format("distance(geom.left, geom.right) >= 0.01")).solve()
    assert around.status == "optimal"
    assert around.objective > through.objective
    assert least_distance(around, LEGS, "left", "right") == pytest.approx(0.01, abs=1e-5)


MISTAKES = {
    "distance(geom.left)": "takes 2 geoms, not 1",
    "distance(geom.left, body.r)": "`distance` takes two geoms",
    "distance(geom.left, geom.rigth)": "the model has no geom `rigth`",
    "distance(geom.left, geom.left)": "a geom and itself",
    "point(body.l, 0, 0, 1)": "a point is not a number",
    "point(body.l, 0, 0).x": "a point in a body is `point(body.NAME, x, y, z)`",
    "point(body.l, joint.lx, 0, 0).x": "must be constant",
    "point(body.m, 0, 0, 1).x": "the model has no body `m`",
    "point(body.l, 0, 0, 1).q": "has no field `q`",
    "sin(joint.lx).x": "`sin(...)` has no fields",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_are_told_with_their_place(tmp_path: Path, text: str) -> None:
    with pytest.raises(SpecError) as told:
        load(tmp_path, LEGS, f"{START}constraints:\n{text} >= 0;").problem()
    assert MISTAKES[text] in str(told.value)
    assert "motion.stc:4:" in str(told.value)


def test_a_shape_without_a_distance_is_named_with_its_line(tmp_path: Path) -> None:
    model = LEGS.replace('<geom name="right" type="capsule"', '<geom name="right" type="cylinder"')
    with pytest.raises(SpecError, match=r"the geom `right` is a cylinder \(.*robot.xml:5\)"):
        load(tmp_path, model, f"{START}constraints: distance(geom.left, geom.right) >= 0;").problem()


def test_a_distance_needs_a_model() -> None:
    import stc

    with pytest.raises(SpecError, match="and the spec has none"):
        stc.load(f"{START}variables: x; constraints: distance(geom.a, geom.b) >= x;").problem()


def test_a_point_in_a_body_moves_as_mujoco_moves_it(tmp_path: Path) -> None:
    """Places and velocities in expressions, at a place made of constants."""
    at = (0.01, -0.02, -0.2)
    fields = ("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz")
    named = " ".join(f"p{f} = point(body.FLcalf, a, -2*a, -0.2).{f};" for f in fields)
    primed = "rate = (point(body.FLcalf, a, -2*a, -0.2).x)';"
    spec = (
        f"constants: n = 2, a = 0.01;\ndefinitions: {named} {primed}\nconstraints: [0]: keyframe.stand; rest;"
    )
    problem = load(tmp_path, quadruped(), spec).problem()
    m = mujoco.MjModel.from_xml_string(quadruped())
    d = mujoco.MjData(m)
    rng = np.random.default_rng(1)
    for _ in range(5):
        known: dict[tuple[str, int], float] = {}
        for name in problem.variables:
            for order in (0, 1):
                known[name, order] = float(rng.normal())
        q = rng.normal(size=4)
        for part, component in zip("wxyz", q / np.linalg.norm(q)):
            known[f"joint.root.q{part}", 0] = float(component)
        put(m, d, lambda name, order=0, known=known: known.get((name, order), 0.0))
        mujoco.mj_forward(m, d)
        along, about = np.zeros((3, m.nv)), np.zeros((3, m.nv))
        body = m.body("FLcalf").id
        place = d.xpos[body] + d.xmat[body].reshape(3, 3) @ at
        mujoco.mj_jac(m, d, along, about, place, body)
        wanted = np.concatenate([place, along @ d.qvel, about @ d.qvel])
        values = {VariableRef(name, order): v for (name, order), v in known.items()}
        values |= {ConstantRef(name): v for name, v in problem.constants.items()}
        found = [evaluate(problem.macros[f"p{f}"], values) for f in fields]
        assert np.abs(np.array(found) - wanted).max() < 1e-12
        assert evaluate(problem.macros["rate"], values) == pytest.approx(wanted[3], abs=1e-12)


def test_an_arm_swings_around_a_box(tmp_path: Path) -> None:
    """The bundled arm with a box in its way: four links keep off it, and a look between the frames finds the same."""
    from stc import models
    from stc.statements_between import check_statements

    path = models.locate("arm7.xml")
    assert path is not None
    text = path.read_text(encoding="utf-8")
    post = (
        '<geom name="post" class="drawn" type="cylinder" material="post" pos="0.5 0 0.55" size="0.05 0.55" />'
    )
    assert post in text
    box = (
        '<geom name="box" class="drawn" type="box" material="post" pos="0.5 0 0.45" size="0.05 0.07 0.45" />'
    )
    arm = text.replace(post, box)
    links = {
        "forearm": '0.17 0 0 0.32" size="0.038"',
        "wrist": '0 0 0 0.045" size="0.034"',
        "elbow": '0 0 0 0.1" size="0.046"',
    }
    for name, words in links.items():
        assert words in arm
        arm = arm.replace(words, f'{words} name="{name}"')
    rows = " ".join(f"distance(geom.{name}, geom.box) >= 0.02;" for name in ("ball", *links))
    spec = f"""constants: n = 30, T = 1, h = T/n;
constraints: [0]: keyframe.left; rest; [n]: keyframe.right; rest;
  [0, n]: -6 <= joint.*' <= 6; {rows} geom.ball.x^2 + geom.ball.y^2 >= 0.2^2;
objective: [0, n]: integral(effort);"""
    loaded = load(tmp_path, arm, spec)
    solution = loaded.solve()
    assert solution.status == "optimal"
    for name in ("ball", *links):
        assert least_distance(solution, arm, name, "box") >= 0.02 - 1e-6
    checks = [check for check in check_statements(loaded.problem(), solution) if "distance" in check.text]
    assert len(checks) >= 4
    assert max(check.share for check in checks) < 0.02
