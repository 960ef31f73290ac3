"""Plain sums over frames are refused where frames are added; the advice leaves the objective what it was."""

from __future__ import annotations

import re

import pytest

import stc
from stc.studies.frames import Spread
from stc.studies.order import observe_order

QUICKEST = """
constants: n = 20, xf = 1, w = 0.01; parameters: T; variables: x, u; definitions: h = T/n; guess: T = 2;
constraints: x'' = u; [0]: x; x'; [n]: x = xf; x'; [0, n]: -1 <= u <= 1;
objective: {objective}
method: trapezoidal;
"""


def refused(objective: str) -> stc.UsageError:
    with pytest.raises(stc.UsageError) as caught:
        Spread.of(stc.load(QUICKEST.format(objective=objective)), None, {}).multiplied(2)
    return caught.value


@pytest.mark.parametrize(
    "objective",
    ["T;", "T; integral(w*u^2);", "T + integral(w*u^2);", "integral(w*u^2) + T;", "T; [0, n]: u^2;"],
)
def test_a_parameter_that_counts_once_per_frame_is_to_count_once(objective: str) -> None:
    assert "write `[0]: T;`" in str(refused(objective))


@pytest.mark.parametrize("objective", ["[0]: T;", "[0]: T; [0, n]: integral(w*u^2);", "integral(w*u^2);"])
def test_what_does_not_grow_is_accepted(objective: str) -> None:
    assert Spread.of(stc.load(QUICKEST.format(objective=objective)), None, {}).multiplied(2) == {"n": 40}


def test_the_advice_gives_the_motion_and_one_duration() -> None:
    """From rest to rest over 1 m with |u| <= 1 takes 2 s; the integral of T would be 4."""
    (advice,) = re.findall(r"write `(\[0\]: T;)`", str(refused("T;")))
    solution = stc.load(QUICKEST.format(objective=advice)).solve()
    assert solution.objective == pytest.approx(2.0, rel=5e-3)


def test_sums_of_variables_are_to_be_integrals() -> None:
    assert "write `integral(w*u^2)`" in str(refused("w*u^2; [0]: T;"))
    assert "write `integral(u^2)`" in str(refused("u^2 + integral(x^2);"))


def test_the_order_is_refused_with_the_same_advice() -> None:
    text = QUICKEST.format(objective="T; integral(w*u^2);")
    text += 'replay: model = "particle.xml"; joint x = x; actuator fx = u;'
    with pytest.raises(stc.UsageError) as caught:
        observe_order(stc.load(text))
    assert "write `[0]: T;`" in str(caught.value)
