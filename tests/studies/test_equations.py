"""A spec's equations of motion against its model's: true ones pass however they are written, wrong ones are named."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from closed_loop import PARALLELOGRAM
from studies.mutations import Mutant, in_rows, in_text

from stc import models, specs
from stc.errors import UsageError
from stc.pipeline import elaborate, load
from stc.studies.equation_report import EquationReport
from stc.studies.equations import check_equations
from stc.validate import ModelError

#: Those with equations of their own, and a model to hold them against.
OWN = [name for name in specs.names() if '\nmodel: "' not in load(name).text]
MODELLED = [name for name in OWN if load(name).problem().model is not None]
#: Those whose equations another one has as well: the lamp's jumps differ in ground, poses and numbers.
SIMILAR = {name for name in MODELLED if name.startswith("luxo_")} - {"luxo_jump", "luxo_poses"}

# A cart with a pole, in words that the parametrised tests change.  The equations are Kelly's (2017), section 6,
# solved for the accelerations and written with speeds of their own.
EXPLICIT = """\
constants: n = 20, h = 1/n, m1 = 1, m2 = 0.3, l = 0.5, I = 0.00018913297255561092, g = 9.81;
variables: x, a, v, w, u;
definitions:
  J = m2*l^2 + I;
  D = (m1 + m2)*J - (m2*l*cos(a))^2;
  F = u + m2*l*sin(a)*w^2;
  G = -m2*g*l*sin(a);
constraints:
  x' = v; a' = w;
  v' = (J*F - m2*l*cos(a)*G)/D;
  w' = ((m1 + m2)*G - m2*l*cos(a)*F)/D;
method: trapezoidal;
replay:
  model = "cart_pole.xml";
  joint cart = x; joint pole = a; actuator cart = u;
  set option.gravity.z = -g;
"""

IMPLICIT = """\
constants: n = 20, h = 1/n, m1 = 1, m2 = 0.3, l = 0.5, I = 0.00018913297255561092, g = 9.81, k = 3;
variables: x, a, u;
constraints:
  {rows}
method: hermite-simpson;
replay:
  model = "cart_pole.xml";
  joint cart = x; joint pole = a; actuator cart = u;
  set option.gravity.z = -g;
"""
CART = "(m1 + m2)*x'' + m2*l*(cos(a)*a'' - sin(a)*a'^2) = u;"
POLE = "m2*l*cos(a)*x'' + (m2*l^2 + I)*a'' + m2*g*l*sin(a) = 0;"


def check(text: str, **constants: float) -> EquationReport:
    return check_equations(load(text, **constants).problem(), states=60)


@pytest.mark.parametrize("name", MODELLED)
@pytest.mark.parametrize("states", [100, pytest.param(1000, marks=pytest.mark.nightly)])
def test_bundled_specs_state_their_models_equations(name: str, states: int) -> None:
    report = check_equations(load(name).problem(), states=states)
    assert report.passed, report.findings
    assert report.states == states
    assert max(metric.value for metric in report.metrics) < 1e-13


def test_equations_from_a_model_are_its_own() -> None:
    assert check_equations(load("quadruped_hop").problem(), states=60).passed


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_the_transcription_does_not_matter(method: str) -> None:
    assert check_equations(load("arm_reach").problem(method), states=60).passed


@pytest.mark.parametrize(
    "rows",
    [
        CART + POLE,
        POLE + CART,
        f"0 = u - ({CART.split(' = ')[0]}); 7*(l*x''*cos(a)*m2 + (m2*l^2 + I)*a'') = -7*m2*g*l*sin(a);",
        # Rows combined: the sum and a multiple that depends on the position.
        "(m1 + m2)*x'' + m2*l*(cos(a)*a'' - sin(a)*a'^2) - u + m2*l*cos(a)*x'' + (m2*l^2 + I)*a'' + m2*g*l*sin(a);"
        "(2 + sin(a))*(m2*l*cos(a)*x'' + (m2*l^2 + I)*a'' + m2*g*l*sin(a));",
        # A momentum balance, by the total derivative of the momentum.
        "((m1 + m2)*x' + m2*l*cos(a)*a')' = u;" + POLE,
        # More rows than needed: one of them follows from the others, another is a wish.
        CART
        + POLE
        + "(m1 + m2)*x'' + m2*l*(cos(a)*a'' - sin(a)*a'^2) + 0*x = u; x'' - a'' <= 100; a'' = k*x;",
    ],
)
def test_true_equations_pass_however_they_are_written(rows: str) -> None:
    report = check(IMPLICIT.format(rows=rows))
    assert report.passed, report.findings


def test_first_order_equations_solved_for_accelerations_pass() -> None:
    assert check(EXPLICIT).passed


@pytest.mark.parametrize(
    ("old", "new", "first"),
    [
        ("G = -m2*g*l*sin(a)", "G = -1.02*m2*g*l*sin(a)", "joint pole: gravity: "),
        ("F = u +", "F = 1.02*u +", "joint cart: force of actuator cart: "),
        ("m2*l*sin(a)*w^2", "m2*l*sin(a)*w^2*1.02", "joint cart: velocity product pole'^2: "),
        ("a' = w", "a' = 1.02*w", "joint "),
    ],
)
def test_mistakes_in_equations_solved_for_accelerations_are_named(old: str, new: str, first: str) -> None:
    report = check(EXPLICIT.replace(old, new))
    assert not report.passed
    assert report.findings[0].startswith(first), report.findings
    assert any("equations of motion that were compared stand at" in note for note in report.notes)


def test_a_finding_shows_both_values() -> None:
    report = check(IMPLICIT.format(rows=CART + POLE.replace("+ I)", "+ 2*I)")))
    assert report.findings == [
        "joint pole: mass matrix entry (pole, pole): spec 0.0753783, model 0.0751891 (frames 0 to 20)"
    ]


def test_a_wrong_inertia_in_a_chain_is_named_where_it_sits() -> None:
    """The arm's forearm: both joints carry it, the elbow carries nothing else."""
    text = specs.locate("arm_reach")
    assert text is not None
    wrong = text.read_text().replace("I2/2", "1.01*I2/2")
    assert wrong != text.read_text()
    assert check(wrong).findings[0].startswith("joint elbow: mass matrix entry (elbow, ")


