"""What expressions mean: against Python's own arithmetic, finite differences, and by hand."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading import body_of, c, d, i, messages_of, p, problem_of, t, v, warnings_of

from stc.problem import ConstantRef, IndexRef, ParameterRef, TimeRef, VariableRef
from stc.symbolic.expr import FUNCTIONS, ONE, ZERO, Expr, call, evaluate, num, pow_, sub, symbols

VALUES = {"m": 2.0, "g": 9.8, "l": 0.5, "T": 1.7, "x": 0.3, "y": -0.8, "u": 1.1, "pi": math.pi}
PYTHON = {name: getattr(math, name) for name in FUNCTIONS} | VALUES


def value_of(e: Expr) -> float:
    """The value of an expression where names have the values above."""
    return float(evaluate(e, {key: VALUES[key.name] for key in symbols(e)}))


@st.composite
def formulas(draw: st.DrawFn, depth: int = 4) -> str:
    """Text that the language and Python read alike, `^` apart."""
    if depth == 0 or draw(st.integers(0, 4)) == 0:
        return draw(st.sampled_from([*VALUES, "2", "1.5e-1"]))
    inner = formulas(depth - 1)
    kind = draw(st.integers(0, 7))
    if kind == 0:
        return f"-{draw(inner)}"
    if kind == 1:
        return f"({draw(inner)})"
    if kind == 2:
        return f"{draw(st.sampled_from(['sin', 'cos', 'tanh', 'atan', 'exp']))}({draw(inner)})"
    if kind == 3:
        return f"({draw(inner)})^{draw(st.sampled_from(['2', '-1', '3', '-2^2', '(1 + 1)']))}"
    if kind == 4:
        return f"{draw(st.sampled_from(list(VALUES)))}^{draw(st.sampled_from(['2', '-1', '2^2', '-l*2']))}"
    return f"{draw(inner)} {draw(st.sampled_from('+-*/'))} {draw(inner)}"


@given(formulas())
def test_expressions_mean_what_python_says(formula: str) -> None:
    try:
        expected = eval(formula.replace("^", "**"), dict(PYTHON))
    except (ZeroDivisionError, OverflowError, ValueError):
        return
    if isinstance(expected, complex) or not 1e-100 < abs(expected) < 1e100:
        return
    # simplification reorders sums: cancellation may cost digits, never the meaning
    scale = abs(expected) + 1e3
    assert abs(value_of(body_of(formula)) - expected) <= 1e-9 * scale


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("-x^2", -(VALUES["x"] ** 2)),
        ("x^-2", VALUES["x"] ** -2),
        ("2^3^2*x", 512 * VALUES["x"]),
        ("m/g*l", 2.0 / 9.8 * 0.5),
        ("m - g - l", 2.0 - 9.8 - 0.5),
        ("-m*x", -2.0 * 0.3),
        ("x^-0.71", 0.3**-0.71),
        ("atan2(y, x)", math.atan2(-0.8, 0.3)),
        ("2*-x", -0.6),
        ("+x", 0.3),
        ("4*\n  x # a comment\n + y", 4 * 0.3 - 0.8),
    ],
)
def test_binding_and_order(text: str, meaning: float) -> None:
    assert value_of(body_of(text)) == pytest.approx(meaning, rel=1e-14)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_known(name: str) -> None:
    arguments = ["x", "y"][: FUNCTIONS[name]]
    expected = call(name, *(v(argument) for argument in arguments))
    assert body_of(f"{name}({', '.join(arguments)})") is expected


def test_long_sums_keep_every_term() -> None:
    terms = [f"{k}*x" if k % 2 else f"{k}*y" for k in range(1, 40)]
    text = " - ".join(terms)
    assert value_of(body_of(text)) == pytest.approx(eval(text, dict(PYTHON)), rel=1e-13)


# ------------------------------------------------------------------- primes


def test_primes_of_names() -> None:
    assert body_of("x'''") is v("x", 3)
    assert body_of("(x')''") is v("x", 3)
    assert body_of("m'*x + T'*x + g''*x + pi'*x + 3'*x + u") is v("u")
    assert body_of("t'*x + t''*y") is v("x")


def test_prime_is_the_total_derivative() -> None:
    for primed, meant in (
        ("(l*sin(x))'", "l*cos(x)*x'"),
        ("(x*y)'", "x'*y + x*y'"),
        ("(m*x'^2/2)'", "m*x'*x''"),
        ("(T*t*x)'", "T*x + T*t*x'"),
    ):
        assert body_of(primed).fingerprint == body_of(meant).fingerprint
    assert body_of("e'", "definitions: e = m*x'^2/2;") is body_of("(m*x'^2/2)'")
    assert body_of("sin(t)'*x") is call("cos", t) * v("x")


MOTION = {"x": lambda s: math.sin(2 * s) + 0.2, "y": lambda s: math.exp(-s), "u": lambda s: 1 / (2 + s)}
MOTION_RATES: dict[str, list] = {
    "x": [
        MOTION["x"],
        lambda s: 2 * math.cos(2 * s),
        lambda s: -4 * math.sin(2 * s),
        lambda s: -8 * math.cos(2 * s),
    ],
    "y": [MOTION["y"], lambda s: -math.exp(-s), lambda s: math.exp(-s), lambda s: -math.exp(-s)],
    "u": [
        MOTION["u"],
        lambda s: -1 / (2 + s) ** 2,
        lambda s: 2 / (2 + s) ** 3,
        lambda s: -6 / (2 + s) ** 4,
    ],
}


def along_the_motion(e: Expr, s: float) -> float:
    """The value of an expression at time s of a known motion."""
    values: dict[object, float] = {}
    for key in symbols(e):
        if isinstance(key, VariableRef):
            values[key] = MOTION_RATES[key.name][key.order](s)
        elif isinstance(key, TimeRef):
            values[key] = s
        elif isinstance(key, ConstantRef | ParameterRef):
            values[key] = VALUES[key.name]
    return float(evaluate(e, values))


@pytest.mark.parametrize(
    "text",
    [
        "l*sin(x)*y",
        "x'^2*m/2 + g*y",
        "atan2(x, 2 + y)",
        "exp(-t*u)*T",
        "sqrt(1 + x'^2)",
        "(1 + y)^(l*x)",
        "log(2 + x*y')/u",
        "x/(1 + u^2)",
    ],
)
@pytest.mark.parametrize("order", [1, 2])
def test_primes_agree_with_finite_differences(text: str, order: int) -> None:
    base, primed = body_of(text), body_of(f"({text}){order * chr(39)}")
    s, step = 0.37, 1e-3 if order == 1 else 4e-3
    at = [along_the_motion(base, s + k * step) for k in (-2, -1, 0, 1, 2)]
    if order == 1:
        expected = (at[0] - 8 * at[1] + 8 * at[3] - at[4]) / (12 * step)
    else:
        expected = (-at[0] + 16 * at[1] - 30 * at[2] + 16 * at[3] - at[4]) / (12 * step**2)
    assert along_the_motion(primed, s) == pytest.approx(expected, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("text", ["i'", "(x*i)'", "s'", "r'", "h'"])
def test_the_index_has_no_derivative(text: str) -> None:
    extra = "definitions: h = 0.1 + i; s = i/n*x; [0, 3]: r = i; [4, n]: r = x;"
    spec = f"constants: n = 8; variables: x; method: trapezoidal; {extra} constraints: {text} = x + s + r;"
    (message,) = messages_of(spec)
    assert message.endswith("has no time derivative")


def test_derivatives_of_absurd_order_are_refused() -> None:
    text = "constants: n = 8; variables: x; constraints: {} = 0;"
    for formula in ("x" + "'" * 30, "(x*x)" + "'" * 30, "x'''''''''''''''[i + 1]''''''''''''"):
        assert messages_of(text.format(formula)) == ["time derivatives go up to order 20"]


# ------------------------------------------------------------------ indices


@pytest.mark.parametrize(
    ("text", "scale", "shift"),
    [
        ("x[0]", 0, 0),
        ("x[n]", 0, 60),
        ("x[n/2]", 0, 30),
        ("x[n/3 + 0.1*10]", 0, 21),
        ("x[i]", 1, 0),
        ("x[i + 1]", 1, 1),
        ("x[2 + i - 3]", 1, -1),
        ("x[n - i]", -1, 60),
        ("x[2*i]", 2, 0),
        ("x[i/2]", Fraction(1, 2), 0),
        ("x[(2*i + n)/4]", Fraction(1, 2), 15),
        ("x[i - i + 7]", 0, 7),
        ("x[(i + 1)*m]", 2, 2),
        ("x[i + 1][i - 1]", 1, 0),
        ("x[2*i][n - i]", -2, 120),
        ("x[mid]", 0, 30),
        ("x[sqrt(m + 2)]", 0, 2),
    ],
)
def test_indices(text: str, scale: Fraction | int, shift: Fraction | int) -> None:
    assert body_of(text, "definitions: mid = n/2;") is v("x", 0, scale, shift)


def test_prime_and_index_commute() -> None:
    for text in ("x'[i + 1]", "x[i + 1]'", "(x[i + 1])'", "(x')[i + 1]"):
        assert body_of(text) is v("x", 1, 1, 1)


def test_an_index_on_an_expression_moves_everything_in_it() -> None:
    assert body_of("(m*x + y')[i + 1]") is c("m") * v("x", 0, 1, 1) + v("y", 1, 1, 1)
    assert body_of("e[n]", "definitions: e = x*i;") is v("x", 0, 0, 60) * num(60.0)
    assert body_of("(x*t)[i + 2]", "definitions: h = T/n;") is v("x", 0, 1, 2) * (p("T") / c("n") * (i + 2.0))


def test_a_definition_under_headers_can_be_read_at_a_fixed_frame() -> None:
    extra = "definitions: [0, 10]: r = x*i; [11, n]: r = y;"
    assert body_of("r[5] + r[n]", extra) is v("x", 0, 0, 5) * num(5.0) + v("y", 0, 0, 60)
    assert body_of("r'[n] + u", extra.replace("*i", "")) is v("y", 1, 0, 60) + v("u")


def test_an_absolute_index_within_a_primed_expression_is_warned_about() -> None:
    text = "constants: n = 8; variables: x; method: trapezoidal; constraints: (x - x[0])' = 1; x[0]' = 1;"
    problem = problem_of(text)
    assert problem.relations[0].body is sub(v("x", 1), v("x", 1, 0, 0))
    assert [w.message for w in problem.warnings] == [
        "`x[0]` within a primed expression gives its derivative at frame 0, not 0"
    ]


# --------------------------------------------------------- before and after

JUMPING = "constants: n = 20; variables: x, y; method: trapezoidal; jumps: [5]: x', y; constraints:"


def test_before_and_after_choose_sides_of_everything_inside() -> None:
    (relation,) = problem_of(f"{JUMPING} [5]: after(x'*y) = 3*before(x') + y;").relations
    expected = sub(v("x", 1, side="after") * v("y", side="after"), 3.0 * v("x", 1, side="before") + v("y"))
    assert relation.body is expected
    (relation,) = problem_of(f"{JUMPING} [5]: before(x)' = after(x[i])';").relations
    assert relation.body is sub(v("x", 1, side="before"), v("x", 1, side="after"))


def test_sides_within_definitions() -> None:
    text = "constants: n = 20; variables: x, y; parameters: L; method: trapezoidal; jumps: [5]: x', y;"
    text += "definitions: leap = after(p) - before(p); p = y*x'; [0, 9]: q = x'; [10, n]: q = y;"
    problem = problem_of(text + "constraints: [5]: leap = L; after(q) = 0;")
    leap = sub(
        v("y", side="after") * v("x", 1, side="after"), v("y", side="before") * v("x", 1, side="before")
    )
    assert problem.relations[0].body is sub(leap, p("L"))
    assert problem.relations[1].body is d("q", side="after")
    nested = messages_of(text + "constraints: [5]: after(leap) = L; q = 0;")
    assert nested == ["`before` and `after` cannot stand within each other"]


@pytest.mark.parametrize("statement", ["[0, 4]: after(x') = y;", "[7]: after(x') = y;", "after(x[3]') = y;"])
def test_sides_where_nothing_jumps_mean_the_plain_value(statement: str) -> None:
    problem = problem_of(f"{JUMPING} {statement}")
    assert all(not key.side for key in symbols(problem.relations[0].body))
    assert [w.message for w in problem.warnings] == [
        "`before` and `after` mean the plain value here: nothing jumps on these frames"
    ]


@pytest.mark.parametrize(
    "statement",
    ["[0, n]: after(x') = y;", "[5]: after(x') = y;", "[0]: after(x'[5]) = y;", "[4]: after(x'[i+1]) = y;"],
)
def test_sides_that_meet_a_jump_stay(statement: str) -> None:
    problem = problem_of(f"{JUMPING} {statement}")
    assert "after" in {key.side for key in symbols(problem.relations[0].body)}
    assert not problem.warnings


# ------------------------------------------------------- names and stand-ins


def test_i_t_pi_n_and_h() -> None:
    assert body_of("x*i") is v("x") * i
    assert body_of("x*t") is v("x") * t
    assert value_of(body_of("x*pi")) == VALUES["x"] * math.pi
    assert body_of("x*n") is v("x") * c("n")
    assert body_of("x*h") is v("x")
    assert body_of("x*h", "definitions: h = T/n;") is v("x") * (p("T") / c("n"))
    assert body_of("x*h", "constants: h = 1/30;") is v("x") * c("h")
    assert body_of("x*h", "definitions: [0, 9]: h = T/n; [10, n]: h = 2*T/n;") is v("x") * d("h")


def test_a_definition_may_use_later_ones_and_a_thousand_of_them() -> None:
    chain = "".join(f"a{k} = a{k + 1} + x;" for k in range(1500)) + "a1500 = y;"
    e = body_of("a0", f"definitions: {chain}")
    assert evaluate(e, {VariableRef("x"): 0.5, VariableRef("y"): 1.0}) == pytest.approx(751.0)


def test_each_undeclared_name_is_reported_once_and_nothing_follows_from_it() -> None:
    text = """constants: n = 8; variables: x; definitions: e = foo*x; [0, 3]: r = bar;
    constraints: foo + x = e; e' = r; x^foo = e[3]; [foo]: x = r; [n]: after(bar) = x;"""
    assert messages_of(text) == ["`foo` is not declared", "`bar` is not declared"]


def test_two_mistakes_in_one_statement_are_both_reported() -> None:
    text = "constants: n = 8; variables: x; constraints: foo*x + sin(x, x) = bar(x) + x[n + 1];"
    assert len(messages_of(text)) == 4


def test_warnings_are_none_for_a_plain_spec() -> None:
    assert warnings_of("constants: n = 8; variables: x; constraints: x'' = ONE; definitions: ONE = 1;") == []


def test_numbers_in_floats_are_exact() -> None:
    assert body_of("0.1*x") is num(0.1) * v("x")
    assert body_of("1e-3*x") is num(1e-3) * v("x")
    assert body_of("x^0") in (ONE, pow_(v("x"), ZERO))
    assert np.isclose(value_of(body_of(".5*x")), 0.15)


def test_the_index_stands_for_itself() -> None:
    assert symbols(body_of("x*(i - m)/n"))[-1] in (
        VariableRef("x"),
        IndexRef(),
        ConstantRef("m"),
        ConstantRef("n"),
    )
