"""What is left out of a solve, against the solution of the whole and the conditions written out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from symbolic_program import INF, SymbolicProgram

from stc.errors import Source
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.solver import IterationRecord, Options, Start, Status, minimize
from stc.solver.evaluator import Scaling, python_evaluator
from stc.solver.presolve import presolved
from stc.solver.residuals import assess
from stc.transcription import transcribe

#: Of presolve.c.
SMALL_PIVOT = 1e-6

STANDING = """
    constants: n = 12, a = 7, h = 0.1;
    variables: x, y, u, v, f;
    method: trapezoidal;
    constraints:
      [0]: x = 0.1; x'; y = 0.5; y'; [0, a]: x''; f >= x + 1;
      [a + 1, n]: x'' = v + 0.1*sin(y); f = 0;
      [0, n]: y'' = u - y^2*f; -9 <= u <= 9; x <= 2; x + x' >= 0;
      [n]: y = 1; y'; x = 0.2;
    objective: [0, n]: integral(u^2 + v^2 + 0.1*f^2);
"""


def standing(changed: Callable[[str], str] = str) -> Any:
    """A body that stands until frame 7: its place, velocity and acceleration are known at every frame till then."""
    transcription = transcribe(elaborate(parse(Source("standing", changed(STANDING))), {}))
    transcription.compile()
    return transcription.bind()


def whole(program: Any) -> Any:
    """The same without any of that."""
    return minimize(program, Options(presolve=False))


def lagrangian_gradient(program: Any, x: np.ndarray, y: np.ndarray, weight: float = 1.0) -> np.ndarray:
    gradient, jac, _ = program.derivatives(x, y, weight)
    result = weight * gradient
    np.add.at(result, program.jac_cols, jac * y[program.jac_rows])
    return result


def determined_of(program: Any, less: Any) -> np.ndarray:
    """Variables that are left out without being fixed by their bounds."""
    return np.setdiff1d(np.flatnonzero(program.x_lower < program.x_upper), less.known.part.cols)


def test_a_body_that_stands_is_not_solved_for() -> None:
    program = standing()
    less = presolved(program)
    assert less is not None
    fixed = np.count_nonzero(program.x_lower == program.x_upper)
    assert less.known.equations.count == 14  # x and x' of frames 1 to 7
    assert less.n == program.n - fixed - 14
    assert less.m < program.m - 14  # x + x' >= 0 of those frames goes as well
    result, wanted = minimize(program), whole(program)
    assert result.status is wanted.status is Status.OPTIMAL
    assert result.x == pytest.approx(wanted.x, abs=1e-8)
    assert result.objective == pytest.approx(wanted.objective, rel=1e-9)
    judged = assess(program, result.x, result.row_multipliers)
    assert judged.optimality == result.optimality < 1e-8
    assert judged.violation == result.violation < 1e-10
    assert result.bound_multipliers.tolist() == judged.bound_multipliers.tolist()
    known = determined_of(program, less)
    slope = lagrangian_gradient(program, result.x, result.row_multipliers)
    assert np.abs(slope[known]).max() < 1e-12
    assert result.row_multipliers == pytest.approx(wanted.row_multipliers, abs=1e-6)


def test_it_starts_from_a_solution() -> None:
    program = standing()
    first = minimize(program)
    start = Start(first.x, first.row_multipliers, first.bound_multipliers)
    again = minimize(program, Options(warm_start=True), start=start)
    assert again.status is Status.OPTIMAL
    assert again.iterations <= 1
    assert again.x == pytest.approx(first.x, abs=1e-8)


def test_callers_see_the_whole_point() -> None:
    program = standing()
    seen: list[np.ndarray] = []

    def told(record: IterationRecord) -> bool:
        assert record.x is not None
        seen.append(record.x.copy())
        return len(seen) == 3

    result = minimize(program, callback=told)
    assert result.status is Status.INTERRUPTED
    assert result.x.size == program.n
    less = presolved(program)
    assert less is not None
    for x in seen:
        known = determined_of(program, less)
        assert x[known] == pytest.approx(less.all_variables(x[less.known.part.cols])[known])
        assert np.array_equal(
            x[program.x_lower == program.x_upper], program.x_lower[program.x_lower == program.x_upper]
        )


def test_a_start_is_that_of_what_is_left() -> None:
    program = standing()
    less = presolved(program)
    assert less is not None
    found = less.start(
        Start(np.arange(float(program.n)), np.arange(float(program.m)), -np.arange(float(program.n)))
    )
    part = less.known.part
    assert found.x.tolist() == part.cols.tolist()
    assert found.row_multipliers is not None and found.row_multipliers.tolist() == part.rows.tolist()
    assert found.bound_multipliers is not None and (-found.bound_multipliers).tolist() == part.cols.tolist()


def test_evaluators_of_what_is_left() -> None:
    """Against the whole program's numbers, picked and scaled in NumPy; whatever was evaluated in between."""
    program = standing()
    less = presolved(program)
    assert less is not None
    rng = np.random.default_rng(5)
    scaling = Scaling(
        np.exp2(rng.integers(-3, 4, less.n)),
        rng.uniform(0.1, 3.0, less.m),
        0.7,
        rng.random(less.n) > 0.2,
        rng.random(less.m) > 0.2,
    )
    one, other = less.evaluator(scaling), python_evaluator(less, scaling)
    for _ in range(3):
        x, y = rng.standard_normal(less.n), rng.standard_normal(less.m)
        for each in (one, other):
            each.x[:], each.y[:], each.weight[0] = x, y, 0.3
            each.values_call()
            each.derivatives_call()
            program.derivatives(rng.standard_normal(program.n), rng.standard_normal(program.m), 1.0)
        for name in ("f", "r", "values_status", "gradient", "jac", "hess", "derivatives_status"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-13, err_msg=name)


