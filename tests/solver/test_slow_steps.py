"""Where only a share of the rows' curvature is used, and that makes an iteration slow, all of it is used again."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc

ALP_RIDER = Path(__file__).parents[1] / "problems" / "literature" / "alp_rider.stc"


@pytest.mark.parametrize(
    ("method", "n"), [("trapezoidal", 60), ("trapezoidal", 300), ("hermite-simpson", 60)]
)
def test_iterations_do_not_creep(method: str, n: int) -> None:
    """Whole steps that each took one per cent off the error went on for thousands of iterations."""
    solution = stc.load(ALP_RIDER, n=n).solve(method=method, max_iterations=300)
    assert solution.status == "optimal"
    assert solution.optimality <= 1e-8
