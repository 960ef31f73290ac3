"""Tying a solution to a model: fields, outputs, names, files, and what is said when they do not fit."""

from __future__ import annotations

import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest
from closed_form_motions import constant, nodes, smooth_particle, solution_of, waypoint_spline

import stc
from stc import models
from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate import ModelError, validate
from stc.validate.fields import NO_END, apply_fields
from stc.validate.model import find_model, load_model, require_mujoco

TIME = np.linspace(0, 2, 21)
ZERO = Channel.smooth(np.zeros(21))


def line(text: str, value: float | Channel = 0.0) -> ReplayChannel:
    """``line("set body.particle.mass", 3)``."""
    kind, path = text.split()
    channel = value if isinstance(value, Channel) else constant(ZERO, value)
    still = ZERO if kind == "joint" else None
    return ReplayChannel(kind, tuple(path.split(".")), channel, still, still)


def spline(*lines: ReplayChannel, method: str = "trapezoidal", **more: object) -> Solution:
    x, y = waypoint_spline()
    time = TIME if method == "trapezoidal" else np.linspace(0, 2, 61)
    return smooth_particle(method, time, x, y, lines=lines, **more)


RICH_MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper">
      <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.2 0.25"/>
      <joint name="slide" type="slide" axis="1 0 0"/>
      <body name="lower" pos="0 0 1">
        <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.2 0.25"/>
        <joint name="hinge" axis="0 1 0" range="-1 1" limited="true"/>
        <geom name="skin" size="0.1" friction="1 0.01 0.002"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="slide"/></actuator>
