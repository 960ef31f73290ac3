"""Where a shift of the Hessian makes steps short, more than all of a step is taken."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import SymbolicProgram

import stc
from stc.solver import minimize
from stc.solver.report import IterationRecord
from stc.symbolic import expr

TRANSFER = """
constants: n = 200, T = {T}, thrust = {thrust}, flow = 0.0749;
variables: r, u, v, p;              # a sail's way outwards (Bryson & Ho 1975, 2.5): radius, speeds, angle of the thrust
method: trapezoidal;
definitions: h = T/n;
guess: r = 1 + 0.5*t/T; v = 1 - 0.2*t/T; p = pi*t/T;
constraints:
  [0, n]:
    r' = u;
    u' = v^2/r - 1/r^2 + thrust*sin(p)/(1 - flow*t);
    v' = -u*v/r + thrust*cos(p)/(1 - flow*t);
  [0]: r = 1; u; v = 1;
  [n]: u; v = 1/sqrt(r);
objective:
  [n]: -r;
"""


def _longer(history: list[IterationRecord]) -> list[IterationRecord]:
    return [record for record in history if record.step_length > 1.0]


def test_down_from_a_summit() -> None:
    """A sum of cosines from near its summit: a step without a shift leads up, one with a shift is short."""
    count = 5
    start = 0.02 * np.arange(1.0, count + 1.0)
    program = SymbolicProgram(
        start, lambda x: sum(expr.call("cos", value) for value in x), lambda x: [(sum(x), -100.0, 100.0)]
    )
    result = minimize(program)
    assert result.status == "optimal"
    assert result.objective == pytest.approx(-count, abs=1e-8)
    assert np.sin(result.x) == pytest.approx(np.zeros(count), abs=1e-6)  # odd multiples of pi
    assert _longer(result.history)


@pytest.mark.parametrize(("T", "thrust", "radius"), [(4.5, 0.12, 1.898473), (3.3207, 0.1405, 1.525495)])
def test_a_transfer_lengthens_shifted_steps(T: float, thrust: float, radius: float) -> None:
    """The angle enters by its sine alone, so that the Hessian is indefinite most of the way. Radii: of IPOPT."""
    history: list[IterationRecord] = []
    model = stc.load(TRANSFER.format(T=T, thrust=thrust))
    solution = model.solve(fewer_first=False, callback=history.append)
    assert solution.status == "optimal"
    assert -solution.objective == pytest.approx(radius, abs=1e-5)
    longer = _longer(history)
    assert longer
    assert all(record.regularization > 0.0 and record.phase == "barrier" for record in longer)


def test_a_step_of_newtons_is_taken_as_it_is() -> None:
    program = SymbolicProgram(
        [3.0, -1.0], lambda x: (x[0] - 1.0) ** 2 + 10.0 * x[1] ** 4, lambda x: [(x[0] + x[1], 0.5, np.inf)]
    )
    result = minimize(program)
    assert result.status == "optimal"
    assert not _longer(result.history)
