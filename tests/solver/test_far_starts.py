"""Least squares, and a bent row, from starts far from a solution."""

from collections.abc import Sequence

import pytest

import stc
from stc.solution import Solution


def _solved(objective: str, start: Sequence[float], rows: str = "") -> Solution:
    names = [f"x{k + 1}" for k in range(len(start))]
    guess = " ".join(f"{name} = {value};" for name, value in zip(names, start, strict=True))
    constraints = f"constraints: [0]: {rows};" if rows else ""
    head = f"constants: n = 0; parameters: {', '.join(names)}; guess: {guess} {constraints}"
    return stc.load(f"{head} objective: [0, n]: {objective};").solve()


def _squares(terms: Sequence[str]) -> str:
    return " + ".join(f"({term})^2" for term in terms)


@pytest.mark.parametrize("start", [[0.141001, 0.121588], [0.0823643, 0.150093]])
def test_a_short_step_without_a_shift_asks_for_none(start: list[float]) -> None:
    """Boggs and Tolle's first problem: the solution is (1, 0)."""
    solution = _solved("100*(x1^2 + x2^2 - 1) - x1", start, "x1^2 + x2^2 = 1")
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(-1.0, abs=1e-8)


def test_a_sum_of_squares_is_not_unbounded() -> None:
    """Meyer's function, where it falls towards a plateau at infinity."""
    data = (
        34780,
        28610,
        23650,
        19630,
        16370,
        13720,
        11540,
        9744,
        8261,
        7030,
        6005,
        5147,
        4427,
        3820,
        3307,
        2872,
    )
    terms = [f"x1*exp(x2/({50 + 5 * k} + x3)) - {value}" for k, value in enumerate(data)]
    solution = _solved(_squares(terms), [0.421501, 2337.86, -358.889])
    assert solution.status != "unbounded"
    assert solution.status != "optimal" or solution.objective == pytest.approx(87.9458, rel=1e-5)


def test_an_attempt_out_of_steps_is_no_solution() -> None:
    """Osborne's first function: the least value is 5.46489e-5."""
    data = (
        0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.85, 0.818, 0.784, 0.751, 0.718, 0.685, 0.658, 0.628, 0.603,
        0.58, 0.558, 0.538, 0.522, 0.506, 0.49, 0.478, 0.467, 0.457, 0.448, 0.438, 0.431, 0.424, 0.42, 0.414, 0.411,
        0.406,
    )  # fmt: skip
    terms = [f"{value} - (x1 + x2*exp(-{10 * k}*x4) + x3*exp(-{10 * k}*x5))" for k, value in enumerate(data)]
    solution = _solved(_squares(terms), [0.502364, 1.63514, -1.07117, 0.0997299, -0.0176337])
    assert solution.status != "optimal" or solution.objective == pytest.approx(5.46489e-5, rel=1e-4)


@pytest.mark.parametrize(
    "start",
    [
        [1.0, 1.0, 1.0],
        [0.0, 74557.47927, 1.0],
        [21.5443469, 464.158883, 1.0],
        [1e5, 0.0, 1.0],
        [0.0, 3e3, 1.0],
    ],
)
def test_what_is_left_to_gain_is_asked_for_where_a_far_start_makes_the_objective_light(
    start: list[float],
) -> None:
    """``x y = 0`` and ``x + y >= 1`` leave ``x^2 + y^2`` at least 1."""
    solution = _solved("x1^2 + x2^2 + (x3 - x1*x2)^2", start, "0 <= x1 complements x2 >= 0; x1 + x2 >= 1")
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(1.0, abs=1e-5)
