"""Published problems whose functions are tables: an aircraft's climb, a glider in a thermal, a rocket in the air.

Where the literature has a formula, it is made a table of here, so that the published optimum is the truth; where it has
a table, what was solved is integrated again by SciPy with SciPy's own splines.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, PchipInterpolator, RectBivariateSpline

import stc
from stc.solution_claims import judge

GLIDER = """
# the farthest flight of a hang glider through a thermal: Bulirsch et al. 1993; COPS 3.0, problem 11
constants: n = 100, m = 100, g = 9.81, S = 14, rho = 1.13, R = 100;
parameters: T;
variables: x, y, vx, vy, cL;
data: thermal = "thermal.csv"; U = table(thermal.r, thermal.u), outside = hold;
definitions:
  h = T/n; ua = 2.5*U(x/R - 2.5); w = vy - ua; v = sqrt(vx^2 + w^2);
  D = 0.5*(0.034 + 0.069662*cL^2)*rho*S*v^2; L = 0.5*cL*rho*S*v^2;
constraints:
  [0, n]: x' = vx; y' = vy; m*vx' = -(L*w + D*vx)/v; m*vy' = (L*vx - D*w)/v - m*g; 0 <= cL <= 1.4; x >= 0; vx >= 0;
  [0]: x = 0; y = 1000; vx = 13.23; vy = -1.288; T >= 0;
  [n]: y = 900; vx = 13.23; vy = -1.288;
objective: [n]: -x;
guess: T = 100; x = 13.2*t; y = 1000 - t; vx = 13.2; vy = -1.3; cL = 1;
method: hermite-simpson;
"""

ROCKET = """
# Goddard's rocket, to the highest altitude: COPS 3.0, problem 10
constants: n = 200, vc = 620, mc = 0.6, c = 0.5, Dc = 0.5*vc, Tmax = 3.5;
variables: alt, v, m, T;
parameters: tf;
data: air = "air.csv"; rho = table(air.alt, air.rho);
definitions: h = tf/n; drag = Dc*v^2*rho(alt);
constraints:
  [0, n]: alt' = v; v' = (T - drag - m/alt^2)/m; m' = -T/c; alt >= 1; v >= 0; mc <= m <= 1; 0 <= T <= Tmax;
  [0]: alt = 1; v = 0; m = 1; tf >= 0;
  [n]: m = mc;
objective: [n]: -alt;
guess: tf = 1; alt = 1; v = i/n*(1 - i/n); m = 1 + (mc - 1)*i/n; T = Tmax/2;
method: trapezoidal;
"""

CLIMB = """
# a supersonic interceptor climbs to 65,600 ft in the least time: Bryson, Desai and Hoffman, J. Aircraft 6, 1969;
# Betts, Practical Methods for Optimal Control, example 6.2
constants: n = 60, ft = 0.3048, lb = 4.4482216152605, g = 9.80665, S = 530*ft^2, Isp = 1600;
data:
  thrust = "thrust.npz"; air = "air.csv";
  aero = (M, CLa, CD0, eta): (0, 3.44, 0.013, 0.54), (0.4, 3.44, 0.013, 0.54), (0.8, 3.44, 0.013, 0.54),
    (0.9, 3.58, 0.014, 0.75), (1.0, 4.44, 0.031, 0.79), (1.2, 3.44, 0.041, 0.78), (1.4, 3.01, 0.039, 0.89),
    (1.6, 2.86, 0.036, 0.93), (1.8, 2.44, 0.035, 0.93);
  F = table(thrust.mach, thrust.height, thrust.force);
  rho = table(air.h, air.rho); a = table(air.h, air.a);
  CLa = table(aero.M, aero.CLa), monotone; CD0 = table(aero.M, aero.CD0), monotone;
  eta = table(aero.M, aero.eta), monotone;
