"""The compiled stages of an iteration, and what is done where one of them needs help."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from symbolic_program import SymbolicProgram

import stc
from stc.solver import Options, Status, minimize
from stc.solver.kkt import MultifrontalKKT, structured_kkt
from stc.solver.workspace import ROOM, Filter

#: The margins of a filter (line_search.c).
GAMMA_THETA, GAMMA_PHI = 1e-5, 1e-8

numbers = st.floats(-1e6, 1e6)


@pytest.mark.parametrize("name", ["cart_pole_swing_up", "luxo_jump", "segment_flip", "particle_jet"])
def test_attempts_change_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Factorisations in one call, and those that are made one step after the other."""

    def solve() -> stc.Solution:
        return stc.load(name).solve()

    with monkeypatch.context() as without:
        without.setattr(MultifrontalKKT, "attempt_call", None)
        expected = solve()
    found = solve()
    assert found.status == expected.status == "optimal"
    assert found.objective == pytest.approx(expected.objective, rel=1e-9)
    assert abs(found.iterations - expected.iterations) <= 1


class Failing(SymbolicProgram):
    """Raises in the middle of a solve."""

    left = 12

    def derivatives(self, x, y, factor):
        self.left -= 1
        if self.left == 0:
            raise ZeroDivisionError("in the middle")
        return super().derivatives(x, y, factor)


def test_exceptions_of_functions_arrive() -> None:
    def rosenbrock(x):
        return 100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2

    assert minimize(SymbolicProgram([-1.2, 1.0], rosenbrock, lower=-5.0)).success
    with pytest.raises(ZeroDivisionError, match="in the middle"):
        minimize(Failing([-1.2, 1.0], rosenbrock, lower=-5.0))


def test_an_interruption_keeps_the_best_point() -> None:
    class Interrupted(Failing):
        def derivatives(self, x, y, factor):
            try:
                return super().derivatives(x, y, factor)
            except ZeroDivisionError:
                raise KeyboardInterrupt from None

    nlp = Interrupted([-1.2, 1.0], lambda x: 100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2, lower=-5.0)
    result = minimize(nlp, Options())
    assert result.status is Status.INTERRUPTED
    least = min(record.objective for record in result.history)
    assert result.objective == pytest.approx(least, rel=1e-12) and least < 24.0


@pytest.mark.parametrize("most", [1, 4, 7])
def test_all_iterates_are_recorded_up_to_a_limit(most: int) -> None:
    """Those that were made in a row, and those that somebody has watched."""

    def solve(callback) -> list:
        problem, transcription = stc.load("cart_pole_swing_up").transcription(n=30)
        return minimize(transcription.bind(problem.constants), Options(max_iterations=most), callback)

    seen: list[float] = []
    alone, watched = solve(None), solve(lambda record: seen.append(record.objective))
    assert alone.status is watched.status is Status.ITERATION_LIMIT
    assert [record.iteration for record in alone.history] == list(range(most + 1))
    assert alone.history == watched.history
    assert seen == [record.objective for record in watched.history]
    np.testing.assert_array_equal(alone.x, watched.x)


def test_no_time_is_a_limit_too() -> None:
    problem, transcription = stc.load("cart_pole_swing_up").transcription(n=30)
    result = minimize(transcription.bind(problem.constants), Options(time_limit=0.0))
    assert result.status is Status.TIME_LIMIT
    assert len(result.history) == 1


@given(st.lists(st.tuples(st.floats(0.0, 1e3), numbers), max_size=30), st.floats(0.0, 1e3), numbers)
def test_a_filter_refuses_what_any_pair_dominates(
    pairs: list[tuple[float, float]], theta: float, phi: float
) -> None:
    own = Filter(500.0)
    for pair in pairs:
        own.add(*pair)
    dominated = any(theta > (1.0 - GAMMA_THETA) * t and phi > p - GAMMA_PHI * t for t, p in pairs)
    assert own.accepts(theta, phi) == (theta <= 500.0 and not dominated)


def test_the_oldest_pair_gives_way() -> None:
    own = Filter(np.inf)
    for k in range(ROOM + 3):
        own.add(1.0 + k, -float(k))
    assert own.accepts(1.5, 10.0)  # the first ones are forgotten
    assert not own.accepts(6.0, 10.0)
    assert not own.accepts(ROOM + 5.0, -10.0)


def test_solves_work_without_attempts_of_their_own() -> None:
    """As with a linear algebra that is watched, and called from Python."""

    class Plain:
        attempt_call = None

        def __init__(self, *arguments):
            self._inner = structured_kkt(*arguments)

        def __getattr__(self, name):
            return getattr(self._inner, name)

    def solve(new_kkt):
        problem, transcription = stc.load("cart_pole_swing_up").transcription(n=30)
        return minimize(transcription.bind(problem.constants), new_kkt=new_kkt)

    own, plain = solve(structured_kkt), solve(Plain)
    assert own.success
    assert (plain.iterations, plain.factorizations) == (own.iterations, own.factorizations)
    np.testing.assert_allclose(plain.x, own.x, rtol=1e-9, atol=1e-9)