def test_what_contradicts_bounds_or_rows_is_left_to_the_solver() -> None:
    beyond = standing(lambda text: text.replace("x <= 2;", "x <= 2; [3]: x <= 0.05; [0, n]:"))
    assert presolved(beyond) is None
    against = SymbolicProgram(
        [0.0] * 3,
        lambda x: x[2] ** 2,
        lambda x: [(2 * x[0], 1.0, 1.0), (x[0] + x[1], 1.0, 1.0), (x[0] * x[1], 1.0, INF)],
    )
    assert presolved(against) is None
    result = minimize(against)
    assert result.status is Status.INFEASIBLE


def test_rows_without_unknowns_go_where_they_hold() -> None:
    """Two ways to say the same, and a condition of known variables alone: none has a multiplier."""
    program = SymbolicProgram(
        [5.0, 5.0, 5.0],
        lambda x: (x[2] - x[1]) ** 2,
        lambda x: [
            (2 * x[0], 1.0, 1.0),
            (4 * x[0], 2.0, 2.0),
            (x[0] + x[1], 2.0, 2.0),
            (x[0] * x[1], 0.0, INF),
        ],
        upper=[INF, INF, 1.0],
    )
    less = presolved(program)
    assert less is not None
    assert (less.n, less.m) == (1, 0)
    result = minimize(program)
    assert result.x == pytest.approx([0.5, 1.5, 1.0])
    assert result.status is Status.OPTIMAL
    # d objective = -1 for x1, +1 for the bound of x2; x1 = 2 - x0 and x0 = 1/2 pass it on
    assert result.row_multipliers == pytest.approx([0.5, 0.0, -1.0, 0.0])
    assert result.bound_multipliers == pytest.approx([0.0, 0.0, 1.0])


def test_everything_may_be_known() -> None:
    program = SymbolicProgram(
        [7.0, 7.0], lambda x: x[1] ** 3, lambda x: [(x[0], 2.0, 2.0), (x[1] - x[0], 1.0, 1.0)]
    )
    result = minimize(program)
    assert result.status is Status.OPTIMAL
    assert result.x == pytest.approx([2.0, 3.0])
    assert result.objective == pytest.approx(27.0)
    assert result.row_multipliers == pytest.approx([-27.0, -27.0])
    assert result.iterations == 0


def test_small_coefficients_tell_nothing() -> None:
    for coefficient, determined in ((0.1 * SMALL_PIVOT, False), (10.0 * SMALL_PIVOT, True)):
        program = SymbolicProgram(
            [0.0, 0.0], lambda x: x[1] ** 2, lambda x, c=coefficient: [(x[0] + c * x[1], 1.0, 1.0)],
            lower=[1.0, -INF], upper=[1.0, INF],
        )  # fmt: skip
        assert (presolved(program) is not None) is determined