parameters: T;
variables: H, V, gam, W, alpha;      # km, km/s, rad, 10^4 kg, rad
definitions:
  h = T/n; M = 1000*V/a(1000*H); thr = F(M, H/ft)*1000*lb; q = 0.5*rho(1000*H)*(1000*V)^2;
  D = q*S*(CD0(M) + eta(M)*CLa(M)*alpha^2); L = q*S*CLa(M)*alpha; m = 10000*W;
constraints:
  [0, n]:
    H' = V*sin(gam);
    1000*V' = (thr*cos(alpha) - D)/m - g*sin(gam);
    gam' = (thr*sin(alpha) + L)/(m*1000*V) - g*cos(gam)/(1000*V);
    10000*W' = -thr/(g*Isp);
    0 <= H <= 21.5; 0.05 <= V <= 0.6; -1.4 <= gam <= 1.4; -0.35 <= alpha <= 0.35; 0.1 <= W;
  [0]: 100 <= T <= 800; H = 0.1*ft; V = 0.42426*ft; gam = 0; 10000*W = 42000*lb/g;
  [n]: H = 65.6*ft; V = 0.968148*ft; gam = 0;
objective: [0]: T;
guess: T = 330; H = 0.03 + 20*i/n; V = 0.15 + 0.2*i/n; gam = 0.1; W = 1.9 - 0.2*i/n; alpha = 0.03;
method: hermite-simpson;
"""

MACH = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8])
HEIGHT = np.array([0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 70.0])
THRUST = np.array(
    [
        [24.2, 24.0, 20.3, 17.3, 14.5, 12.2, 10.2, 5.7, 3.4, 0.1],
        [28.0, 24.6, 21.1, 18.1, 15.2, 12.8, 10.7, 6.5, 3.9, 0.2],
        [28.3, 25.2, 21.9, 18.7, 15.9, 13.4, 11.2, 7.3, 4.4, 0.4],
        [30.8, 27.2, 23.8, 20.5, 17.3, 14.7, 12.3, 8.1, 4.9, 0.8],
        [34.5, 30.3, 26.6, 23.2, 19.8, 16.8, 14.1, 9.4, 5.6, 1.1],
        [37.9, 34.3, 30.4, 26.8, 23.3, 19.8, 16.8, 11.2, 6.8, 1.4],
        [36.1, 38.0, 34.9, 31.3, 27.3, 23.6, 20.1, 13.4, 8.3, 1.7],
        [36.1, 36.6, 38.5, 36.1, 31.6, 28.1, 24.2, 16.2, 10.0, 2.2],
        [36.1, 35.2, 42.1, 38.7, 35.7, 32.0, 28.1, 19.3, 11.9, 2.9],
        [36.1, 33.8, 45.7, 41.3, 39.8, 34.6, 31.1, 21.7, 13.3, 3.1],
    ]
)
AERO = np.array(
    [
        (0, 3.44, 0.013, 0.54),
        (0.4, 3.44, 0.013, 0.54),
        (0.8, 3.44, 0.013, 0.54),
        (0.9, 3.58, 0.014, 0.75),
        (1.0, 4.44, 0.031, 0.79),
        (1.2, 3.44, 0.041, 0.78),
        (1.4, 3.01, 0.039, 0.89),
        (1.6, 2.86, 0.036, 0.93),
        (1.8, 2.44, 0.035, 0.93),
    ]
)


def in_columns(path: Path, **columns: np.ndarray) -> None:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]))


def solved(folder: Path, text: str) -> stc.Solution:
    path = folder / "problem.stc"
    path.write_text(text, encoding="utf-8")
    found = stc.load(path).solve()
    assert found.status == "optimal"
    assert not judge(found).faults
    return found


def test_glider_in_a_tabulated_thermal(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    r = np.sort(np.concatenate([np.linspace(-2.6, 11.0, 250), rng.uniform(-2.6, 4.0, 60)]))
    square = r * r
    in_columns(tmp_path / "thermal.csv", r=r, u=(1.0 - square) * np.exp(-square))
    found = solved(tmp_path, GLIDER)
    formula = GLIDER.replace("U(x/R - 2.5)", "(1 - X)*exp(-X)").replace(
        "h = T/n;", "h = T/n; X = (x/R - 2.5)^2;"
    )
    exact = solved(tmp_path, "\n".join(line for line in formula.splitlines() if not line.startswith("data:")))
    assert found.objective == pytest.approx(exact.objective, rel=1e-5)
    assert -found.objective == pytest.approx(1248.0, rel=1e-3)


def test_rocket_in_tabulated_air(tmp_path: Path) -> None:
    altitude = np.linspace(1.0, 1.02, 41)
    in_columns(tmp_path / "air.csv", alt=altitude, rho=np.exp(-500.0 * (altitude - 1.0)))
    found = solved(tmp_path, ROCKET)
    assert -found.objective == pytest.approx(1.01283, abs=2e-5)
    assert not found.outside


def standard_atmosphere(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Density and speed of sound of 1976 up to 32 km."""
    at = 6356766.0 * height / (6356766.0 + height)
    low, mid = np.minimum(at, 11000.0), np.clip(at, 11000.0, 20000.0) - 11000.0
    warm = np.maximum(at - 20000.0, 0.0)
    temperature = 288.15 - 0.0065 * low + 0.001 * warm
    pressure = 101325.0 * ((288.15 - 0.0065 * low) / 288.15) ** 5.2558797
    pressure = (
        pressure
        * np.exp(-9.80665 * mid / (287.053 * 216.65))
        * (216.65 / (216.65 + 0.001 * warm)) ** 34.16319
    )
    return pressure / (287.053 * temperature), np.sqrt(1.4 * 287.053 * temperature)


