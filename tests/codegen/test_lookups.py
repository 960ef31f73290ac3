"""Tables in compiled code: machine code, instructions and NumPy against SciPy, inside of the table and outside."""

from __future__ import annotations

import numpy as np
import pytest
import tape_reference as reference
from scipy.interpolate import CubicSpline, RectBivariateSpline

from stc.arrays import aligned_zeros
from stc.codegen import engine
from stc.codegen.kernel import LANES, Backend, compile_tapes
from stc.codegen.runs import Runs
from stc.codegen.tape import Tape, build_tape
from stc.symbolic.expr import Expr, looked_up, sym
from stc.symbolic.tables import TOLD, Table, TableRef, interpolated

pytestmark = pytest.mark.skipif(not engine.llvm_wanted(), reason="needs LLVM")


def drawn(count: int, seed: int) -> np.ndarray:
    """Places at random."""
    return np.sort(np.random.default_rng(seed).uniform(-3.0, 9.0, count))


#: By how their pieces are found: evenly spaced, one place in a bucket, two, three, many.
PLACES = {
    0: np.linspace(-1.0, 2.0, 4),
    1: np.concatenate([np.linspace(0.0, 1.0, 5), [2.5, 3.0, 7.0]]),
    2: np.concatenate([drawn(20, 2), 9.0 + np.array([0.2, 0.2001])]),
    TOLD + 2: np.concatenate([drawn(20, 2), 9.0 + np.array([0.2, 0.2001, 0.2002])]),
    TOLD + 4: np.concatenate([np.linspace(0.0, 1e-2, 7), np.linspace(1.0, 30.0, 20), [1e4]]),
}


def values_of(tape: Tape, uniform: np.ndarray, varying: np.ndarray) -> list[np.ndarray]:
    """What machine code, instructions and the meaning of a tape give for (inputs, blocks*LANES) numbers."""
    blocks = varying.shape[1] // LANES
    workspace = np.concatenate([varying.ravel(), np.zeros(8)])
    index = np.arange(varying.size, dtype=np.int32).reshape(len(varying), blocks, LANES).transpose(1, 0, 2)
    runs = Runs.alone(len(varying))
    found = []
    ways: tuple[Backend, Backend] = "llvm", "interpreter"
    for backend in ways:
        kernels = compile_tapes([tape], [runs], backend, cache=False)
        out = aligned_zeros((blocks, len(tape.outputs), LANES))
        kernels[0].bind(workspace, uniform, np.ascontiguousarray(index), out)()
        found.append(out.transpose(1, 0, 2).reshape(len(tape.outputs), -1))
    return [*found, reference.run(tape, uniform, varying)]


def inputs(tables: list[Table]) -> np.ndarray:
    """Where each begins, and then their numbers."""
    stored = [table.storage() for table in tables]
    begins = len(tables) + np.cumsum([0, *(len(numbers) for numbers in stored)])[:-1]
    return np.concatenate([begins, *stored])


def derivatives(ref: TableRef, arguments: list[Expr], most: int) -> dict[tuple[int, ...], Expr]:
    """The function and its partial derivatives up to an order."""
    found = {}
    for orders in np.ndindex(*[most + 1] * len(arguments)):
        leaf: TableRef | None = ref
        for argument, order in enumerate(orders):
            for _ in range(order):
                leaf = None if leaf is None else leaf.derivative(argument)
        assert leaf is not None
        found[tuple(orders)] = looked_up(leaf, *arguments)
    return found


