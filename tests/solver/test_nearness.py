"""Restoration stays near where it began, which is no proof that rows cannot be met farther away."""

import pytest

import stc

#: A state constraint of third order.  Its least value is 3280.2 in the limit (Hermite-Simpson, 1500 intervals).
SPEC = """
constants: n = 60, h = 1/n, l = 0.02;
variables: x, u;
method: hermite-simpson;
constraints:
  [0, n]: x''' = u; x <= l;
  [0]: x; x' = 1/2; x'' = 0;
  [n]: x; x' = -1/2; x'' = 0;
objective: [0, n]: integral(u^2/2);
"""


@pytest.mark.parametrize("n", [80, 150, 300])
def test_a_state_constraint_of_third_order_can_be_met(n: int) -> None:
    solution = stc.load(SPEC).solve(n=n)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(3280.2, rel=2e-3)


def test_what_cannot_be_met_is_still_infeasible() -> None:
    """The same below zero, where it begins and ends."""
    assert stc.load(SPEC).solve(l=-0.001).status == "infeasible"
