"""Going through instructions gives the bits that machine code gives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stc.codegen import engine, kernel
from stc.codegen.interpreter import CHUNK, assemble
from stc.codegen.kernel import LANES, Backend, compile_tapes
from stc.codegen.runs import Runs
from stc.codegen.tape import LOOKUPS, Tape, build_tape
from stc.core.library import library
from stc.symbolic.expr import ARITY, add, call, mul, num, sym

pytestmark = pytest.mark.skipif(not engine.llvm_wanted(), reason="needs LLVM")

UNIFORM, VARYING = 3, 7


@st.composite
def tapes(draw: st.DrawFn) -> Tape:
    """Any straight-line program, uniform operations first; products that are needed once, twice and not at all."""
    constants = draw(st.lists(st.floats(-3.0, 3.0), max_size=3))
    first = UNIFORM + VARYING + len(constants)
    ops: list[tuple[str, int, int]] = []
    names = st.sampled_from(("add", "sub", "mul", "mul", "add", "sub", *ARITY))
    uniform_slots = [*range(UNIFORM), *range(UNIFORM + VARYING, first)]
    once = draw(st.integers(0, 4))
    for number in range(once + draw(st.integers(0, 40))):
        op = draw(names)
        slots = uniform_slots if number < once else [*range(first), *range(first, first + number)]
        a = draw(st.sampled_from(slots))
        b = draw(st.sampled_from(slots)) if ARITY[op] == 2 else -1
        if number < once:
            uniform_slots.append(first + number)
        ops.append((op, a, b))
    outputs = draw(st.lists(st.integers(0, first + len(ops) - 1), min_size=1, max_size=8))
    return Tape(UNIFORM, VARYING, constants, ops, outputs, [k < once for k in range(len(ops))])


def _both(tape: Tape, runs: Runs, blocks: int, seed: int, kept: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """What machine code gives, and what instructions give."""
    rng = np.random.default_rng(seed)
    workspace, uniform = rng.normal(size=200), rng.normal(size=UNIFORM)
    index = rng.integers(0, 190, (blocks, runs.count, LANES)).astype(np.int32)
    given = rng.normal(size=(blocks, runs.kept_width, LANES)) if kept else None
    results = []
    ways: tuple[Backend, Backend] = "llvm", "interpreter"
    for backend in ways:
        kernels = compile_tapes([tape], [runs], backend, cache=False)
        out = np.full((blocks, len(tape.outputs), LANES), 7.0)
        kernels[0].bind(workspace, uniform, index, out, given)()
        results.append(out)
    return results[0], results[1]


def test_every_operator_is_an_instruction() -> None:
    assert {*ARITY, *LOOKUPS} <= set(library().tape_instructions().decode().split())


@settings(max_examples=60, deadline=None)
@given(tapes(), st.integers(0, 2 * CHUNK + 3), st.integers(0, 2**31))
def test_any_tape(tape: Tape, blocks: int, seed: int) -> None:
    compiled, interpreted = _both(tape, Runs.alone(VARYING), blocks, seed)
    assert compiled.tobytes() == interpreted.tobytes() or np.array_equal(
        compiled, interpreted, equal_nan=True
    )


@settings(max_examples=30, deadline=None)
@given(tapes(), st.integers(1, 20), st.integers(0, 2**31))
def test_runs_and_what_another_kernel_has_found(tape: Tape, blocks: int, seed: int) -> None:
    runs = Runs((0, 1, 3, 4, 8), 3, 1, 4)  # the last two inputs are outputs 1 and 2 of another kernel
    compiled, interpreted = _both(tape, runs, blocks, seed, kept=2)
    assert np.array_equal(compiled, interpreted, equal_nan=True)


def test_rows_are_used_again() -> None:
    """A sum of many terms takes as many rows as its inputs, and a few."""
    keys = [("x", k) for k in range(50)]
    total = num(0.0)
    for key in keys:
        total = add(total, call("exp", mul(sym(key), sym(key))))
    tape = build_tape([total], [], keys)
    assert assemble(tape, Runs.alone(50)).rows <= 4 * 50 + 4


def test_machine_code_takes_over_in_prepared_calls() -> None:
    x = sym("x")
    tape = build_tape([add(mul(x, x), call("cos", x))], [], ["x"])
    kernels = compile_tapes([tape], cache=False, instances=[8])
    assert kernels.interpreted
    workspace = np.linspace(-1.0, 1.0, 12)
    index = np.tile(np.arange(8, dtype=np.int32).reshape(2, 1, LANES), (10_000, 1, 1))
    out = np.zeros((20_000, 1, LANES))
    call_it = kernels[0].bind(workspace, np.zeros(0), index, out)
    call_it()
    before = out.copy()
    kernels.compile_when_due()
    assert kernels.interpreted
    for _ in range(1000):
        call_it()
    kernels.compile_when_due()
    assert not kernels.interpreted
    out[:] = 0.0
    call_it()
    assert out.tobytes() == before.tobytes()
    np.testing.assert_allclose(out[:2].reshape(-1), workspace[:8] ** 2 + np.cos(workspace[:8]), rtol=1e-15)


def test_many_instances_are_compiled_at_once() -> None:
    tape = build_tape([mul(sym("x"), sym("x"))], [], ["x"])
    assert not compile_tapes([tape], cache=False, instances=[10_000_000]).interpreted


def test_what_does_not_fit_the_stack_is_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel of many values at once stays with instructions, whose values are elsewhere, and gives the same."""
    monkeypatch.setattr(kernel, "STACK", 1000)
    values = [mul(sym("v0"), num(float(k))) for k in range(200)]
    total = values[0]
    for value in reversed(values):
        total = add(mul(total, value), value)

    wide, narrow = build_tape([total, *values], [], ["v0"]), build_tape([values[3]], [], ["v0"])
    workspace, index = np.linspace(-1.0, 1.0, 20), np.zeros((1, 1, LANES), np.int32)
    results = []
    for tapes in ([wide], [narrow]):
        kernels = compile_tapes(tapes, cache=False)
        out = np.zeros((1, len(tapes[0].outputs), LANES))
        kernels[0].bind(workspace, np.zeros(1), index, out)()
        results.append((kernels[0].is_compiled, out[0, :, 0]))
    assert [compiled for compiled, _ in results] == [False, True]
    assert np.allclose(results[0][1][1:], -np.arange(200.0))
    assert results[1][1][0] == -3.0
