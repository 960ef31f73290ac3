"""Every way a solve can end, and what stands behind the word."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import INF, SymbolicProgram

from stc.solver import IterationRecord, Options, Status, minimize
from stc.solver.report import Start
from stc.solver.residuals import assess
from stc.solver.status import advice, sentence
from stc.symbolic.expr import call


def rosenbrock() -> SymbolicProgram:
    return SymbolicProgram([-1.2, 1.0], lambda x: 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2)


def test_every_status_has_a_sentence_and_all_but_success_have_advice() -> None:
    for status in Status:
        assert sentence(status).endswith(".")
        assert bool(advice(status)) is (status is not Status.OPTIMAL)


def test_optimal_holds_for_the_problem_as_stated() -> None:
    program = SymbolicProgram(
        [1.0, 5.0],
        lambda x: 1e5 * (x[0] - 3) ** 2 + x[1],
        lambda x: [(1e4 * x[0] * x[1], 1e4, INF)],
        lower=0.0,
    )
    result = minimize(program)
    assert result.status is Status.OPTIMAL
    judged = assess(program, result.x, result.row_multipliers)
    assert judged.optimality == result.optimality <= 1e-8
    assert judged.violation == result.violation <= 1e-8
    assert result.success


def test_infeasible_rows_come_with_a_certificate() -> None:
    """Two disjoint circles: the multipliers combine the violated rows' gradients to zero."""
    program = SymbolicProgram(
        [1.0, 1.0],
        lambda x: x[0] + x[1],
        lambda x: [(x[0] ** 2 + x[1] ** 2, 1.0, 1.0), ((x[0] - 4) ** 2 + x[1] ** 2, 1.0, 1.0)],
    )
    result = minimize(program)
    assert result.status is Status.INFEASIBLE
    assert result.x[1] == pytest.approx(0.0, abs=1e-4)
    _, rows = program.values(result.x)
    y = result.row_multipliers
    assert np.all(y * (rows - 1.0) > 0.0)
    _, jac, _ = program.derivatives(result.x, y, 0.0)
    stationary = np.bincount(program.jac_cols, weights=jac * y[program.jac_rows], minlength=2)
    assert stationary == pytest.approx([0.0, 0.0], abs=1e-5 * np.abs(jac).max())


def test_infeasible_linear_rows() -> None:
    program = SymbolicProgram(
        [0.0, 0.0], lambda x: x[0] ** 2, lambda x: [(x[0] + x[1], -INF, 1.0), (x[0] + x[1], 3.0, INF)]
    )
    result = minimize(program)
    assert result.status is Status.INFEASIBLE
    assert result.row_multipliers == pytest.approx([1.0, -1.0], abs=1e-4)


def test_rows_against_bounds() -> None:
    program = SymbolicProgram(
        [0.5] * 5, None, lambda x: [(sum(x[1:], x[0]), 10.0, 10.0)], lower=0.0, upper=1.0
    )
    result = minimize(program)
    assert result.status is Status.INFEASIBLE
    assert result.x == pytest.approx(np.ones(5), abs=1e-5)


def test_contradictory_bounds() -> None:
    result = minimize(SymbolicProgram([0.0], lambda x: x[0], lower=2.0, upper=1.0))
    assert result.status is Status.INFEASIBLE
    assert "contradict" in result.message
    assert result.iterations == 0


@pytest.mark.parametrize(
    "program",
    [
        SymbolicProgram([0.0, 0.0], lambda x: -x[0] - x[1], lambda x: [(x[0] - x[1], -INF, 1.0)], lower=0.0),
        SymbolicProgram([1.0, 2.0], lambda x: -(x[0] ** 2) - x[1] ** 2, lambda x: [(x[0] + x[1], 3.0, 3.0)]),
        SymbolicProgram([1.0], lambda x: -(x[0] ** 3)),
        SymbolicProgram([0.5, 1.0], lambda x: -x[1], lambda x: [(x[1] - x[0] ** 2, 0.0, INF)]),
        SymbolicProgram([0.0, 0.0], lambda x: x[1] ** 2 - call("exp", x[0])),
    ],
    ids=["linear", "concave", "cubic", "parabola", "exponential"],
)
def test_unbounded(program: SymbolicProgram) -> None:
    result = minimize(program)
    assert result.status is Status.UNBOUNDED
    # Where unknowns have grown that far, terms of a row are rounded by as much.
    assert result.violation < 1e-4 + 16 * np.finfo(float).eps * np.abs(result.x).max()
    assert result.objective < -1e3


def test_iteration_limit_keeps_the_best_point() -> None:
    result = minimize(rosenbrock(), Options(max_iterations=5))
    assert result.status is Status.ITERATION_LIMIT
    assert result.iterations == 5
    assert result.objective == min(record.objective for record in result.history)


LINE = SymbolicProgram([3.0, 1.0], lambda x: x[0] ** 2 + x[1] ** 2, lambda x: [(x[0] + x[1], 2.0, 2.0)])


