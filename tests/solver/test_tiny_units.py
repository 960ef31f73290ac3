"""Motions of nanometres in SI units: their variables are all tiny, and scaled up."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.solver import Options, minimize
from stc.solver.scaled_problem import ScaledProblem

#: The tip of a cantilever, moved in {microseconds} with forces and places in these units.
CANTILEVER = """
constants: n = 60, L = {length}, S = {time}, N = {force}, T = 40e-6/S, h = T/n,
  m = 1e-11*L/S^2/N, k = 0.1*L/N, d = 1e-7*L/S/N;
variables: x, f;
method: {rule};
constraints:
  [0, n]: m*x'' = -k*x - d*x' + f; -1e-8/N <= f <= 1e-8/N; x <= 5e-8/L;
  [0]: x; x'; [n]: x = 30e-9/L; x';
objective: [0, n]: integral(1e24*S*(N*f)^2);
"""


@pytest.mark.parametrize("rule", ["central", "trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("n", [20, 60, 300])
def test_units_make_no_difference(rule: str, n: int) -> None:
    tiny = stc.load(CANTILEVER.format(length=1, time=1, force=1, rule=rule), n=n).solve(max_iterations=30)
    usual = stc.load(CANTILEVER.format(length=1e-9, time=1e-6, force=1e-9, rule=rule), n=n).solve()
    assert tiny.status == usual.status == "optimal"
    assert tiny.objective == pytest.approx(usual.objective, rel=1e-6)
    np.testing.assert_allclose(tiny["x"], 1e-9 * usual["x"], atol=1e-12)


def test_small_variables_are_scaled_where_the_first_attempt_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """With one large variable among them the others are left alone at first."""
    spec = CANTILEVER.format(length=1, time=1, force=1, rule="central")
    model = stc.load(
        spec.replace("variables: x, f;", "variables: x, f, y; guess: y = 1;").replace(
            "[0]: x;", "[0]: y = 1; x;"
        )
    )
    problem, transcription = model.transcription()
    nlp = transcription.bind(problem.constants)
    scaled: list[bool] = []
    original = ScaledProblem._choose_scales

    def choose(self: ScaledProblem, x0: np.ndarray, small_too: bool, weak_below: float) -> None:
        scaled.append(small_too)
        original(self, x0, small_too, weak_below)

    monkeypatch.setattr(ScaledProblem, "_choose_scales", choose)
    result = minimize(nlp, Options())
    assert scaled[0] is False
    assert True in scaled
    assert result.status == "optimal"
    assert result.objective == pytest.approx(61.2771927, rel=1e-6)
