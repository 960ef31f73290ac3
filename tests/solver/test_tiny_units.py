"""Motions of nanometres in SI units: their variables are all tiny, and scaled up."""

from __future__ import annotations

import numpy as np
import pytest

import stc

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
    # A violation of 1e-10, which the tolerance allows, changes the objective by 2e-6 of it.
    assert tiny.objective == pytest.approx(usual.objective, rel=1e-5)
    np.testing.assert_allclose(tiny["x"], 1e-9 * usual["x"], atol=1e-12)
