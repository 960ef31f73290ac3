"""Equations of motion from energies, against equations derived on paper and by another route."""

from __future__ import annotations

import numpy as np
import pytest
from chains import WAYS, chain, joint_torques

from stc.errors import Source
from stc.language import read_problem
from stc.problem import ConstantRef, DefinitionRef, Problem, TimeRef, VariableRef
from stc.symbolic.expr import evaluate, symbols

HEAD = "constants: n = 4, m = 1.3, M = 2.1, l = 0.7, g = 9.81, k = 3, c = 0.2; method: trapezoidal;\n"


def problem_of(text: str) -> Problem:
    return read_problem(Source("mechanics.stc", HEAD + text))


def residuals(problem: Problem, values: dict[str, float]) -> dict[str, float]:
    """The equations of motion at numbers for ``q``, ``q'``, ``q''`` and forces, by coordinate."""
    given: dict[object, float] = {ConstantRef(k): v for k, v in problem.constants.items()}
    found = {}
    for relation in problem.relations:
        if not relation.coordinate:
            continue
        for key in symbols(relation.body):
            if isinstance(key, VariableRef):
                given[key] = values[key.name + "'" * key.order]
        found[relation.coordinate] = float(evaluate(relation.body, given))
    return found


def at_random(names: list[str], seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {name + "'" * order: rng.normal() for name in names for order in range(3)}


@pytest.mark.parametrize("seed", range(5))
def test_cart_and_pole(seed):
    """Against the textbook equations of a cart with a hanging point mass."""
    problem = problem_of(
        """variables: x, a, f;
        definitions: px = x + l*sin(a); pz = -l*cos(a);
        lagrangian: M*x'^2/2 + m*(px'^2 + pz'^2)/2 - m*g*pz;
        forces: x: f - c*x';
        objective: [0, n]: integral(f^2);"""
    )
    v = at_random(["x", "a", "f"], seed)
    m, M, l, g, c = 1.3, 2.1, 0.7, 9.81, 0.2
    sin, cos = np.sin(v["a"]), np.cos(v["a"])
    found = residuals(problem, v)
    cart = (M + m) * v["x''"] + m * l * (v["a''"] * cos - v["a'"] ** 2 * sin) - v["f"] + c * v["x'"]
    pole = m * l**2 * v["a''"] + m * l * v["x''"] * cos + m * g * l * sin
    assert found["x"] == pytest.approx(cart, rel=1e-12, abs=1e-12)
    assert found["a"] == pytest.approx(pole, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("relative", [False, True], ids=["absolute", "relative"])
def test_chain_of_rods(relative, way):
    """Against Newton's and Euler's laws for each rod."""
    rods = 5
    problem = read_problem(Source("chain.stc", chain(rods, relative, way)))
    for seed in range(3):
        v = at_random([f"{name}{k}" for name in "qu" for k in range(1, rods + 1)], seed)
        found = residuals(problem, v)
        q = np.array([[v[f"q{k}" + "'" * order] for k in range(1, rods + 1)] for order in range(3)])
        couples = joint_torques(*(np.cumsum(q, axis=1) if relative else q))
        acting = couples if relative else couples - np.append(couples[1:], 0.0)
        for k in range(rods):
            assert found[f"q{k + 1}"] == pytest.approx(acting[k] - v[f"u{k + 1}"], rel=1e-12, abs=1e-11)


def test_constraints_that_move_with_time():
    """A pendulum on a pivot that is shaken: the momentum has a part from the pivot's velocity."""
    problem = problem_of(
        """variables: a, f;
        definitions: x = l*sin(a)/c + k*t^2; z = -l*cos(a)/c;
        lagrangian: m/2*(x'^2 + z'^2) - m*g*z;
        forces: a: f;
        constraints: [0, n]: momentum(a) >= -1e9;
        objective: [0, n]: integral(f^2);"""
    )
    v = at_random(["a", "f"], 1)
    m, g, k, r, t = 1.3, 9.81, 3.0, 0.7 / 0.2, 0.8
    sin, cos = np.sin(v["a"]), np.cos(v["a"])
    given: dict[object, float] = {ConstantRef(key): value for key, value in problem.constants.items()}
    given |= {VariableRef(name.rstrip("'"), name.count("'")): value for name, value in v.items()}
    given[TimeRef()] = t
    momentum, row = (
        float(evaluate(next(r.body for r in problem.relations if bool(r.coordinate) is moving), given))
        for moving in (False, True)
    )
    assert momentum == pytest.approx(m * r * (r * v["a'"] + 2 * k * t * cos), rel=1e-12)
    expected = m * r**2 * v["a''"] + m * r * cos * 2 * k + m * g * r * sin - v["f"]
    assert row == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_energy_grows_by_the_power_of_the_forces(seed):
    """For any motion: the rows times the velocities are the rate of energy less the power of the forces."""
    problem = problem_of(
        """variables: r, p, s, f;
        definitions: x = r*cos(p); y = r*sin(p) + s^2; E = m/2*(x'^2 + y'^2) + M/2*s'^2*r^2;
          V = m*g*y + k/2*(r - l)^2;
        lagrangian: E - V;
        forces: r: f; s: -c*s';
        constraints: [0, n]: E + V >= -1e9;
        objective: [0, n]: integral(f^2);"""
    )
    v = at_random(["r", "p", "s", "f"], seed)
    found = residuals(problem, v)
    energy = next(r.body for r in problem.relations if not r.coordinate)
    given: dict[object, float] = {ConstantRef(key): value for key, value in problem.constants.items()}

    def total(e: float) -> float:
        """Energy a moment later, by Taylor."""
        moved = dict(given)
        for key in symbols(energy):
            if isinstance(key, VariableRef):
                name = key.name + "'" * key.order
                change = v[name + "'"] if key.order < 2 else 0.0
                moved[key] = v[name] + e * change
        return float(evaluate(energy, moved))

    step = 1e-5
    rate = (total(step) - total(-step)) / (2 * step)
    power = v["f"] * v["r'"] - 0.2 * v["s'"] ** 2
    assert sum(found[q] * v[q + "'"] for q in ("r", "p", "s")) == pytest.approx(
        rate - power, rel=1e-6, abs=1e-6
    )


def test_forces_add_up_and_ranged_ones_act_on_top():
    problem = problem_of(
        """variables: x, f, w;
        lagrangian: m*x'^2/2;
        forces: x: f; x: -c*x'; [0, 2]: x: w;
        objective: [0, n]: integral(f^2 + w^2);"""
    )
    (row,) = [r for r in problem.relations if r.coordinate]
    ranged = [key for key in symbols(row.body) if isinstance(key, DefinitionRef)]
    assert [key.name for key in ranged] == ["force on x"]
    pieces = problem.definitions["force on x"]
    assert [(p.range.first, p.range.last) for p in pieces] == [(0, 4), (0, 2)]
    assert pieces[1].body is problem.definitions["force on x"][1].body


def test_ranges_of_the_lagrangian():
    problem = problem_of(
        """variables: x, f;
        lagrangian: [0, 2]: m*x'^2/2; [2, n]: M*x'^2/2;
        forces: x: f;
        objective: [0, n]: integral(f^2);"""
    )
    rows = [r for r in problem.relations if r.coordinate]
    assert [(r.range.first, r.range.last) for r in rows] == [(0, 2), (2, 4)]
