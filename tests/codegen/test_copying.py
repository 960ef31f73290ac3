"""Copies that machine code makes of blocks of memory, against NumPy."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from stc.codegen import engine, image
from stc.codegen.copying import BEHIND, LARGE, MIDDLING, PAGE, REPLACED

IR = """
declare ptr @memcpy(ptr, ptr, i64)
declare ptr @memmove(ptr, ptr, i64)
define ptr @copy_apart(ptr %to, ptr %from, i64 %size) nounwind {
  %same = call ptr @memcpy(ptr %to, ptr %from, i64 %size)
  ret ptr %same
}
define ptr @copy_any(ptr %to, ptr %from, i64 %size) nounwind {
  %same = call ptr @memmove(ptr %to, ptr %from, i64 %size)
  ret ptr %same
}
"""
SYMBOLS = ["copy_apart", "copy_any"]

pytestmark = pytest.mark.skipif(not image.supported(), reason="images are for Linux on x86-64")


@pytest.mark.parametrize("symbol", SYMBOLS)
@pytest.mark.parametrize("size", [0, 5, LARGE - 1, LARGE, LARGE + 100])
@pytest.mark.parametrize(("to", "source"), [(0, 0), (3, 50), (64, 9), (61, 128)])
def test_copies_are_whole_and_nothing_else_is_written(symbol: str, size: int, to: int, source: int) -> None:
    loaded = engine.load_object(engine.compile_ir(IR, level=1, optimise=False), SYMBOLS)
    copy = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)(
        loaded.address(symbol)
    )
    given = np.random.default_rng(1).integers(0, 255, source + size + 7, dtype=np.uint8)
    target = np.full(to + size + 200, 255, dtype=np.uint8)
    expected = target.copy()
    expected[to : to + size] = given[source : source + size]
    assert copy(target.ctypes.data + to, given.ctypes.data + source, size) == target.ctypes.data + to
    np.testing.assert_array_equal(target, expected)


@pytest.mark.parametrize("size", [MIDDLING - 1, MIDDLING, 3 * PAGE + 5, LARGE - 1])
@pytest.mark.parametrize("behind", [0, 1, 8, BEHIND, BEHIND + 1, -8])
@pytest.mark.parametrize("begin", [0, 8, 61])
def test_targets_a_little_behind_their_sources_within_a_page(size: int, behind: int, begin: int) -> None:
    loaded = engine.load_object(engine.compile_ir(IR, level=1, optimise=False), SYMBOLS)
    copy = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)(
        loaded.address("copy_any")
    )
    pages = -(-size // PAGE) + 2
    memory = np.random.default_rng(3).integers(0, 255, (2 * pages + 1) * PAGE, dtype=np.uint8)
    first = -memory.ctypes.data % PAGE + 64
    source, to = first + begin, first + pages * PAGE + begin + behind
    expected = memory.copy()
    expected[to : to + size] = memory[source : source + size]
    copy(memory.ctypes.data + to, memory.ctypes.data + source, size)
    np.testing.assert_array_equal(memory, expected)


@pytest.mark.parametrize("shift", [-4097, -64, -1, 1, 64, 4097])
def test_blocks_that_overlap_are_moved(shift: int) -> None:
    loaded = engine.load_object(engine.compile_ir(IR, level=1, optimise=False), SYMBOLS)
    move = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)(
        loaded.address("copy_any")
    )
    size = LARGE + 1000 if abs(shift) > 1 else MIDDLING + 100
    memory = np.random.default_rng(2).integers(0, 255, size + 2 * abs(shift), dtype=np.uint8)
    begin = abs(shift)
    expected = memory.copy()
    expected[begin + shift : begin + shift + size] = memory[begin : begin + size]
    move(memory.ctypes.data + begin + shift, memory.ctypes.data + begin, size)
    np.testing.assert_array_equal(memory, expected)


def test_machine_code_gets_them_instead_of_those_of_the_library() -> None:
    assert set(engine._stand_ins()) == set(REPLACED)