@pytest.mark.parametrize("presolve", [True, False])
@pytest.mark.parametrize("program", [LINE, rosenbrock()], ids=["linear equations", "curved"])
def test_a_limit_of_no_iterations_returns_the_start(program: SymbolicProgram, presolve: bool) -> None:
    seen: list[IterationRecord] = []
    result = minimize(program, Options(max_iterations=0, presolve=presolve), seen.append)
    assert (result.status, result.iterations) == (Status.ITERATION_LIMIT, 0)
    assert result.x == pytest.approx(program.x0, rel=0, abs=0)
    assert [record.iteration for record in seen] == [0]


def test_a_start_that_is_optimal_is_told_without_an_iteration() -> None:
    none = Options(max_iterations=0)
    result = minimize(LINE, none, start=Start(np.array([1.0, 1.0])))
    assert (result.status, result.iterations) == (Status.OPTIMAL, 0)
    assert result.row_multipliers == pytest.approx([-2.0])
    held = SymbolicProgram([0.0], lambda x: x[0], lower=0.0)
    assert minimize(held, none).status is Status.OPTIMAL
    # Of three rows that hold with equality one would have to pull the wrong way.
    corner = SymbolicProgram(
        [1.0, 1.0],
        lambda x: (x[0] - 2) ** 2 + (x[1] - 2) ** 2,
        lambda x: [(x[0] + x[1], -INF, 2.0), (x[0] - 2 * x[1], -INF, -1.0), (x[0], 1.0, INF)],
    )
    result = minimize(corner, none)
    assert result.status is Status.OPTIMAL
    assert result.row_multipliers == pytest.approx([2.0, 0.0, 0.0])
    assert minimize(corner, none, start=Start(np.array([1.0, 1.001]))).status is Status.ITERATION_LIMIT
    solved = minimize(rosenbrock())
    again = minimize(rosenbrock(), none, start=Start(solved.x, solved.row_multipliers))
    assert (again.status, again.iterations) == (Status.OPTIMAL, 0)


def test_time_limit() -> None:
    result = minimize(rosenbrock(), Options(time_limit=0.0))
    assert result.status is Status.TIME_LIMIT
    assert np.all(np.isfinite(result.x))


def test_the_callback_can_stop() -> None:
    seen: list[IterationRecord] = []

    def watch(record: IterationRecord) -> bool:
        seen.append(record)
        return len(seen) == 4

    result = minimize(rosenbrock(), callback=watch)
    assert result.status is Status.INTERRUPTED
    assert [record.iteration for record in seen] == [0, 1, 2, 3]
    assert result.history == seen


def test_ctrl_c_in_the_middle_returns_the_best_point() -> None:
    program = rosenbrock()
    calls = 0
    values = program.values

    def interrupted(x: np.ndarray) -> tuple[float, np.ndarray]:
        nonlocal calls
        calls += 1
        if calls == 20:
            raise KeyboardInterrupt
        return values(x)

    program.values = interrupted  # type: ignore[method-assign]
    result = minimize(program)
    assert result.status is Status.INTERRUPTED
    assert result.objective < 24.2


def test_undefined_start() -> None:
    result = minimize(SymbolicProgram([-1.0], lambda x: call("log", x[0])))
    assert result.status is Status.FAILED
    assert "undefined" in result.message


def test_every_factorisation_is_counted() -> None:
    from solver.kkt.dense import DenseKKT

    made: list[DenseKKT] = []

    def counted(*args: object) -> DenseKKT:
        made.append(DenseKKT(*args))  # type: ignore[arg-type]
        return made[-1]

    result = minimize(rosenbrock(), new_kkt=counted)
    assert len(made) == 1
    assert result.factorizations == made[0].factorizations >= result.iterations


def test_the_same_answer_twice() -> None:
    """Random directions are seeded: nothing depends on the state of the process."""
    program = SymbolicProgram([0.0, 0.0], lambda x: x[0] ** 4 / 4 - x[0] ** 2 / 2 + x[1] ** 2 / 2)
    first, second = minimize(program), minimize(program)
    assert np.array_equal(first.x, second.x)
    assert first.iterations == second.iterations


def test_a_point_passed_on_the_way_counts_where_the_problem_confirms_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever the iteration made of it: the best point seen is judged like any other."""
    from stc.solver import sqp
    from stc.solver.outcome import End, Outcome

    def lost(self: object, outcome: Outcome) -> Outcome:
        outcome.end, outcome.error = End.STUCK, 1.0
        return outcome

    monkeypatch.setattr(sqp._Solve, "_settle", lost)
    flat = SymbolicProgram(
        [0.6, 0.8], lambda x: 7.0 + 0.0 * x[0], lambda x: [(x[0] ** 2 + x[1] ** 2, 1.0, 1.0)]
    )
    assert minimize(flat, Options(retries=0)).status is Status.OPTIMAL
    steep = SymbolicProgram([0.6, 0.8], lambda x: x[0], lambda x: [(x[0] ** 2 + x[1] ** 2, 1.0, 1.0)])
    assert minimize(steep, Options(retries=0, max_iterations=1)).status is not Status.OPTIMAL
