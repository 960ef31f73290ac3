"""Euler-Lagrange expressions, whatever part of a Lagrangian is written in terms of points."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from symbolic.random_expressions import SMOOTH, expressions, points, simplified

from stc.symbolic.differentiate import derivative, total_derivative
from stc.symbolic.expr import ONE, ZERO, Expr, call, evaluate, render, sub, substitute, sym
from stc.symbolic.variation import euler_lagrange

RATES = {"a": sym("a'"), "b": sym("b'"), "a'": sym("a''"), "b'": sym("b''"), "t": ONE}
COORDINATES = [(sym("a"), sym("a'")), (sym("b"), sym("b'"))]
SPEEDS = {"c": sym("a'"), "d": sym("b'")}


def rate(e: Expr) -> Expr:
    return total_derivative(e, lambda key: RATES.get(key, ZERO))


def directly(lagrangian: Expr, name: str) -> tuple[Expr, Expr]:
    """Momentum and row of a coordinate by their definition."""
    momentum = derivative(lagrangian, name + "'")
    return momentum, sub(rate(momentum), derivative(lagrangian, name))


@settings(max_examples=100)
@given(expressions(SMOOTH, 6), expressions(SMOOTH, 6), expressions(SMOOTH, 8), expressions(SMOOTH, 4))
def test_points_change_the_form_alone(first: Expr, second: Expr, energy: Expr, rest: Expr) -> None:
    """Two points move with the coordinates and the time; the energy is a function of their velocities and more."""
    places = [substitute(simplified(e), {"c": sym("t"), "d": sym("a")}) for e in (first, second)]
    velocities = [rate(place) for place in places]
    lagrangian = substitute(simplified(energy), {"c": velocities[0], "d": velocities[1]})
    lagrangian = lagrangian + substitute(simplified(rest), SPEEDS) * velocities[0] + sym("a'") * sym("a'")
    held = {v: w for v, w in zip(velocities, places, strict=True) if v.args}
    random = points(seed=7, count=8)
    at = dict(zip(("a", "b", "t", "a'"), random.values(), strict=True))
    at |= {"b'": random["a"] - 0.3, "a''": 0.2 - random["b"], "b''": random["c"] + 0.1}
    for name, found in zip("ab", euler_lagrange(lagrangian, COORDINATES, held, rate), strict=True):
        for ours, plain in zip((found.momentum, found.row), directly(lagrangian, name), strict=True):
            expected, value = (np.broadcast_to(evaluate(e, at), 8) for e in (plain, ours))
            sound = np.isfinite(expected) & (np.abs(expected) < 1e6)
            np.testing.assert_allclose(value[sound], expected[sound], rtol=1e-7, atol=1e-7)


def test_a_particle_in_polar_coordinates() -> None:
    r, angle = sym("a"), sym("b")
    x, y = r * call("cos", angle), r * call("sin", angle)
    velocities = rate(x), rate(y)
    energy = 0.5 * (velocities[0] ** 2 + velocities[1] ** 2)
    radial, turning = euler_lagrange(energy, COORDINATES, dict(zip(velocities, (x, y), strict=True)), rate)
    at = {"a": 1.3, "b": 0.4, "a'": -0.7, "b'": 2.1, "a''": 0.9, "b''": -1.1}
    np.testing.assert_allclose(evaluate(radial.momentum, at), -0.7, rtol=1e-14)
    np.testing.assert_allclose(evaluate(radial.row, at), 0.9 - 1.3 * 2.1**2, rtol=1e-14)
    np.testing.assert_allclose(evaluate(turning.momentum, at), 1.3**2 * 2.1, rtol=1e-14)
    np.testing.assert_allclose(evaluate(turning.row, at), 1.3**2 * -1.1 + 2 * 1.3 * -0.7 * 2.1, rtol=1e-14)


def test_rows_are_built_from_accelerations_of_points() -> None:
    """Along a chain a further link adds so many operations, however long the chain is."""
    x = call("sin", sym("a")) + call("sin", sym("b"))
    (_, row) = euler_lagrange(0.5 * rate(x) ** 2, COORDINATES, {rate(x): x}, rate)
    assert row.row is call("cos", sym("b")) * rate(rate(x))
    assert render(euler_lagrange(sym("a'") * sym("b"), COORDINATES, {}, rate)[1].row) == "-a'"