def test_laws_between_forces_are_obeyed() -> None:
    """A motor with damping and a spring of its own: what acts is what the actuator line says."""
    rows = CART.replace("= u", "= f") + POLE + "f = u; u = -k*x - 2*x' + 5*sin(t);"
    text = IMPLICIT.format(rows=rows).replace("variables: x, a, u;", "variables: x, a, u, f;")
    assert check(text).passed
    assert not check(text.replace("f = u;", "f = 1.1*u;")).passed


def test_a_force_that_no_replay_line_hands_over_is_named() -> None:
    rows = CART.replace("= u", "= u + wind") + POLE
    text = IMPLICIT.format(rows=rows).replace("variables: x, a, u;", "variables: x, a, u, wind;")
    report = check(text)
    assert report.findings[0].startswith("joint cart: force of wind, which no replay line hands over: spec 1")
    assert check(text.replace("actuator cart = u;", "actuator cart = u; apply body.cart.fx = wind;")).passed


#: A bar on two rods. The loop that it closes is held by an equality, in the spec by two forces.
LOOP = f"<mujoco>\n{PARALLELOGRAM}</mujoco>\n"
BAR = """\
constants: n = 20, h = 1/n, l = 0.4, w = 0.6, g = 9.81, k = 1, slope = 0, gravity = g;
variables: a, b, c, u, rx, rz, wind;
definitions:
  x = l*sin(a) + w*cos(a + b) - w - l*sin(c); z = -l*cos(a) + w*sin(a + b) + l*cos(c);
  bx = l*sin(a) + w/2*cos(a + b); bz = -l*cos(a) + w/2*sin(a + b);
lagrangian:
  0.06*a'^2/2 + 3*(bx'^2 + bz'^2)/2 + 0.1*(a' + b')^2/2 + 0.06*c'^2/2 + g*0.2*cos(a) - 3*g*bz + gravity*0.2*cos(c);
forces:
  a: u + rx*(l*cos(a) - w*sin(a + b)) + rz*(l*sin(a) + w*cos(a + b));
  b: -rx*w*sin(a + b) + rz*w*cos(a + b);
  c: -k*rx*l*cos(c) - rz*l*sin(c) + slope*wind;
constraints: x'' = 0; z'' = 0;
method: hermite-simpson;
replay:
  model = "loop.xml";
  joint left = a; joint bar = b; joint right = c; actuator torque = u;
  set option.gravity.z = -g;
"""


def test_what_holds_a_loop_of_the_model_is_its_own_force(tmp_path: Path) -> None:
    (tmp_path / "loop.xml").write_text(LOOP)
    (tmp_path / "bar.stc").write_text(BAR)

    def findings(**constants: float) -> list[str]:
        report = check_equations(load(tmp_path / "bar.stc", **constants).problem(), states=60)
        assert report.passed is not bool(report.findings)
        return report.findings

    assert not findings()
    held = "force of rx, as far as a loop or gear of the model can give it: spec"
    wrong = findings(k=1.1)
    assert {one.partition(": ")[0] for one in wrong} == {"joint left", "joint bar", "joint right"}
    assert all(held in one for one in wrong)
    assert findings(gravity=9)[0].startswith("joint right: gravity: spec ")
    assert findings(slope=1)[0].startswith("joint right: force of wind, ")


