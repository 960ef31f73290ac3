"""The estimated discretisation error against the true one, which a far finer grid or a closed form tells."""

from __future__ import annotations

import time

import numpy as np
import pytest

import stc
from stc.pipeline import Model
from stc.studies.doubled import apart, sizes
from stc.studies.effort import Clock, Effort
from stc.studies.finer import solve_finer
from stc.studies.grid_error import GROSS, determined, grid_error, local_grid_error

ACROBOT = """
constants:
  n = 40, m1 = 1, m2 = {m2}, l1 = 1, lc1 = 0.5, lc2 = 1, I1 = 0.083, I2 = 0.33, b = 0.1, g = 9.81, umax = {most};
parameters: T;
definitions: h = T/n;
  x1 = lc1*sin(a); z1 = -lc1*cos(a);
  x2 = l1*sin(a) + lc2*sin(a+e); z2 = -l1*cos(a) - lc2*cos(a+e);
variables: a, e, u;
lagrangian:
  m1*(x1'^2+z1'^2)/2 + I1*a'^2/2 - m1*g*z1;
  m2*(x2'^2+z2'^2)/2 + I2*(a'+e')^2/2 - m2*g*z2;
forces: a: -b*a'; e: u - b*e';
constraints:
  [0]: a; e; a'; e'; 2 <= T <= 10;
  [n]: a = pi; e; a'; e';
  [0,n]: -umax <= u <= umax;
objective: [0,n]: integral(10*u^2); [0]: T;
guess: T = {guess}; a = pi*t/T;
method: {method};
"""
SPIN = """
# A body turned by torques about its own axes, its inertias all different.
constants: n = 20, T = 1.5, h = T/n;
variables: qw, qx, qy, qz, wx, wy, wz, tx, ty, tz;
method: {method};
guess: qw = 1;
constraints:
  [0, n]:
    qw' = -(qx*wx + qy*wy + qz*wz)/2; qx' = (qw*wx + qy*wz - qz*wy)/2;
    qy' = (qw*wy + qz*wx - qx*wz)/2; qz' = (qw*wz + qx*wy - qy*wx)/2;
    wx' = tx - 0.5*wy*wz; wy' = (ty + 0.8*wx*wz)/1.2; wz' = (tz - 0.2*wx*wy)/1.5;
  [0]: qw = 1; qx; qy; qz; wx; wy = 0.5; wz;
  [n]: qx = 0.6; qy = -0.3; qz = 0.5; wx; wy; wz;
objective: [0, n]: integral(tx^2 + ty^2 + tz^2);
"""
SWING = """
constants: n = 30, T = 2, h = T/n;
variables: a, u;
method: {method};
constraints: [0, n]: a'' = u - 9.81*sin(a) - 0.2*a'; [0]: a; a'; [n]: a = 2.5; a';
objective: [0, n]: integral(u^2);
"""
BOUNCE = """
constants: n = 24, k = n/2;
variables: z, u;
parameters: T1, T2;
definitions: [0, k - 1]: h = T1/k; [k, n]: h = T2/(n - k);
method: {method};
guess: T1 = 0.5; T2 = 0.5; z = 1;
jumps: [k]: z';
constraints:
  [0, n]: z'' = u - 9.81 - 0.3*z'*abs(z');
  [0]: z = 1; z'; 0.1 <= T1 <= 2; 0.1 <= T2 <= 2;
  [k]: z = 0; after(z') = -0.8*before(z');
  [n]: z = 0.9; z' = 0;
objective: [0, n]: integral(u^2);
"""
BANG = """
constants: n = {n};
parameters: T;
definitions: h = T/n;
variables: x, v, u;
method: trapezoidal;
guess: T = 2;
constraints: [0, n]: x' = v; v' = u; -1 <= u <= 2; [0]: x; v; 0.1 <= T; [n]: x = 1; v;
objective: [0]: T;
"""

SMALL_LOCAL_ERRORS = {
    "multiplied by an unstable system": """
constants: n = 20, T = 4, h = T/n; variables: x, u; method: trapezoidal;
constraints: [0, n]: x'' = 4*sin(x) + u; [0]: x = 0; x' = 0; [n]: x = 1; x' = 0;
objective: [0, n]: integral(u^2);""",
    "in layers at both ends": """
constants: n = 30, T = 12, h = T/n; variables: x, u; method: hermite-simpson;
constraints: [0, n]: x' = -x^3 + u; [0]: x = 1; [n]: x = 1.5;
objective: [0, n]: integral(x^2 + u^2);""",
    "of a pendulum that waits": """
constants: n = 60, T = 8, h = T/n; variables: a, u; method: trapezoidal; guess: a = pi*t/T;
constraints: [0, n]: a'' = u - 9.81*sin(a); -4 <= u <= 4; [0]: a; a'; [n]: a = pi; a';
objective: [0, n]: integral(u^2);""",
    "of an orbit that is raised": """
constants: n = 40, T = 10, h = T/n; variables: x, y, u, w; method: trapezoidal; guess: x = cos(t); y = sin(t);
constraints: [0, n]: x'' = -x/(x^2 + y^2)^1.5 + u; y'' = -y/(x^2 + y^2)^1.5 + w;
  [0]: x = 1; y = 0; x' = 0; y' = 1; [n]: x^2 + y^2 = 2.25; x*x' + y*y' = 0;
objective: [0, n]: integral(u^2 + w^2);""",
}