</mujoco>
"""

FIELDS = [
    ("option.gravity.x", 0.5, lambda m: m.opt.gravity[0]),
    ("option.gravity.z", -1.62, lambda m: m.opt.gravity[2]),
    ("option.wind.y", 2.0, lambda m: m.opt.wind[1]),
    ("option.density", 1.2, lambda m: m.opt.density),
    ("option.viscosity", 1e-5, lambda m: m.opt.viscosity),
    ("option.impratio", 10.0, lambda m: m.opt.impratio),
    ("body.lower.mass", 3.0, lambda m: m.body_mass[2]),
    ("body.lower.inertia.x", 0.11, lambda m: m.body_inertia[2, 0]),
    ("body.lower.inertia.z", 0.29, lambda m: m.body_inertia[2, 2]),
    ("body.lower.com.z", 0.3, lambda m: m.body_ipos[2, 2]),
    ("body.lower.pos.z", 1.5, lambda m: m.body_pos[2, 2]),
    ("body.upper.gravcomp", 1.0, lambda m: m.body_gravcomp[1]),
    ("joint.hinge.damping", 0.4, lambda m: m.dof_damping[1]),
    ("joint.hinge.armature", 0.05, lambda m: m.dof_armature[1]),
    ("joint.slide.frictionloss", 0.06, lambda m: m.dof_frictionloss[0]),
    ("joint.hinge.stiffness", 7.0, lambda m: m.jnt_stiffness[1]),
    ("joint.hinge.springref", 0.2, lambda m: m.qpos_spring[1]),
    ("joint.hinge.lower", -0.5, lambda m: m.jnt_range[1, 0]),
    ("joint.hinge.upper", 0.7, lambda m: m.jnt_range[1, 1]),
    ("geom.skin.friction.slide", 0.6, lambda m: m.geom_friction[0, 0]),
    ("geom.skin.friction.spin", 0.02, lambda m: m.geom_friction[0, 1]),
    ("geom.skin.friction.roll", 0.03, lambda m: m.geom_friction[0, 2]),
    ("geom.skin.pos.x", 0.4, lambda m: m.geom_pos[0, 0]),
    ("actuator.push.gear", 5.0, lambda m: m.actuator_gear[0, 0]),
]


@pytest.mark.parametrize(("path", "value", "read"), FIELDS, ids=[field[0] for field in FIELDS])
def test_a_set_line_changes_its_own_field_and_nothing_else(path: str, value: float, read: object) -> None:
    before = mujoco.MjModel.from_xml_string(RICH_MODEL)
    after = mujoco.MjModel.from_xml_string(RICH_MODEL)
    solution = solution_of("trapezoidal", TIME, {("x", 0): ZERO}, [line(f"set {path}", value)])
    assert apply_fields(after, solution) == {path: value}
    assert read(after) == value  # type: ignore[operator]
    for other, _, look in FIELDS:
        if other != path:
            assert look(after) == look(before), f"{path} changed {other}"


def test_a_range_that_is_set_limits_the_joint() -> None:
    before = mujoco.MjModel.from_xml_string(RICH_MODEL)
    assert not before.jnt_limited[0]
    for lines, low, high in (
        ({"upper": 0.3}, -NO_END, 0.3),
        ({"lower": -0.1}, -0.1, NO_END),
        ({"lower": -0.1, "upper": 0.3}, -0.1, 0.3),
    ):
        model = mujoco.MjModel.from_xml_string(RICH_MODEL)
        stated = [line(f"set joint.slide.{end}", value) for end, value in lines.items()]
        apply_fields(model, solution_of("trapezoidal", TIME, {("x", 0): ZERO}, stated))
        assert model.jnt_limited[0]
        assert model.jnt_range[0].tolist() == [low, high]
        assert model.jnt_range[1].tolist() == before.jnt_range[1].tolist()


def test_a_joint_with_several_freedoms_is_set_in_all() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="hip" type="ball"/><geom size=".1"/><site name="toe"/>'
        '<body><joint name="knee"/><geom size=".1"/></body></body></worldbody></mujoco>'
    )
    stated = [line("set joint.hip.damping", 0.4), line("set site.toe.pos.z", -0.3)]
    apply_fields(model, solution_of("trapezoidal", TIME, {("x", 0): ZERO}, stated))
    assert model.dof_damping.tolist() == [0.4, 0.4, 0.4, 0.0]
    assert model.site_pos[0].tolist() == [0.0, 0.0, -0.3]


def test_a_gear_of_several_parts_is_not_set_by_one() -> None:
    text = RICH_MODEL.replace("</body>\n    </body>", '<site name="jet"/></body>\n    </body>')
    text = text.replace("</actuator>", '<motor name="up" site="jet" gear="0 0 1 0 0 0"/></actuator>')
    model = mujoco.MjModel.from_xml_string(text)
    solution = solution_of("trapezoidal", TIME, {("x", 0): ZERO}, [line("set actuator.up.gear", 1.0)])
    with pytest.raises(ModelError, match="gear of several parts"):
        apply_fields(model, solution)


def test_what_mujoco_derives_from_a_field_follows() -> None:
    model = mujoco.MjModel.from_xml_string(RICH_MODEL)
    lines = [line("set body.lower.mass", 5)]
    apply_fields(model, solution_of("trapezoidal", TIME, {("x", 0): ZERO}, lines))
    assert model.body_subtreemass[0] == 7.0


WRONG_LINES = [
    (line("joint y"), "joint y: the model has no joint y; known: x, z"),
    (line("actuator fxx"), "actuator fxx: the model has no actuator fxx; did you mean fx?"),
    (line("set body.particel.mass", 1), r"no body particel; did you mean particle\?"),
    (line("set body.particle.mas", 1), r"a body has no field mas; did you mean mass\?"),
    (line("set body.particle", 1), "write body.NAME.FIELD"),
    (line("set body.particle.mass.x", 1), "this field has no parts"),
    (line("set body.particle.inertia", 1), r"end the path in \.x, \.y, \.z"),
    (line("set joint.x.lower.x", 1), "lower has no parts"),
    (line("set option.gravty.z", 1), r"no such option; did you mean gravity\?"),
    (line("set option", 1), "no such option"),
    (line("set wind.x", 1), "wind cannot be set; known: option, body"),
    (line("set option.density", Channel.smooth(TIME)), "the value changes along the motion"),
    (line("set body.particle.mass", 2), "set body.particle.mass stands in the replay section twice"),
    (line("compare site.trial.x"), r"no site trial; did you mean trail\?"),
    (line("compare site.trail.w"), r"end the path in one of \.x, \.y, \.z, \.vx"),
    (line("compare com.particle.wx"), r"end the path in one of \.x, \.y, \.z, \.vx, \.vy, \.vz$"),
    (line("compare light.sun"), "light cannot be compared; known: joint"),
    (line("compare site"), "the name of the site is missing"),
    (line("compare joint.x.force"), r"a joint has its position and \.velocity, but no \.force"),
    (line("compare sensor.none"), "the model has no sensor none$"),
]


@pytest.mark.parametrize(
    ("wrong", "message"), WRONG_LINES, ids=[w.kind + " " + w.name for w, _ in WRONG_LINES]
)
def test_lines_that_do_not_fit_are_explained(wrong: ReplayChannel, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        validate(spline(wrong))


def test_joints_with_several_coordinates_and_unknown_velocities(tmp_path: Path) -> None:
    model = tmp_path / "ball.xml"
    model.write_text(
        "<mujoco><worldbody><body><joint name='b' type='ball'/><geom size='1'/></body></worldbody></mujoco>"
    )
    solution = solution_of("trapezoidal", TIME, {("x", 0): ZERO}, [line("joint b")], str(model))
    with pytest.raises(ModelError, match="joint b: a ball joint has several coordinates"):
        validate(solution)
    bare = ReplayChannel("joint", ("x",), ZERO)
    with pytest.raises(ModelError, match="has no velocity for it at the start"):
        validate(solution_of("trapezoidal", TIME, {("x", 0): ZERO}, [bare]))


def test_values_that_are_not_numbers_are_named() -> None:
    solution = spline()
    solution.replay[2].value.before[4] = np.nan
    with pytest.raises(ModelError, match="actuator fx: not a finite number at frame 4"):
        validate(solution)


def test_models_are_looked_up_beside_the_spec_then_beside_the_file_then_among_the_bundled(
    tmp_path: Path,
) -> None:
    spec, file = tmp_path / "spec", tmp_path / "file"
    for folder in (spec, file):
        folder.mkdir()
    bundled = models.locate("particle.xml")
    assert bundled is not None
    assert find_model("particle.xml", ["", spec, file]) == bundled
    shutil.copy(bundled, file / "particle.xml")
    assert find_model("particle.xml", ["", spec, file]) == file / "particle.xml"
    shutil.copy(bundled, spec / "particle.xml")
    assert find_model("particle.xml", ["", spec, file]) == spec / "particle.xml"
    assert find_model(str(bundled), [spec]) == bundled
    with pytest.raises(
        ModelError, match=r"no model partcle\.xml: looked in .*spec and among the bundled models; did"
    ):
        find_model("partcle.xml", [spec])
    with pytest.raises(ModelError, match=r"did you mean particle\.xml\?"):
        find_model("partcle.xml", [])


def test_a_model_beside_the_solution_file_is_used(tmp_path: Path) -> None:
    bundled = models.locate("particle")
    assert bundled is not None
    text = bundled.read_text().replace('<joint name="x" type="slide" axis="1 0 0"/>', "")
    (tmp_path / "particle.xml").write_text(text.replace('<motor name="fx" joint="x" gear="1"/>', ""))
    path = tmp_path / "a.npz"
    stc.load(stc.load("particle_waypoints").text).solve(n=20).save(path)  # text has no folder of its own
    with pytest.raises(ModelError, match="the model has no joint x"):
        validate(path)
    assert validate(path, model=bundled).passed


def test_a_model_that_has_changed_since_is_told_of(tmp_path: Path) -> None:
    """The verdict is about the body that was solved for; where none is found, the file's own is replayed."""
    bundled = models.locate("particle")
    assert bundled is not None
    text = stc.load("particle_waypoints").text.replace("particle.xml", "mine.xml")
    (tmp_path / "mine.xml").write_text(bundled.read_text())
    (tmp_path / "mine.stc").write_text(text)
    path = tmp_path / "mine.npz"
    stc.load(tmp_path / "mine.stc").solve(n=20).save(path)
    assert validate(path).passed
    (tmp_path / "mine.xml").write_text(
        bundled.read_text().replace("<worldbody>", "<worldbody><!-- other -->")
    )
    report = validate(path)
    assert not report.passed
    assert report.findings == [
        "mine.xml of the model has changed since this motion was solved: solve it again, or name the model that is to "
        "be replayed"
    ]
    assert validate(path, model=tmp_path / "mine.xml").passed
    (tmp_path / "mine.xml").unlink()
    report = validate(path)
    assert report.passed
    assert "there is no model mine.xml here: the one stored in the solution is replayed" in report.notes


