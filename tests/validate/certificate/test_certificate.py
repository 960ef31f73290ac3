"""Certificates: the same rows everywhere, and a first line that points at the joint and the term."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.certification import certify, statements_of
from stc.solution import Solution
from stc.specs import locate
from stc.validate import Metric
from stc.validate.certificate import Certificate, blame, table
from stc.validate.certificate.listing import listing
from stc.validate.momentum import flights


def spec(name: str) -> str:
    path = locate(name)
    assert path is not None
    return path.read_text()


@pytest.fixture(scope="module")
def reach() -> Certificate:
    return certify(stc.load("arm_reach").solve(), equations=True)


def test_what_is_in_it(reach: Certificate) -> None:
    assert reach.passed
    titles = [section.title for section in table.sections(reach.metrics)]
    assert titles == [
        "The solver's answer",
        "Equations of motion, spec against model",
        "Physics, instant by instant",
        "Replay, forces alone",
        "Replay with feedback",
        "The spec's statements between the frames",
    ]
    assert sum(len(section.metrics) for section in table.sections(reach.metrics)) == len(reach.metrics)
    facts = dict(reach.facts())
    assert reach.solution.sha256.startswith(facts["spec"].rpartition(" ")[2])
    assert facts["model"].startswith("arm.xml, sha256 ")
    assert "rk4" in facts["integrator"]
    found = json.loads(json.dumps(reach.to_dict(), allow_nan=False))
    assert found["passed"] is True
    assert found["headline"] == reach.headline
    assert len(found["metrics"]) == len(reach.metrics)


def test_the_terminal_shows_every_row_and_ends_in_the_verdict(reach: Certificate) -> None:
    text = str(reach)
    for metric in reach.metrics:
        assert metric.name in text
        assert table.quantity(metric, metric.value) in text
    assert re.search(r"^passed: \d+ measurements within their limits", text, re.MULTILINE)


def test_the_summary_has_a_line_for_each_kind_of_check_with_the_measurement_nearest_to_its_limit(
    reach: Certificate,
) -> None:
    lines = [str(line) for line in reach.summary()]
    assert len(lines) <= 12
    assert lines[-1] == f"passed: {reach.headline}"
    for section in table.sections(reach.metrics):
        (line,) = [line for line in lines if f"  pass  {section.title}: " in line]
        worst = max(section.metrics, key=lambda metric: table.margin(metric) or 0.0)
        assert f"closest: {worst.name}, {worst.subject}: " in line


def test_the_summary_of_a_motion_that_failed_tells_what_failed_most_and_what_to_do() -> None:
    wrong = spec("arm_reach").replace("- m2*g*z2;", "- 1.1*m2*g*z2;")
    certificate = certify(stc.load(wrong).solve(), equations=True)
    lines = [str(line) for line in certificate.summary()]
    assert len(lines) <= 12
    failed = [line for line in lines if line.startswith("  fail  ")]
    assert any(
        "Physics, instant by instant: " in line and "inverse-dynamics residual" in line for line in failed
    )
    assert all(
        re.search(r"\d+ of \d+ beyond their limits; worst: |beyond its limit; worst: ", line)
        for line in failed
    )
    assert f"failed: {certificate.headline}" in lines
    assert lines[-1].startswith("next: ")


FAULTS = {
    "mass in the potential": ("arm_reach", "- m2*g*z2;", "- 1.1*m2*g*z2;", "shoulder|elbow", "gravity"),
    "mass in the kinetic energy": (
        "arm_reach",
        "m2/2*(x2'^2",
        "1.1*m2/2*(x2'^2",
        "shoulder|elbow",
        "mass matrix",
    ),
    "sign of gravity": ("arm_reach", "- m1*g*z1", "+ m1*g*z1", "shoulder", "gravity"),
    "missing inertia": ("arm_reach", "+ I2/2*(a1' + a2')^2", "", "elbow|shoulder", "mass matrix"),
    "length": (
        "arm_reach",
        "x2 = l1*cos(a1)",
        "x2 = 1.05*l1*cos(a1)",
        "shoulder|elbow",
        "mass matrix|gravity|velocity product",
    ),
    "sign of a torque": ("arm_reach", "a1: u1;", "a1: -u1;", "shoulder", "force of actuator shoulder"),
    "damping that is not there": ("arm_reach", "a2: u2;", "a2: u2 - 0.1*a2';", "elbow", "damping"),
    "swapped motors": (
        "arm_reach",
        "actuator shoulder = u1;       # what drives each motor\n  actuator elbow = u2;",
        "actuator shoulder = u2;\n  actuator elbow = u1;",
        "shoulder|elbow",
        "force of actuator",
    ),
    "swapped joints": (
        "arm_reach",
        "joint shoulder = a1;          # where each joint starts and how fast; its path is then compared\n"
        "  joint elbow = a2;",
        "joint shoulder = a2;\n  joint elbow = a1;",
        "shoulder|elbow",
        "mass matrix|force|gravity|velocity product",
    ),
    "gravity of another place": (
        "arm_reach",
        "set option.gravity.z = -g;",
        "set option.gravity.z = -1.62;",
        "shoulder|elbow",
        "gravity",
    ),
    "weight of the particle": ("particle_waypoints", "fy - m*g", "fy - 0.9*m*g", "z", "gravity"),
}


@pytest.mark.daily_every(4)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_fails_with_joint_and_term_in_the_first_line(fault: str) -> None:
    name, old, new, joint, term = FAULTS[fault]
    assert old in spec(name)
    certificate = certify(stc.load(spec(name).replace(old, new)).solve(max_iterations=200), force=True)
    assert not certificate.passed
    assert re.match(rf"joint ({joint})\b", certificate.headline), certificate.headline
    assert re.search(term, certificate.headline), certificate.headline
    text = str(certificate)
    assert f"failed: {certificate.headline}" in " ".join(text.split())


def test_a_motion_of_another_model_is_told_from_a_wrong_spec(tmp_path: Path) -> None:
    """The spec is right and the file is not: the trajectory was tampered with after the solve."""
    solution = stc.load("arm_reach").solve()
    line = next(channel for channel in solution.replay if channel.kind == "actuator")
    line.value.after[7] *= 1.01
    line.value.before[7] *= 1.01
    certificate = certify(solution)
    assert not certificate.passed
    assert certificate.headline.startswith("joint shoulder: inverse-dynamics residual")
    assert certificate.headline.endswith("but this solution does not satisfy them")


def test_a_solution_of_an_older_text_is_stale(tmp_path: Path) -> None:
    path = tmp_path / "reach.stc"
    path.write_text(spec("arm_reach"))
    solution = stc.load(path).solve()
    assert certify(solution).passed
    path.write_text(spec("arm_reach") + "\n")
    certificate = certify(solution)
    assert not certificate.passed
    assert certificate.headline.startswith("reach.stc has changed since this solution was made")


def test_causes_come_before_effects() -> None:
    drift = Metric("open-loop drift, largest", "joint a", 9.0, "rad", 1e-4)
    residual = Metric("inverse-dynamics residual", "joint b", 2e-9, "share", 1e-9)
    worse = dataclasses.replace(residual, subject="joint c", value=3e-9)
    order = Metric("order of convergence", "n = 4, 8", 1.0, "", 3.3, at_least=True)
    assert blame.headline([drift, residual, order, worse], [], False).startswith("joint c: inverse-dynamics")
    assert blame.headline([drift, residual], ["joint d: gravity: ..."], True) == "joint d: gravity: ..."
    assert blame.headline([drift, order], [], False).startswith("joint a: open-loop drift")
    assert blame.headline([order], [], False) == "n = 4, 8: order of convergence 1, limit ≥ 3.3"
    assert blame.others([drift, residual, worse], [])[0].startswith("joint b")
    assert blame.headline([], [], False) == "nothing was measured that has a limit"


def test_numbers_are_short() -> None:
    values = (0.0, 1e-9, 1.234e-5, 0.05, 3.14159, 12345.0, float("inf"), float("nan"))
    shown = ["0", "1e-09", "1.23e-05", "0.05", "3.14", "1.23e+04", "unbounded", "broke down"]
    assert [table.number(value) for value in values] == shown


def test_multipliers_stand_beside_their_statements() -> None:
    solution = stc.load(spec("arm_reach")).solve(umax1=12.0)
    marks = {
        mark.text: (line, mark) for line in listing(solution, statements_of(solution)) for mark in line.marks
    }
    for text, (line, _) in marks.items():
        if not text.startswith("equation of motion"):
            assert text in " ".join(line.text.partition("#")[0].split())
    line, mark = marks["-umax1 <= u1 <= umax1"]
    at_limit = np.abs(np.abs(solution["u1"]) - 12.0) < 1e-6
    assert mark.active >= at_limit.sum() > 0
    assert mark.active < mark.nodes == 2 * solution.n + 1
    assert abs(abs(solution.at(mark.time)["u1"]) - 12.0) < 1e-6
    elbow = marks["0.1 <= a2 <= 2.8"][1]
    assert elbow.value > 0
    assert solution.at(elbow.time)["a2"] == pytest.approx(2.8, abs=1e-3)
    # The hand's target: least torque falls if the target comes nearer, so that its multipliers are not zero.
    assert marks["xh = xt"][1].frame == solution.n
    assert marks["xh = xt"][1].value != 0.0
    # Starting values are bounds on single frames, told apart from the range on all frames.
    assert marks["a2 = start2"][1].nodes == 1


def test_what_is_far_from_its_limit_is_never_active() -> None:
    """Whatever small multipliers an interior method leaves there."""
    solution = stc.load(spec("arm_reach")).solve(umax1=12.0)
    (block,) = (block for block in solution.multipliers if block.kind == "bound" and block.label == "u1")

    def active() -> int:
        return next(
            m.active
            for line in listing(solution, statements_of(solution))
            for m in line.marks
            if "u1" in m.text
        )

    assert max(np.abs(b.values).max() for b in solution.multipliers if b.kind != "link") > 1.0
    block.values[:] = -2e-8
    assert active() == 0
    block.values[3] = -1e-3
    assert active() == 1


RESTING = """<mujoco><option gravity="0 0 -10" timestep="0.001"/><worldbody>
  <geom type="plane" size="1 1 1" friction="0.7"/>
  <body name="block" pos="0 0 0.1">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><geom type="box" size="0.1 0.1 0.1" friction="0.5"/>
  </body></worldbody>
  <actuator><motor name="push" joint="x"/></actuator></mujoco>"""

PUSHED = """
constants: n = 20, T = 0.4, h = T/n;
variables: x, z, u, fx, fz;
constraints:
  [0, n]: 2*x'' = u + fx; 2*z'' = fz - 20; x''; z''; u = {push};
  [0]: x; x'; z; z';
