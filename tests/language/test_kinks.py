"""`abs`, `min`, `max` and their kin: where they may stay they mean what they say, elsewhere the message's lines do."""

import re

import numpy as np
import pytest

from stc.errors import Source, SpecError
from stc.language import read_problem
from stc.language.show import show_problem
from stc.pipeline import Model

DRAG = """
constants: n = 40, T = 1, h = T/n, m = 1, c = 0.4, g = 9.81;
variables: x, y, fx, fy;
{definitions}
constraints:
  [0, n]: m*x'' = fx - {dragx}; m*y'' = fy - m*g - {dragy};
  [0]: x; y; x'; y'; [n]: x = 1; y = 1; x'; y';
objective: [0, n]: integral(fx^2 + fy^2);
method: {method};
"""


@pytest.mark.parametrize(
    ("definitions", "dragx", "dragy"),
    [
        ("", "c*x'*sqrt(x'^2 + y'^2)", "c*y'*sqrt(x'^2 + y'^2)"),
        ("definitions: v = sqrt(x'^2 + y'^2);", "c*v*x'", "c*v*y'"),
        ("definitions: [0, n]: v2 = x'^2 + y'^2; [0, n]: d = c*x'*v2^0.5;", "d", "c*y'*v2^0.5"),
        ("definitions: v = sqrt(x'^2 + y'^2); d = c*v^2;", "d*x'/v", "y'/v*d"),
        ("definitions: v = sqrt(x'^2 + y'^2);", "c*(x'^2 + y'^2)/v*x'", "-c*(-y'/v)*(x'^2 + y'^2)"),
        ("", "0.5*(x'^2 + y'^2)^(1/2)*(2*c*x')", "(c*y')*(y'*y' + x'*x')^(1/2)"),
    ],
)
def test_drag_by_the_square_of_the_speed_works_from_rest(definitions: str, dragx: str, dragy: str) -> None:
    text = DRAG.format(definitions=definitions, dragx=dragx, dragy=dragy, method="hermite-simpson")
    solution = Model(Source("drag.stc", text)).solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(134.700, abs=1e-3)


def test_drag_among_the_forces_of_a_lagrangian_works_from_rest() -> None:
    text = """constants: n = 40, T = 1, h = T/n, c = 0.4, g = 9.81;
    variables: x, y, fx, fy;
    definitions: v = sqrt(x'^2 + y'^2);
    lagrangian: (x'^2 + y'^2)/2 - g*y;
    forces: x: fx - c*v*x'; y: fy - c*v*y';
    constraints: [0]: x; y; x'; y'; [n]: x = 1; y = 1; x'; y';
    objective: [0, n]: integral(fx^2 + fy^2);
    method: hermite-simpson;"""
    solution = Model(Source("drag.stc", text)).solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(134.700, abs=1e-3)


def test_a_kink_that_no_product_takes_away_stays_as_it_is_written() -> None:
    text = "constants: n = 4; variables: x, y; constraints: [0, n]: x'' = -x'/sqrt(x'^2 + y^2) + sqrt(x^2 + y^2);"
    shown = show_problem(read_problem(Source("a.stc", text)))
    assert "1e-200" not in shown and "/sqrt(" in shown


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("drag", ["c*x'*abs(x')", "c*x'*sqrt(x'^2)", "c*max(0, x')^2 - c*max(0, -x')^2"])
def test_drag_along_a_line_works_from_rest_and_through_a_turn(drag: str, method: str) -> None:
    text = f"""constants: n = 60, T = 2, h = T/n, c = 0.7; variables: x, u;
    constraints: [0, n]: x'' = u - ({drag}); [0]: x; x'; [n/2]: x = 1; [n]: x; x';
    objective: [0, n]: integral(u^2); method: {method};"""
    solution = Model(Source("turn.stc", text)).solve()
    assert solution.status == "optimal"
    # The force that the motion needs, from its own accelerations and speeds.
    inner = slice(1, -1)
    speed, force = solution["x'"], solution["u"]
    assert solution["x''"][inner] + 0.7 * speed[inner] * np.abs(speed[inner]) == pytest.approx(force[inner])
    smoothed = text.replace("abs(x')", "sqrt(x'^2 + 1e-12)").replace("sqrt(x'^2)", "sqrt(x'^2 + 1e-12)")
    smoothed = smoothed.replace("c*max(0, x')^2 - c*max(0, -x')^2", "c*x'*sqrt(x'^2 + 1e-12)")
    other = Model(Source("other.stc", smoothed)).solve()
    assert solution.objective == pytest.approx(other.objective, rel=1e-5)


def test_the_reformulation_is_shown() -> None:
    text = "constants: n = 4; variables: x; constraints: [0, n]: x'' = -x'*abs(x');"
    assert "sqrt(x'^2 + 1e-200)" in show_problem(read_problem(Source("a.stc", text)))


