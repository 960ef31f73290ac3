"""Copies of blocks of memory, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from stc.core.library import library

LINE, PAGE = 64, 4096
#: Sizes from which on copies are made in other ways (``stc/core/copy.c``).
MIDDLING, LARGE = 2**11, 2**22


@pytest.fixture
def copy():
    return library().copy_block


@pytest.mark.parametrize("size", [0, 5, LARGE - 1, LARGE, LARGE + 100])
@pytest.mark.parametrize(("to", "source"), [(0, 0), (3, 50), (64, 9), (61, 128)])
def test_copies_are_whole_and_nothing_else_is_written(copy, size: int, to: int, source: int) -> None:
    given = np.random.default_rng(1).integers(0, 255, source + size + 7, dtype=np.uint8)
    target = np.full(to + size + 200, 255, dtype=np.uint8)
    expected = target.copy()
    expected[to : to + size] = given[source : source + size]
    assert copy(target.ctypes.data + to, given.ctypes.data + source, size) == target.ctypes.data + to
    np.testing.assert_array_equal(target, expected)


@pytest.mark.parametrize("size", [MIDDLING - 1, MIDDLING, 3 * PAGE + 5, LARGE - 1])
@pytest.mark.parametrize("behind", [0, 1, 8, LINE - 1, LINE, -8])
@pytest.mark.parametrize("begin", [0, 8, 61])
def test_targets_a_little_behind_their_sources_within_a_page(
    copy, size: int, behind: int, begin: int
) -> None:
    pages = -(-size // PAGE) + 2
    memory = np.random.default_rng(3).integers(0, 255, (2 * pages + 1) * PAGE, dtype=np.uint8)
    first = -memory.ctypes.data % PAGE + 64
    source, to = first + begin, first + pages * PAGE + begin + behind
    expected = memory.copy()
    expected[to : to + size] = memory[source : source + size]
    copy(memory.ctypes.data + to, memory.ctypes.data + source, size)
    np.testing.assert_array_equal(memory, expected)


@pytest.mark.parametrize("shift", [-4097, -64, -1, 1, 64, 4097])
def test_blocks_that_overlap_are_moved(copy, shift: int) -> None:
    size = LARGE + 1000 if abs(shift) > 1 else MIDDLING + 100
    memory = np.random.default_rng(2).integers(0, 255, size + 2 * abs(shift), dtype=np.uint8)
    begin = abs(shift)
    expected = memory.copy()
    expected[begin + shift : begin + shift + size] = memory[begin : begin + size]
    copy(memory.ctypes.data + begin + shift, memory.ctypes.data + begin, size)
    np.testing.assert_array_equal(memory, expected)