method: hermite-simpson;
replay:
  model = "block.xml"; joint x = x; joint z = z; actuator push = u;
  contact body.block.fx = fx; contact body.block.fz = fz;
"""


def pushed(tmp_path: Path, push: float) -> Certificate:
    (tmp_path / "block.xml").write_text(RESTING)
    (tmp_path / "block.stc").write_text(PUSHED.format(push=push))
    return certify(stc.load(tmp_path / "block.stc").solve())


def test_ground_forces_are_those_of_statics(tmp_path: Path) -> None:
    """A block at rest: the floor carries its weight and holds against the push, up to its friction."""
    certificate = pushed(tmp_path, 7.0)
    (ground,) = certificate.replays.ground
    assert ground.friction == pytest.approx(0.7)  # MuJoCo takes the larger of the two
    assert np.allclose(ground.solved["fz"], 20.0, atol=1e-6)
    # The floor is soft: it takes a while until the block has settled.
    assert np.allclose(ground.found["fz"][-5:], 20.0, atol=1e-2)
    assert np.allclose(ground.found["fx"][-5:], -7.0, atol=1e-2)
    used = next(m for m in certificate.metrics if m.name.startswith("friction used"))
    assert used.value == pytest.approx(0.5, abs=1e-6)
    assert used.verdict == "pass"


def test_a_push_beyond_the_friction_is_found(tmp_path: Path) -> None:
    certificate = pushed(tmp_path, 15.0)
    used = next(m for m in certificate.metrics if m.name.startswith("friction used"))
    assert used.value == pytest.approx(15 / 14, abs=1e-6)
    assert used.verdict == "fail"
    assert not certificate.passed
    assert certificate.headline.startswith("body block: friction used")


THROWN = """<mujoco><option gravity="0 0 -10"/><worldbody>
  <body name="block">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <joint name="turn" type="hinge" axis="0 1 0"/>
    <inertial pos="0 0 0" mass="2" diaginertia="0.5 0.5 0.5"/><geom type="sphere" size="0.1"/>
    <body name="tail" pos="0.2 0 0"><joint name="tail" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.25 0.25 0.25"/><geom type="sphere" size="0.1"/></body>
  </body></worldbody>
  <actuator><motor name="tail" joint="tail"/></actuator></mujoco>"""

THROW = """
constants: n = 12, T = 0.6, h = T/n;
variables: x, z, th, a, u, fz;
definitions: xt = x + 0.2*cos(th); zt = z - 0.2*sin(th);
lagrangian: (x'^2 + z'^2) + 0.25*th'^2 - 20*z; (xt'^2 + zt'^2)/2 + 0.125*(th' + a')^2 - 10*zt;
forces: z: fz; a: u; th: SPIN;
constraints:
  [0, 4]: fz = 60; [5, n]: fz = 0;
  [0]: x; z; th; a; z'; x' = 1; th' = 0.3; a';
  [0, n]: u = 0.2;
