"""Robertson's kinetics: rates from 0.04 to 3e7, steps from 1e-67 to 5 s."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stc

SPEC = """
constants: n = 60, T = 40, q = 1.15, c = T*(q - 1)/(q^n - 1);
variables: y1, y2, y3;
parameters: k;
definitions: h = c*q^i;
method: trapezoidal;
guess: y1 = 1; k = 0.1;
constraints:
  0 <= k <= 1;
  [0, n]: y1' = -k*y1 + 1e4*y2*y3; y2' = k*y1 - 1e4*y2*y3 - 3e7*y2^2; y3' = 3e7*y2^2;
  [0]: y1 = 1; y2; y3;
  [n]: y1 = 0.7158;
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("n", [300, 1200])
def test_the_rate_is_found(n: int) -> None:
    """The steps at the end are those of q, whatever n: the error of the rate is that of theirs."""
    solution = stc.load(SPEC).solve(n=n)
    assert solution.status == "optimal"
    found = float(solution.parameters["k"])

    def rates(t: float, y: np.ndarray) -> list[float]:
        slow, fast = found * y[0] - 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
        return [-slow, slow - fast, fast]

    run = solve_ivp(rates, (0.0, 40.0), [1.0, 0.0, 0.0], method="Radau", rtol=1e-9, atol=1e-12)
    assert run.y[0, -1] == pytest.approx(0.7158, abs=5e-4)
