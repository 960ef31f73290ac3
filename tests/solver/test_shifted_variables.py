"""A problem whose variables or rows are shifted far from 0 is the same problem: bounds give way no more than before."""

from __future__ import annotations

import numpy as np
import pytest
from quadratic_program import Quadratic
from scipy.optimize import linprog
from solver.kkt.dense import DenseKKT
from symbolic_program import SymbolicProgram

import stc
from stc.solver import Options, minimize
from stc.solver.scaled_problem import ScaledProblem

#: A smooth path in a tube, and the path of least total variation in it.
SMOOTH = """
constants: n = 60, far = FAR, room = 0.5;
variables: x;
guess: x = far;
constraints: [0,n]: far + sin(i/5) - room <= x <= far + sin(i/5) + room;
objective: [1,n-1]: (x[i+1] - 2*x + x[i-1])^2;
"""
STEADY = """
constants: n = 60, far = FAR, room = 0.5;
variables: x, p;
guess: x = far;
constraints: [0,n]: far + sin(i/5) - room <= x <= far + sin(i/5) + room;
  [0,n-1]: x[i+1] - x <= p; x - x[i+1] <= p; [n]: p = 0;
objective: [0,n]: p;
"""


def variation() -> float:
    """The least total variation, by SciPy."""
    n = 60
    middle = np.sin(np.arange(n + 1) / 5)
    step = np.diff(np.eye(n + 1), axis=0)
    matrix = np.block([[step, -np.eye(n)], [-step, -np.eye(n)]])
    bounds = [*zip(middle - 0.5, middle + 0.5, strict=True), *[(0.0, None)] * n]
    return float(
        linprog(np.repeat([0.0, 1.0], [n + 1, n]), A_ub=matrix, b_ub=np.zeros(2 * n), bounds=bounds).fun
    )


@pytest.mark.parametrize("far", [1e3, 1e5, 6.378e6])
def test_paths_far_from_the_origin(far: float) -> None:
    near, there = (stc.load(SMOOTH.replace("FAR", f"{v}")).solve() for v in (0, far))
    assert near.status == there.status == "optimal"
    assert there.objective == pytest.approx(near.objective, rel=1e-5)
    assert there.iterations < 2 * near.iterations
    steady = stc.load(STEADY.replace("FAR", f"{far}")).solve()
    assert steady.status == "optimal"
    assert steady.objective == pytest.approx(variation(), rel=1e-7)


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e5, 1e7])
def test_a_fit_by_least_absolute_deviations_does_not_profit_from_large_data(offset: float) -> None:
    """Each of its thirty rows may give way by rounding only, not by a billionth of the data."""
    rng = np.random.default_rng(0)
    at = np.column_stack([np.ones(15), rng.normal(size=(15, 2))])
    data = offset + rng.normal(size=15)
    unit, none = np.eye(15), np.full(15, np.inf)
    program = Quadratic(
        np.repeat([0.0, 1.0], [3, 15]),
        np.zeros((18, 18)),
        np.block([[at, unit], [at, -unit]]),
        (np.concatenate([data, -none]), np.concatenate([none, data])),
        (np.full(18, -np.inf), np.full(18, np.inf)),
    )
    found = minimize(program)
    known = linprog(
        program.gradient,
        A_ub=np.block([[-at, -unit], [at, -unit]]),
        b_ub=np.concatenate([-(data - offset), data - offset]),
        bounds=(None, None),
    )
    assert found.status == "optimal"
    assert found.objective == pytest.approx(known.fun, rel=1e-6)


def _shifted(seed: int, by: float) -> Quadratic:
    """A random convex quadratic program whose variables are all ``by`` farther up or down; the same but for that, and
    for a constant in the objective."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(4, 15)), int(rng.integers(2, 12))
    matrix = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.7)
    point, root = 10.0 * rng.normal(size=n), rng.normal(size=(n // 2, n))
    value, curvature = matrix @ point, 10.0 ** rng.uniform(-3.0, 3.0) * root.T @ root
    row, bound = rng.integers(0, 3, m), rng.integers(0, 4, n)  # an equation, one limit, the other; none
    y = np.where(row == 1, -1.0, 1.0) * 10.0 ** rng.uniform(-3.0, 2.0, m)
    z = np.select([bound == 0, bound == 1], [-1.0, 1.0], 0.0) * 10.0 ** rng.uniform(-3.0, 2.0, n)
    gradient = -(curvature @ point + matrix.T @ y + z)  # all of these are active
    away = np.where(np.arange(n) % 2, by, -by)
    program = Quadratic(
        gradient - curvature @ away,
        curvature,
        matrix,
        (
            np.where(row == 2, -np.inf, value) + matrix @ away,
            np.where(row == 1, np.inf, value) + matrix @ away,
        ),
        (np.where(bound == 0, point, -np.inf) + away, np.where(bound == 1, point, np.inf) + away),
    )
    program.x0 = 10.0 * rng.normal(size=n) + away
    return program


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("by", [1e5, 3e5])
def test_quadratic_programs_do_not_depend_on_the_origin(seed: int, by: float) -> None:
    """The objective is as large as the constant makes it, so that a millionth of it would be much near the origin."""
    near, far = _shifted(seed, 0.0), _shifted(seed, by)
    known, found = minimize(near), minimize(far)
    assert known.status == found.status == "optimal"
    assert found.objective == pytest.approx(far.values(known.x + (far.x0 - near.x0))[0], rel=1e-8)


def test_bounds_give_way_in_their_own_units() -> None:
    """A slack that matters little to its row is measured in large units; a billionth of these is too much of it."""
    nlp = SymbolicProgram(
        [3.0, 2.0, 0.0],
        lambda x: x[0] + x[1],
        lambda x: [(1e9 * (x[0] * x[1] - 1.0) - x[2], 0.0, 0.0)],
        lower=[0.1, 0.1, 0.0],
    )
    form = ScaledProblem(nlp, nlp.x0, Options(), DenseKKT)
    assert form.x_scale[2] > 1e6
    given_way = (nlp.x_lower - form.lower[: nlp.n] * form.x_scale)[2]
    assert 0.0 < given_way < Options().feasibility_tolerance


#: A point goes over a bump between walls; from a guess that goes through it, rounding decides which optimum is found.
WALLS = """
constants: n = 60, T = 10, h = T/n, far = FAR, way = 10, most = 1, height = 4;
variables: x, y, u, w;
method: trapezoidal;
guess: x = far + way*i/n; y = far + height*sin(pi*i/n);
constraints: [0,n]: x'' = u; y'' = w; -most <= u <= most; -most <= w <= most;
  y >= far + height - (x - far - way/2)^2; far - 1 <= x <= far + way + 1; far - 1 <= y <= far + 10;
  [0]: x = far; y = far; x'; y';
  [n]: x = far + way; y = far; x'; y';
objective: [0,n]: integral(u^2 + w^2);
"""


@pytest.mark.parametrize("far", [1e5, 6.378e6])
def test_a_motion_far_from_the_origin(far: float) -> None:
    """Beside coordinates of the size of the earth, walls give way no more than beside those of a room."""
    near, there = (stc.load(WALLS.replace("FAR", f"{v}")).solve() for v in (0, far))
    assert near.status == there.status == "optimal"
    assert there.objective == pytest.approx(near.objective, rel=1e-6)
