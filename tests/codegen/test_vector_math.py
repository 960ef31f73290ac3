"""Elementary functions of kernels, compiled and interpreted, against sixty-digit decimals, and C's special cases."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal, localcontext

import numpy as np
import pytest
from core.instruction_sets import INSTRUCTIONS, need
from numpy.typing import NDArray

from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import RUN
from stc.codegen.tape import Tape
from stc.core import library as core

Array = NDArray[np.float64]
PI = Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798"
)
COUNT = 240


@pytest.fixture(params=["machine code", "baseline", "avx2", "avx512"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Called by machine code, or by the instructions of a tape, for each instruction set."""
    if request.param == "machine code":
        return
    if request.param not in INSTRUCTIONS:
        pytest.skip(f"no {request.param} here")
    need(request.param)
    loaded = core.library(request.param)
    monkeypatch.setattr(core, "library", lambda: loaded)
    monkeypatch.setenv("STC_BACKEND", "python")


def evaluate(name: str, *arguments: Array) -> Array:
    """One operation, by a compiled kernel."""
    count = arguments[0].size
    padded = [np.concatenate([a, np.full(-count % LANES, a[-1])]) for a in arguments]
    tape = Tape(
        0,
        len(arguments),
        [],
        [(name, 0, len(arguments) - 2 if len(arguments) < 2 else 1)],
        [len(arguments)],
        [False],
    )
    blocks = padded[0].size // LANES
    index = np.arange(len(arguments) * blocks * LANES, dtype=np.int32).reshape(len(arguments), blocks, LANES)
    out = np.empty((blocks, 1, LANES))
    kernels = compile_tapes([tape], cache=False)
    workspace = np.concatenate([*padded, np.zeros(RUN - 1)])
    kernels[0](workspace, np.zeros(0), np.ascontiguousarray(index.transpose(1, 0, 2)), out)
    return out.ravel()[:count]


# ---- truth --------------------------------------------------------------------------------------------


def power_series(first: Decimal, factor: Callable[[int], Decimal]) -> Decimal:
    """Sum of terms, each the one before times ``factor(k)``."""
    total = term = first
    k = 0
    while term and abs(term) > abs(total) * Decimal("1e-70"):
        term *= factor(k)
        total += term
        k += 1
    return total


def sine(x: Decimal) -> Decimal:
    quarter_turns = (x * 2 / PI).to_integral_value()
    r = x - quarter_turns * PI / 2
    s = power_series(r, lambda k: -r * r / ((2 * k + 2) * (2 * k + 3)))
    c = power_series(Decimal(1), lambda k: -r * r / ((2 * k + 1) * (2 * k + 2)))
    return (s, c, -s, -c)[int(quarter_turns) % 4]


def arc_tangent(x: Decimal) -> Decimal:
    if abs(x) > 1:
        return (PI / 2).copy_sign(x) - arc_tangent(1 / x)
    for _ in range(5):
        x = x / (1 + (1 + x * x).sqrt())
    return 32 * power_series(x, lambda k: -x * x * (2 * k + 1) / (2 * k + 3))


def hyperbolic_sine(x: Decimal) -> Decimal:
    return (
        power_series(x, lambda k: x * x / ((2 * k + 2) * (2 * k + 3)))
        if abs(x) < 1
        else (x.exp() - (-x).exp()) / 2
    )


def hyperbolic_cosine(x: Decimal) -> Decimal:
    return (x.exp() + (-x).exp()) / 2


def leg(x: Decimal) -> Decimal:
    return ((1 - x) * (1 + x)).sqrt()


def angle(y: Decimal, x: Decimal) -> Decimal:
    if x == 0:
        return (PI / 2).copy_sign(y)
    return arc_tangent(y / x) + (PI.copy_sign(y) if x < 0 else 0)


TRUTH: dict[str, Callable[..., Decimal]] = {
    "sin": sine,
    "cos": lambda x: sine(x + PI / 2),
    "tan": lambda x: sine(x) / sine(x + PI / 2),
    "exp": lambda x: x.exp(),
    "log": lambda x: x.ln(),
    "sinh": hyperbolic_sine,
    "cosh": hyperbolic_cosine,
    "tanh": lambda x: hyperbolic_sine(x) / hyperbolic_cosine(x),
    "asin": lambda x: angle(x, leg(x)),
    "acos": lambda x: angle(leg(x), x),
    "atan": arc_tangent,
    "atan2": angle,
    "pow": lambda x, y: (y * x.ln()).exp(),
}


def largest_error(name: str, *arguments: Array) -> float:
    """In units in the last place of the true value."""
    results = evaluate(name, *arguments)
    worst = 0.0
    with localcontext() as context:
        context.prec = 75
        context.Emax, context.Emin = 999999, -999999
        for k, result in enumerate(results):
            true = TRUTH[name](*[Decimal(float(a[k])) for a in arguments])
            assert math.isfinite(result), (name, [a[k] for a in arguments])
            unit = Decimal(float(np.spacing(abs(float(true)))))
            worst = max(worst, float(abs(Decimal(float(result)) - true) / unit))
    return worst


