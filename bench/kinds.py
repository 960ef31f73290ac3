"""Kinds of motions, as specs with random constants: what a comparison must not be tuned to.

Every kind is a function of a random generator.  What is drawn are masses, lengths, limits, times, obstacles, the rule,
the number of frames and the guess; some of what comes out cannot be done at all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

__all__ = ["KINDS", "Kind"]

Kind = Callable[[np.random.Generator], str]


def _in(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.round(rng.uniform(low, high), 3))


def _rule(rng: np.random.Generator) -> str:
    return str(rng.choice(["trapezoidal", "hermite-simpson"]))


def cart_pole(rng: np.random.Generator) -> str:
    """A pole swung up by its cart, with least effort."""
    return f"""
    constants: n = {rng.choice([30, 50, 80, 200, 500])}, T = {_in(rng, 1.2, 4)}, m1 = {_in(rng, 0.5, 3)},
      m2 = {_in(rng, 0.1, 1)}, l = {_in(rng, 0.3, 1)}, g = 9.81, d = {_in(rng, -1, 1.5)}, most = {_in(rng, 15, 40)};
    variables: q1, q2, u;
    method: {_rule(rng)};
    definitions: h = T/n; D = m1 + m2*(1 - cos(q2)^2);
    guess: q1 = d*t/T; q2 = pi*t/T;
    constraints:
      [0, n]:
        q1'' = (l*m2*sin(q2)*q2'^2 + u + m2*g*cos(q2)*sin(q2))/D;
        q2'' = -(l*m2*cos(q2)*sin(q2)*q2'^2 + u*cos(q2) + (m1 + m2)*g*sin(q2))/(l*D);
        -2 <= q1 <= 2; -most <= u <= most;
      [0]: q1; q2; q1'; q2';
      [n]: q1 = d; q2 = pi; q1'; q2';
    objective: [0, n]: integral(u^2);
    """


def _chain(rng: np.random.Generator, rods: int, free: int, time: float) -> str:
    """Rods hanging from a pivot, swung upright; the first ``free`` joints have no motor."""
    masses = [_in(rng, 0.2, 1) for _ in range(rods)]
    lengths = [_in(rng, 0.2, 0.6) for _ in range(rods)]
    angles, motors = range(1, rods + 1), range(free + 1, rods + 1)
    places, energy, forces = [], [], []
    for k in angles:
        parts = [(lengths[i - 1] if i < k else lengths[i - 1] / 2, i) for i in range(1, k + 1)]
        places.append(f"x{k} = {' + '.join(f'{l}*sin(q{i})' for l, i in parts)};")
        places.append(f"z{k} = 0 - {' - '.join(f'{l}*cos(q{i})' for l, i in parts)};")
        mass, inertia = masses[k - 1], masses[k - 1] * lengths[k - 1] ** 2 / 12
        energy.append(f"{mass / 2}*((x{k})'^2 + (z{k})'^2) + {inertia / 2}*q{k}'^2 - {mass}*g*z{k}")
        pulls = [f"tau{k}"] * (k in motors) + [f"-tau{k + 1}"] * (k + 1 in motors)
        forces += [f"q{k}: {' '.join(pulls)};"] if pulls else []
    guess = "guess: " + " ".join(f"q{k} = pi*t/T;" for k in angles) if rng.random() < 0.5 or free else ""
    limit = int(rng.choice([0, 60, 100])) if not free else 0
    limits = "[0, n]: " + " ".join(f"-{limit} <= tau{k} <= {limit};" for k in motors) if limit else ""
    return f"""
    constants: n = {rng.choice([40, 50, 80])}, T = {time}, g = 9.81;
    variables: {", ".join(f"q{k}" for k in angles)}, {", ".join(f"tau{k}" for k in motors)};
    method: {_rule(rng)};
    definitions: h = T/n; {" ".join(places)}
    lagrangian: {" + ".join(energy)};
    forces: {" ".join(forces)}
    {guess}
    constraints:
      [0]: {" ".join(f"q{k}; q{k}';" for k in angles)}
      [n]: {" ".join(f"q{k} = pi; q{k}';" for k in angles)}
      {limits}
    objective: [0, n]: integral({" + ".join(f"tau{k}^2" for k in motors)});
    """


def rods(rng: np.random.Generator) -> str:
    """Two to eight rods with a motor in each joint."""
    return _chain(rng, int(rng.integers(2, 9)), 0, _in(rng, 0.4, 1.5))


def acrobot(rng: np.random.Generator) -> str:
    """Two or three rods without a motor at the pivot."""
    return _chain(rng, int(rng.integers(2, 4)), 1, _in(rng, 2, 5))


def quadrotor(rng: np.random.Generator) -> str:
    """A planar quadrotor past three discs, in little time and with little thrust."""
    discs = " ".join(
        f"(x - {_in(rng, 1, 4)})^2 + (z - ({_in(rng, -0.6, 0.6)}))^2 >= {_in(rng, 0.3, 0.8)}^2;"
        for _ in range(3)
    )
    return f"""
    constants: n = {rng.choice([40, 60, 120, 300])}, g = 9.81, m = {_in(rng, 0.5, 2)}, J = {_in(rng, 0.01, 0.1)},
      r = {_in(rng, 0.1, 0.3)}, most = {_in(rng, 12, 25)};
    variables: x, z, th, f1, f2;
    parameters: T;
    method: {_rule(rng)};
    definitions: h = T/n;
    guess: T = {_in(rng, 1.5, 4)}; x = 5*t/T; f1 = m*g/2; f2 = m*g/2;
    constraints:
      {_in(rng, 0.2, 0.5)} <= T <= 10;
      [0, n]:
        m*x'' = -(f1 + f2)*sin(th); m*z'' = (f1 + f2)*cos(th) - m*g; J*th'' = r*(f1 - f2);
        0 <= f1 <= most; 0 <= f2 <= most; -1.2 <= th <= 1.2; {discs}
      [0]: x; z; th; x'; z'; th';
      [n]: x = 5; z; th; x'; z'; th';
    objective: [0]: 50*T; [0, n]: integral({_in(rng, 0.001, 0.05)}*(f1^2 + f2^2));
    """


def car(rng: np.random.Generator) -> str:
    """A car that parks behind a disc."""
    return f"""
    constants: n = {rng.choice([40, 60, 100, 200])}, L = {_in(rng, 1, 3)}, vmax = {_in(rng, 1.5, 4)},
      amax = {_in(rng, 1, 3)}, smax = {_in(rng, 0.4, 0.7)};
    variables: x, y, th, v, s, a, w;
    parameters: T;
    method: {_rule(rng)};
    definitions: h = T/n;
    guess: T = {_in(rng, 4, 9)}; v = 1;
    constraints:
      0.5 <= T <= 30;
      [0, n]:
        x' = v*cos(th); y' = v*sin(th); th' = v*tan(s)/L; v' = a; s' = w;
        -vmax <= v <= vmax; -amax <= a <= amax; -smax <= s <= smax; -1 <= w <= 1;
        (x - 3)^2 + (y - {_in(rng, 0.5, 2)})^2 >= {_in(rng, 0.5, 1)};
      [0]: x; y; th; v; s;
      [n]: x = {_in(rng, 5, 7)}; y = {_in(rng, -1, 3)}; th = {rng.choice(["0", "pi/2", "-pi/2", "pi"])}; v; s;
    objective: [0]: 50*T; [0, n]: integral({_in(rng, 0.001, 0.1)}*(a^2 + w^2));
    """


def landing(rng: np.random.Generator) -> str:
    """A rocket that lands with little fuel, whose flow bends sharply where the thrust is small."""
    x = _in(rng, 2, 8)
    return f"""
    constants: n = {rng.choice([50, 100, 200])}, g = 1.62, most = {_in(rng, 15, 30)}, m0 = {_in(rng, 1.5, 3)},
      c = {_in(rng, 8, 30)};
    variables: x, z, m, fx, fz;
    parameters: T;
    method: {_rule(rng)};
    definitions: h = T/n;
    guess: T = {_in(rng, 4, 10)}; m = m0; fz = m0*g; x = {x}*(1 - t/T); z = 10*(1 - t/T);
    constraints:
      0.5 <= T <= 40;
      [0, n]:
        m*x'' = fx; m*z'' = fz - m*g; m' = -sqrt(fx^2 + fz^2 + 1e-6)/c;
        fx^2 + fz^2 <= most^2; fz >= 0; z >= 0; m >= 0.2; fz >= 0.5*fx; fz >= -0.5*fx;
      [0]: x = {x}; z = 10; x' = {_in(rng, -1, 1)}; z' = {_in(rng, -2, 0)}; m = m0;
      [n]: x; z; x'; z';
    objective: [n]: -m;
    """


def waypoints(rng: np.random.Generator) -> str:
    """A particle through four places with a bounded force, which may be too small."""
    frames = sorted(int(k) for k in rng.choice(np.arange(10, 90), 4, replace=False))
    points = " ".join(f"[{k}]: x = {_in(rng, -2, 2)}; y = {_in(rng, -1, 2)};" for k in frames)
    cost = rng.choice(["x''^2 + y''^2", "fx^2 + fy^2"])
    return f"""
    constants: n = 100, h = 1/30, g = 9.8, m = {_in(rng, 0.5, 2)}, most = {_in(rng, 2000, 20000)};
    variables: x, y, fx, fy;
    method: {rng.choice(["central", "trapezoidal", "hermite-simpson"])};
    constraints:
      [0, n]: m*x'' = fx; m*y'' = fy - m*g; fx^2 + fy^2 <= most;
      [0]: x; y; x'; y';
      {points}
      [n]: x = 2; y; x'; y';
    objective: [0, n]: integral({cost});
    """


def crane(rng: np.random.Generator) -> str:
    """A crane that moves its load in least time."""
    return f"""
    constants: n = {rng.choice([50, 100, 300])}, g = 9.81, most = {_in(rng, 2, 6)}, longest = {_in(rng, 1.5, 3)};
    variables: x, l, th, u, w;
    parameters: T;
    method: {_rule(rng)};
    definitions: h = T/n;
    guess: T = {_in(rng, 2, 6)}; l = 1; x = 3*t/T;
    constraints:
      0.3 <= T <= 20;
      [0, n]:
        x'' = u; l'' = w; l*th'' + 2*l'*th' + g*sin(th) + u*cos(th);
        0.5 <= l <= longest; -most <= u <= most; -3 <= w <= 3;
      [0]: x; x'; l = 1; l'; th; th';
      [n]: x = 3; x'; l = {_in(rng, 0.8, 1.4)}; l'; th; th';
    objective: [0]: T;
    """


def hop(rng: np.random.Generator) -> str:
    """A point mass on a leg that hops, with phases of free length."""
    return f"""
    constants: n = 60, g = 9.81, m = {_in(rng, 0.8, 2)}, d = {_in(rng, 0.5, 1.5)}, most = {_in(rng, 40, 80)},
      mu = {_in(rng, 0.4, 1)};
    variables: x, z, fx, fz;
    parameters: T1, T2, T3;
    method: {_rule(rng)};
    definitions: [0, 19]: h = T1/20; [20, 39]: h = T2/20; [40, n]: h = T3/20;
    guess: T1 = 0.4; T2 = 0.4; T3 = 0.4; x = d*t/1.2; z = 0.5;
    jumps: [20]: fx, fz; [40]: fx, fz;
    constraints:
      0.1 <= T1 <= 1; 0.05 <= T2 <= 1; 0.1 <= T3 <= 1;
      [0, n]: m*x'' = fx; m*z'' = fz - m*g;
      [0, 20]: x^2 + z^2 <= 0.49; z >= 0.25; -mu*fz <= fx; fx <= mu*fz; 0 <= fz <= most;
      [20, 40]: fx; fz; z >= 0.1;
      [40, n]: (x - d)^2 + z^2 <= 0.49; z >= 0.25; -mu*fz <= fx; fx <= mu*fz; 0 <= fz <= most;
      [0]: x; z = 0.5; x'; z';
      [n]: x = d; z = 0.5; x'; z';
    objective: [0, n]: integral(fx^2 + fz^2);
    """


def satellite(rng: np.random.Generator) -> str:
    """A rigid body turned around by bounded torques, its attitude a quaternion."""
    return f"""
    constants: n = {rng.choice([60, 150])}, most = {_in(rng, 0.5, 2)}, I1 = {_in(rng, 0.5, 1)}, I2 = {_in(rng, 1, 2)},
      I3 = {_in(rng, 1.5, 2.5)};
    variables: q0, q1, q2, q3, w1, w2, w3, u1, u2, u3;
    parameters: T;
    method: {_rule(rng)};
    definitions: h = T/n;
    guess: T = {_in(rng, 2, 5)}; q0 = cos(pi*t/T/2); q3 = sin(pi*t/T/2);
    constraints:
      0.3 <= T <= 20;
      [0, n]:
        q0' = -0.5*(q1*w1 + q2*w2 + q3*w3); q1' = 0.5*(q0*w1 + q2*w3 - q3*w2);
        q2' = 0.5*(q0*w2 + q3*w1 - q1*w3); q3' = 0.5*(q0*w3 + q1*w2 - q2*w1);
        I1*w1' = u1 + (I2 - I3)*w2*w3; I2*w2' = u2 + (I3 - I1)*w3*w1; I3*w3' = u3 + (I1 - I2)*w1*w2;
        -most <= u1 <= most; -most <= u2 <= most; -most <= u3 <= most;
      [0]: q0 = 1; q1; q2; q3; w1; w2; w3;
      [n]: q0; q1 = {_in(rng, -0.5, 0.5)}; q2 = {_in(rng, -0.5, 0.5)}; w1; w2; w3;
    objective: [0]: T; [0, n]: integral({rng.choice([0.001, 0.01, 0.1])}*(u1^2 + u2^2 + u3^2));
    """


def arm(rng: np.random.Generator) -> str:
    """An arm of two links past a disc, in little time."""
    return f"""
    constants: n = {rng.choice([60, 100, 150])}, m1 = {_in(rng, 1, 3)}, m2 = {_in(rng, 0.5, 2)},
      l1 = {_in(rng, 0.4, 0.7)}, l2 = {_in(rng, 0.4, 0.7)}, J1 = {_in(rng, 0.03, 0.1)}, J2 = {_in(rng, 0.02, 0.08)},
      most = {_in(rng, 8, 20)}, g = {rng.choice([0, 9.81])};
    variables: a, b, u, v;
    parameters: T;
    method: {_rule(rng)};
    definitions: h = T/n; x = l1*cos(a) + l2*cos(a + b); y = l1*sin(a) + l2*sin(a + b);
    lagrangian: (m1*l1^2/8 + J1/2 + m2*l1^2/2)*a'^2 + (m2*l2^2/8 + J2/2)*(a' + b')^2
      + m2*l1*l2/2*cos(b)*a'*(a' + b') - m1*g*l1/2*sin(a) - m2*g*(l1*sin(a) + l2/2*sin(a + b));
    forces: a: u; b: v;
    guess: T = 1.2;
    constraints:
      0.1 <= T <= 10;
      [0, n]:
        -most <= u <= most; -most/2 <= v <= most/2; -2.5 <= b <= 2.5; -8 <= a' <= 8; -10 <= b' <= 10;
        (x - {_in(rng, 0.3, 0.6)})^2 + (y - {_in(rng, 0.3, 0.6)})^2 >= {_in(rng, 0.05, 0.15)}^2;
      [0]: a = {_in(rng, -1.2, -0.3)}; b = {_in(rng, 0.2, 1)}; a'; b';
      [n]: a = {_in(rng, 1, 1.8)}; b = {_in(rng, 0.2, 1.5)}; a'; b';
    objective: [0]: T; [0, n]: integral({rng.choice([0.0001, 0.001, 0.01])}*(u^2 + v^2));
    """


def glider(rng: np.random.Generator) -> str:
    """A hang glider in an updraft that goes as far as it can (R. Bulirsch and others, 1993)."""
    return f"""
    constants: n = {rng.choice([50, 100, 200])}, g = 9.81, m = 100, S = 14, rho = 1.13, c0 = 0.034, c1 = 0.069662,
      um = {_in(rng, 2, 3)}, R = {_in(rng, 80, 120)};
    variables: x, y, vx, vy, cl;
    parameters: T;
    method: {_rule(rng)};
    definitions:
      h = T/n; X = (x/R - 2.5)^2; wy = vy - um*(1 - X)*exp(-X); v = sqrt(vx^2 + wy^2);
      drag = 0.5*(c0 + c1*cl^2)*rho*S*v; lift = 0.5*cl*rho*S*v;
    guess: T = {_in(rng, 80, 110)}; x = 1250*t/T; y = 1000 - 100*t/T; vx = 13.23; vy = -1.288; cl = 1;
    constraints:
      10 <= T <= 200;
      [0, n]:
        x' = vx; y' = vy; vx' = (-lift*wy - drag*vx)/m; vy' = (lift*vx - drag*wy)/m - g;
        0 <= cl <= 1.4; x >= 0; vx >= 0;
      [0]: x; y = 1000; vx = 13.23; vy = -1.288;
      [n]: y = 900; vx = 13.23; vy = -1.288;
    objective: [n]: -0.01*x;
    """


def orbit(rng: np.random.Generator) -> str:
    """A low thrust that lifts an orbit as far as it can (A. E. Bryson and Y. C. Ho, 1975)."""
    return f"""
    constants: n = {rng.choice([50, 100, 200])}, T = {_in(rng, 3, 5)}, thrust = {_in(rng, 0.13, 0.2)}, flow = 0.0749;
    variables: r, u, v, p;
    method: {_rule(rng)};
    definitions: h = T/n;
    guess: r = 1 + 0.5*t/T; v = 1 - 0.2*t/T; p = pi*t/T;
    constraints:
      [0, n]:
        r' = u; u' = v^2/r - 1/r^2 + thrust*sin(p)/(1 - flow*t); v' = -u*v/r + thrust*cos(p)/(1 - flow*t);
        r >= 0.5;
      [0]: r = 1; u; v = 1;
      [n]: u; v = 1/sqrt(r);
    objective: [n]: -r;
    """


KINDS: tuple[Kind, ...] = (
    cart_pole, rods, acrobot, quadrotor, car, landing, waypoints, crane, hop, satellite, arm, glider, orbit,
)  # fmt: skip