def test_files_that_are_no_models_are_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.xml").write_text("<mujoco><worldbody><bdy/></worldbody></mujoco>")
    with pytest.raises(ModelError, match=r"MuJoCo does not accept .*broken\.xml: .*bdy"):
        load_model(tmp_path / "broken.xml")
    with pytest.raises(ModelError, match="names no model: add a replay section"):
        validate(solution_of("trapezoidal", TIME, {("x", 0): ZERO}, [], model=None))
    with pytest.raises(ModelError, match="ties no joint"):
        validate(solution_of("trapezoidal", TIME, {("x", 0): ZERO}, []))


def test_outputs_are_compared_in_their_own_units(tmp_path: Path) -> None:
    """Every kind of output, on the spline whose coordinates are all known."""
    x, y = waypoint_spline()
    bundled = models.locate("particle")
    assert bundled is not None
    text = bundled.read_text().replace(
        '<site name="trail"', '<site name="high" pos="0 0 0.25"/><site name="trail"'
    )
    sensor = '<sensor><jointpos name="reading" joint="z"/></sensor></mujoco>'
    (tmp_path / "particle.xml").write_text(text.replace("</mujoco>", sensor))
    time = np.linspace(0, 2, 61)
    known = {
        "joint.x": (x[0], "m"),
        "joint.z.velocity": (y[1], "m/s"),
        "body.particle.z": (y[0], "m"),
        "site.high.z": (lambda t: y[0](t) + 0.25, "m"),
        "geom.ball.x": (x[0], "m"),
        "com.particle.x": (x[0], "m"),
        "site.high.vx": (x[1], "m/s"),
        "body.particle.vz": (y[1], "m/s"),
        "geom.ball.vy": (np.zeros_like, "m/s"),
        "sensor.reading": (y[0], ""),
    }
    lines = [line(f"compare {path}", nodes("hermite-simpson", time, c)) for path, (c, _) in known.items()]
    solution = smooth_particle("hermite-simpson", time, x, y, lines=lines, directory=str(tmp_path))
    report = validate(solution)
    for path, (_, unit) in known.items():
        about = [metric for metric in report.metrics if metric.subject == f"output {path}"]
        largest, rms = (metric for metric in about if metric.name.startswith("open-loop"))
        assert largest.value < 1e-12
        assert rms.value <= largest.value
        assert largest.unit == unit


