"""Linear and quadratic programs that fall without limit, and some whose solution is far away, beside another solver."""

from __future__ import annotations

import numpy as np
import pytest
from quadratic_program import Quadratic
from scipy.optimize import linprog
from scipy.sparse import csr_matrix

import stc
from stc.solver import Options, minimize
from stc.solver.recession import RecessionProblem, falls_forever

INF = float("inf")


def _random(seed: int) -> tuple[Quadratic, np.ndarray]:
    """A program and a feasible point of it; half of them bend, in some directions."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(3, 9)), int(rng.integers(1, 7))
    matrix, point = rng.integers(-3, 4, (m, n)).astype(float), rng.normal(size=n)
    value = matrix @ point
    kind = rng.integers(0, 4, m)  # an equation, one bound, the other, two
    lower = np.where(kind == 0, value, np.where(kind == 2, -INF, value - rng.random(m)))
    upper = np.where(kind == 0, value, np.where(kind == 1, INF, value + rng.random(m)))
    kind = rng.integers(0, 4, n)
    low = np.where((kind == 1) | (kind == 3), point - rng.random(n), -INF)
    high = np.where((kind == 2) | (kind == 3), point + rng.random(n), INF)
    root = rng.normal(size=(int(rng.integers(1, n)), n)) if seed % 2 else np.zeros((1, n))
    return Quadratic(rng.normal(size=n), root.T @ root, matrix, (lower, upper), (low, high)), point


def _falls(program: Quadratic) -> bool:
    """The truth: whether a direction in the cone, in which nothing bends, leads downhill."""
    equal = np.isfinite(program.row_lower) & np.isfinite(program.row_upper)
    below = np.isfinite(program.row_lower) & ~equal
    above = np.isfinite(program.row_upper) & ~equal
    still = np.vstack([program.matrix[equal], program.curvature])
    apart = np.vstack([-program.matrix[below], program.matrix[above], np.zeros((1, program.n))])
    bounds = [
        (0.0 if np.isfinite(low) else -1.0, 0.0 if np.isfinite(high) else 1.0)
        for low, high in zip(program.x_lower, program.x_upper, strict=True)
    ]
    answer = linprog(
        program.gradient, apart, np.zeros(len(apart)), still, np.zeros(len(still)), bounds, method="highs"
    )
    assert answer.status == 0
    return bool(answer.fun < -1e-6)


@pytest.mark.parametrize("seed", range(60))
def test_random_programs_fall_or_do_not(seed: int) -> None:
    program, point = _random(seed)
    assert falls_forever(program, point, np.ones(program.n), Options())[0] is _falls(program)
    assert minimize(program).status.value == ("unbounded" if _falls(program) else "optimal")


def test_some_of_these_fall() -> None:
    assert {_falls(_random(seed)[0]) for seed in range(0, 60, 2)} == {True, False}
    assert {_falls(_random(seed)[0]) for seed in range(1, 60, 2)} == {True, False}


def test_derivatives_are_those_of_values() -> None:
    program, point = _random(7)
    cone = RecessionProblem(program, point, np.full(program.n, 2.0))
    rng = np.random.default_rng(7)
    x, y, way = rng.normal(size=program.n), rng.normal(size=program.m), rng.normal(size=program.n)
    gradient, jac, hess = cone.derivatives(x, y, 1.0)
    step = 1e-6
    ahead, behind = cone.values(x + step * way), cone.values(x - step * way)
    assert (ahead[0] - behind[0]) / (2.0 * step) == pytest.approx(gradient @ way, rel=1e-6)
    rows = np.bincount(cone.jac_rows, jac * way[cone.jac_cols], cone.m)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2.0 * step), rows, rtol=1e-6)
    full = np.zeros((cone.n, cone.n))
    full[cone.hess_rows, cone.hess_cols] = full[cone.hess_cols, cone.hess_rows] = hess
    turned = cone.derivatives(x + way, y, 1.0)[0] - gradient
    np.testing.assert_allclose(turned, full @ way, rtol=1e-9)


#: A force without limits pays for itself where another one holds a neighbour: found along no ray from the origin.
FALLING = """
constants: n = 150, T = 8.588, h = T/n;
variables: x0, x1, u0, u1;
method: trapezoidal;
constraints:
  [0, n]:
    x0'' = u0 - 1.653*x0 - 0.881*x1 - 0.419*x0'; x1'' = u1 - 1.38*x0 - 1.016*x1 - 0.155*x1';
    -1.282 <= u1 <= 1.282; x1 <= 0.91;
  [0]: x0 = -0.43; x0'; x1 = -0.746; x1'; [12]: x0 = -0.915; [148]: x1 = -0.855; [n]: x0' = -0.02; x1';
objective: [n]: 0.08*x0; [0, n]: integral(0.41*u0);
"""


def test_a_motion_that_falls_though_rays_do_not_tell() -> None:
    solution = stc.load(FALLING).solve()
    assert solution.status == "unbounded"
    assert solution.iterations <= 100


#: Third differences and a force without limits: the solution has forces of 1e8, beside which slopes of 1e-9 count.
FAR_OFF = """
constants: n = 20, T = 5.97, h = T/n;
variables: x0, x1, x2, u0, u1, u2;
method: trapezoidal;
constraints:
  [0, n]:
    x0''' = u0 - 0.022*x1 - 0.486*x2 + 0.961*x0'; x1''' = u1 + 1.963*x0 + 0.988*x1; x2''' = u2 - 1.713*x1;
    -19.24 <= u0 <= 19.24; x0 <= 2.524; -1.051 <= x0' <= 1.051; -7.394 <= u2 <= 7.394; x2 <= 1.023;
  [0]: x0; x0' = 0.785; x0'' = 0.089; x1 = 0.769; x1'; x1'' = -0.552; x2 = -0.026; x2' = -0.084; x2'' = -0.57;
  [6]: x1 = -0.528;
  [n]: x0 = 0.796; x0' = -0.603; x0''; x1; x1'' = -0.666; x2'' = -0.636;
objective: [n]: 0.25*x0; [0, n]: integral(-0.6*u0);
"""


def test_slopes_count_where_variables_are_large() -> None:
    model = stc.load(FAR_OFF)
    problem, transcription = model.transcription()
    bound = transcription.bind(problem.constants)
    origin = np.zeros(bound.n)
    f, r = bound.values(origin)
    gradient, jac, _ = bound.derivatives(origin, np.zeros(bound.m), 1.0)
    gradient, rows = gradient.copy(), csr_matrix((jac, (bound.jac_rows, bound.jac_cols)), (bound.m, bound.n))
    equal = bound.row_lower == bound.row_upper
    limits = rows[~equal], (bound.row_lower - r)[~equal], (bound.row_upper - r)[~equal]
    matrix, low, high = limits
    answer = linprog(
        gradient,
        np.vstack([matrix[np.isfinite(high)].toarray(), -matrix[np.isfinite(low)].toarray()]),
        np.concatenate([high[np.isfinite(high)], -low[np.isfinite(low)]]),
        rows[equal],
        (bound.row_lower - r)[equal],
        np.column_stack([bound.x_lower, bound.x_upper]),
        method="highs",
    )
    assert answer.status == 0
    solution = model.solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(answer.fun + f, rel=1e-6)
