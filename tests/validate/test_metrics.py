"""Sizes of errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stc.validate.metrics import drift, root_mean_square


@pytest.mark.parametrize("scale", [1e-200, 1.0, 1e200])
def test_the_root_of_the_mean_square_keeps_its_scale(scale: float) -> None:
    assert root_mean_square(scale * np.array([3.0, 4.0, 0.0])) == pytest.approx(scale * math.sqrt(25 / 3))
    assert root_mean_square(np.zeros(3)) == 0.0


def test_a_drift_of_any_size_is_a_number() -> None:
    assert drift(np.array([0.0, 1e300])) == pytest.approx((1e300, 1e300 / math.sqrt(2)))
    assert drift(np.array([0.0, np.nan])) == (math.inf, math.inf)
