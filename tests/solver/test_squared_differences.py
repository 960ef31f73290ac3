"""Rows of squared second differences, whose gradients vanish wherever the guess is straight."""

import pytest

import stc

#: A smooth curve through five places; its greatest acceleration is 0.7.
CURVE = """
constants: n = 60, T = 10, h = T/n, A = 2500;
variables: x, y;
method: central;
constraints:
  [0]: x; y = 0.9; [n/4]: x = -0.7; y = 0.9; [n/2]: x = 0.6; y = -0.2; [3*n/4]: x = 0.1; y = -0.9; [n]: x = 0.5; y;
  {limit}
objective: [0, n]: integral(x''^2 + y''^2);
"""
LIMIT = "[0, n]: x''^2 + y''^2 <= A;"


@pytest.mark.parametrize("n", [120, 300])
def test_a_limit_that_is_not_reached_changes_nothing(n: int) -> None:
    free = stc.load(CURVE.replace("{limit}", "")).solve(n=n)
    limited = stc.load(CURVE.replace("{limit}", LIMIT)).solve(n=n)
    assert limited.status == "optimal"
    assert limited.objective == pytest.approx(free.objective, rel=1e-7)
    assert limited.iterations < 60