def test_what_the_spec_leaves_out_is_noted(tmp_path: Path) -> None:
    bundled = models.locate("particle")
    assert bundled is not None
    motor = '<motor name="fx" joint="x" gear="1"'
    model = tmp_path / "small.xml"
    model.write_text(bundled.read_text().replace(motor, f'{motor} ctrlrange="-1 1" ctrllimited="true"'))
    x, y = waypoint_spline()
    solution = smooth_particle("trapezoidal", TIME, x, y)
    solution.replay = [line for line in solution.replay if line.name not in ("fz", "z")]
    notes = " / ".join(validate(solution, model=model).notes)
    assert "joints without a `joint` line start at rest in the model's initial position: z" in notes
    assert "actuators not driven by the spec get the control 0: fz" in notes
    assert "the model clamps the control of fx" in notes
    assert not validate(spline(), model=model).passed


def test_the_bundled_particle_is_what_the_specs_take_it_for() -> None:
    assert models.names() == sorted(models.names())
    path = models.locate("particle.xml")
    assert path is not None
    model = load_model(path)
    assert (model.nv, model.nu) == (2, 2)
    assert not np.any(model.geom_contype)
    assert not np.any(model.geom_conaffinity)
    assert model.body("particle").mass == 1.0
    np.testing.assert_array_equal(model.actuator_gear[:, 0], 1.0)


def test_ctrl_c_while_mujoco_is_imported_is_no_failure_to_import_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(name: str) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as stop:
            inner = ImportError("initialization failed")
            inner.__cause__ = stop
            raise ImportError("initialization failed") from inner

    monkeypatch.setattr("importlib.import_module", interrupted)
    with pytest.raises(KeyboardInterrupt):
        require_mujoco()
