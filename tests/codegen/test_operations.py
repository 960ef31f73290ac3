"""Elementary functions called instead of written out: the same values, whatever else is going on."""

from __future__ import annotations

import re

import numpy as np
import pytest

from stc.arrays import aligned_zeros
from stc.codegen import engine, operations, reference
from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import RUN
from stc.codegen.tape import OPERATORS, Tape, build_tape
from stc.symbolic import expr

FUNCTIONS = sorted(set(OPERATORS) - {"add", "sub", "mul", "div", "neg", "sqrt"})


def busy_tape() -> Tape:
    """Every function several times, of values that are needed again after many calls, and uniform ones too."""
    x, y, c = (expr.sym(name) for name in "xyc")
    values = [x, y, x * y + c, x - 2.0 * y]
    outputs = []
    for round_ in range(3):
        for name in FUNCTIONS:
            first = values[round_] * 0.3
            if name == "pow":
                first = 1.0 + first * first
            arguments = [first, values[-1]] if OPERATORS[name] == 2 else [first]
            if name == "log":
                arguments = [1.5 + first]
            result = expr.pow_(*arguments) if name == "pow" else expr.call(name, *arguments)
            outputs.append(result * x + y)
            values.append(expr.call("tanh", result))
    outputs += [expr.call("exp", c) * x, expr.call("sin", c) + expr.call("cos", c) * y, expr.sum_of(values)]
    return build_tape(outputs, ["c"], ["x", "y"])


def run(tape: Tape, count: int = 21) -> tuple[np.ndarray, np.ndarray, str]:
    """Results of the compiled tape, its meaning, and its IR."""
    blocks = -(-count // LANES)
    rng = np.random.default_rng(5)
    held = 2 * blocks * LANES
    workspace = rng.uniform(-0.9, 0.9, held + RUN - 1)
    index = np.arange(held, dtype=np.int32).reshape(blocks, 2, LANES)
    out = aligned_zeros((blocks, len(tape.outputs), LANES))
    kernels = compile_tapes([tape], backend="llvm", cache=False)
    kernels[0](workspace, np.array([0.7]), index, out)
    each = workspace[index].transpose(1, 0, 2).reshape(2, -1)
    meaning = reference.run(tape, [0.7], each).reshape(-1, blocks, LANES).transpose(1, 0, 2)
    return out, meaning, kernels.llvm_ir()


@pytest.mark.parametrize("registers", [1, 16, 32])
@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("fused", [True, False])
def test_calls_give_the_same_values(
    registers: int, width: int, fused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "vector_registers", lambda: registers)
    monkeypatch.setattr(engine, "vector_width", lambda: width)
    monkeypatch.setattr(engine, "has_fma", lambda: fused)
    tape = busy_tape()
    monkeypatch.setattr("stc.codegen.llvm.WRITTEN_OUT", 10**9)
    written, meaning, long_ir = run(tape)
    monkeypatch.setattr("stc.codegen.llvm.WRITTEN_OUT", 0)
    called, _, short_ir = run(tape)
    assert "define internal" not in long_ir
    assert len(short_ir) < len(long_ir)
    np.testing.assert_allclose(called, written, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(called, meaning, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_called_function_has_the_same_bits(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tape = Tape(1, 2, [], [(name, 1, 2 if OPERATORS[name] == 2 else -1)], [3], [False])
    results = []
    for longest in (10**9, 0):
        monkeypatch.setattr("stc.codegen.llvm.WRITTEN_OUT", longest)
        results.append(run(tape)[0])
    np.testing.assert_array_equal(*results)


def test_each_function_is_there_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stc.codegen.llvm.WRITTEN_OUT", 0)
    _, _, ir = run(busy_tape())
    defined = re.findall(r"define internal .*? @(\S+?)\(", ir)
    assert len(defined) == len(set(defined))
    assert {name.split(".")[0] for name in defined} >= {"pow", "exp", "tanh", "atan2", "sincos"}


def test_many_functions_are_called_and_few_written_out() -> None:
    x, y = expr.sym("x"), expr.sym("y")

    def terms(count: int) -> Tape:
        return build_tape(
            [expr.sum_of([expr.pow_(x + float(k), y) for k in range(count)])], ["c"], ["x", "y"]
        )

    many, few = terms(60), terms(3)
    assert operations.function_length([many]) == 20 * operations.function_length([few])
    assert "define internal" in run(many)[2]
    assert "define internal" not in run(few)[2]


def test_sine_and_cosine_of_one_argument_count_once() -> None:
    x = expr.sym("x")
    tape = build_tape([expr.call(name, x) for name in ("sin", "cos", "tan")], [], ["x"])
    assert operations.function_length([tape]) == 1
