"""Bounds of decision variables: what several statements, and one statement at many frames, leave of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import stc
from stc.transcription.bind import BoundProgram, _tighten

TEXT = """
constants: n = 40, T = 2, h = T/n;
variables: x;
parameters: p;
method: trapezoidal;
constraints:
  [0, n]: x' = p;
  1 <= p <= 9;
  [0, n]: p >= 1.5 + t;
  [5, 20]: p <= 6 - t;
  [3, 9]: 0 <= x <= 4 + t;
  [0]: x;
objective: [0]: p^2;
"""


def bound(text: str, **constants: float) -> BoundProgram:
    problem, transcription = stc.load(text).compiled(None, constants)
    return transcription.bind(problem.constants)


def of_parameter(program: BoundProgram) -> int:
    """Its place: nothing else is at least 1."""
    return int(np.flatnonzero(program.x_lower >= 1.0)[0])


@pytest.mark.parametrize("n", [40, 4000])
def test_the_tightest_of_all_frames_holds(n: int) -> None:
    program = bound(TEXT.replace("[5, 20]", "[n/8, n/2]").replace("[3, 9]", "[n/20, n/5]"), n=n)
    at = of_parameter(program)
    assert program.x_lower[at] == pytest.approx(3.5)  # at the end
    assert program.x_upper[at] == pytest.approx(5.0)  # half way
    assert not program.contradictions
    assert np.count_nonzero(program.x_lower == 0.0) == n // 5 - n // 20 + 2  # and x at the first frame


def test_whose_bound_it_is() -> None:
    program = bound(TEXT)
    at = of_parameter(program)
    lower, upper = program.bounds.lower_from[at], program.bounds.upper_from[at]
    relations = stc.load(TEXT).problem().relations
    assert "1.5" in relations[lower].text
    assert "6 - t" in relations[upper].text


def test_a_tie_belongs_to_the_first() -> None:
    text = TEXT.replace("p >= 1.5 + t", "p >= 1")
    program = bound(text)
    first = program.bounds.lower_from[of_parameter(program)]
    assert "1 <= p" in stc.load(text).problem().relations[first].text


def test_frames_that_exclude_each_other_are_told_once() -> None:
    program = bound(TEXT.replace("6 - t", "3 - t"))
    (contradiction,) = program.contradictions
    assert contradiction.gap == pytest.approx(3.5 - 2.0)
    assert contradiction.name == "p"


@given(
    st.lists(
        st.tuples(st.integers(0, 5), st.sampled_from([-math.inf, -1.0, 0.0, 0.5, 2.0, math.nan])), max_size=20
    )
)
def test_bounds_are_intersected_one_by_one_or_at_once(bounds: list[tuple[int, float]]) -> None:
    limits, owners = np.array([-math.inf, -1.0, 0.0, 0.5, 1.0, math.inf]), np.full(6, -1)
    expected, belong = limits.copy(), owners.copy()
    for at, value in bounds:
        if value > expected[at]:
            expected[at], belong[at] = value, 7
    places = np.array([at for at, _ in bounds], dtype=np.int64)
    _tighten(np.fmax, limits, owners, places, np.array([value for _, value in bounds], dtype=float), 7)
    np.testing.assert_array_equal(limits, expected)
    np.testing.assert_array_equal(owners, belong)
