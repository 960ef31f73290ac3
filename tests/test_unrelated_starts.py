"""A warm start from another spec's motion: refused where they share no variable, told where they share some."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.guesses.values import UnusedWarning

LINE = "constants: n = 6; variables: {0}; constraints: [0]: {0}; [n]: {0} = 1; objective: integral({0}''^2);"


def test_a_motion_without_any_of_the_variables_is_refused(tmp_path: Path) -> None:
    other = stc.load(LINE.format("a")).solve()
    model = stc.load(LINE.format("q"))
    other.save(tmp_path / "other.npz")
    for start in (other, tmp_path / "other.npz"):
        with pytest.raises(
            stc.UsageError, match=r"the motion of .* has no variable of .*\n.*it has a, and .* q"
        ):
            model.solve(warm_start=start)


def test_what_is_left_over_of_a_motion_is_told() -> None:
    both = stc.load(LINE.format("q") + "variables: b; constraints: b = 2*q;").solve()
    with pytest.warns(UnusedWarning, match="has `b`.*does not use"):
        solution = stc.load(LINE.format("q")).solve(warm_start=both)
    np.testing.assert_allclose(solution["q"], np.linspace(0, 1, 7), atol=1e-9)


def test_another_text_with_the_same_names_starts_without_a_word() -> None:
    earlier = stc.load(LINE.format("q")).solve()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solution = stc.load("# edited\n" + LINE.format("q")).solve(warm_start=earlier, method="trapezoidal")
        assert solution.resolve(n=12).status == "optimal"
