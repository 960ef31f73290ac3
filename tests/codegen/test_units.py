"""What is compiled together, and which functions of it Python can call."""

from __future__ import annotations

import numpy as np
import pytest

from stc.codegen import engine, native
from stc.codegen.native import FEW_CALLS, f64, f64s, i64
from stc.codegen.native import native as compiled
from stc.codegen.native_units import units


@compiled(inline=True)
def doubled(x: f64) -> f64:
    return 2.0 * x


@compiled
def doubled_sum(count: i64, x: f64s) -> f64:
    total = 0.0
    for k in range(count):
        total += doubled(x[k])
    return total


@compiled
def scaled(count: i64, factor: f64, x: f64s) -> None:
    for k in range(count):
        x[k] *= factor


needs_llvm = pytest.mark.skipif(not engine.llvm_wanted(), reason="without LLVM nothing is compiled")


@needs_llvm
def test_what_is_copied_into_its_callers_is_compiled_by_itself_only_when_it_is_called() -> None:
    x = np.arange(5.0)
    assert doubled_sum(5, x) == 20.0
    assert scaled.is_compiled and not doubled.is_compiled
    (own,) = [unit for unit in units() if doubled_sum in unit.roots]
    assert scaled in own.roots and doubled not in own.roots
    assert doubled in own.functions
    assert doubled(3.0) == 6.0
    assert doubled.is_compiled


def test_all_calls_are_alike() -> None:
    """The first ones are prepared one by one, later ones by a function made for them."""
    for call in range(2 * FEW_CALLS):
        x = np.ones(3)
        if call % 2:
            scaled(2, 3.0, x)
        else:
            scaled(count=2, factor=3.0, x=x)
        assert x.tolist() == [3.0, 3.0, 1.0]
        assert doubled_sum(3, x) == 14.0
        with pytest.raises(native.NativeError, match="x must be a one-dimensional"):
            doubled_sum(2, x[::2])
        with pytest.raises(native.NativeError, match="x must be a float64 array, not list"):
            doubled_sum(2, [1.0, 2.0])  # type: ignore[arg-type]
        with pytest.raises(TypeError):
            doubled_sum(2)  # type: ignore[call-arg]
