"""Convex programs are told from others, and what cannot be met is told at the first attempt there."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import INF, SymbolicProgram

import stc
from stc.solver.convexity import is_convex


class Bent(SymbolicProgram):
    """A program whose rows are told to bend in some ways."""

    def __init__(self, *bounds: tuple[int, float, float]) -> None:
        super().__init__([1.0, 1.0], rows=lambda x: [(x[0] * x[1], low, high) for _, low, high in bounds])
        self.bends = np.array([bend for bend, _, _ in bounds], np.int8)

    def row_bends(self):
        return self.bends


@pytest.mark.parametrize(
    ("bounds", "expected"),
    [
        ([(1, -INF, 1.0)], True),
        ([(1, 0.0, 1.0)], False),
        ([(1, 0.0, INF)], False),
        ([(-1, 0.0, INF)], True),
        ([(-1, -INF, 1.0)], False),
        ([(1, 1.0, 1.0)], False),
        ([(0, -INF, 1.0)], False),
        ([(0, -INF, INF)], True),
        ([(1, -INF, 1.0), (-1, 0.0, INF)], True),
        ([(1, -INF, 1.0), (-1, -INF, 0.0)], False),
    ],
)
def test_rows_and_bounds_tell(bounds, expected: bool) -> None:
    assert is_convex(Bent(*bounds)) is expected


def test_linear_rows_are_convex_and_others_unknown() -> None:
    assert is_convex(SymbolicProgram([1.0], rows=lambda x: [(2.0 * x[0], 1.0, 1.0)]))
    assert not is_convex(SymbolicProgram([1.0], rows=lambda x: [(x[0] * x[0], -INF, 1.0)]))


PUSHED = """
    constants: n = 30, T = 1, h = T/n, most = MOST;
    variables: x, y, u, v;
    constraints:
        [0, n]: x'' = u; y'' = v - 9.81; u^2 + v^2 <= most^2;
        [0]: x; y; x'; y'; [n]: x = 3; y = 1; x'; y';
    objective: [0, n]: integral(u^2 + v^2);
"""


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_a_convex_program_that_cannot_be_met_is_infeasible(method: str) -> None:
    """A mass is moved 3 m in a second: a force of 12 N is the least that does it, were there no gravity."""

    solution = stc.load(PUSHED.replace("MOST", "11")).solve(method=method)
    assert solution.status == "infeasible"
    assert solution.violation > 1e-3


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_one_that_can_be_met_is_solved(method: str) -> None:
    assert stc.load(PUSHED.replace("MOST", "20")).solve(method=method).status == "optimal"