def test_a_missing_equation_is_named() -> None:
    report = check(IMPLICIT.format(rows=CART))
    assert not report.passed
    assert "the spec states no equation of motion for it" in report.findings[0]


def test_each_phase_is_compared() -> None:
    """Other equations after frame 8: the second set holds the mistake."""
    rows = f"[0, 8]: {CART}{POLE} [8, n]: {CART}{POLE.replace('g*l', 'g*l*1.5')}"
    report = check(IMPLICIT.format(rows=rows))
    assert report.findings[0].startswith("joint pole: gravity: ")
    assert report.findings[0].endswith("(frames 8 to 20)")
    gap = check(IMPLICIT.format(rows=f"[0, 8]: {CART}{POLE} [12, n]: {CART}{POLE}"))
    assert all("frames 8 to 12" in finding for finding in gap.findings)
    assert len(gap.findings) == 2


def test_ranged_definitions_are_resolved_in_each_phase() -> None:
    rows = f"{CART}{POLE.replace('m2*g', 'weight')}"
    text = IMPLICIT.format(rows=rows) + "definitions: [0, 9]: weight = m2*g; [10, n]: weight = 0.9*m2*g;"
    report = check(text)
    assert report.findings[0].startswith("joint pole: gravity: ")
    assert "frames 10 to 20" in report.findings[0]


def test_parameters_take_part() -> None:
    rows = CART.replace("m1", "mc") + POLE
    text = IMPLICIT.format(rows=rows) + "parameters: mc; guess: mc = 2;"
    assert not check(text).passed
    assert check(text.replace("set option", "set body.cart.mass = mc; set option")).passed


def test_absolute_angles_are_compared_joint_by_joint() -> None:
    """The arm's second angle from the x axis instead of from the upper arm."""
    text = """
    constants: n = 10, h = 1/n, m1 = 2.3, m2 = 1.2, l = 0.45, c1 = 0.3032608695652174, g = 9.81,
      c2 = 0.25000000000000006, I1 = 0.05304940164044723, I2 = 0.021347573924069337;
    variables: p, q, u, v;
    definitions:
      X = l*cos(p) + c2*cos(q); Z = l*sin(p) + c2*sin(q);
    lagrangian:
      m1/2*c1^2*p'^2 + I1/2*p'^2 - m1*g*c1*sin(p) + m2/2*(X'^2 + Z'^2) + I2/2*q'^2 - m2*g*Z;
    forces: p: u - v; q: v;
    method: hermite-simpson;
    replay:
      model = "arm.xml";
      joint elbow = q - p; joint shoulder = p; actuator shoulder = u; actuator elbow = v;
      set option.gravity.z = -g;
    """
    assert check(text).passed
    report = check(text.replace("I2/2*q'^2", "I2/2*(q' - p')^2"))
    assert report.findings[0].startswith("joint elbow: mass matrix entry (elbow, shoulder)")
    assert len(report.findings) == 3  # and (shoulder, elbow), (shoulder, shoulder)
    assert (
        check(text.replace("forces: p: u - v;", "forces: p: u;"))
        .findings[0]
        .startswith("joint shoulder: force of actuator elbow: spec 1, model 0")
    )


def test_what_cannot_be_compared_is_said() -> None:
    with pytest.raises(UsageError, match="names no model"):
        check("constants: n = 3; variables: x; constraints: x'' = 1;")
    with pytest.raises(ModelError, match=r"does not tie every joint of cart_pole\.xml: pole"):
        check(IMPLICIT.format(rows=CART + POLE).replace("joint pole = a;", ""))
    with pytest.raises(UsageError, match="expressions of 3 variables"):
        check(
            IMPLICIT.format(rows=CART + POLE)
            .replace("joint pole = a;", "joint pole = a + b;")
            .replace("variables: x, a, u;", "variables: x, a, u, b;")
        )
    with pytest.raises(
        UsageError, match=r"the equations at <text>:\d+:\d+ have values of neighbouring frames"
    ):
        check(IMPLICIT.format(rows=CART + POLE.replace("a''", "(a[i+1] - 2*a + a[i-1])/h^2")))
    with pytest.raises(
        UsageError, match=r"the equations at <text>:\d+:\d+ are not linear in second derivatives"
    ):
        check(IMPLICIT.format(rows=CART + POLE.replace("a''", "a''^3")))


def named_right(mutant: Mutant, report: EquationReport) -> bool:
    """Whether the first line names a joint and a term."""
    head = report.findings[0].split(":")
    known = (
        "mass matrix",
        "gravity",
        "velocity product",
        "damping",
        "force of",
        "the spec states no equation",
    )
    return head[0].startswith("joint ") and head[1].strip().startswith(known)


def judge(mutants: list[Mutant]) -> None:
    for mutant in mutants:
        if mutant.problem is None:
            continue
        report = check_equations(mutant.problem, states=20)
        assert report.passed != mutant.matters, (mutant.what, report.findings)
        assert not mutant.matters or named_right(mutant, report), (mutant.what, report.findings)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", [name for name in MODELLED if name not in SIMILAR])
def test_planted_mistakes_are_caught(name: str) -> None:
    model = load(name)
    problem = model.problem()
    mutants = [*in_rows(problem), *in_text(model.source, problem)]
    assert len(mutants) >= 8
    judge(random.Random(name).sample(mutants, 8))


@pytest.mark.nightly
@pytest.mark.parametrize("name", MODELLED)
def test_every_planted_mistake_is_caught(name: str) -> None:
    model = load(name)
    problem = model.problem()
    judge([*in_rows(problem), *in_text(model.source, problem)])


@pytest.mark.parametrize(
    "name", [pytest.param("arm_reach_by_hand", marks=pytest.mark.nightly), "cart_pole_swing_up"]
)
def test_the_joint_and_kind_that_a_mistake_is_in_are_named(name: str) -> None:
    """A change of one row of a balance of forces stays in that joint's row."""
    problem = load(name).problem()
    joints = [".".join(line.path) for line in problem.replay if line.kind == "joint"]
    rows: list[int] = []
    for mutant in in_rows(problem):
        (row,) = mutant.rows
        if row not in rows:
            rows.append(row)
        if mutant.matters:
            report = check_equations(mutant.problem, states=20)
            assert report.findings[0].startswith(f"joint {joints[rows.index(row)]}: "), mutant.what


@pytest.mark.daily_every(4)
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.nightly if n in SIMILAR else ()) for n in MODELLED]
)
def test_other_values_of_constants_raise_no_false_alarm(name: str) -> None:
    """What a spec hands over to the model may have any value."""
    model = load(name)
    problem = model.problem()
    given = {
        str(key)
        for line in problem.replay
        if line.kind == "set"
        for key in _constants(line.body)
        if str(key) in problem.constants
    }
    for constant in sorted(given):
        other = elaborate(model.tree, {constant: 1.07 * problem.constants[constant]})
        report = check_equations(other, states=40)
        assert report.passed, (constant, report.findings)


def _constants(body: object) -> list[object]:
    from stc.symbolic.expr import Expr, symbols

    assert isinstance(body, Expr)
    return list(symbols(body))


def test_a_mass_wrong_in_the_model_is_not_taken_for_a_force(tmp_path: Path) -> None:
    """Most of the neck's row grows with the head's mass, so that a row scaled by it would differ in fewer places."""
    text = models.locate("luxo.xml")
    assert text is not None
    heavier = text.read_text().replace('mass="0.6"', 'mass="0.66"')
    assert heavier != text.read_text()
    for mesh in (text.parent / "meshes").iterdir():
        heavier = heavier.replace(f'file="{mesh.name}"', f'file="{mesh}"')
    (tmp_path / "heavier.xml").write_text(heavier)
    report = check_equations(load("luxo_jump").problem(), str(tmp_path / "heavier.xml"), states=20)
    assert re.match(r"joint neck: (gravity|mass matrix)", report.findings[0])
    assert not any("actuator" in finding for finding in report.findings)


@pytest.mark.parametrize(
    ("law", "said"),
    [
        ("- F", "that of sliding forwards"),
        ("+ F", "that of sliding backwards"),
        ("", "left out"),
        ("- 0.9*F", "that of sliding forwards"),  # of another size, but that way
    ],
)
def test_dry_friction_acts_as_the_spec_slides(tmp_path: Path, law: str, said: str) -> None:
    """A block on the floor that is pulled one way, with the friction that the spec gives the model."""
    (tmp_path / "block.xml").write_text(
        """
        <mujoco>
          <worldbody><body>
            <joint name="x" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
          </body></worldbody>
          <actuator><motor name="u" joint="x"/></actuator>
        </mujoco>
        """
    )
    (tmp_path / "block.stc").write_text(
        f"""
        constants: n = 20, h = 1/n, F = 3;
        variables: x, u;
        constraints: 2*x'' = u {law};
        method: hermite-simpson;
        replay: model = "block.xml"; joint x = x; actuator u = u; set joint.x.frictionloss = F;
        """
    )
    report = check_equations(load(tmp_path / "block.stc").problem(), states=60)
    assert f"dry friction of joint x: {said} (frames 0 to 20)" in report.notes
    assert report.passed is (law != "- 0.9*F")
