"""A particle that is to be in too many places with too little force: the solver says so."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.optimize import linprog

import stc

PARTICLE = """
constants: n = {n}, h = 1/30, g = 9.8, m = {m}, most = {most};
variables: x, z, fx, fz;
method: trapezoidal;
constraints:
  [0, n]: m*x'' = fx; m*z'' = fz - m*g; fx^2 + fz^2 <= most;
  [0]: x; z; x'; z';
  {points}
  [n]: x = 2; z; x'; z';
objective: [0, n]: integral({cost});
"""

Points = Mapping[int, tuple[float, float]]

CASES = [
    (60, 1.5, 680.0, {18: (-0.5, 0.7), 26: (1.8, 1.7), 33: (-0.5, -0.2), 53: (1.5, 0.5)}, "x''^2 + z''^2"),
    (100, 0.94, 1230.0, {44: (1.4, 0.7), 67: (0.2, 1.0), 69: (0.7, 0.75), 84: (-0.3, -0.45)}, "fx^2 + fz^2"),
    (100, 1.53, 683.0, {29: (-0.5, 0.7), 43: (1.8, 1.7), 54: (-0.5, -0.2), 89: (1.5, 0.5)}, "x''^2 + z''^2"),
]


def can_be_met(n: int, mass: float, most: float, points: Points) -> bool:
    """Whether forces of bounded components, which are more than forces of bounded size, lead through all points."""
    h, frames = 1.0 / 30.0, n + 1
    identity = np.eye(3 * frames)
    position, velocity, acceleration = (
        identity[:frames],
        identity[frames : 2 * frames],
        identity[2 * frames :],
    )
    rule = [
        low[1:] - low[:-1] - h / 2 * (high[1:] + high[:-1])
        for low, high in ((position, velocity), (velocity, acceleration))
    ]
    fixed = [position[0], velocity[0], velocity[n], position[n], *(position[k] for k in points)]
    rows = np.vstack([*rule, *fixed])
    reach = most**0.5 / mass
    for axis, (end, weight) in enumerate(((2.0, 0.0), (0.0, 9.8))):
        sides = np.concatenate([np.zeros(2 * n + 3), [end], [point[axis] for point in points.values()]])
        bounds = [(None, None)] * (2 * frames) + [(-reach - weight, reach - weight)] * frames
        if linprog(np.zeros(3 * frames), A_eq=rows, b_eq=sides, bounds=bounds).status == 2:
            return False
    return True


@pytest.mark.parametrize(("n", "m", "most", "points", "cost"), CASES)
def test_what_cannot_be_met_is_infeasible(n: int, m: float, most: float, points: Points, cost: str) -> None:
    assert not can_be_met(n, m, most, points)
    listed = " ".join(f"[{k}]: x = {x}; z = {z};" for k, (x, z) in points.items())
    text = PARTICLE.format(n=n, m=m, most=most, points=listed, cost=cost)
    solution = stc.load(text).solve()
    assert solution.status == "infeasible"
    # Ten times the force does.
    assert can_be_met(n, m, 100.0 * most, points)
    assert stc.load(text).solve(most=100.0 * most).status == "optimal"
