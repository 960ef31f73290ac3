"""Compiled functions that make prepared calls by number."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.backends import printed_by

from stc.codegen.native import NativeError, f64s, i64, i64s, native, native_source
from stc.core.calls import Bound, CallTable, invoke


@native
def double(s: f64s) -> i64:
    """Doubles the first number; whether it is large then."""
    s[0] = 2.0 * s[0]
    return 1 if s[0] > 10.0 else 0


@native(shared=True)
def until_large(calls: i64s, most: i64, s: f64s) -> i64:
    """How many calls it took."""
    for k in range(most):
        before = s[0]
        if calls[0] == 0:
            return -1
        large = invoke(calls, 0)
        s[1] += s[0] - before  # what the call wrote is seen
        if large != 0:
            return k + 1
    return 0


def test_calls_are_made_and_what_they_write_is_seen():
    table, s = CallTable(1), np.array([1.0, 0.0])
    table.put(0, double.bind(s))
    assert until_large(table.cells, 10, s) == 4
    assert s.tolist() == [16.0, 15.0]


def test_without_a_call_there_is_none():
    table, s = CallTable(1), np.ones(2)
    assert until_large(table.cells, 10, s) == -1
    table.put(0, double.bind(s))
    table.put(0, None)
    assert until_large(table.cells, 10, s) == -1
    assert s.tolist() == [1.0, 1.0]


def test_python_functions_may_be_called():
    table, s = CallTable(1), np.array([1.0, 0.0])

    def add() -> int:
        s[0] += 5.0
        return int(s[0] > 10.0)

    table.put(0, Bound.of_python(add, ()))
    assert until_large(table.cells, 10, s) == 2
    table.check()
    table.put(0, Bound.of_python(lambda: None, ()))  # nothing counts as 0
    assert until_large(table.cells, 10, s) == 0


@pytest.mark.parametrize("raised", [ValueError("no"), KeyboardInterrupt()])
def test_what_python_raises_is_raised_afterwards(raised):
    table, s = CallTable(1), np.array([1.0, 0.0])
    made = []

    def fail() -> int:
        made.append(1)
        raise raised

    table.put(0, Bound.of_python(fail, ()))
    assert until_large(table.cells, 10, s) == 0
    assert len(made) == 1  # later ones are not made
    assert table.cells[-1] == 1
    with pytest.raises(type(raised)):
        table.check()
    assert table.cells[-1] == 0
    table.check()
    until_large(table.cells, 10, s)
    table.forget()
    table.check()


def test_a_table_is_needed():
    text = "from stc.codegen.native import *\nfrom stc.core.calls import invoke\n"
    text += "@native\ndef wrong(s: f64s) -> i64:\n    return invoke(s, 0)\n"
    with pytest.raises(NativeError, match="cells of a table"):
        native_source(text, "wrong table")["wrong"](np.zeros(1))


def test_the_same_without_machine_code():
    script = """
import sys
sys.path.insert(0, sys.argv[1])
from codegen import test_calls
test_calls.test_calls_are_made_and_what_they_write_is_seen()
test_calls.test_without_a_call_there_is_none()
test_calls.test_python_functions_may_be_called()
print(test_calls.until_large.is_compiled)
"""
    assert printed_by(script, "python") == ["False"]
    assert printed_by(script, "llvm") == ["True"]
