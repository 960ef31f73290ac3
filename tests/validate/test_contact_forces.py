"""The solved ground forces: which of them a contact can give, and what they are compared with."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import stc
from stc.certification import certify
from stc.validate import Metric, Report, validate
from stc.validate.contact import can_touch
from stc.validate.contact_forces import ContactForces, contact_force_metrics

BLOCK_MODEL = """<mujoco><option gravity="0 0 -10" timestep="0.001"/><worldbody>
  {surfaces}
  <body name="block" pos="0 0 0.1">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
    <geom type="box" size="0.1 0.1 0.1" friction="0.5" solref="0.004 1"/>
  </body></worldbody>
  <actuator><motor name="push" joint="x"/><motor name="lift" joint="z"/></actuator></mujoco>"""

FLOOR = '<geom type="plane" size="1 1 1" friction="0.5" solref="0.004 1"/>'
WALL = '<geom type="box" pos="0.2 0 0.1" size="0.1 1 1" friction="0.5" solref="0.004 1"/>'

#: A block at rest under two motors and what touches it.
BLOCK = """
constants: n = 20, T = 0.2, h = T/n;
variables: x, z, u, w, fx, fz;
constraints:
  [0, n]: 2*x'' = u + fx; 2*z'' = w + fz - 20; x''; z''; u = {push}; w = {lift};
  [0]: x; x'; z; z';
method: hermite-simpson;
replay:
  model = "block.xml"; joint x = x; joint z = z; actuator push = u; actuator lift = w;
  contact body.block.fx = fx; contact body.block.fz = fz;
