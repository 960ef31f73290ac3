"""Rows whose terms are so large that rounding leaves more of them than counts as met."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.solver.residuals import is_met_but_for_rounding
from stc.solver.status import MET_BUT_FOR_ROUNDING

#: At an apsis of an orbit of given energy, nearest to a place, in metres and seconds: terms of ``r . v`` are 5e10.
APSIS = """
constants: n = 0, mu = 3.986012e14, a = 7e6, X = 5.1e6, Y = 3.7e6, Z = 2.9e6;
variables: x, y, z, vx, vy, vz;
guess: x = 5e6; y = 3e6; z = 2e6; vx = -4000; vy = 5000; vz = 3000;
constraints:
  [0]:
    x*vx + y*vy + z*vz = 0;
    (vx^2 + vy^2 + vz^2)/2 - mu/sqrt(x^2 + y^2 + z^2) = -mu/(2*a);
    x*vy - y*vx = 0.6*sqrt((x*vy - y*vx)^2 + (y*vz - z*vy)^2 + (z*vx - x*vz)^2);
objective:
  [0]: ((x - X)/1e6)^2 + ((y - Y)/1e6)^2 + ((z - Z)/1e6)^2 + (vz/1e3 - 2)^2;
"""


@pytest.mark.parametrize("x", [4.9e6, 5.1e6, 5.5e6, 6e6])
@pytest.mark.parametrize("y", [3e6, 3.7e6])
def test_rows_of_large_terms_are_met_as_far_as_can_be(x: float, y: float) -> None:
    solution = stc.load(APSIS, X=x, Y=y).solve(max_iterations=30)
    assert solution.status == "optimal"
    r = np.array([solution[name][0] for name in ("x", "y", "z")])
    v = np.array([solution[name][0] for name in ("vx", "vy", "vz")])
    assert abs(r @ v) <= 16 * 2.0**-52 * np.abs(r * v).sum()
    assert (MET_BUT_FOR_ROUNDING in solution.message) == (solution.violation > 1e-6)


def test_what_rounding_does_not_explain_is_not_met() -> None:
    problem, transcription = stc.load(
        "constants: n = 0; variables: x, y; constraints: [0]: x - y = 1;"
    ).transcription()
    nlp = transcription.bind(problem.constants)
    point = np.array([3e12, 3e12 - 1.0])
    gap = float(np.spacing(3e12))
    assert is_met_but_for_rounding(nlp, point, 1e-6)
    assert is_met_but_for_rounding(nlp, point + [gap, 0.0], 1e-6)
    assert not is_met_but_for_rounding(nlp, point + [100 * gap, 0.0], 1e-6)
    assert not is_met_but_for_rounding(nlp, np.array([3.0, 2.0 + 1e-5]), 1e-6)
    assert is_met_but_for_rounding(nlp, np.array([3.0, 2.0 + 1e-7]), 1e-6)
    assert not is_met_but_for_rounding(nlp, np.array([np.nan, 1.0]), 1e-6)
    assert not is_met_but_for_rounding(nlp, np.array([np.inf, 1.0]), 1e-6)


def test_bounds_are_met_or_not() -> None:
    problem, transcription = stc.load(
        "constants: n = 0; variables: x, y; constraints: [0]: x - y = 1; x <= 3e12; y >= 0;"
    ).transcription()
    nlp = transcription.bind(problem.constants)
    assert is_met_but_for_rounding(nlp, np.array([3e12, 3e12 - 1.0]), 1e-6)
    assert not is_met_but_for_rounding(nlp, np.array([0.5, -0.5]), 1e-6)


# Third differences over steps of 6 ms: 1/h^3 is five million, and so are the terms that cancel in the slopes.
FINE = """
constants: n = 400, T = 2.348, h = T/n;
variables: x, y;
method: central;
constraints:
  [0, n]: -7082 <= x' <= 1499.5; -86806 <= x''' <= 86806; y <= x + 600;
  [0]: x; y; x'; y';
  [103]: 393.88 <= x <= 536.55; y = 139.529;
  [195]: 338.06 <= x <= 530.819; y = -155.849;
  [233]: 311.087 <= x <= 653.531; y = -149.027;
  [n]: x = 1000; y; x'; y';
objective: [0, n]: integral(x'''^2 + y'''^2);
"""


def test_slopes_are_not_blamed_for_their_rounding() -> None:
    """They are a hundred thousand times what may be gained, all of it rounding error; the objective is IPOPT's."""
    solution = stc.load(FINE).solve()
    assert solution.status == "optimal"
    assert solution.iterations <= 40
    assert solution.violation <= 1e-8
    assert solution.objective == pytest.approx(110220103.0, rel=1e-7)
