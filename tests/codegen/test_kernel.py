"""Compiled kernels against the meaning of their tapes in NumPy."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tape_reference as reference
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen import engine
from stc.codegen.kernel import LANES, KernelSet, compile_tapes, effort
from stc.codegen.runs import RUN
from stc.codegen.tape import Tape, build_tape
from stc.core.calls import Bound, chain, chain_until
from stc.core.functions import function
from stc.symbolic import expr
from stc.symbolic.expr import ARITY

Array = NDArray[np.float64]


class Setting:
    """Arrays for one tape with ``count`` instances, their inputs scattered over the workspace."""

    def __init__(self, tape: Tape, count: int, seed: int = 0, low: float = -2.0, high: float = 2.0) -> None:
        rng = np.random.default_rng(seed)
        self.tape = tape
        self.blocks = -(-count // LANES)
        held = 3 * tape.n_varying * count + 5
        self.workspace = rng.uniform(low, high, held + RUN - 1)
        self.uniform = rng.uniform(low, high, tape.n_uniform)
        places = rng.choice(held, (tape.n_varying, count), replace=False)
        padded = np.concatenate(
            [places, np.repeat(places[:, :1], self.blocks * LANES - count, axis=1)], axis=1
        )
        blocked = padded.reshape(tape.n_varying, self.blocks, LANES).transpose(1, 0, 2)
        self.index = np.ascontiguousarray(blocked, dtype=np.int32)
        self.out = np.full((self.blocks, len(tape.outputs), LANES), 1e99)

    @property
    def arguments(self) -> tuple[Array, Array, NDArray[np.int32], Array]:
        return self.workspace, self.uniform, self.index, self.out

    def expected(self) -> Array:
        """By definition of the tape, blocked."""
        inputs = self.workspace[self.index].transpose(1, 0, 2).reshape(self.tape.n_varying, -1)
        values = reference.run(self.tape, self.uniform, inputs)
        return values.reshape(len(self.tape.outputs), self.blocks, LANES).transpose(1, 0, 2)


def double_pendulum() -> Tape:
    """Lagrangian accelerations of a two-link pendulum: divisions, sines shared, uniform subexpressions."""
    a, b, u, v = (expr.sym(name) for name in ("a", "b", "u", "v"))
    m, l, g = (expr.sym(name) for name in ("m", "l", "g"))
    sine, cosine = expr.call("sin", a - b), expr.call("cos", a - b)
    shared = (g / l) * m * m
    determinant = m * (2.0 - cosine * cosine)
    first = (-(v * v) * sine - u * u * sine * cosine - shared * expr.call("sin", a)) / determinant
    second = (2.0 * u * u * sine + v * v * sine * cosine + shared * cosine) / determinant
    return build_tape([first, second, shared, a, expr.num(3.5)], ["m", "l", "g"], ["a", "b", "u", "v"])


@st.composite
def tapes(draw: st.DrawFn) -> Tape:
    """Any valid tape: uniform operations first, all kinds of outputs."""
    n_uniform, n_varying = draw(st.integers(0, 3)), draw(st.integers(1, 4))
    finite = st.floats(-4.0, 4.0)
    constants = draw(st.lists(finite, max_size=3))
    ops: list[tuple[str, int, int]] = []
    flags: list[bool] = []
    names = st.sampled_from(sorted(ARITY))
    literals = range(n_uniform + n_varying, n_uniform + n_varying + len(constants))
    first = n_uniform + n_varying + len(constants)
    uniform_slots = [*range(n_uniform), *literals]
    for _ in range(draw(st.integers(0, 6)) if uniform_slots else 0):
        name = draw(names)
        operands = [draw(st.sampled_from(uniform_slots)) for _ in range(ARITY[name])]
        uniform_slots.append(first + len(ops))
        ops.append((name, operands[0], operands[1] if len(operands) == 2 else -1))
        flags.append(True)
    varying_slots = list(range(n_uniform, n_uniform + n_varying))
    for _ in range(draw(st.integers(0, 25))):
        name = draw(names)
        operands = [draw(st.sampled_from(uniform_slots + varying_slots)) for _ in range(ARITY[name])]
        operands[draw(st.integers(0, len(operands) - 1))] = draw(st.sampled_from(varying_slots))
        varying_slots.append(first + len(ops))
        ops.append((name, operands[0], operands[1] if len(operands) == 2 else -1))
        flags.append(False)
    outputs = draw(st.lists(st.sampled_from(uniform_slots + varying_slots), min_size=1, max_size=8))
    return Tape(n_uniform, n_varying, constants, ops, outputs, flags)


def well_conditioned(setting: Setting) -> NDArray[np.bool_]:
    """Where a perturbation of the inputs by a few roundings moves the outputs a little only."""
    exact = setting.expected()
    stable = np.ones(exact.shape, dtype=bool)
    workspace, uniform = setting.workspace.copy(), setting.uniform.copy()
    constants = list(setting.tape.constants)
    for factor in (1 - 1e-13, 1 + 1e-13):
        setting.workspace = workspace * factor
        setting.uniform = uniform / factor
        setting.tape.constants[:] = [value * factor for value in constants]
        with np.errstate(all="ignore"):
            moved = setting.expected()
            stable &= (np.abs(moved - exact) <= 1e-9 * np.abs(exact)) | (np.isnan(moved) & np.isnan(exact))
    setting.workspace, setting.uniform = workspace, uniform
    setting.tape.constants[:] = constants
    return stable & ~(np.abs(exact) > 1e300)


@settings(max_examples=60, deadline=None)
@given(tapes(), st.integers(1, 11), st.integers(0, 10**6))
def test_any_tape(tape: Tape, count: int, seed: int) -> None:
    setting = Setting(tape, count, seed)
    compile_tapes([tape], backend="llvm", cache=False)[0](*setting.arguments)
    expected, good = setting.expected(), well_conditioned(setting)
    np.testing.assert_allclose(setting.out[good], expected[good], rtol=1e-8, atol=1e-300)


def polynomial_mess(seed: int, length: int) -> Tape:
    """A long tape of additions and multiplications that reach far back."""
    rng = np.random.default_rng(seed)
    n_uniform, n_varying, constants = 3, 9, [0.5, -0.25]
    first = n_uniform + n_varying + len(constants)
    ops = [("mul", 0, 1), ("add", 2, first)]
    for k in range(2, length):
        name = ("add", "mul", "sub", "neg", "sin", "cos")[
            int(rng.choice(6, p=[0.4, 0.2, 0.3, 0.04, 0.03, 0.03]))
        ]
        near, far = rng.integers(max(0, first + k - 12), first + k), rng.integers(0, first + k)
        operand = int(near) if int(near) >= first + 2 else n_uniform
        ops.append((name, operand, int(far) if ARITY[name] == 2 else -1))
        if name == "mul":  # keep the numbers small
            ops[-1] = ("mul", operand, int(rng.integers(0, first)))
    outputs = [int(slot) for slot in rng.integers(0, first + length, 40)]
    return Tape(n_uniform, n_varying, constants, ops, outputs, [True] * 2 + [False] * (length - 2))


@pytest.mark.parametrize("registers", [1, 16, 32])
@pytest.mark.parametrize("seed", range(4))
def test_values_move_to_memory_and_back(registers: int, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "vector_registers", lambda: registers)
    setting = Setting(polynomial_mess(seed, 700), 9, seed, -1.0, 1.0)
    kernels = compile_tapes([setting.tape], backend="llvm", cache=False)
    kernels[0](*setting.arguments)
    expected, good = setting.expected(), well_conditioned(setting)
    assert good.mean() > 0.5
    np.testing.assert_allclose(setting.out[good], expected[good], rtol=1e-8)


def test_long_kernels_are_compiled_with_less_effort(monkeypatch: pytest.MonkeyPatch) -> None:
    tape = polynomial_mess(1, 700)
    for longest, level in ((700, 1), (699, 0)):
        monkeypatch.setattr("stc.codegen.kernel._LONG", longest)
        assert effort([tape]) == level
        setting = Setting(tape, 9, 1, -1.0, 1.0)
        compile_tapes([tape], backend="llvm", cache=False)[0](*setting.arguments)
        expected, good = setting.expected(), well_conditioned(setting)
        assert good.mean() > 0.5
        np.testing.assert_allclose(setting.out[good], expected[good], rtol=1e-8)


@pytest.mark.parametrize("name", sorted(ARITY))
@pytest.mark.parametrize("short", [False, True])
@pytest.mark.parametrize("uniform", [False, True])
def test_every_operator(name: str, uniform: bool, short: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not short:  # as in long kernels, without optimisation
        monkeypatch.setattr("stc.codegen.kernel._LONG", 0)
    arity = ARITY[name]
    if uniform:  # the operation runs once
        tape = Tape(2, 1, [], [(name, 0, 1 if arity == 2 else -1), ("add", 3, 2)], [3, 4], [True, False])
    else:
        tape = Tape(0, 2, [], [(name, 0, 1 if arity == 2 else -1)], [2], [False])
    for seed, (low, high) in enumerate([(0.1, 0.9), (-0.9, 0.9), (1.0, 30.0)]):
        setting = Setting(tape, 9, seed, low, high)
        compile_tapes([tape], backend="llvm", cache=False)[0](*setting.arguments)
        np.testing.assert_allclose(setting.out, setting.expected(), rtol=4e-15, atol=1e-300)


@pytest.mark.parametrize("count", [1, 3, 4, 5, 8, 21])
@pytest.mark.parametrize(("backend", "width"), [("llvm", 4), ("llvm", 8), ("interpreter", 4)])
def test_blocks_and_their_filling(
    count: int, backend: Any, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "vector_width", lambda: width)
    setting = Setting(double_pendulum(), count)
    kernels = compile_tapes([setting.tape], backend=backend, cache=False)
    assert kernels.backend == backend
    kernels[0](*setting.arguments)
    np.testing.assert_allclose(setting.out, setting.expected(), rtol=1e-12)


def test_no_blocks_at_all() -> None:
    setting = Setting(double_pendulum(), 4)
    for backend in ("llvm", "interpreter"):
        kernels = compile_tapes([setting.tape], backend=backend, cache=False)
        kernels[0](setting.workspace, setting.uniform, setting.index[:0], setting.out[:0])
    assert (setting.out == 1e99).all()


def test_many_tapes() -> None:
    first, second = double_pendulum(), build_tape([expr.sym("x") * 2.0], [], ["x"])
    kernels = compile_tapes([first, second, first], backend="llvm", cache=False)
    assert len(kernels) == 3
    for k, tape in enumerate([first, second, first]):
        setting = Setting(tape, 6, k)
        kernels[k].bind(*setting.arguments)()
        np.testing.assert_allclose(setting.out, setting.expected(), rtol=1e-12)
    assert not kernels.cached


def test_without_tapes_nothing_is_compiled() -> None:
    assert len(compile_tapes([], backend="llvm")) == 0


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_angles_that_are_there_go_together(count: int) -> None:
    """Also one of which the tape wants a tangent, or comes to the cosine long after; results are the same bits."""
    names = [f"x{k}" for k in range(count)]
    angles = [expr.sym(name) for name in names]
    wanted = [expr.call(("sin", "cos", "tan")[k % 3], angle) for k, angle in enumerate(angles)]
    outputs = [
        *wanted,
        expr.call("cos", sum(wanted, start=expr.call("cos", expr.sym("u")))),
        expr.call("cos", angles[0]),
    ]
    tape = build_tape(outputs, ["u"], names)
    setting = Setting(tape, 11)
    kernels = compile_tapes([tape], backend="llvm", cache=False)
    kernels[0](*setting.arguments)
    np.testing.assert_allclose(setting.out, setting.expected(), rtol=1e-13, atol=1e-14)
    together = setting.out.copy()
    for k, want in enumerate(wanted):
        alone = build_tape([want], ["u"], [names[k]])
        one = Setting(alone, 11)
        one.workspace, one.uniform, one.index = (
            setting.workspace,
            setting.uniform,
            setting.index[:, [k]].copy(),
        )
        compile_tapes([alone], backend="llvm", cache=False)[0](*one.arguments)
        np.testing.assert_array_equal(one.out[:, 0], together[:, k])


def test_bound_calls_see_new_values() -> None:
    for backend in ("llvm", "interpreter"):
        setting = Setting(double_pendulum(), 7)
        call = compile_tapes([setting.tape], backend=backend)[0].bind(*setting.arguments)
        for factor in (1.0, 0.5):
            setting.workspace *= factor
            setting.uniform *= factor
            call()
            np.testing.assert_allclose(setting.out, setting.expected(), rtol=1e-12)


def test_chains_run_kernels_and_functions_of_the_core_in_order() -> None:
    setting = Setting(double_pendulum(), 8)
    for backend in ("llvm", "interpreter"):
        setting.out[:] = 0.0
        flat = setting.out.reshape(-1)
        result, factors = np.zeros(flat.size), np.full(flat.size, 2.0)
        scaled = function("gather_place").bind(flat.size, flat, factors, result)
        kernel = compile_tapes([setting.tape], backend=backend)[0].bind(*setting.arguments)
        both = chain([kernel, scaled])
        assert both.native
        both()
        np.testing.assert_allclose(result, 2.0 * flat, rtol=1e-13)
        factors[:] = 3.0
        nested = chain([both, both])
        nested()
        np.testing.assert_allclose(result, 3.0 * flat, rtol=1e-13)
    assert chain([])() is None


@pytest.mark.parametrize("native_code", [True, False])
def test_chains_end_at_a_result(native_code: bool) -> None:
    none, some, status = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64), np.ones(1)
    counter = np.zeros(1, dtype=np.int64)
    all_same, begin = function("gather_all_same"), function("gather_begin")
    last: Bound = begin.bind(status, counter)
    if not native_code:
        last = Bound.of_python(last, ())
    for result, checked, ended in ((0, True, 0), (1, True, 2), (1, False, 0)):
        counter[0], some[0] = 0, result
        parts = all_same.bind(1, none), all_same.bind(1, some)
        call = chain_until([(parts[0], True), (parts[1], checked), (last, False)])
        assert call.native == native_code
        assert call() == ended
        assert counter[0] == (0 if ended else 1)
    assert chain_until([])() == 0


def test_special_values_pass_through() -> None:
    x, y = expr.sym("x"), expr.sym("y")
    tape = build_tape([x / y, expr.call("sqrt", x), x * y, expr.call("log", x), x + y], [], ["x", "y"])
    values = [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 1e-310]
    pairs = np.array([(a, b) for a in values for b in values]).T
    setting = Setting(tape, pairs.shape[1])
    setting.workspace = np.concatenate([pairs.reshape(-1), np.zeros(RUN - 1)])
    places = np.arange(pairs.size, dtype=np.int32).reshape(2, -1, LANES).transpose(1, 0, 2)
    setting.index = np.ascontiguousarray(places)
    compile_tapes([tape], backend="llvm", cache=False)[0](*setting.arguments)
    np.testing.assert_allclose(setting.out, setting.expected(), rtol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"workspace": np.zeros(3, dtype=np.float32)}, "workspace must be"),
        ({"workspace": np.zeros((2, 40))}, "must be vectors"),
        ({"workspace": np.zeros(3)}, "outside the workspace"),
        ({"uniform": np.zeros(2)}, "3 or more"),
        ({"index": np.zeros((2, 4, LANES), dtype=np.int64)}, "index must be"),
        ({"index": np.zeros((2, 5, LANES), dtype=np.int32)}, "index has shape"),
        ({"index": np.full((2, 4, LANES), -1, dtype=np.int32)}, "outside"),
        ({"out": np.zeros((3, 5, LANES))}, "out has shape"),
        ({"out": np.zeros((2, LANES, 5)).transpose(0, 2, 1)}, "out must be"),
    ],
)
@pytest.mark.parametrize("backend", ["llvm", "interpreter"])
def test_wrong_arrays_are_refused(change: dict[str, Any], message: str, backend: Any) -> None:
    setting = Setting(double_pendulum(), 8)
    arguments: dict[str, Any] = (
        dict(zip(("workspace", "uniform", "index", "out"), setting.arguments)) | change
    )
    kernels = compile_tapes([setting.tape], backend=backend)
    with pytest.raises(ValueError, match=message):
        kernels[0](*arguments.values())
    with pytest.raises(ValueError, match=message):
        kernels[0].bind(*arguments.values())


def test_aligned_zeros() -> None:
    for shape in (1, 7, (3, 5, 4), (0, 4)):
        array = aligned_zeros(shape)
        assert array.ctypes.data % 64 == 0 or array.size == 0
        assert array.shape == (shape if isinstance(shape, tuple) else (shape,))
        assert array.flags.c_contiguous
        assert not array.any()


# ---- the object cache, end to end -----------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache directory."""
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path))
    return tmp_path


