"""Limits and requests to stop count within an iteration that takes long, too."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import stc
from stc import deadline
from stc.solver.quadratic import QuadraticProgram


@pytest.fixture
def finer(monkeypatch: pytest.MonkeyPatch) -> tuple[Callable[[bool], stc.Solution], list[str]]:
    """A solve that starts with quadratic programs, and what is tried in them."""
    coarse = stc.load("arm_reach").solve(n=20)
    tried: list[str] = []
    factorize = QuadraticProgram._factorize

    def told(self: QuadraticProgram, *given: object) -> bool:
        tried.append("active set")
        deadline.asked_to_stop = bool(asked)
        return factorize(self, *given)  # type: ignore[arg-type]

    asked: list[bool] = []
    monkeypatch.setattr(QuadraticProgram, "_factorize", told)
    monkeypatch.setattr(deadline, "asked_to_stop", False)

    def solve(stop: bool) -> stc.Solution:
        asked.extend([True] * stop)
        return stc.load("arm_reach").solve(n=40, umax1=30.0, warm_start=coarse)

    return solve, tried


def test_a_request_is_heard_between_two_factorisations(
    finer: tuple[Callable[[bool], stc.Solution], list[str]],
) -> None:
    solve, tried = finer
    assert solve(True).status == "interrupted"
    assert len(tried) == 1


def test_without_a_request_nothing_changes(finer: tuple[Callable[[bool], stc.Solution], list[str]]) -> None:
    solve, tried = finer
    assert solve(False).status == "optimal"
    assert len(tried) > 1


@pytest.mark.parametrize("name", ["nlopt:cobyla", "nlopt:slsqp", "nlopt:auglag"])
def test_nlopt_hears_a_request_at_the_next_evaluation(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A method without derivatives counts an iteration in n + 1 evaluations."""
    from stc.optimizers.nlopt_functions import Functions

    moves: list[int] = []
    move = Functions.move

    def told(self: Functions, z: object) -> None:
        moves.append(1)
        deadline.asked_to_stop = len(moves) >= 3
        move(self, z)  # type: ignore[arg-type]

    monkeypatch.setattr(deadline, "asked_to_stop", False)
    model = stc.load(
        "constants: n = 40; variables: x; constraints: [1, n]: x - x[i-1] <= 5; objective: (x - 1)^4;"
    )
    monkeypatch.setattr(Functions, "move", told)
    assert model.solve(optimizer=name, max_iterations=50).status == "interrupted"
    assert len(moves) <= 5
