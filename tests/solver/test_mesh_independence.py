"""As many iterations on a fine motion as on a coarse one."""

from __future__ import annotations

from pathlib import Path

import stc

CART_POLE = Path(__file__).parents[1] / "problems" / "speed" / "p2_cart_pole.stc"


def test_iterations_hardly_depend_on_the_number_of_frames():
    model = stc.load(CART_POLE)
    solutions = [model.solve(n=n) for n in (50, 200, 1000)]
    assert {solution.status for solution in solutions} == {"optimal"}
    counts = [solution.iterations for solution in solutions]
    assert max(counts) <= min(counts) + 2