def works(kernels: KernelSet) -> bool:
    setting = Setting(kernels.tapes[0], 5)
    kernels[0](*setting.arguments)
    return bool(np.allclose(setting.out, setting.expected(), rtol=1e-12, atol=0))


def test_second_compilation_is_a_lookup(folder: Path) -> None:
    first = compile_tapes([double_pendulum()], backend="llvm")
    second = compile_tapes([double_pendulum()], backend="llvm")
    assert (first.cached, second.cached) == (False, True)
    assert works(first)
    assert works(second)
    assert len(list(folder.iterdir())) == 1
    assert not compile_tapes([double_pendulum()], backend="llvm", cache=False).cached


def test_different_tapes_have_different_objects(folder: Path) -> None:
    x = expr.sym("x")
    for exponent in (2.5, 3.5):
        tape = build_tape([x * exponent], [], ["x"])
        kernels = compile_tapes([tape], backend="llvm")
        assert not kernels.cached
        assert works(kernels)


def test_stale_code_is_never_loaded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_tapes([double_pendulum()], backend="llvm")
    with monkeypatch.context() as patched:
        patched.setattr(engine, "own_digest", lambda: "another version")
        assert not compile_tapes([double_pendulum()], backend="llvm").cached
    assert compile_tapes([double_pendulum()], backend="llvm").cached


