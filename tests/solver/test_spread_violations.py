"""Rows that cannot be met, though what is missing is below the tolerance in each where it is spread over all."""

from __future__ import annotations

import numpy as np
import pytest
from quadratic_program import Quadratic

from stc.solver import minimize


def _transport(seed: int, more: float) -> Quadratic:
    """Supplies of seven places, up to a million, go to seven others at least cost; these demand that much more."""
    rng = np.random.default_rng(seed)
    places = 7
    ways = np.zeros((2 * places, places * places))
    for place in range(places):
        ways[place, place * places : (place + 1) * places] = 1.0
        ways[places + place, place::places] = 1.0
    cost = np.round(10.0 * rng.random(places * places))
    supply = np.round(1000.0 * rng.random(places) * 10.0 ** rng.uniform(0.0, 3.0))
    demand = rng.permutation(supply)
    demand[0] += more
    amounts = np.concatenate([supply, demand])
    least = np.zeros(places * places)
    return Quadratic(cost, np.diag(least), ways, (amounts, amounts), (least, np.full(least.size, np.inf)))


@pytest.mark.parametrize("seed", range(8))
def test_a_unit_in_a_million_more_is_demanded_than_there_is(seed: int) -> None:
    """What is demanded in all is not what is supplied: nothing meets both."""
    assert minimize(_transport(seed, 1.0)).status == "infeasible"
    assert minimize(_transport(seed, 0.0)).status == "optimal"