"""


def block(folder: Path, surfaces: str, push: str, lift: str) -> Path:
    (folder / "block.xml").write_text(BLOCK_MODEL.format(surfaces=surfaces))
    (folder / "block.stc").write_text(BLOCK.format(push=push, lift=lift))
    return folder / "block.stc"


def metric(report: Report, name: str, subject: str = "") -> Metric:
    return next(m for m in report.metrics if m.name.startswith(name) and m.subject.endswith(subject))


def test_validate_and_certify_judge_by_one_list(tmp_path: Path) -> None:
    """The floor carries the weight, and no floor gives twice its friction."""
    solution = stc.load(block(tmp_path, FLOOR, "20", "0")).solve()
    report, certificate = validate(solution), certify(solution, equations=False)
    assert metric(report, "friction used").value == pytest.approx(20 / (0.5 * 20), rel=1e-6)
    assert report.passed is certificate.passed is False
    assert [(m.name, m.subject) for m in certificate.metrics if "between" not in m.name] == [
        (m.name, m.subject) for m in report.metrics if "between" not in m.name
    ]


def test_a_part_that_is_rounding_has_the_scale_of_the_whole_force(tmp_path: Path) -> None:
    report = validate(stc.load(block(tmp_path, FLOOR, "1e-13*sin(40*t)", "0")).solve())
    assert metric(report, "contact force, MuJoCo's against solved, median", "fx").value < 1e-9
    assert not [m for m in report.metrics if m.name.startswith("contact force") and m.verdict != "pass"]


def test_no_floor_holds_a_block_down(tmp_path: Path) -> None:
    report = validate(stc.load(block(tmp_path, FLOOR, "0", "25")).solve())
    pull = metric(report, "contact force, solved one pulls")
    assert pull.value == pytest.approx(1.0) and pull.verdict == "fail"


@pytest.mark.parametrize(("push", "verdict"), [(100, "pass"), (30, "fail")])
def test_a_wall_presses_sideways_and_holds_by_friction(tmp_path: Path, push: float, verdict: str) -> None:
    report = validate(stc.load(block(tmp_path, WALL, str(push), "0")).solve())
    used = metric(report, "friction used")
    assert used.value == pytest.approx(20 / (0.5 * push), rel=1e-6)
    assert used.verdict == verdict


def forces(
    solved: dict[str, np.ndarray], found: dict[str, np.ndarray], friction: np.ndarray
) -> ContactForces:
    n = len(friction)
    upwards = np.where(np.isfinite(friction)[:, None], [0.0, 0.0, 1.0], np.nan)
    slides = np.zeros(n, dtype=bool)
    return ContactForces(
        "foot", np.linspace(0, 1, n), solved, found, solved, found, friction, upwards, slides, 0.1
    )


def test_each_surface_has_its_own_friction() -> None:
    """First on rubber, then on ice; between them one frame without a contact, to which the nearer one counts."""
    friction = np.array([1.0] * 5 + [np.nan] + [0.2] * 5)
    press, slide = np.full(11, 10.0), np.array([8.0] * 5 + [0.0] + [1.0] * 5)
    parts = {"fx": slide, "fz": press}
    used = contact_force_metrics([forces(parts, parts, friction)])[0]
    assert used.value == pytest.approx(0.8)
    parts = {"fx": np.where(np.arange(11) > 8, 4.0, slide), "fz": press}
    used = contact_force_metrics([forces(parts, parts, friction)])[0]
    assert used.value == pytest.approx(2.0)


def test_a_force_that_is_wrong_for_a_fifth_of_its_time_is_found() -> None:
    press, nothing = np.full(100, 10.0), np.zeros(100)
    turn = np.where(np.arange(100) < 20, 0.5, 0.0)
    solved, found = {"fz": press, "my": turn}, {"fz": press, "my": nothing}
    rows = {
        (m.name.split(", ")[-1], m.subject): m
        for m in contact_force_metrics([forces(solved, found, np.full(100, 0.5))])
        if "MuJoCo's" in m.name
    }
    assert rows["median", "body foot my"].value == 0.0
    assert rows["90th percentile", "body foot my"].value == pytest.approx(0.5 / (10.0 * 0.1))
    assert rows["90th percentile", "body foot my"].verdict == "fail"
    assert rows["90th percentile", "body foot fz"].verdict == "pass"


def test_a_model_in_which_nothing_touches_is_told(tmp_path: Path) -> None:
    path = block(tmp_path, "", "0", "0")
    certificate = certify(stc.load(path).solve())
    assert certificate.headline.startswith("pairs of geoms: contacts that the model can have 0, limit ≥ 1")
    assert any(note.startswith("no geom of the model can touch another") for note in certificate.notes)
    assert "`apply` lines" in certificate.next_steps[0]
    assert not any("friction: " in note for note in certificate.notes)


@pytest.mark.parametrize(
    ("bodies", "touch"),
    [
        ("{floor}<body>{slide}{ball}</body>", True),
        ('<body>{slide}{ball}</body><body pos="0 0 1">{slide}{ball}</body>', True),
        ('{floor}<body>{slide}<geom size="0.1" contype="0" conaffinity="0"/></body>', False),
        ("{floor}<body>{ball}</body>", False),  # welded to the world
        ("<body>{slide}{ball}<body>{slide}{ball}</body></body>", False),  # one hangs on the other
        ("<body>{slide}{ball}<body>{slide}{ball}<body>{slide}{ball}</body></body></body>", True),
    ],
)
def test_whether_anything_can_touch_is_what_mujoco_does(bodies: str, touch: bool) -> None:
    """Geoms on top of one another: MuJoCo finds a contact wherever it may."""
    parts = {
        "floor": '<geom type="plane" size="1 1 1"/>',
        "ball": '<geom size="0.6"/>',
        "slide": '<joint type="slide"/>',
    }
    text = f"<mujoco><worldbody>{bodies.format(**parts)}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (data.ncon > 0) is touch
    assert can_touch(model) is touch


def test_forces_at_a_site_are_compared_too(tmp_path: Path) -> None:
    """Above the floor nothing touches: what the site's force is said to be is not there."""
    path = block(tmp_path, FLOOR, "0", "0")
    model = (tmp_path / "block.xml").read_text()
    model = model.replace('pos="0 0 0.1">', 'pos="0 0 2"><site name="sole" pos="0 0 -0.1"/>')
    (tmp_path / "block.xml").write_text(model)
    path.write_text(path.read_text().replace("body.block", "site.sole"))
    report = validate(stc.load(path).solve())
    error = metric(report, "contact force, MuJoCo's against solved, median", "body block fz")
    assert error.value == pytest.approx(1.0) and error.verdict == "fail"
