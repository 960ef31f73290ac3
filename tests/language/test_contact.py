"""Contact sections: what they are written out as, what that means, and how mistakes are told."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.errors import Source, SpecError
from stc.language import parse, read_problem
from stc.language.contact import plain_text
from stc.language.diagnostics import Diagnostics
from stc.language.elaborate import elaborate_with_recovery
from stc.studies.blame import blame

HOPPER = """\
constants: n = 24, na = 8, nb = 16, D = 0.3, g = 9.81, m = 2, I = 0.05, h = 0.05;
variables: x, z, th, fx, fz, u;
method: trapezoidal;
lagrangian: m/2*(x'^2 + z'^2) + I/2*th'^2 - m*g*z;
forces: x: fx; z: fz; th: u;
contact:
  sole = foot(x, z, th), half = 0.1, friction = 0.5, clearance = 0.02, speed = 0.4, spin = 1;
  [0, na]: sole at 0;
  [nb, n]: sole at D;
objective: integral(fx^2 + fz^2 + u^2);
"""
"""A sled with thrusters that hops."""


def test_the_written_out_spec_states_the_same_problem() -> None:
    plain = plain_text(parse(Source("hopper", HOPPER)), {})
    assert "contact:" not in plain
    with_section = stc.load(HOPPER).solve()
    without = stc.load(plain).solve()
    assert with_section.status == without.status == "optimal"
    assert with_section.iterations == without.iterations
    for name in ("x", "z", "sole_fz", "sole_jz1"):
        np.testing.assert_array_equal(with_section[name], without[name])


def test_contact_forces_act_along_the_pose_by_virtual_work() -> None:
    text = """\
constants: n = 4, h = 0.1, m = 1, l = 2, g = 9.81;
variables: a, u;
method: hermite-simpson;
definitions: px = l*sin(a); pz = -l*cos(a);
lagrangian: m/2*(px'^2 + pz'^2) - m*g*pz;
forces: a: u;
contact:
  tip = pin(px, pz);
  [0, n]: tip at 0, -l;
