"""Small problems with data, stated as one would at first, whose answers SciPy or a formula tells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, PchipInterpolator, RectBivariateSpline

import stc
from stc.errors import SpecError


def solved(folder: Path, text: str, **constants: float) -> stc.Solution:
    """The optimal solution of a spec that stands in a folder."""
    path = folder / "stated.stc"
    path.write_text(text, encoding="utf-8")
    solution = stc.load(path).solve(**constants)
    assert solution.status == "optimal"
    return solution


def refused(folder: Path, text: str) -> str:
    """The only message about a spec that stands in a folder."""
    with pytest.raises(SpecError) as caught:
        solved(folder, text)
    assert len(caught.value.diagnostics) == 1
    return str(caught.value)


def test_air_listed_from_the_top_down(tmp_path: Path) -> None:
    height = np.array([0.0, 500.0, 1200.0, 2500.0, 4000.0])
    density = 1.225 * np.exp(-height / 8500.0)
    rows = [f"{a:g}\t {b:.12g}" for a, b in zip(height[::-1], density[::-1], strict=True)]
    (tmp_path / "air.tsv").write_text('altitude\t "rho"\n' + "\n".join(rows), encoding="utf-8")
    text = """
    data: air = "air.tsv"; rho = table(air.altitude, air.rho);
    constants: n = 60, T = 20, h = T/n, k = 0.0025, g = 9.81;
    variables: z;
    constraints: [0, n]: z'' = -g - k*rho(z)*z'*abs(z'); [0]: z = 3000; z';
    method: hermite-simpson;
    """
    rho = CubicSpline(height, density)
    fall = solve_ivp(
        lambda t, u: [u[1], -9.81 - 0.0025 * rho(u[0]) * u[1] * abs(u[1])], (0, 20), [3000, 0], rtol=1e-10
    )
    assert solved(tmp_path, text)["z"][-1] == pytest.approx(fall.y[0, -1], abs=0.05)


def test_a_matrix_whose_axes_fall_and_one_the_other_way_round(tmp_path: Path) -> None:
    x, y = np.array([0.0, 0.4, 1.0, 1.7, 2.0]), np.array([-1.0, 0.0, 0.3, 2.0, 2.5, 3.0])
    z = np.sin(x)[:, None] * np.cos(y) + 0.1 * x[:, None] * y
    np.savez(tmp_path / "map.npz", x=x[::-1], y=y[::-1], z=z[::-1, ::-1], turned=z.T)
    text = """
    data: m = "map.npz"; H = table(m.x, m.y, m.z);
    variables: q;
    constants: n = 0;
    constraints: [0]: q = H(1.2, 0.7);
    """
    truth = RectBivariateSpline(x, y, z, s=0).ev(1.2, 0.7)
    assert solved(tmp_path, text)["q"][0] == pytest.approx(float(truth), rel=1e-10)
    message = refused(tmp_path, text.replace("m.z)", "m.turned)"))
    assert "has the shape (6, 5), and its arguments have 5 and 6 numbers" in message
    assert "write `table(m.y, m.x, m.turned)`" in message


def test_a_table_that_goes_up_and_down_is_not_sorted(tmp_path: Path) -> None:
    text = "data: d = (x, y): (0, 0), (1, 1), (2, 4), (1.5, 2); f = table(d.x, d.y); constants: n = 0; variables: q;"
    assert "`d.x` is less than before on row 4" in refused(tmp_path, text + "constraints: [0]: q = f(1);")


@pytest.mark.parametrize(("kind", "curve"), [("", CubicSpline), (", monotone", PchipInterpolator)])
def test_a_ball_lands_on_tabulated_ground(kind: str, curve: type, tmp_path: Path) -> None:
    x, z = [-1.0, 0.0, 1.0, 2.0, 3.0], [0.9, 0.5, 0.2, 0.0, 0.1]
    rows = ", ".join(f"({a}, {b})" for a, b in zip(x, z, strict=True))
    text = f"""
    data: terrain = (x, z): {rows}; ground = table(terrain.x, terrain.z){kind};
    constants: n = 40, T = 1, h = T/n, g = 9.81;
    variables: z, v, f;
    constraints:
      [0, n]: 0 <= z - ground(1 + t) complements f >= 0;
      [1, n]: v - v[i-1] = h*(f - g);  z - z[i-1] = h*v;
      [0]: z = 1; v; f;
    """
    found, ground = solved(tmp_path, text), curve(x, z)
    h, height, speed = 1.0 / 40, 1.0, 0.0
    for k in range(1, 41):  # implicit Euler, with what keeps it from falling below the ground
        fallen = height + h * (speed - h * 9.81)
        reached = max(fallen, float(ground(1.0 + k * h)))
        height, speed = reached, (reached - height) / h
        assert found["z"][k] == pytest.approx(height, abs=1e-6)


def test_friction_that_a_table_gives_sticks_and_slips(tmp_path: Path) -> None:
    text = """
    data: stribeck = (v, mu): (0, 0.6), (0.5, 0.45), (1, 0.4), (3, 0.38); mu = table(stribeck.v, stribeck.mu), monotone;
    constants: n = 60, T = 2, h = T/n, N = 9.81;
    variables: v, s, f;
    constraints:
      [1, n]: v - v[i-1] = h*(8*sin(pi*t) + f);
      [0, n]: 0 <= s - v complements mu(s)*N - f >= 0;
              0 <= s + v complements mu(s)*N + f >= 0;
      [0]: v; s; f;
    """
    found = solved(tmp_path, text)
    mu = PchipInterpolator([0.0, 0.5, 1.0, 3.0], [0.6, 0.45, 0.4, 0.38])
    limit = 9.81 * mu(np.abs(found["v"]))
    slides = np.abs(found["v"]) > 1e-5
    assert slides.any() and not slides.all()
    np.testing.assert_allclose(found["f"][slides], -np.sign(found["v"][slides]) * limit[slides], atol=1e-5)
    assert (np.abs(found["f"]) <= limit + 1e-6).all()
    push = 8.0 * np.sin(np.pi * found.time[1:]) + found["f"][1:]
    np.testing.assert_allclose(np.diff(found["v"]), push * 2.0 / 60, atol=1e-8)


def test_what_holds_a_control_that_nothing_decides_is_taken_up(tmp_path: Path) -> None:
    text = """
    data: d = (x, y): (0, 0), (1, 1), (2, 4), (3, 9); f = table(d.x, d.y);
    constants: n = 10, T = 1, h = T/n;
    variables: x, w;
    constraints: [0, n]: x = 1 + t; w = (f(x))';
    method: hermite-simpson;
    """
    (told,) = solved(tmp_path, text).ringing()
    assert "since no objective determines it" in str(told)
    assert f"objective: {told.term}" == "objective: [0, n]: integral(w'^2);"
    better = solved(tmp_path, f"{text}objective: {told.term}")
    np.testing.assert_allclose(better["w"], 2.0 * (1.0 + better.time), atol=1e-4)
    assert not better.ringing()


def test_a_limit_on_the_larger_of_two_sizes_has_one_message_at_a_time(tmp_path: Path) -> None:
    limit = "max(abs(u), abs(v)) <= 2;"
    text = """
    constants: n = 20, T = 1, h = T/n;
    variables: x, y, u, v;
    constraints: [0, n]: x' = u; y' = v; {limit} [0]: x; y;
    objective: [n]: x + y;
    method: trapezoidal;
    """
    message = refused(tmp_path, text.format(limit=limit))
    assert "write `abs(u) <= 2; abs(v) <= 2;`" in message
    for one in ("u", "v"):
        limit = f"abs({one}) <= 2;"
        assert f"write `-2 <= {one} <= 2;`" in refused(tmp_path, text.format(limit=limit))
    assert solved(tmp_path, text.format(limit="-2 <= u <= 2; -2 <= v <= 2;")).objective == pytest.approx(-4.0)


def test_a_step_in_time_is_written_as_the_message_says(tmp_path: Path) -> None:
    text = """
    constants: n = 20, T = 1, h = T/n;
    variables: x;
    constraints: [0, n]: x' = {what}; [0]: x;
    method: trapezoidal;
    """
    message = refused(tmp_path, text.format(what="floor(2*t)"))
    line = next(line.strip() for line in message.splitlines() if line.strip().startswith("definitions:"))
    found = solved(tmp_path, f"{line}\n{text.format(what='step')}")
    assert found["x"][-1] == pytest.approx(0.5, abs=0.03)


def test_data_cannot_hold_what_is_unknown(tmp_path: Path) -> None:
    text = "parameters: p; data: d = (x, y): (0, 0), (1, p); f = table(d.x, d.y); objective: [0]: (f(0.5) - 2)^2;"
    message = refused(tmp_path, text)
    assert "a row of data cannot use the parameter `p`" in message
    assert "as in `p*f(x)`" in message