@pytest.mark.parametrize(
    ("e", "value"),
    [
        ("max(1, 2, 5)", 5.0),
        ("min(c, 2)", -3.0),
        ("abs(c)", 3.0),
        ("sign(c)*4", -4.0),
        ("floor(7/2) + floor(-0.5)", 2.0),
        ("abs(t - 0.25)[0] + max(t, 0.5)[n]", None),
    ],
)
def test_of_what_is_known_they_are_functions_like_any_other(e: str, value: float | None) -> None:
    if value is None:
        e, value = "abs(t - 3) + max(t, 2)", 5.0
    text = f"constants: n = 0, c = -3; variables: x; constraints: x = {e};"
    assert Model(Source("a.stc", text)).solve()["x"][0] == pytest.approx(value)
    if "t" not in e.replace("abs(", ""):
        text = f"constants: n = 0, c = -3, k = {e}; variables: x; constraints: x = k;"
        assert Model(Source("a.stc", text)).solve()["x"][0] == pytest.approx(value)


def test_a_changed_constant_changes_what_is_known() -> None:
    model = Model(Source("a.stc", "constants: n = 0, c = -3; variables: x; constraints: x = max(c, 1);"))
    assert model.solve()["x"][0] == pytest.approx(1.0)
    assert model.solve(c=4.0)["x"][0] == pytest.approx(4.0)


def message(text: str) -> str:
    with pytest.raises(SpecError) as caught:
        read_problem(Source("a.stc", text))
    return str(caught.value)


STATIC = "constants: n = 0; variables: x, y; {constraints} objective: {objective}; guess: x = 3; y = 2;"


@pytest.mark.parametrize(
    ("objective", "call", "least"),
    [
        ("(x - 2)^2 + max(x, 0)", "max(x, 0)", 1.75),
        ("(x - 2)^2 + abs(x)", "abs(x)", 1.75),
        ("(x - 2)^2 + 3*abs(x - y) + y^2", "abs(x - y)", 2.0),
        ("(x - 2)^2 + (y - 1)^2 - min(x, y)", "min(x, y)", -1.25),
        ("(x - 2)^2 + (y + 1)^2 + max(x, y, 5)", "max(x, y, 5)", 5.0),
    ],
)
def test_following_the_lines_for_the_objective_finds_the_least(
    objective: str, call: str, least: float
) -> None:
    told = message(STATIC.format(constraints="", objective=objective))
    solved = follow(told, STATIC.format(constraints="", objective=objective), call)
    assert solved == pytest.approx(least, abs=1e-6)


def follow(told: str, text: str, call: str) -> float:
    """Write what a message says, and solve."""
    variables = re.search(r"variables: (\w+);", told)
    constraints = re.search(r"constraints: (.*)", told)
    assert variables is not None and constraints is not None, told
    name = variables[1]
    assert f"`{name}` in place of `{call}`" in told
    new = text.replace(call, name).replace("variables:", f"variables: {name},", 1)
    rows = constraints[1].replace("[0, n]:", "")
    new = new.replace("objective:", f"constraints: {rows} objective:", 1)
    solution = Model(Source("new.stc", new)).solve()
    assert solution.status == "optimal"
    return solution.objective


@pytest.mark.parametrize(
    ("statement", "lines"),
    [
        ("abs(x) <= 2", "`-2 <= x <= 2;`"),
        ("3 >= abs(x - y)", "`-3 <= x - y <= 3;`"),
        ("max(x, y) <= 1", "`x <= 1; y <= 1;`"),
        ("min(x, 2*y) >= x + 1", "`x >= x + 1; 2*y >= x + 1;`"),
        ("abs(x) >= 2", "`x >= 2;` or `-x >= 2;`"),
        ("y = max(0, x)", "`0 <= y - 0 complements y - x >= 0;`"),
        ("y = abs(x)", "`0 <= y - x complements y + x >= 0;`"),
        ("y = min(x, 3)", "`0 <= x - y complements 3 - y >= 0;`"),
        ("y = 1 + abs(x)", "0 <= abs_x - x complements abs_x + x >= 0;"),
    ],
)
def test_constraints_are_told_what_states_the_same(statement: str, lines: str) -> None:
    told = message(f"constants: n = 4; variables: x, y; constraints: [0, n]: {statement};")
    assert lines in told


