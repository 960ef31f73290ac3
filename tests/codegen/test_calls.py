"""Functions of the core that make prepared calls by number."""

from __future__ import annotations

import numpy as np
import pytest

from stc.core.calls import Bound, CallTable
from stc.core.functions import ArgumentError, function
from stc.core.structures import structure
from stc.solver.constants import CALLS, VALUES

#: Makes the call at ``VALUES``, and looks at what that says of the values.
evaluate = function("active_set_evaluate")


@pytest.fixture
def table():
    return CallTable(CALLS)


@pytest.fixture
def point(table):
    """One where functions are undefined."""
    return structure("primal_dual")(calls=table.cells, values_status=np.ones(1))


def test_calls_are_made(table, point):
    counter, status = np.zeros(1, dtype=np.int64), np.ones(1)
    table.put(VALUES, function("gather_begin").bind(status, counter))
    for made in (1, 2):
        evaluate(point)
        assert counter[0] == made


def test_python_functions_may_be_called_and_what_they_write_is_seen(table, point):
    def note() -> None:
        point.error += 5.0

    table.put(VALUES, Bound.of_python(note, ()))
    for made in (1, 2):
        evaluate(point)
        assert point.error == 5.0 * made
    table.check()


@pytest.mark.parametrize("raised", [ValueError("no"), KeyboardInterrupt()])
def test_what_python_raises_is_raised_afterwards(table, point, raised):
    made = []

    def fail() -> int:
        made.append(1)
        raise raised

    table.put(VALUES, Bound.of_python(fail, ()))
    evaluate(point)
    evaluate(point)
    assert len(made) == 1  # later ones are not made
    assert table.cells[-1] == 1
    with pytest.raises(type(raised)):
        table.check()
    assert table.cells[-1] == 0
    table.check()
    evaluate(point)
    table.forget()
    table.check()


def test_a_place_that_is_emptied_is_empty(table):
    call = Bound.of_python(lambda: None, ())
    table.put(3, call)
    assert table.cells[6] != 0
    table.put(3, None)
    assert table.cells[6] == table.cells[7] == 0


def test_arguments_are_checked():
    copy = function("point_copy")
    v, out = np.arange(6.0), np.zeros(6)
    copy(6, v, out)
    np.testing.assert_array_equal(out, v)
    for wrong, message in (
        (v.astype(np.float32), "source must be a one-dimensional C-contiguous array of float64, not float32"),
        (np.zeros(12)[::2], "source must be .*strides"),
        (v.reshape(2, 3), "source must be .*shape"),
        ([1.0] * 6, "source must be a float64 array, not list"),
    ):
        with pytest.raises(ArgumentError, match=message):
            copy(6, wrong, out)
    with pytest.raises(ArgumentError, match="takes 3 arguments, not 2"):
        copy(6, v)


def test_structures_are_filled_by_name():
    step = structure("step")(dw=np.zeros(3))
    with pytest.raises(ArgumentError, match="dy must be a float64 array"):
        step.set(dy=[1.0])
    iterate = structure("iterate")(f=2.0, z=np.ones(2))
    iterate.array_of("theta")[0] = 3.0
    assert (iterate.f, iterate.theta, iterate.smallest_gap) == (2.0, 3.0, 0.0)
    with pytest.raises(KeyError):
        iterate.set(no=1.0)
    with pytest.raises(ArgumentError, match=r"measure.*must be a structure"):
        function("progress_measure")(np.zeros(3))


def test_scalars_of_a_prepared_call_can_be_set():
    call = function("point_multiplier_scale").bind(1000.0, 2)  # the mean, in hundreds
    assert call() == 5.0
    call.set("count", 1)
    assert call() == 10.0
    call.floats[call.position("total")] = 500.0
    assert call() == 5.0
    copied = function("gather_copy").bind(1, np.zeros(1), np.zeros(1))
    with pytest.raises(ArgumentError, match="bind again"):
        copied.set("values", 1.0)