def draw(kind: str) -> Array:
    """Arguments of one kind."""
    rng = np.random.default_rng(len(kind))
    sign = rng.choice([-1.0, 1.0], COUNT)
    kinds: dict[str, Callable[[], Array]] = {
        "a few turns": lambda: rng.uniform(-10.0, 10.0, COUNT),
        "many turns": lambda: rng.uniform(-1e8, 1e8, COUNT),
        "quarter turns": lambda: rng.integers(-60_000_000, 60_000_000, COUNT) * (math.pi / 2),
        "first quarter turns": lambda: np.arange(-COUNT // 2, COUNT // 2) * (math.pi / 2),
        "tiny": lambda: sign * np.exp(rng.uniform(-60.0, 0.0, COUNT)),
        "moderate": lambda: rng.uniform(-5.0, 5.0, COUNT),
        "exponents": lambda: rng.uniform(-708.0, 709.7, COUNT),
        "subnormal exponents": lambda: rng.uniform(-744.0, -708.0, COUNT),
        "near one": lambda: 1.0 + sign * np.exp(rng.uniform(-36.0, -1.2, COUNT)),
        "positive": lambda: np.exp(rng.uniform(-708.0, 709.0, COUNT)),
        "subnormal": lambda: np.exp(rng.uniform(-740.0, -708.0, COUNT)),
        "unit": lambda: rng.uniform(-1.0, 1.0, COUNT),
        "below one": lambda: sign * (1.0 - np.exp(rng.uniform(-36.0, 0.0, COUNT))),
        "any size": lambda: sign * np.exp(rng.uniform(-30.0, 30.0, COUNT)),
    }
    return np.asarray(kinds[kind]())


ANGLES = ("a few turns", "many turns", "quarter turns", "first quarter turns", "tiny")
CASES = [
    *[
        (name, bound, kinds)
        for name, bound in (("sin", 2.0), ("cos", 2.0), ("tan", 3.5))
        for kinds in (ANGLES,)
    ],
    ("exp", 1.2, ("moderate", "exponents", "subnormal exponents", "tiny")),
    ("log", 1.0, ("near one", "positive", "subnormal")),
    ("sinh", 2.5, ("moderate", "tiny", "exponents")),
    ("cosh", 2.0, ("moderate", "tiny", "exponents")),
    ("tanh", 2.5, ("moderate", "tiny", "exponents")),
    ("asin", 2.5, ("unit", "tiny", "below one")),
    ("acos", 2.5, ("unit", "tiny", "below one")),
    ("atan", 2.0, ("moderate", "any size")),
]


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("name", "bound", "kind"), [(n, b, kind) for n, b, kinds in CASES for kind in kinds])
def test_functions_of_one_argument(name: str, bound: float, kind: str, way: None) -> None:
    x = draw(kind)
    if name == "tan":  # poles
        x = x[np.abs(np.cos(x)) > 1e-12] if kind != "many turns" else x
    assert largest_error(name, x) < bound


def test_powers(way: None) -> None:
    rng = np.random.default_rng(5)
    x = np.exp(rng.uniform(-3.0, 3.0, COUNT))
    assert largest_error("pow", x, rng.uniform(-10.0, 10.0, COUNT)) < 1.5
    assert (
        largest_error("pow", np.exp(rng.uniform(-100.0, 100.0, COUNT)), rng.uniform(-7.0, 7.0, COUNT)) < 2.0
    )
    assert largest_error("pow", 1.0 + rng.uniform(-1e-3, 1e-3, COUNT), rng.uniform(-6e5, 6e5, COUNT)) < 2.0


def test_angles_of_points(way: None) -> None:
    rng = np.random.default_rng(6)
    assert largest_error("atan2", rng.normal(size=COUNT), rng.normal(size=COUNT)) < 2.0
    assert largest_error("atan2", draw("any size"), draw("any size")[::-1].copy()) < 2.0


SPECIAL = np.array(
    [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -0.5,
        2.0,
        -2.0,
        3.0,
        -3.0,
        1e308,
        -1e308,
        5e-324,
        -5e-324,
        math.inf,
        -math.inf,
        math.nan,
    ]
)
NUMPY = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "exp": np.exp,
    "log": np.log,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sqrt": np.sqrt,
}


@pytest.mark.parametrize("name", sorted(NUMPY))
def test_special_arguments(name: str, way: None) -> None:
    x = SPECIAL
    with np.errstate(all="ignore"):
        expected = NUMPY[name](x)
    np.testing.assert_allclose(evaluate(name, x), expected, rtol=1e-15, atol=5e-324)


@pytest.mark.parametrize("name", ["pow", "atan2"])
def test_special_pairs(name: str, way: None) -> None:
    x, y = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    if name == "atan2":  # the sum of two such sides overflows
        keep = ~((np.abs(x) == 1e308) & (np.abs(y) == 1e308))
        x, y = x[keep], y[keep]
    with np.errstate(all="ignore"):
        expected = {"pow": np.power, "atan2": np.arctan2}[name](x, y)
    result = evaluate(name, x, y)
    np.testing.assert_allclose(result, expected, rtol=1e-15, atol=0.0)
    known = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(result[known]), np.signbit(expected[known]))


def test_fractional_power_of_a_negative_number_is_nan(way: None) -> None:
    x = np.array([-2.0, -1e-300, -0.5, -3.0])
    assert np.isnan(evaluate("pow", x, np.full(4, -0.71))).all()
    np.testing.assert_allclose(evaluate("pow", x, np.full(4, 3.0)), x**3, rtol=1e-15)
