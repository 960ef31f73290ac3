"""What a start tells: rows that nothing can change, and functions that have a value there but no finite slope."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import INF, SymbolicProgram

import stc
from stc.solver import Options, minimize
from stc.solver.residuals import rows_missed
from stc.symbolic.expr import call

#: A target that is fixed within a disc which is to be kept out of.
INSIDE = """
constants: n = 60, T = 4, h = T/n, R = RADIUS;
variables: x, y, u, v;
method: hermite-simpson;
constraints: [0, n]: x'' = u; y'' = v; u^2 + v^2 <= 4; (x - 1)^2 + y^2 >= R^2;
  [0]: x = -1; y = 0; x'; y'; [n]: x = 1.5; y = 0; x'; y';
objective: [0, n]: integral(u^2 + v^2);
"""


def test_a_violated_row_of_fixed_variables_is_told_at_once() -> None:
    solution = stc.load(INSIDE.replace("RADIUS", "0.6")).solve()
    assert solution.status == "infeasible"
    assert solution.iterations == 0
    assert "fixed variables" in solution.message
    assert stc.load(INSIDE.replace("RADIUS", "0.4")).solve().status == "optimal"


@pytest.mark.parametrize(("size", "missed"), [(1.0, True), (1e12, False)])
def test_what_rounding_leaves_of_fixed_rows_is_no_violation(size: float, missed: bool) -> None:
    """1e12 (0.1 + 0.2 - 0.3) is not 0 but for rounding; the same amount of small terms is."""
    off = size * (0.1 + 0.2) - size * 0.3 if size > 1.0 else 1e-4
    values = [0.1 + 0.2, 0.3] if size > 1.0 else [1e-4, 0.0]
    assert abs(off) > 1e-6
    program = SymbolicProgram(
        [*values, 0.0],
        lambda x: (x[2] - 1.0) ** 2,
        lambda x: [(size * x[0] - size * x[1], 0.0, 0.0)],
        lower=[*values, -INF],
        upper=[*values, INF],
    )
    assert bool(rows_missed(program, program.x0, 1e-6)[0]) is missed
    assert (minimize(program, Options(presolve=False)).status == "infeasible") is missed


def test_infinite_slopes_at_the_start_are_left() -> None:
    """sqrt(x) + x >= 1 from x = 0: the least x is (3 - sqrt(5))/2."""
    program = SymbolicProgram([0.0], lambda x: x[0], lambda x: [(call("sqrt", x[0]) + x[0], 1.0, INF)])
    result = minimize(program)
    assert result.status == "optimal"
    assert result.x[0] == pytest.approx((3.0 - np.sqrt(5.0)) / 2.0, rel=1e-6)


def test_slopes_that_stay_infinite_are_a_failure_and_no_exception() -> None:
    solution = stc.load(
        "constants: n = 20, T = 1, h = T/n; variables: x, y, u; method: trapezoidal;"
        "constraints: [0, n]: x' = u; y' = 1; sqrt(x^2 + y^2) <= 2; [0]: x; y; [n]: x = 1;"
        "objective: [0, n]: integral(u^2);"
    ).solve()
    assert solution.status in ("failed", "optimal")