@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("search", PLACES)
def test_a_curve_and_its_derivatives(search: int, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    places = PLACES[search]
    monkeypatch.setattr(engine, "vector_width", lambda: width)
    table = interpolated([places], np.sin(3.0 * places), "cubic", "extend")
    assert table.axes[0].search == search
    ref = TableRef("T", table, (0,))
    wanted = derivatives(ref, [sym("x")], 3)
    tape = build_tape(list(wanted.values()), [ref], ["x"])
    rng = np.random.default_rng(3)
    inside = np.sort(np.concatenate([places, rng.uniform(places[0], places[-1], 103 - len(places))]))
    x = np.concatenate([inside, [places[0] - 2.0, places[-1] + 5.0, np.nan, -np.inf, np.inf]])
    machine, instructions, meaning = values_of(tape, inputs([table]), x[None])
    assert np.array_equal(machine, instructions, equal_nan=True)
    spline = CubicSpline(places, np.sin(3.0 * places)) if len(places) > 2 else None
    for row, (order,) in enumerate(wanted):
        for found in (machine, meaning):
            if spline is not None and order < 3:
                truth = spline(inside, order)
                scale = np.abs(truth).max()
                np.testing.assert_allclose(found[row][:103], truth, atol=1e-9 * scale)
            numbers = table.value([x[:-3]], [order])
            np.testing.assert_allclose(
                found[row][:-3], numbers, rtol=1e-9, atol=1e-10 * np.abs(numbers).max()
            )
            assert order > 2 or np.isnan(found[row][-3])
    low = table.value([x[-5]], [0])
    assert low == pytest.approx(np.sin(3.0 * places[0]) - 2.0 * table.value([places[0]], [1]))


@pytest.mark.parametrize("outside", ["extend", "hold", "error"])
def test_a_surface_and_its_derivatives(outside: str) -> None:
    rng = np.random.default_rng(1)
    x, y = np.sort(rng.uniform(0.0, 1.0, 9)), np.sort(rng.uniform(-40.0, 70.0, 6))
    values = rng.normal(size=(9, 6))
    table = interpolated([x, y], values, "cubic", outside)
    other = interpolated([np.array([0.0, 1.0])], np.array([2.0, 7.0]), "cubic", "hold")
    refs = [TableRef("other", other, (0,)), TableRef("H", table, (0, 0))]
    wanted = derivatives(refs[1], [sym("x"), sym("y")], 2)
    tape = build_tape([*wanted.values(), looked_up(refs[0], sym("x"))], refs, ["x", "y"])
    at = np.array([rng.uniform(x[0], x[-1], 60), rng.uniform(y[0], y[-1], 60)])
    beyond = np.array([[x[0] - 1.0, x[-1] + 1.0, x[3], x[-1]], [y[2], y[-1] + 3.0, y[0] - 9.0, y[-1]]])
    both = np.concatenate([at, beyond], axis=1)
    machine, instructions, meaning = values_of(tape, inputs([other, table]), both)
    assert np.array_equal(machine, instructions, equal_nan=True)
    truth = RectBivariateSpline(x, y, values, s=0)
    for row, (dx, dy) in enumerate(wanted):
        expected = truth.ev(*at, dx=dx, dy=dy)
        for found in (machine, meaning):
            np.testing.assert_allclose(found[row][:60], expected, atol=1e-10 * np.abs(expected).max())
            np.testing.assert_allclose(found[row], table.value(list(both), [dx, dy]), rtol=1e-9, atol=1e-9)
    corner = table.value(list(beyond[:, 1]), [0, 0])
    edge = table.value([x[-1], y[-1]], [0, 0])
    if outside == "hold":
        assert corner == pytest.approx(edge)
    elif outside == "error":
        assert np.isnan(machine[0][60:63]).all()
        assert machine[0][63] == pytest.approx(values[-1, -1])
    else:
        assert corner == pytest.approx(
            edge
            + table.value([x[-1], y[-1]], [1, 0])
            + 3.0 * table.value([x[-1], y[-1]], [0, 1])
            + 3.0 * table.value([x[-1], y[-1]], [1, 1])
        )


def test_other_numbers_make_the_same_program() -> None:
    programs = set()
    for count in (3, 400):
        places = np.linspace(0.0, 1.0, count)
        ref = TableRef("T", interpolated([places], places**2, "cubic", "hold"), (0,))
        slope = ref.derivative(0)
        assert slope is not None
        expressions = [looked_up(ref, sym("x")) * sym("y"), looked_up(slope, sym("x"))]
        programs.add(build_tape(expressions, [ref], ["x", "y"]).digest())
    assert len(programs) == 1
