"""Which frames' forces a replay takes: those at which the equations of motion hold, whatever else a spec states.

Under central differences frames whose equations reach outside the motion have forces that nothing determines.
"""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.validate import validate

HEAD = "constants: n = 20, h = 1/30, g = 9.8, m = 1, k = 2, xf = 2; variables: x, y, fx, fy;"
ENDS = "constraints: [0]: x; y; x'; y'; [n]: x = xf; y; x'; y';"
NEWTON = "constraints: m*x'' = fx; m*y'' = fy - m*g;"
COST = "objective: integral(x''^2 + y''^2);"
REPLAY = """
replay: model = "particle.xml"; joint x = x; joint z = y; actuator fx = fx; actuator fz = fy;
  set body.particle.mass = m; set option.gravity.z = -g;
"""
ALONG = "m*(x[i+1] - 2*x + x[i-1])/h^2"
UP = "m*(y[i+1] - 2*y + y[i-1])/h^2"

SAME_MOTION = {
    "as it is": NEWTON,
    "an inequality with a wider stencil": NEWTON + "constraints: x'''' <= 1e5;",
    "an equality of another variable with a wider stencil": NEWTON.replace(
        "constraints:", "variables: q; constraints:"
    )
    + "constraints: q = x'''';",
    "a wide stencil in the middle": NEWTON + "constraints: [8, 12]: fx'''' <= 1e9; (x')''' <= 1e9;",
    "a limit of the force's bend": NEWTON + "constraints: fx'''' <= 1e9; -1e9 <= fy'' <= 1e9;",
    "written as differences": f"constraints: {ALONG} = fx; {UP} = fy - m*g;",
    "on the frames it reaches": "constraints: [1, n - 1]: m*x'' = fx; m*y'' = fy - m*g;",
    "of phases": "definitions: w = g; [0, 9]: w = g; constraints: [0, 9]: m*x'' = fx; [10, n]: m*x'' = fx; [0, n]: "
    "m*y'' = fy - m*w;",
    "through a law": "variables: tau; constraints: tau = k*fx; m*x'' = tau/k; m*y'' = fy - m*g;",
    "from energies": "lagrangian: m*(x'^2 + y'^2)/2 - m*g*y; forces: x: fx; y: fy;",
    "from energies, ranged forces": "lagrangian: m*(x'^2 + y'^2)/2 - m*g*y; forces: [0, 9]: x: fx; y: fy; [10, n]: x: "
    "fx; y: fy;",
}


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("dynamics", SAME_MOTION.values(), ids=SAME_MOTION)
def test_what_else_is_stated_does_not_move_the_frames_of_motion(dynamics: str) -> None:
    solution = stc.load(HEAD + dynamics + ENDS + COST + REPLAY).solve()
    assert solution.status == "optimal"
    assert solution.force_frames == (1, 19)
    assert validate(solution).passed


@pytest.mark.parametrize(
    ("dynamics", "frames"),
    [
        ("x' = v; m*v' = fx;", (0, 20)),  # first differences reach the ends one-sidedly
        ("x[i+1] = x + h*v[i+1]; m*(v[i+1] - v) = h*fx;", (0, 19)),  # the last force moves nothing
        ("x[i+1] = x + h*v; m*(v - v[i-1]) = h*fx;", (1, 20)),  # nor here the first
        ("m*x'' + k*x'''' = fx;", (2, 18)),  # here the wide stencil is the equation of motion
        ("x' = v; m*v' = fx; fx'' = 0;", (0, 20)),  # a wish of the force, whose end values it reaches
    ],
)
def test_the_equations_that_tell_forces_decide(dynamics: str, frames: tuple[int, int]) -> None:
    text = f"""
    constants: n = 20, h = 1/30, m = 1, k = 0.01; variables: x, v, fx;
    constraints: {dynamics} [0]: x = 0; v = 0; [n/2]: fx = 1;
    objective: [0, n]: fx^2 + v^2;
    replay: model = "particle.xml"; joint x = x; actuator fx = fx;
    """
    assert stc.load(text).solve().force_frames == frames


def test_a_passive_motion_written_as_differences_is_judged_where_they_fit() -> None:
    text = """
    constants: n = 20, h = 0.02, g = 9.8; variables: x, y;
    constraints: x[i+1] - 2*x + x[i-1] = 0; y[i+1] - 2*y + y[i-1] = -g*h^2; [0]: x; y; x[1] = 0.1; y[1] = 0.2;
    replay: model = "particle.xml"; joint x = x; joint z = y; set option.gravity.z = -g;
    """
    assert stc.load(text).solve().force_frames == (1, 19)


def test_forces_that_nothing_determines_are_not_replayed() -> None:
    """The motion is the same as with ``x''``, though the end frames' forces are left at 0."""
    text = HEAD + SAME_MOTION["written as differences"] + ENDS + COST + REPLAY
    solution = stc.load(text).solve()
    assert solution["fx"][0] == 0.0 != solution["fx"][1]
    report = validate(solution, tracked=False)
    drift = max(metric.value for metric in report.metrics if metric.name == "open-loop drift, largest")
    same = validate(stc.load(HEAD + NEWTON + ENDS + COST + REPLAY).solve(), tracked=False)
    other = max(metric.value for metric in same.metrics if metric.name == "open-loop drift, largest")
    np.testing.assert_allclose(drift, other, rtol=1e-5)