def both(text, factor=8, **constants):
    """A solution, and the one next to it on so many times the frames."""
    model = stc.load(text)
    coarse = model.solve(**constants)
    n = coarse.n * factor
    finer = solve_finer(model.solve, coarse, {"constants": {**constants, "n": n}}, Clock(60), Effort())
    assert coarse.status == finer.status == "optimal"
    return coarse, finer


def true_error(coarse, finer):
    """Relative errors of the objective and of the motion."""
    times = finer.n // coarse.n
    gaps = []
    for name in determined(coarse.origin.problem(coarse.method, **coarse.overrides), coarse):
        one, other = coarse.trajectories[name, 0], finer.trajectories[name, 0]
        gaps.append(np.abs(one.after - other.after[::times]).max() / sizes(finer, [name])[name])
    return abs(coarse.objective - finer.objective) / abs(finer.objective), max(gaps)


@pytest.mark.parametrize(
    ("text", "method"),
    [
        (SWING, "central"),
        *((text, method) for text in (SWING, SPIN) for method in ("trapezoidal", "hermite-simpson")),
    ],
)
def test_the_estimate_is_near_the_change_to_a_finer_grid(text, method):
    coarse, finer = both(text.format(method=method))
    objective, motion = true_error(coarse, finer)
    found = coarse.grid_error()
    assert objective / 10 <= found.objective <= 10 * objective
    assert motion / 10 <= found.motion <= 10 * motion


@pytest.mark.parametrize("text", SMALL_LOCAL_ERRORS.values(), ids=SMALL_LOCAL_ERRORS)
def test_what_becomes_of_small_local_errors_is_told(text):
    """The steps alone say too little of these; the next grid says what the optimum makes of it."""
    coarse, finer = both(text)
    objective, motion = true_error(coarse, finer)
    found = coarse.grid_error()
    assert found.gross and max(objective, motion) > GROSS
    assert objective / 3 <= found.objective <= 3 * objective
    assert motion / 3 <= found.motion <= 3 * motion


def test_where_the_spec_cannot_take_twice_the_frames_the_steps_are_asked():
    """A frame of its own number in a statement keeps a spec from taking more."""
    text = SWING.format(method="trapezoidal").replace("[0]: a;", "[15]: a <= 3; [0]: a;")
    solution = stc.load(text).solve()
    assert solution.grid_error() == local_grid_error(solution)
    objective, _ = true_error(*both(SWING.format(method="trapezoidal")))
    assert objective / 10 <= solution.grid_error().objective <= 10 * objective


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
def test_the_price_of_the_grid_falls_with_the_methods_order(method):
    order = {"trapezoidal": 2, "hermite-simpson": 4}[method]
    errors = [stc.load(SWING.format(method=method)).solve(n=n).grid_error().objective for n in (40, 80)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.5)


@pytest.mark.parametrize(
    ("m2", "most", "guess", "method"),
    [
        (1, 8, 4, "hermite-simpson"),
        (1.1, 9, 5, "hermite-simpson"),
        (1, 8, 4, "trapezoidal"),
        (0.9, 7, 6, "hermite-simpson"),
    ],
)
def test_a_swing_up_that_only_a_coarse_grid_has_is_warned_of(m2, most, guess, method):
    """An acrobot on 40 frames that swings up with a fraction of the effort that it takes."""
    text = ACROBOT.format(m2=m2, most=most, guess=guess, method=method)
    found = stc.load(text).solve()
    assert found.status == "optimal"
    assert found.grid_error().gross
    assert "frames" in found.grid_error().warning


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
def test_what_twice_the_frames_rule_out_is_warned_of(method):
    """A hurdle that stands between two frames, higher than the force can lift: this grid alone does not see it."""
    text = f"""
    constants: n = 10, T = 1, h = T/n, at = 0.425;
    variables: x, u; constraints:
      [0, n]: x'' = u; -1 <= u <= 1; x >= 2*exp(-((t - at)/0.004)^2) - 1;
      [0]: x; x'; [n]: x; x';
    objective: [0, n]: integral(u^2 + (x - 0.1*t)^2);
    method: {method};
    """.replace("at = 0.425", "at = 0.45" if method == "trapezoidal" else "at = 0.425")
    found = stc.load(text).solve()
    assert found.status == "optimal"
    told = found.grid_error()
    assert told.lost
    assert "twice the frames" in told.warning


def test_fine_grids_are_not_warned_of():
    for name in ("cart_pole_swing_up", "arm_reach", "luxo_poses", "particle_jet"):
        assert not stc.load(name).solve().grid_error().warning


