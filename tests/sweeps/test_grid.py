"""Which points a grid has, and from which neighbours they start."""

from __future__ import annotations

from itertools import product
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stc.errors import UsageError
from stc.sweeps import Grid

axes_of = st.dictionaries(
    st.sampled_from("abc"), st.lists(st.integers(-20, 20), min_size=1, max_size=9, unique=True), min_size=1
)


@given(axes_of)
def test_the_points_are_all_combinations(axes: dict[str, list[int]]) -> None:
    grid = Grid(axes, {})
    points = [tuple(grid.constants(index).values()) for index in range(len(grid))]
    assert points == list(product(*(sorted(values) for values in axes.values())))


@given(axes_of, st.integers(-20, 20))
def test_parents_are_solved_before_and_differ_in_one_constant(axes: dict[str, list[int]], own: int) -> None:
    grid = Grid(axes, {"a": own})
    rounds = grid.rounds()
    assert sorted(index for indices in rounds for index in indices) == list(range(len(grid)))
    solved: set[int] = set()
    for number, indices in enumerate(rounds):
        for index in indices:
            parent = grid.parent(index)
            assert (parent is None) == (number == 0)
            if parent is not None:
                assert parent in solved
                one, other = grid.constants(index), grid.constants(parent)
                assert sum(one[name] != other[name] for name in axes) == 1
        solved.update(indices)
    (root,) = rounds[0]
    if "a" in axes:
        assert abs(grid.constants(root)["a"] - own) == min(abs(value - own) for value in axes["a"])


def test_rounds_are_few() -> None:
    """A binary tree over k values has some log2(k) levels, wherever its root is."""
    for own in (0.0, 300.0, 999.0):
        assert len(Grid({"a": range(1000)}, {"a": own}).rounds()) <= 1 + 10


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({}, "a sweep needs constants with their values"),
        ([1, 2], "a sweep needs constants with their values"),
        ({"g": []}, "g is given no values"),
        ({"g": 3}, "the values of g are given as a list of numbers, not as 3"),
        ({"g": "12"}, "the values of g are given as a list of numbers, not as '12'"),
        ({"g": [1, "a"]}, "a value of g must be a number, not 'a'"),
        ({"g": [1, float("inf")]}, "a value of g is inf; a sweep takes finite numbers"),
        ({"g": [float("nan")]}, "a value of g is nan"),
        ({"g": [1, 2, 1]}, "g is given the value 1 twice"),
        ({"g": range(2000), "h": range(2000)}, "the grid has 4000000 points; at most 100000 "),
    ],
)
def test_what_is_no_grid_is_refused(axes: Any, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        Grid(axes, {})