"""
    plain = plain_text(parse(Source("rod", text)), {})
    assert "a: (cos(a)*l)*tip_fx + (l*sin(a))*tip_fz;" in plain or (
        "a: (l*cos(a))*tip_fx + (l*sin(a))*tip_fz;" in plain
    )


def test_rows_are_not_redundant() -> None:
    """Position and velocity are fixed at the start of a phase alone, acceleration on all of it."""
    plain = plain_text(parse(Source("hopper", HOPPER)), {})
    assert plain.count("x'' = 0; z'' = 0; th'' = 0;") == 2
    assert plain.count("x' = 0; z' = 0; th' = 0;") == 1
    assert plain.count("after(x') = 0; after(z') = 0; after(th') = 0;") == 1


def test_a_landing_conserves_momentum_up_to_an_impulse_in_the_cone() -> None:
    found = stc.load(HOPPER).solve()
    assert found.status == "optimal"
    frame, mass = 16, 2.0
    rise = found.after["z'"][frame] - found.before["z'"][frame]
    slide = found.after["x'"][frame] - found.before["x'"][frame]
    assert found["sole_jz1"] == pytest.approx(mass * rise, abs=1e-8)
    assert found["sole_jx1"] == pytest.approx(mass * slide, abs=1e-8)
    assert abs(found["sole_jx1"]) <= 0.5 * found["sole_jz1"] + 1e-8
    assert abs(found.before["z'"][frame]) <= 0.4 + 1e-8
    assert np.all(found["sole_fz"][9:16] == pytest.approx(0.0, abs=1e-8))
    low = found["z"] - 0.1 * np.abs(np.sin(found["th"]))
    share = (np.arange(8, 17) - 8) / 8
    assert np.all(low[8:17] >= 16 * 0.02 * share**2 * (1 - share) ** 2 - 1e-7)


def test_a_soft_landing_needs_no_impulse() -> None:
    problem = read_problem(Source("hopper", HOPPER.replace("speed = 0.4, spin = 1", "soft")))
    assert not problem.parameters
    assert {jump.name for jump in problem.jumps if jump.order} == set()
    found = stc.load(HOPPER.replace("speed = 0.4, spin = 1", "soft")).solve()
    assert found.status == "optimal"
    assert found["z'"][16] == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("foot(x, z, th)", "fot(x, z, th)", "no kind of contact `fot`"),
        ("foot(x, z, th)", "foot(x, z)", "takes x, z and its angle, not 2"),
        ("friction = 0.5", "fricton = 0.5", "a foot has no `fricton`"),
        (", friction = 0.5", "", "a foot needs `friction"),
        ("spin = 1", "soft = 1", "`soft` stands alone"),
        ("[0, na]: sole at 0;", "[0, na]: sol at 0;", "there is no contact `sol`"),
        ("[0, na]: sole at 0;", "[0, nb]: sole at 0;", "with no frames between"),
        ("[0, na]: sole at 0;\n  [nb, n]: sole at D;", "", "stands nowhere"),
        ("method: trapezoidal", "method: central", "does not support jumps"),
        ("friction = 0.5", "friction = -D", "`friction` is -0.3"),
        ("half = 0.1", "half = 1/0", "division by zero"),
    ],
)
def test_mistakes_are_told_where_they_are(old: str, new: str, message: str) -> None:
    assert old in HOPPER
    with pytest.raises(SpecError, match=message) as caught:
        read_problem(Source("hopper", HOPPER.replace(old, new)))
    span = caught.value.diagnostics[0].span
    assert span is not None
    assert span.line >= 3


@pytest.mark.parametrize(
    ("old", "new", "message", "where"),
    [
        ("foot(x, z, th)", "foot(x, z, q)", "`q` is not declared", "q)"),
        ("friction = 0.5", "friction = mu", "`mu` is not declared", "mu"),
        ("friction = 0.5", "friction = -0.5", "`friction` is -0.5", "-0.5"),
        ("clearance = 0.02", "clearance = -g", "`clearance` is -9.81", "-g"),
        ("sole at D;", "sole at E;", "`E` is not declared", "E;"),
        ("D = 0.3, g", "D = 0.3, k = 1, g", "the constant `k` is not used", "k ="),
    ],
)
def test_expressions_of_a_contact_are_told_where_they_stand(
    old: str, new: str, message: str, where: str
) -> None:
    text = HOPPER.replace(old, new)
    diagnostics = Diagnostics(Source("hopper", text))
    elaborate_with_recovery(parse(diagnostics.source), {}, None, diagnostics)
    found = [(one.message, one.span.start) for one in diagnostics.items if one.span is not None]
    at = text.index(new) + new.index(where)
    assert found == [(message, at)]


def test_forces_of_a_contact_that_makes_no_sense_are_not_called_undeclared_on_top() -> None:
    text = HOPPER.replace("foot(x, z, th)", "foot(x, z, q)") + "constraints: sole_fz <= 100;\n"
    with pytest.raises(SpecError) as caught:
        read_problem(Source("hopper", text))
    assert [one.message for one in caught.value.diagnostics] == ["`q` is not declared"]


def test_statements_stand_at_the_phase_that_they_are_there_for() -> None:
    problem = read_problem(Source("hopper", HOPPER))
    lines: dict[str, set[str]] = {}
    for relation in problem.relations:
        if not relation.coordinate:
            lines.setdefault(relation.text, set()).add(relation.span.text)
    first, second = "sole at 0", "sole at D"
    assert lines["x = 0"] == lines["x' = 0"] == {first}
    assert lines["x = D"] == lines["after(x') = 0"] == lines["sole_jx1 <= 0.5*sole_jz1"] == {second}
    assert lines["x'' = 0"] == lines["sole_fx <= 0.5*sole_fz"] == {first, second}
    # In flight it is on its way to the second one.
    assert lines["sole_fx = 0"] == {second}
    assert {"after(momentum(x)) = before(momentum(x)) + sole_jx1"} <= lines.keys()


def test_a_conflict_says_which_phase_its_statements_are_from() -> None:
    # From rest to rest 0.3 away in four tenths of a second, with thrusters that hardly push.
    text = HOPPER + "constraints: -0.1 <= fx <= 0.1; sole_fx = 0;\n"
    model = stc.load(text)
    found = blame(model, model.solve())
    assert found is not None
    said = [one.text for one in found.culprits]
    assert any("`x = D` (from `sole at D`)" in one for one in said), said
    assert all("<text>:6:1" not in one for one in said)


def test_momentum_is_the_derivative_of_the_lagrangian() -> None:
    text = """\
constants: n = 8, h = 0.1, m = 3, I = 0.5, l = 0.7;
variables: x, a, f;
method: trapezoidal;
definitions: px = x + l*sin(a); pz = -l*cos(a);
lagrangian: m/2*(px'^2 + pz'^2) + I/2*a'^2;
forces: x: f;
constraints:
  [0]: x; a = 0.4; momentum(a) = 0.9; momentum(x) = 2;
objective: integral(f^2);
"""
    found = stc.load(text).solve()
    assert found.status == "optimal"
    rate = found["x'"][0], found["a'"][0]
    assert 3 * (rate[0] + 0.7 * np.cos(0.4) * rate[1]) == pytest.approx(2.0)
    assert 3 * 0.7 * np.cos(0.4) * rate[0] + (0.5 + 3 * 0.49) * rate[1] == pytest.approx(0.9)


def test_momentum_is_a_plain_name_where_a_spec_declares_it() -> None:
    problem = read_problem(Source("p", "constants: n = 2; variables: momentum; constraints: momentum = 1;"))
    assert problem.variables == ["momentum"]