@pytest.mark.parametrize("damage", ["flip", "cut", "empty"])
def test_damaged_objects_are_compiled_again(folder: Path, damage: str) -> None:
    compile_tapes([double_pendulum()], backend="llvm")
    (path,) = folder.iterdir()
    content = bytearray(path.read_bytes())
    if damage == "flip":
        content[len(content) // 2] ^= 255
    else:
        del content[len(content) // 2 if damage == "cut" else 0 :]
    path.write_bytes(content)
    again = compile_tapes([double_pendulum()], backend="llvm")
    assert not again.cached
    assert works(again)
    assert compile_tapes([double_pendulum()], backend="llvm").cached


def test_unwritable_cache_still_compiles(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "file").write_text("in the way")
    monkeypatch.setenv("STC_CACHE_DIR", str(folder / "file" / "below"))
    assert works(compile_tapes([double_pendulum()], backend="llvm"))


def test_backend_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STC_BACKEND", "python")
    assert compile_tapes([double_pendulum()]).backend == "interpreter"
    monkeypatch.setenv("STC_BACKEND", "auto")
    assert compile_tapes([double_pendulum()]).backend == "llvm"
    monkeypatch.setattr(engine, "_compiler", lambda: None)
    kernels = compile_tapes([double_pendulum()])
    assert kernels.backend == "interpreter"
    assert works(kernels)
    monkeypatch.setenv("STC_BACKEND", "llvm")
    with pytest.raises(ImportError, match="llvmlite"):
        compile_tapes([double_pendulum()])


def test_literals_are_exact() -> None:
    values = [0.1, -0.0, 5e-324, 1.7976931348623157e308, math.pi, math.inf, math.nan]
    tape = Tape(0, 1, values, [], list(range(1, 8)), [])
    setting = Setting(tape, 4)
    compile_tapes([tape], backend="llvm", cache=False)[0](*setting.arguments)
    for row, value in enumerate(values):
        assert struct.pack("<d", setting.out[0, row, 3]) == struct.pack("<d", value) or value != value


def test_calls_keep_everything_alive() -> None:
    def make() -> tuple[Bound, Array, Array]:
        setting = Setting(double_pendulum(), 8)
        return (
            compile_tapes([setting.tape], cache=False)[0].bind(*setting.arguments),
            setting.out,
            setting.expected(),
        )

    call, out, expected = make()
    import gc

    gc.collect()
    call()
    np.testing.assert_allclose(out, expected, rtol=1e-12)
