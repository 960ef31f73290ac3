"""What counts as written: terms that vanish, and definitions given twice."""

from __future__ import annotations

import numpy as np
import pytest

import stc

TEXT = "constants: n = 4, a = 0; variables: x, y; guess: y = 7; constraints: x = 2; y = {e}; objective: {o};"


@pytest.mark.parametrize(("e", "ends"), [("1 + 0*x''", 1.0), ("1 + (x'' - x'')", 1.0), ("1 + a*x''", 7.0)])
def test_a_term_that_vanishes_whatever_the_values_clips_nothing(e: str, ends: float) -> None:
    y = stc.load(TEXT.format(e=e, o="0")).solve()["y"]
    np.testing.assert_allclose(y, [ends, 1.0, 1.0, 1.0, ends])


def test_of_definitions_under_headers_the_later_wins_even_on_all_frames() -> None:
    text = "constants: n = 2; variables: x; definitions: {}; constraints: x = f;"
    assert stc.load(text.format("[0, n]: f = 1; [0, n]: f = 2")).solve()["x"][0] == 2.0
    with pytest.raises(stc.SpecError, match="`f` is defined already"):
        stc.load(text.format("f = 1; f = 2")).solve()
