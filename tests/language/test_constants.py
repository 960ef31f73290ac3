import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading import c, messages_of, problem_of, v

from stc.errors import UsageError
from stc.symbolic.expr import num, pow_

SPEC = """
constants: n = 20*k, k = 3, T = h*n, h = 1/30, g = 9.8, twice = 2*g, m0 = 1, area = pi*m0^2, big = inf;
variables: x;
constraints: [0, n]: m0*x'' = -twice*area; [0]: x = T; x <= big; x <= k + g;
"""


def test_constants_may_be_defined_from_later_ones() -> None:
    constants = problem_of(SPEC).constants
    assert constants == {
        "n": 60.0,
        "k": 3.0,
        "T": 2.0,
        "h": 1 / 30,
        "g": 9.8,
        "twice": 19.6,
        "m0": 1.0,
        "area": math.pi,
        "big": math.inf,
    }


def test_constants_defined_from_an_overridden_one_follow() -> None:
    constants = problem_of(SPEC, g=1.62, k=5).constants
    assert (constants["twice"], constants["n"]) == (3.24, 100.0)
    assert constants["T"] == pytest.approx(100 / 30, rel=1e-15)


def test_an_override_wins_over_the_definition() -> None:
    problem = problem_of(SPEC, n=40, twice=7)
    assert (problem.n, problem.constants["twice"], problem.constants["g"]) == (40, 7.0, 9.8)


def test_a_constant_without_a_value_takes_it_from_outside() -> None:
    text = "constants: n = 4, m; variables: x; constraints: m*x'' = 1;"
    assert messages_of(text) == ["the constant `m` has no value"]
    assert problem_of(text, m=3).constants["m"] == 3.0


def test_the_number_of_frames_may_come_from_outside_alone() -> None:
    text = "constants: half = n/2; variables: x; constraints: [half]: x = 1;"
    assert messages_of(text)[0] == "`n`, the number of the last frame, is not declared"
    problem = problem_of(text, n=8)
    assert (problem.n, problem.relations[0].range.first) == (8, 4)


