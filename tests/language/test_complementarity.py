"""``0 <= a complements b >= 0`` in constraints."""

from __future__ import annotations

import pytest
from reading import problem_of

import stc
from stc.errors import Source, SpecError
from stc.language import parse
from stc.language.show import show_problem, show_syntax

SPEC = "constants: n = 6, k = 2; variables: x, y; constraints: [1, 4]: {}; objective: (x - 1)^2 + (y - 2)^2;"


@pytest.mark.parametrize(
    ("short", "long"),
    [
        ("0 <= x complements y >= 0", "0 <= x; y >= 0; x*y <= 0"),
        ("x >= 0 complements 0 <= y", "x >= 0; 0 <= y; x*y <= 0"),
        ("0 <= x + y complements y/k + x' >= 0", "0 <= x + y; y/k + x' >= 0; (x + y)*(y/k + x') <= 0"),
        ("k <= x complements 3 >= y", "k <= x; 3 >= y; (x - k)*(3 - y) <= 0"),
        ("x <= y complements y <= 1", "x <= y; y <= 1; (y - x)*(1 - y) <= 0"),
    ],
)
def test_it_stands_for_three_inequalities(short: str, long: str) -> None:
    found, meant = (show_problem(problem_of(SPEC.format(text))) for text in (short, long))
    assert found == meant
    canonical = show_syntax(parse(Source("a.stc", SPEC.format(short))))
    assert show_syntax(parse(Source("a.stc", canonical))) == canonical


def test_messages_show_it_as_written() -> None:
    problem = problem_of(SPEC.format("0 <= x   complements  # the gap\n  y >= 0"))
    assert problem.relations[-1].text == "0 <= x complements y >= 0"


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("0 <= x complements y", "y", "what `complements` joins are inequalities"),
        ("x complements y >= 0", "x", "what `complements` joins are inequalities"),
        ("0 <= x complements y = 0", "y = 0", "what `complements` joins are inequalities"),
        ("0 <= x <= 1 complements y >= 0", "0 <= x <= 1", "what `complements` joins are inequalities"),
        ("0 <= x complements", ";", "expected an expression after `complements`"),
        ("complements y >= 0", "y", "expected an operator"),
    ],
)
def test_mistakes(text: str, place: str, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        parse(Source("a.stc", SPEC.format(text)))
    first = caught.value.diagnostics[0]
    assert message in first.message
    assert first.span.source.text[first.span.start : first.span.end] == place


def test_a_name_may_be_the_same_word() -> None:
    problem = problem_of("constants: n = 0; variables: complements; constraints: complements = 2;")
    assert [str(relation.text) for relation in problem.relations] == ["complements = 2"]


@pytest.mark.parametrize(("x", "y"), [(0.1, 1.0), (2.0, 0.1)])
def test_one_side_or_the_other(x: float, y: float) -> None:
    """Two local optima: 1 where x is nothing, 4 where y is."""
    spec = SPEC.format("0 <= x complements y >= 0").replace("n = 6", "n = 0").replace("[1, 4]", "[0]")
    solution = stc.load(f"{spec} guess: x = {x}; y = {y};").solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(1.0 if solution["x"][0] < 0.5 else 4.0, abs=1e-6)
    assert min(solution["x"][0], solution["y"][0]) == pytest.approx(0.0, abs=1e-6)


def test_a_ball_stops_on_a_soft_floor() -> None:
    """The floor pushes where it is pressed in, and only there; it comes to rest at m*g/k below."""
    spec = """
    constants: n = 60, T = 4, h = T/n, k = 50, d = 4, g = 9.81;
    variables: y, f;
    method: hermite-simpson;
    guess: y = 0.5*(1 - t/T); f = g*t/T;
    constraints:
      [0, n]: y'' = f - g - d*y'; 0 <= f complements y + f/k >= 0;
      [0]: y = 0.5; y' = 0;
    """
    solution = stc.load(spec).solve()
    assert solution.status == "optimal"
    assert solution["y"][-1] == pytest.approx(-9.81 / 50, abs=1e-3)
    assert solution["f"].min() >= -1e-6
    assert abs(solution["f"] * (solution["y"] + solution["f"] / 50)).max() < 1e-5
