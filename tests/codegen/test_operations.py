"""Elementary functions that kernels call: the right values, whatever else is going on."""

from __future__ import annotations

import numpy as np
import pytest
import tape_reference as reference

from stc.arrays import aligned_zeros
from stc.codegen import engine
from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import RUN
from stc.codegen.tape import Tape, build_tape
from stc.symbolic import expr
from stc.symbolic.expr import ARITY

FUNCTIONS = sorted(set(ARITY) - {"add", "sub", "mul", "div", "neg", "sqrt"})


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
            arguments = [first, values[-1]] if ARITY[name] == 2 else [first]
            if name == "log":
                arguments = [1.5 + first]
            result = expr.pow_(*arguments) if name == "pow" else expr.call(name, *arguments)
            outputs.append(result * x + y)
            values.append(expr.call("tanh", result))
    outputs += [expr.call("exp", c) * x, expr.call("sin", c) + expr.call("cos", c) * y, expr.sum_of(values)]
    return build_tape(outputs, ["c"], ["x", "y"])


@pytest.mark.parametrize("registers", [1, 16, 32])
@pytest.mark.parametrize("width", [4, 8])
def test_values_outlast_calls(registers: int, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "vector_registers", lambda: registers)
    monkeypatch.setattr(engine, "vector_width", lambda: width)
    tape, blocks = busy_tape(), 6
    workspace = np.random.default_rng(5).uniform(-0.9, 0.9, 2 * blocks * LANES + RUN - 1)
    index = np.arange(2 * blocks * LANES, dtype=np.int32).reshape(blocks, 2, LANES)
    out = aligned_zeros((blocks, len(tape.outputs), LANES))
    compile_tapes([tape], backend="llvm", cache=False)[0](workspace, np.array([0.7]), index, out)
    each = workspace[index].transpose(1, 0, 2).reshape(2, -1)
    meaning = reference.run(tape, [0.7], each).reshape(-1, blocks, LANES).transpose(1, 0, 2)
    np.testing.assert_allclose(out, meaning, rtol=1e-12, atol=1e-13)