def test_a_switch_within_a_step_shows_in_the_states():
    """The least time of a double integrator with a stronger brake; against the closed form of its motion."""
    for n in (20, 50):
        solution = stc.load(BANG.format(n=n)).solve()
        exact = np.sqrt(2 * (1 / 2 + 1 / 1) * 1)
        switch = exact * 2 / 3 if solution["u"][0] < 1.5 else exact / 3
        gain, brake = (1, 2) if solution["u"][0] < 1.5 else (2, 1)
        share = np.linspace(0, 1, n + 1) * exact
        v = np.where(share < switch, gain * share, gain * switch - brake * (share - switch))
        true = np.abs(solution["v"] - v).max() / v.max()
        found = solution.grid_error()
        assert found.motion >= true / 10
        assert found.motion <= max(10 * true, 1.0 / n)


def test_jumps_are_no_errors_of_the_grid():
    coarse, finer = both(BOUNCE.format(method="hermite-simpson").replace("0.3*z'*abs(z')", "0.3*z'"))
    objective, motion = true_error(coarse, finer)
    found = coarse.grid_error()
    assert max(found.objective, found.motion) <= max(20 * max(objective, motion), 1e-6)


def test_stiff_kinetics_do_not_blow_the_estimate_up():
    text = """
    constants: n = 40, T = 1, h = T/n;
    variables: x, y;
    method: hermite-simpson;
    constraints: [0, n]: x' = -2000*(x - y); y' = -y; [0]: x = 1; y = 1;
    """
    found = stc.load(text).solve().grid_error()
    assert found.motion < 0.01


def test_nothing_between_frames_or_no_solution_has_no_estimate():
    assert (
        stc.load("variables: x; constants: n = 0, h = 1; objective: [0]: (x - 1)^2;").solve().grid_error()
        is None
    )
    wrong = (
        "constants: n = 4, h = 1; variables: x; constraints: [0, n]: x >= 1; x <= 0; objective: [0, n]: x^2;"
    )
    assert stc.load(wrong).solve().grid_error() is None


def test_a_saved_solution_tells_the_same(tmp_path):
    solution = stc.load("cart_pole_swing_up", n=30).solve()
    solution.save(tmp_path / "a.npz")
    assert stc.read(tmp_path / "a.npz").grid_error() == solution.grid_error()


def test_a_sum_that_leaves_out_its_ends_is_short_of_the_integral():
    """The sum over the inner frames of h times a constant 1 is 1 - h."""
    text = """
    constants: n = 20, h = 1/n;
    variables: x;
    method: central;
    constraints: [0, n]: x' = 1; [0]: x;
    objective: [1, n - 1]: h*(x - x + 1 + 0*x'^2 + (x - t)^2);
    """
    found = stc.load(text).solve()
    assert found.grid_error().objective == pytest.approx(0.05 / 0.95, rel=0.1)


def test_what_stands_still_but_for_rounding_has_no_error() -> None:
    text = """constants: n = 10, h = 1/n; variables: x, y, u; constraints: [0, n]: x'' = u; y'' = 0;
        [0]: x; x'; y; y'; [n]: x = 1; x'; objective: [0, n]: integral(u^2);"""
    coarse, finer = (stc.load(text).solve(n=n, method="trapezoidal") for n in (10, 40))
    clean = apart(coarse, finer, ["x", "y"])
    still = finer.trajectories["y", 0]
    still.before[1:-1] += 2e-10
    noisy = apart(coarse, finer, ["x", "y"])
    assert noisy["x"] == clean["x"] > 1e-4
    assert noisy["y"] < 1e-3


def test_a_busy_machine_changes_nothing(monkeypatch) -> None:
    solution = stc.load(SWING.format(method="trapezoidal")).solve()
    expected = solution.grid_error()
    solve, slept = Model.solve, []

    def slowly(self, callback=None, **arguments):
        def look(record):
            if not slept:
                slept.append(time.sleep(3.0))  # time that others take
            return callback is not None and callback(record)

        return solve(self, callback=look, **arguments)

    monkeypatch.setattr(Model, "solve", slowly)
    assert solution.grid_error() == expected
    assert slept
    assert expected != local_grid_error(solution)


def test_a_joint_that_hardly_moves_needs_no_finer_grid(tmp_path):
    (tmp_path / "spring.xml").write_text("""<mujoco><worldbody><body name="mass">
      <joint name="x" type="slide" axis="1 0 0" stiffness="400"/><geom type="sphere" size="0.1" mass="1"/>
      </body></worldbody><actuator><motor name="push" joint="x"/></actuator></mujoco>""")
    spec = """constants: n = 8, T = 2, h = T/n, D = 0.5; model: "spring.xml"; method: central;
      constraints: [0]: joint.x; rest; [n]: joint.x = D; rest; objective: [0, n]: integral(effort);"""
    (tmp_path / "spring.stc").write_text(spec)
    model = stc.load(tmp_path / "spring.stc")
    # The problem is linear: both motions have the same shape, and one of them is smaller than anyone sees.
    assert grid_error(model.solve()).gross
    still = grid_error(model.solve(D=5e-7))
    assert still.motion < 0.01