def test_a_certificate_of_infeasibility_holds_for_the_whole() -> None:
    """Multipliers that combine gradients to zero, those of known variables too; the objective has no part in it."""
    program = SymbolicProgram(
        [0.0, 1.0, 1.0, 1.0],
        lambda x: x[0] * 100.0 + x[1],
        lambda x: [
            (x[0] - x[3], 0.0, 0.0),
            (x[1] ** 2 + x[2] ** 2 + x[0], 2.0, 2.0),
            ((x[1] - 4) ** 2 + x[2] ** 2, 1.0, 1.0),
        ],
        lower=[-INF, -INF, -INF, 1.0],
        upper=[INF, INF, INF, 1.0],
    )
    assert presolved(program) is not None
    result = minimize(program)
    assert result.status is Status.INFEASIBLE
    slope = lagrangian_gradient(program, result.x, result.row_multipliers, 0.0)
    assert np.abs(result.row_multipliers).max() > 0.1
    assert slope[:3] == pytest.approx(np.zeros(3), abs=1e-4)


def test_functions_without_values_are_left_to_the_solver() -> None:
    from stc.symbolic.expr import call

    program = SymbolicProgram([0.0, -1.0], lambda x: call("log", x[1]), lambda x: [(x[0], 1.0, 1.0)])
    assert presolved(program) is None
    assert minimize(program).status is Status.FAILED


def test_an_optimum_that_the_whole_does_not_confirm_is_solved_for_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from stc.solver import presolve

    program = standing()
    wanted = whole(program)

    def wrong(equations: Any, weight: float, gradient: np.ndarray, y: np.ndarray) -> None:
        y[:] = 1e3

    right = presolve.function
    monkeypatch.setattr(
        presolve, "function", lambda name: wrong if name == "presolve_balance" else right(name)
    )
    result = minimize(program)
    assert result.status is Status.OPTIMAL
    assert result.x.tolist() == wanted.x.tolist()


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 6), st.integers(0, 3), st.integers(0, 2**31))
def test_quadratic_programs_have_their_closed_solution(determined: int, others: int, seed: int) -> None:
    """A triangular system, shuffled, determines some variables; dense algebra solves for all at once."""
    rng = np.random.default_rng(seed)
    n = determined + others + 1
    order, rows_in = rng.permutation(n), rng.permutation(determined + (others > 1))
    matrix = np.zeros((len(rows_in), n))
    for k in range(determined):
        matrix[k, order[: k + 1]] = rng.choice([-1.0, 0.0, 2.0], k + 1)
        matrix[k, order[k]] = rng.choice([-2.0, 0.5, 1.0])
    if others > 1:
        matrix[-1, order] = rng.uniform(-1.0, 1.0, n)
    matrix = matrix[rows_in]
    right, target = rng.uniform(-2.0, 2.0, len(rows_in)), rng.uniform(-2.0, 2.0, n)
    root = rng.uniform(-1.0, 1.0, (n, n))
    hessian = root @ root.T + np.eye(n)

    def objective(x: Any) -> Any:
        return sum(
            (float(hessian[i, j]) / 2) * (x[i] - float(target[i])) * (x[j] - float(target[j]))
            for i in range(n)
            for j in range(n)
        )

    def rows(x: Any) -> Any:
        sums = [sum((float(a) * v for a, v in zip(row, x) if a), 0.0 * x[0]) for row in matrix]
        return [(total, float(b), float(b)) for total, b in zip(sums, right)]

    program = SymbolicProgram(rng.uniform(-9.0, 9.0, n).tolist(), objective, rows)
    less = presolved(program)
    assume(less is not None)
    assert less is not None
    assert less.known.equations.count >= determined
    zero = np.zeros((len(matrix), len(matrix)))
    exact = np.linalg.solve(
        np.block([[hessian, matrix.T], [matrix, zero]]), np.concatenate([hessian @ target, right])
    )
    result = minimize(program)
    assert result.status is Status.OPTIMAL
    scale = 1.0 + np.abs(exact).max()
    assert np.abs(np.concatenate([result.x, result.row_multipliers]) - exact).max() < 1e-7 * scale
