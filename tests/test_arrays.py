"""Distinct values as NumPy has them, and numbers that spread evenly."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stc.arrays import distinct, ranks, scattered


@given(st.lists(st.integers(-5, 5)))
def test_distinct_is_unique(values: list[int]) -> None:
    array = np.array(values, dtype=np.int64)
    assert np.array_equal(distinct(array), np.unique(array))


@given(st.lists(st.one_of(st.integers(-5, 5), st.integers(-(2**40), 2**40))))
def test_ranks_are_those_of_unique(values: list[int]) -> None:
    array = np.array(values, dtype=np.int64)
    different, inverse = np.unique(array, return_inverse=True)
    found, count = ranks(array)
    assert count == different.size
    assert np.array_equal(found, inverse)


def test_scattered_fills_the_interval() -> None:
    values = np.sort(scattered(1000))
    assert -1.0 <= values[0] < values[-1] <= 1.0
    assert np.diff(values).max() < 0.05


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_differences_of_scattered_numbers_do_not_vanish(order: int) -> None:
    """Functions are judged at such numbers; equal steps, as of any multiples, would leave none of the second."""
    sizes = np.abs(np.diff(scattered(10_000), order))
    assert np.mean(sizes < 1e-2) < 0.02


def test_a_solve_does_not_import_what_it_does_not_need() -> None:
    code = (
        "import sys, stc; stc.load('particle_waypoints').solve(n=8); stc.load('cart_pole_swing_up').solve(n=200); "
        "print(*[m for m in ('numpy.ma', 'numpy.random', 'scipy', 'mujoco', 'matplotlib', 'rich', 'nlopt', 'typer')"
        " if m in sys.modules])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == []
