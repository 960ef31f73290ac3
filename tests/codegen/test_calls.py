"""Functions of the core that make prepared calls by number."""

from __future__ import annotations

import numpy as np
import pytest

from stc.core.calls import Bound, CallTable
from stc.core.functions import ArgumentError, function
from stc.solver import state

#: Makes the call at ``state.DIAGONALS``, then notes what it has begun.
begin = function("inertia_correction_begin")


@pytest.fixture
def table():
    return CallTable(state.CALLS)


@pytest.fixture
def s():
    """The numbers of an iteration."""
    return np.zeros(state.NUMBERS)


def test_calls_are_made(table, s):
    counter, status = np.zeros(1, dtype=np.int64), np.ones(1)
    table.put(state.DIAGONALS, function("gather_begin").bind(status, counter))
    for made in (1, 2):
        begin(table.cells, s)
        assert counter[0] == made


def test_python_functions_may_be_called_and_what_they_write_is_seen(table, s):
    def note() -> None:
        s[state.STIFFNESS] += 5.0

    table.put(state.DIAGONALS, Bound.of_python(note, ()))
    for made in (1, 2):
        begin(table.cells, s)
        assert s[state.SHIFT] == 5.0 * made
    table.check()


@pytest.mark.parametrize("raised", [ValueError("no"), KeyboardInterrupt()])
def test_what_python_raises_is_raised_afterwards(table, s, raised):
    made = []

    def fail() -> int:
        made.append(1)
        raise raised

    table.put(state.DIAGONALS, Bound.of_python(fail, ()))
    begin(table.cells, s)
    begin(table.cells, s)
    assert len(made) == 1  # later ones are not made
    assert table.cells[-1] == 1
    with pytest.raises(type(raised)):
        table.check()
    assert table.cells[-1] == 0
    table.check()
    begin(table.cells, s)
    table.forget()
    table.check()


def test_a_place_that_is_emptied_is_empty(table):
    call = Bound.of_python(lambda: None, ())
    table.put(3, call)
    assert table.cells[6] != 0
    table.put(3, None)
    assert table.cells[6] == table.cells[7] == 0


def test_arguments_are_checked():
    combine = function("step_combine")
    factor, one, other, out = np.full(1, 2.0), np.ones(6), np.arange(6.0), np.zeros(6)
    combine(6, factor, one, other, out)
    np.testing.assert_array_equal(out, 1.0 + 2.0 * other)
    for wrong, message in (
        (
            other.astype(np.float32),
            "other must be a one-dimensional C-contiguous array of float64, not float32",
        ),
        (np.zeros(12)[::2], "other must be .*strides"),
        (other.reshape(2, 3), "other must be .*shape"),
        ([1.0] * 6, "other must be a float64 array, not list"),
    ):
        with pytest.raises(ArgumentError, match=message):
            combine(6, factor, one, wrong, out)
    with pytest.raises(ArgumentError, match="takes 5 arguments, not 2"):
        combine(6, factor)


def test_scalars_of_a_prepared_call_can_be_set():
    call = function("kernels_multiplier_scale").bind(1000.0, 2)  # the mean, in hundreds
    assert call() == 5.0
    call.set("count", 1)
    assert call() == 10.0
    call.floats[call.position("total")] = 500.0
    assert call() == 5.0
    copied = function("gather_copy").bind(1, np.zeros(1), np.zeros(1))
    with pytest.raises(ArgumentError, match="bind again"):
        copied.set("values", 1.0)