def test_climb_with_tabulated_thrust_and_air(tmp_path: Path) -> None:
    np.savez(tmp_path / "thrust.npz", mach=MACH, height=HEIGHT, force=THRUST)
    height = np.arange(0.0, 24001.0, 500.0)
    density, sound = standard_atmosphere(height)
    in_columns(tmp_path / "air.csv", h=height, rho=density, a=sound)
    found = solved(tmp_path, CLIMB)
    duration = found.parameters["T"]
    # Betts has 324.98 s over a round earth, with splines and missing corners of the table of his own.
    assert duration == pytest.approx(324.98, rel=0.025)

    rho, a = CubicSpline(height, density), CubicSpline(height, sound)
    thrust = RectBivariateSpline(MACH, HEIGHT, THRUST, s=0)
    lift, drag, eta = (PchipInterpolator(AERO[:, 0], AERO[:, k]) for k in (1, 2, 3))
    area, pound, g = 530 * 0.3048**2, 4.4482216152605, 9.80665

    def rates(t: float, state: np.ndarray) -> list[float]:
        h, v, gam, mass = state
        alpha = float(found.at(t)["alpha"])
        mach = v / a(h)
        force = float(thrust.ev(mach, h / 304.8)) * 1000 * pound
        q = 0.5 * rho(h) * v * v * area
        resistance = q * (drag(mach) + eta(mach) * lift(mach) * alpha**2)
        return [
            v * np.sin(gam),
            (force * np.cos(alpha) - resistance) / mass - g * np.sin(gam),
            (force * np.sin(alpha) + q * lift(mach) * alpha) / (mass * v) - g * np.cos(gam) / v,
            -force / (g * 1600),
        ]

    start = [30.48, 129.314448, 0.0, 42000 * pound / g]
    flown = solve_ivp(rates, (0.0, duration), start, rtol=1e-6, atol=1e-6, max_step=2.0)
    h, v, gam, mass = flown.y[:, -1]
    assert h == pytest.approx(19994.88, rel=0.02)
    assert v == pytest.approx(295.09, rel=0.03)
    assert gam == pytest.approx(0.0, abs=0.05)
    assert mass == pytest.approx(1e4 * found["W"][-1], rel=2e-3)