@pytest.mark.parametrize(
    ("statement", "value"), [("y = max(0, x)", 0.0), ("y = abs(x)", 2.0), ("y = min(x, 3)", -2.0)]
)
def test_the_lines_for_equations_are_exact(statement: str, value: float) -> None:
    told = message(f"constants: n = 0; variables: x, y; constraints: {statement};")
    line = re.search(r"write `(.*complements.*)`", told)
    assert line is not None
    text = f"constants: n = 0; variables: x, y; constraints: {line[1]} x = -2; guess: x = -1; y = 1;"
    solution = Model(Source("new.stc", text)).solve()
    assert solution.status == "optimal"
    assert solution["y"][0] == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[0, n/2]: integral(max(u, 0));", ("[0, n/2]: max_u >= u; max_u >= 0;", "`max_u` in place of")),
        ("[0, n]: max(u);", ("parameters: max_u;", "constraints: [0, n]: u <= max_u;")),
        ("[0, n]: -min(x' + u);", ("parameters: min_x;", "x' + u >= min_x;")),
        ("[0, n]: sign(x')*x'^2;", ("`x'*abs(x')`", "`tanh(x'/e)`")),
        ("[0, n]: clip(u, -1, 2*x);", ("`-1 <= u <= 2*x;`",)),
        ("[0, n]: relu(u);", ("`max(u, 0)`",)),
        ("[0, n]: norm(x', u);", ("`sqrt(x'^2 + u^2)`",)),
        ("[0, n]: Heaviside(u - 1);", ("`(1 + tanh((u - 1)/e))/2`",)),
        ("[0, n]: floor(x);", ("whole numbers", "constant")),
        ("[0, n]: if(x >= 0, u, 0);", ("chosen = u", "u*(1 + tanh(x/e))/2")),
        ("[0, n]: if(x > 2, u, x);", ("x + (u - x)*(1 + tanh((x - 2)/e))/2",)),
        ("[0, n]: where(u <= x', 1, 2);", ("2 + (1 - 2)*(1 + tanh((x' - u)/e))/2",)),
        ("[0, n]: u^2; constraints: if x: u = 1;", ("there is no `if`", "range headers")),
        ("[0, n]: x > 0 ? 1 : 2;", ("tanh(x/e)",)),
    ],
)
def test_what_is_written_per_frame_is_told_what_to_write(text: str, parts: tuple[str, ...]) -> None:
    told = message(f"constants: n = 20; variables: x, u; constraints: [0, n]: x'' = u; objective: {text}")
    assert all(part in told for part in parts), told


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("variables: x[3];", ("`for k in 1..3: x{k};`", "`x1`, `x2`, `x3`")),
        ("parameters: p[12];", ("`for k in 1..12: p{k};`", "`p1` to `p12`")),
        ("variables: q1..q3;", ("`for k in 1..3: q{k};`",)),
        ("variables: x(2);", ("`for k in 1..2: x{k};`",)),
        ("variables: q[N];", ("`for k in 1..3: q{k};`",)),
        ("constants: m = [1, 2.5];", ("`m1 = 1, m2 = 2.5;`", "m{k}")),
        ("constants: r = (1,2,3);", ("`r1 = 1, r2 = 2, r3 = 3;`",)),
        ("variables: x; constraints: x = [1, 2];", ("`x1 = 1; x2 = 2;`",)),
        ("variables: x; constraints: x'' = (0, 0, -9.8);", ("`x1'' = 0; x2'' = 0; x3'' = -9.8;`",)),
        ("variables: x, y; constraints: (x, y) >= (1, 2);", ("`x >= 1; y >= 2;`",)),
    ],
)
def test_vectors_are_told_what_to_write(text: str, parts: tuple[str, ...]) -> None:
    told = message(f"constants: n = 20; {text}")
    assert all(part in told for part in parts), told


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (
            'replay: model = "ur3.xml"; variables: q; lagrangian: model;',
            ('`model: "ur3.xml";`', "`q`", "stc show ur3.xml"),
        ),
        ("variables: a, b; constraints: a = model.M*b;", ('`model: "robot.xml";`', "`a`, `b`")),
        (
            'replay: model = "arm.xml"; variables: q, u; forces: q: model + u; lagrangian: q\'^2;',
            ('`model: "arm.xml";`',),
        ),
    ],
)
def test_the_word_model_is_told_where_it_belongs(text: str, parts: tuple[str, ...]) -> None:
    told = message(f"constants: n = 20; {text}")
    assert all(part in told for part in parts), told


@pytest.mark.parametrize(
    ("step", "start"),
    [
        ("h = T/n", "guess: T = 1;"),
        ("h = (T - 3)/n", "guess: T = "),
        ("[0, 9]: h = T/10; [10, n]: h = 0.1", "guess: T = 1;"),
    ],
)
def test_a_parameter_in_a_step_is_told_the_guess_to_write(step: str, start: str) -> None:
    text = f"""constants: n = 20; parameters: T; definitions: {step};
    variables: x; constraints: [0, n]: x'' = 1; objective: [0]: T;"""
    with pytest.raises(SpecError) as caught:
        Model(Source("a.stc", text)).solve()
    assert start in str(caught.value)