def test_h_is_one_where_the_file_is_silent_and_can_be_set_from_outside() -> None:
    text = "constants: n = 4, T = n*h; variables: x; constraints: x[i+1] - x = h;"
    problem = problem_of(text)
    assert problem.step is num(1.0)
    assert problem.constants["T"] == 4.0
    problem = problem_of(text, h=0.5)
    assert problem.step is c("h")
    assert problem.constants["T"] == 2.0


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"gg": 1.0}, "the spec has no constant `gg`\n  did you mean `g`?"),
        ({"x": 1.0}, "`x` is a variable of the spec; only constants can be set from outside"),
        ({"g": math.nan}, "the constant `g` needs a number, not nan"),
        ({"g": "fast"}, "the constant `g` needs a number, not 'fast'"),
    ],
)
def test_what_cannot_be_set_from_outside(overrides: dict[str, float], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        problem_of("constants: n = 4, g = 9.8; variables: x; constraints: x = g;", **overrides)
    assert str(caught.value) == message


@pytest.mark.parametrize("n", [-1, 2.5, math.inf, 1e12])
def test_the_last_frame_is_a_whole_number(n: float) -> None:
    (message,) = messages_of("constants: n = 4; variables: x; constraints: x = 1;", n=n)
    assert message.startswith("`n`, the number of the last frame, is ")


def test_rounding_noise_in_n_is_forgiven() -> None:
    problem = problem_of("constants: n = 0.1*30*10; variables: x; constraints: [n]: x = 1;")
    assert problem.n == 30
    assert problem.constants["n"] == 30.0


def test_constants_that_define_each_other_are_refused() -> None:
    assert messages_of("constants: n = 3, a = b, b = a + 1; variables: x; constraints: x = a + b;") == [
        "the constant `a` is defined by itself"
    ]


def test_constants_that_are_too_large_are_refused() -> None:
    for formula in ("1e200*1e200", "1e308 + 1e308", "-1e308 - 1e308", "1e200/1e-200"):
        spec = f"constants: n = 0, k = {formula}; variables: x; constraints: x <= k;"
        assert messages_of(spec) == ["this number is too large"]
    spec = "constants: n = 0, k = 2*inf + 1; variables: x; constraints: x <= k;"
    assert problem_of(spec).constants["k"] == math.inf


def test_a_division_by_zero_is_told_where_it_stands() -> None:
    for formula in ("x/0", "x/(2 - 2)", "1/(x - x)", "x/(3*0)"):
        spec = f"constants: n = 0; variables: x; constraints: x + {formula} = 1;"
        assert messages_of(spec) == ["division by zero"]


def test_an_override_breaks_a_cycle() -> None:
    text = "constants: n = 3, a = b, b = a + 1; variables: x; constraints: x = a + b;"
    assert problem_of(text, a=2).constants["b"] == 3.0


def test_a_chain_of_a_thousand_constants() -> None:
    chain = ", ".join(f"c{k} = c{k + 1} + 1" for k in range(2000))
    problem = problem_of(f"constants: n = 3, {chain}, c2000 = 0; variables: x; constraints: x = c0;")
    assert problem.constants["c0"] == 2000.0


def test_constants_stay_symbols_in_expressions() -> None:
    first = problem_of(SPEC).relations[0]
    assert first.body is c("m0") * v("x", 2)
    assert first.upper is -c("twice") * c("area")
    assert problem_of(SPEC, twice=1).relations[0].body is first.body


def test_structural_are_those_that_shape_the_problem_with_all_they_were_made_from() -> None:
    assert problem_of(SPEC).structural == {"n", "k"}
    text = """constants: n = 12, a = b/2, b = 4, p = q + 1, q = 1, r = 2, s = 3, jump = 2*s;
    variables: x, u; method: trapezoidal; jumps: [jump]: u;
    constraints: [a]: x = r; x''^p = u; x[r] = 1;"""
    assert problem_of(text).structural == {"n", "a", "b", "p", "q", "r", "s", "jump"}
    assert problem_of(text, a=1).structural == {"n", "a", "p", "q", "r", "s", "jump"}


def test_constant_exponents_become_numbers_unless_the_base_is_constant_too() -> None:
    text = "constants: n = 3, k = 0.1*30, m = 2; variables: x; constraints: x^k + m^k = 0;"
    problem = problem_of(text)
    assert problem.relations[0].body is pow_(v("x"), num(3.0)) + pow_(c("m"), c("k"))
    assert problem.structural == {"n", "k"}


NUMBERS = {"a": 1.25, "b": -0.5, "k": 3.0}


@st.composite
def formulas(draw: st.DrawFn, depth: int = 4) -> str:
    """Arithmetic in the notation that Python shares, `^` apart."""
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        return draw(st.sampled_from([*NUMBERS, "2", "0.5", "3e-1", "(1 + a)"]))
    inner = formulas(depth - 1)
    kind = draw(st.integers(0, 5))
    if kind == 0:
        return f"-{draw(inner)}"
    if kind == 1:
        return f"({draw(inner)})"
    if kind == 2:
        return f"sin({draw(inner)})"
    if kind == 3:
        return f"{draw(inner)}^{draw(st.sampled_from(['2', '-1', '3', '-2']))}"
    return f"{draw(inner)} {draw(st.sampled_from('+-*/'))} {draw(inner)}"


@given(formulas())
def test_values_are_those_of_python(formula: str) -> None:
    try:
        expected = float(eval(formula.replace("^", "**"), {"sin": math.sin, **NUMBERS}))
    except (ZeroDivisionError, OverflowError, TypeError):  # a root of a negative number is complex
        return
    given_numbers = ", ".join(f"{name} = {value}" for name, value in NUMBERS.items())
    text = f"constants: n = 1, {given_numbers}, value = {formula}; variables: x; constraints: x = value;"
    assert problem_of(text).constants["value"] == pytest.approx(expected, rel=1e-14, abs=1e-300)
