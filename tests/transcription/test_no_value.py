"""What has no value is an error that says so, and never a bound that is not there."""

from __future__ import annotations

import pytest

import stc

HEAD = "constants: n = 2, a = 1e300, lim = inf, z = 0;\nvariables: x; parameters: p;\n"


def refused(statement: str, head: str = HEAD) -> stc.EvaluationError:
    """What is raised about a constraint."""
    with pytest.raises(stc.EvaluationError) as caught:
        stc.load(f"{head}constraints:\n  [0, n]: {statement};\nobjective: x^2 + p^2;").solve()
    return caught.value


@pytest.mark.parametrize(
    ("statement", "values", "hint"),
    [
        ("a*a*x = 2", {"a": 1e300}, "more than the largest number"),
        ("x <= a*a", {"a": 1e300}, "more than the largest number"),
        ("x + a*a = 2", {"a": 1e300}, "more than the largest number"),
        ("a*a = 2", {"a": 1e300}, "more than the largest number"),
        ("sin(x) <= a*a", {"a": 1e300}, "more than the largest number"),
        ("sin(x) = a*a", {"a": 1e300}, "more than the largest number"),
        ("sin(x)*(a*a) = 1", {"a": 1e300}, "more than the largest number"),
        ("x/z = 2", {"z": 0.0}, "it divides by zero, so that no guess helps"),
        ("sin(x)/z = 2", {"z": 0.0}, "it divides by zero, so that no guess helps"),
        ("x <= z/z", {"z": 0.0}, "it divides by zero"),
        ("sqrt(-a)*sin(x) = 1", {"a": 1e300}, "no real number"),
        ("x = lim", {"lim": float("inf")}, "`inf` is not a number"),
        ("sin(x) >= lim", {"lim": float("inf")}, "`inf` is not a number"),
    ],
)
def test_constants_without_a_value_are_an_error(statement: str, values: dict[str, float], hint: str) -> None:
    error = refused(statement)
    assert error.message == "this has no value"
    assert (error.expression, error.frame, error.values) == (statement, 0.0, values)
    assert hint in error.hint
    assert error.span is not None and (error.span.line, error.span.column) == (4, 11)


def test_a_bound_beyond_all_numbers_is_an_error() -> None:
    error = refused("x/a = a")
    assert "too large" in error.hint and error.frame == 0.0


def test_the_frame_is_told_where_only_some_have_none() -> None:
    assert refused("x <= 1/(1 - i)").frame == 1.0


def test_an_infinite_constant_stays_no_bound() -> None:
    for statement in ("-lim <= x <= lim", "x >= -2*lim", "sin(x) <= lim"):
        spec = f"{HEAD}constraints: {statement};\nobjective: (x - 1)^2 + p^2;"
        assert stc.load(spec).solve()["x"] == pytest.approx([1.0, 1.0, 1.0])


def test_a_start_without_a_value_asks_for_a_guess() -> None:
    error = refused("1/sin(x) = 1")
    assert "give a guess" in error.hint and error.values["x"] == 0.0


@pytest.mark.parametrize(("guess", "frame"), [("x = sqrt(1 - i)", 2.0), ("x = a*a", 0.0), ("p = a*a", None)])
def test_a_guess_without_a_value_is_an_error(guess: str, frame: float | None) -> None:
    with pytest.raises(stc.EvaluationError, match="this guess has no value") as caught:
        stc.load(f"{HEAD}guess: {guess};\nconstraints: x + p = 2;").solve()
    assert caught.value.frame == frame
