"""Limits and requests to stop count within an iteration that takes long, too."""

from __future__ import annotations

import pytest

import stc
from stc import deadline


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