method: hermite-simpson;
replay:
  model = "thrown.xml"; joint x = x; joint z = z; joint turn = th; joint tail = a; actuator tail = u;
  contact body.block.fz = fz;
"""

WALL = """<body name="wall" pos="3 0 1"><inertial pos="0 0 0" mass="40" diaginertia="9 9 9"/>
  <geom type="box" size="0.1 1 1"/></body>"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("beside", ["", WALL])
@pytest.mark.parametrize(("spin", "conserved"), [("0", True), ("0.5", False)])
def test_momentum_in_flight(tmp_path: Path, spin: str, conserved: bool, beside: str) -> None:
    """Thrown upwards, a body with a tail keeps its angular momentum, unless a torque comes from nowhere.

    A wall beside it has a mass and no part in that.
    """
    (tmp_path / "thrown.xml").write_text(THROWN.replace("</worldbody>", f"{beside}</worldbody>"))
    (tmp_path / "thrown.stc").write_text(THROW.replace("SPIN", spin))
    certificate = certify(stc.load(tmp_path / "thrown.stc").solve())
    (flight,) = flights(certificate.replays.setup)
    assert (flight.first, flight.last) == (5, 12)
    assert flight.linear < 1e-5
    assert flight.angular < 1e-5 if conserved else flight.angular > 0.1
    failed = {metric.name for metric in certificate.metrics if metric.verdict == "fail"}
    assert ("angular momentum in flight, change" in failed) is not conserved


def test_solve_spec_and_certify_motion_are_fixtures(
    solve_spec: Callable[..., Solution], certify_motion: Callable[..., Certificate]
) -> None:
    assert certify_motion(solve_spec("particle_waypoints")).passed
