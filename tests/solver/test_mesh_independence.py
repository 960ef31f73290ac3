"""As many iterations on a fine motion as on a coarse one."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc

CART_POLE = Path(__file__).parents[1] / "problems" / "speed" / "p2_cart_pole.stc"


def test_iterations_hardly_depend_on_the_number_of_frames():
    model = stc.load(CART_POLE)
    solutions = [model.solve(n=n) for n in (50, 200, 1000)]
    assert {solution.status for solution in solutions} == {"optimal"}
    counts = [solution.iterations for solution in solutions]
    assert max(counts) <= min(counts) + 2


LANDING = """
constants: n = 200, g = 1.62, most = 18.148, m0 = 2.583, c = 24.268;
variables: x, z, m, fx, fz;
parameters: T;
method: hermite-simpson;
definitions: h = T/n;
guess: T = 5.188; m = m0; fz = m0*g; x = 2.066*(1 - t/T); z = 10*(1 - t/T);
constraints:
  0.5 <= T <= 40;
  [0, n]:
    m*x'' = fx; m*z'' = fz - m*g; m' = -sqrt(fx^2 + fz^2 + 1e-6)/c;
    fx^2 + fz^2 <= most^2; fz >= 0; z >= 0; m >= 0.2; fz >= 0.5*fx; fz >= -0.5*fx;
  [0]: x = 2.066; z = 10; x' = -0.715; z' = -1.901; m = m0;
  [n]: x; z; x'; z';
objective: [n]: -m;
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("n", [2000, 3000])
def test_many_bounds_do_not_add_up_to_another_optimum(n: int):
    """Each of ten thousand and more products of gap and multiplier may be small, and their sum not: it is what the
    objective may be off by."""
    model = stc.load(LANDING)
    coarse, fine = model.solve(n=200), model.solve(n=n)
    assert fine.status == coarse.status == "optimal"
    assert abs(fine.objective - coarse.objective) < 1e-5
