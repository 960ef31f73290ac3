"""Kernels that take what another kernel has found for the same instances, against their tapes in NumPy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import tape_reference as reference

from stc.codegen import engine
from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import RUN, Runs
from stc.codegen.tape import Tape, build_tape
from stc.symbolic import expr

OWN, KEPT, FIRST, WIDTH = 2, 30, 3, 35


def taker() -> Tape:
    """More inputs than registers hold, each needed at two places far apart; some of them are outputs."""
    own = [expr.sym(f"x{k}") for k in range(OWN)]
    kept = [expr.sym(f"k{k}") for k in range(KEPT)]
    up = [a * own[0] + b for a, b in pairwise(kept)]
    down = [a * own[1] - b * b for a, b in zip(kept[::-1], kept[-3::-1], strict=False)]
    names = [*(f"x{k}" for k in range(OWN)), *(f"k{k}" for k in range(KEPT))]
    return build_tape([*up, kept[4], *down, own[1], expr.sym("u") * kept[7]], ["u"], names)


@pytest.mark.parametrize(("backend", "width"), [("llvm", 4), ("llvm", 8), ("interpreter", 4)])
@pytest.mark.parametrize("count", [1, 4, 9, 16])
def test_what_another_kernel_has_found_is_taken(
    count: int, backend: Any, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "vector_width", lambda: width)
    rng = np.random.default_rng(count)
    tape = taker()
    blocks = -(-count // LANES)
    runs = Runs((0, RUN), OWN, FIRST, WIDTH)
    kernels = compile_tapes([tape], [runs], backend=backend, cache=False)
    workspace, uniform = rng.uniform(-2, 2, 50 + RUN), rng.uniform(-2, 2, 1)
    index = rng.integers(0, 50, (blocks, OWN, LANES), np.int32)
    kept = rng.uniform(-2, 2, (blocks, WIDTH, LANES))
    out = np.full((blocks, len(tape.outputs), LANES), np.nan)
    kernels[0](workspace, uniform, index, out, kept)
    inputs = np.concatenate([workspace[index], kept[:, FIRST : FIRST + KEPT]], axis=1)
    values = reference.run(tape, uniform, inputs.transpose(1, 0, 2).reshape(OWN + KEPT, -1))
    expected = values.reshape(-1, blocks, LANES).transpose(1, 0, 2)
    np.testing.assert_allclose(out, expected, rtol=1e-13, atol=1e-13)
    bound = np.zeros_like(out)
    kernels[0].bind(workspace, uniform, index, bound, kept)()
    assert (bound == out).all()


def test_it_has_to_be_there() -> None:
    tape = taker()
    kernel = compile_tapes([tape], [Runs((0, RUN), OWN, FIRST, WIDTH)], backend="interpreter")[0]
    arrays = np.zeros(9), np.zeros(1), np.zeros((2, OWN, LANES), np.int32)
    out = np.zeros((2, len(tape.outputs), LANES))
    for wrong in (None, np.zeros((2, WIDTH - 1, LANES)), np.zeros((1, WIDTH, LANES))):
        with pytest.raises(ValueError, match=r"kept has shape .*, not \(2, 35, 4\)"):
            kernel(*arrays, out, wrong)


def test_where_it_is_is_part_of_what_is_compiled() -> None:
    digests = {Runs((0, RUN), OWN, *kept).digest() for kept in ((0, 0), (3, 35), (4, 35), (3, 36))}
    assert len(digests) == 4
