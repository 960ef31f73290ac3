"""Rows divided by 1e8 leave matrices singular to working precision, unless the objective is divided as well."""

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.solver.kkt.reuse import forget

BEAM = Path(__file__).parents[1] / "problems" / "traj" / "beam_load.stc"


@pytest.fixture(autouse=True)
def no_plans() -> None:
    """At the limit of what rounding allows, the order of elimination that another test has left may decide."""
    forget()


@pytest.mark.parametrize("n", [240, 300, 480])
def test_fourth_differences_on_many_frames(n: int) -> None:
    """The load converges with the square of the interval: two coarse grids foretell it on a finer one."""
    model = stc.load(BEAM)
    coarse, finer = (model.solve(n=k).objective for k in (120, 180))
    slope = (coarse - finer) / (120**-2 - 180**-2)
    solution = model.solve(n=n)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(coarse + slope * (n**-2 - 120**-2), rel=1e-6)


@pytest.mark.parametrize("most", [4.0, 4.5, 5.0])
def test_fourth_differences_with_a_limit(most: float) -> None:
    """The same, from grids on which nothing is singular; bounds hold somewhere between frames."""
    model = stc.load(BEAM.read_text().replace("objective:", f"[0, n]: -{most} <= w <= {most};\nobjective:"))
    coarse = np.array([40, 60, 80, 100])
    loads = [model.solve(n=n).objective for n in coarse]
    slope, limit = np.polyfit(coarse**-2.0, loads, 1)
    for n in (120, 180, 240):
        solution = model.solve(n=n)
        assert solution.status == "optimal"
        assert solution.objective == pytest.approx(limit + slope * n**-2, rel=5e-4)
