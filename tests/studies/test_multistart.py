"""Several starts: the optima of functions whose optima are known, the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.studies.multistart import multistart

# Three wells near x = -2, 0 and 2, the deepest on the right.
WELLS = """
constants: n = 0;
variables: x;
guess: x = 1.9;
constraints: -3 <= x <= 3;
objective: x^2*(x - 2)^2*(x + 2)^2/10 + (1 - x/4)/2;
"""


def minima():
    x = np.linspace(-3, 3, 600_001)
    f = x**2 * (x - 2) ** 2 * (x + 2) ** 2 / 10 + (1 - x / 4) / 2
    inner = np.flatnonzero((f[1:-1] < f[:-2]) & (f[1:-1] < f[2:])) + 1
    return sorted(f[inner])


def test_it_finds_all_minima_of_a_function_of_one_variable():
    found = multistart(stc.load(WELLS), 20, 1)
    assert [one.objective for one in found.optima] == pytest.approx(minima(), abs=1e-7)
    assert sorted(start for one in found.optima for start in one.starts) == list(range(20))
    assert found.solution is found.optima[0].solution
    assert found.starts[0].start == 0  # the spec's own guess
    assert all(
        found.optima[one.optimum].objective == pytest.approx(one.objective, abs=1e-6) for one in found.starts
    )


def test_the_same_seed_gives_the_same_and_more_starts_go_on_from_there():
    few, again, more = (multistart(stc.load(WELLS), k, 3) for k in (4, 4, 6))
    assert few.to_dict() == again.to_dict()
    assert [s.objective for s in more.starts[:4]] == [s.objective for s in few.starts]
    other = multistart(stc.load(WELLS), 4, 4)
    assert [s.iterations for s in other.starts] != [s.iterations for s in few.starts]


def test_a_motion_is_perturbed_inside_its_bounds_and_keeps_what_is_pinned():
    seen = []
    model = stc.load("cart_pole_swing_up", n=20)

    def solve(**settings):
        problem, transcription = model.transcription()
        bound = transcription.bind(problem.constants, guess=settings["guess"])
        inside = np.clip(bound.x0, bound.bounds.lower, bound.bounds.upper)
        assert np.array_equal(inside, bound.x0)
        seen.append(transcription.recovery(bound.x0).trajectories()["a", 0].before)
        return model.solve(**settings, max_iterations=1)

    multistart(model, 4, 1, solve=solve)
    assert np.ptp([a[0] for a in seen]) == np.ptp([a[-1] for a in seen]) == 0
    middle = [a[10] for a in seen]
    assert min(abs(x - y) for k, x in enumerate(middle) for y in middle[:k]) > 1e-3
    assert max(np.abs(np.diff(a)).max() for a in seen) < 2.0  # smooth: no jump beside a pin


def test_starts_at_which_a_function_is_undefined_come_nearer():
    text = """
    constants: n = 0;
    variables: x;
    guess: x = 0.05;
    objective: x - log(x - 0.04);
    """
    found = multistart(stc.load(text), 8, 1)
    assert len(found.optima) == 1
    assert found.optima[0].objective == pytest.approx(1.04)
    assert {s.status for s in found.starts} <= {"optimal", "undefined"}


def test_without_an_optimum_the_least_violation_is_kept():
    text = "constants: n = 0; variables: x; guess: x = 3; constraints: x^2 = -1; objective: x;"
    found = multistart(stc.load(text), 3, 1)
    assert not found.optima
    assert found.solution.status == "infeasible"
    assert found.solution.violation == pytest.approx(1, abs=1e-6)


def test_mistakes_are_told():
    with pytest.raises(stc.UsageError, match="at least one start"):
        multistart(stc.load(WELLS), 0)
    with pytest.raises(stc.UsageError, match="seed"):
        multistart(stc.load(WELLS), 2, -1)
