"""What is said of convex programs, optimal or infeasible, held against linear programs around and inside them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import csr_matrix, vstack

import stc
from stc.transcription.bind import BoundProgram

#: A particle through places in the plane, with a bounded force.
SPEC = """
constants: n = 100, h = 1/30, g = 9.8, m = MASS, most = MOST;
variables: x, y, fx, fy;
method: central;
constraints:
  [0, n]: m*x'' = fx; m*y'' = fy - m*g; fx^2 + fy^2 <= most;
  [0]: x; y; x'; y';
  PLACES
  [n]: x = 2; y; x'; y';
objective: [0, n]: integral(fx^2 + fy^2);
"""
FACETS = 128

CASES = [
    # Restoration ended near where it began, and called that a proof; the force is a few per cent more than is needed.
    (1.037, 19628.314, [(29, 0.742, 0.749), (49, -0.916, 0.605), (76, 0.359, 0.125), (77, 1.773, -0.284)]),
    (1.983, 3912.642, [(26, 1.682, 1.087), (30, 0.908, 0.273), (60, 0.362, -0.475), (67, 0.803, -0.459)]),
    (1.423, 2545.434, [(32, 1.724, 0.898), (57, -1.311, 0.694), (67, 1.587, -0.579), (74, -1.512, 0.47)]),
]


def _can_be_met(bound: BoundProgram, radius: float) -> bool:
    """Whether the linear rows can be met together with polygons in the circles' place, in a share of their radius."""
    origin = np.zeros(bound.n)
    constant = bound.values(origin)[1]
    jac = bound.derivatives(origin, np.zeros(bound.m), 0.0)[1]
    rows = csr_matrix((jac, (bound.jac_rows, bound.jac_cols)), shape=(bound.m, bound.n))
    linear = bound.row_linear
    assert (bound.row_lower == bound.row_upper)[linear].all()
    angles = np.arange(FACETS) * (2.0 * np.pi / FACETS)
    turn = np.concatenate([np.cos(angles), np.sin(angles)])
    sides, limits = [], []
    for row in np.flatnonzero(~linear):
        force = np.repeat(bound.jac_cols[bound.jac_rows == row], FACETS)
        sides.append(csr_matrix((turn, (np.tile(np.arange(FACETS), 2), force)), shape=(FACETS, bound.n)))
        limits.append(np.full(FACETS, radius * np.sqrt(bound.row_upper[row] - constant[row])))
    answer = linprog(
        origin,
        A_ub=vstack(sides).tocsr(),
        b_ub=np.concatenate(limits),
        A_eq=rows[linear],
        b_eq=(bound.row_lower - constant)[linear],
        bounds=np.column_stack([bound.x_lower, bound.x_upper]),
        method="highs",
    )
    assert answer.status in (0, 2)
    return bool(answer.status == 0)


@pytest.mark.parametrize("share", [1.0, 0.9])
@pytest.mark.parametrize(("mass", "most", "places"), CASES)
def test_places_can_be_reached_or_not(
    mass: float, most: float, places: list[tuple[int, float, float]], share: float
) -> None:
    text = " ".join(f"[{frame}]: x = {x}; y = {y};" for frame, x, y in places)
    text = SPEC.replace("MASS", f"{mass}").replace("MOST", f"{share * most}").replace("PLACES", text)
    model = stc.load(text)
    problem, transcription = model.transcription()
    bound = transcription.bind(problem.constants)
    inside, around = _can_be_met(bound, np.cos(np.pi / FACETS)), _can_be_met(bound, 1.0)
    assert inside == around  # else nothing is known
    assert model.solve().status == ("optimal" if inside else "infeasible")
