"""Kernels compiled in several modules, side by side or one after the other: the same code, the same numbers."""

from __future__ import annotations

import os

import numpy as np
import pytest

from stc.codegen import compiling, engine, kernel, reference, threads
from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import RUN
from stc.codegen.tape import build_tape
from stc.symbolic.expr import call, sym

MODULES = [
    f"define double @f{k}(double %x) {{\n" + f"  %y = fmul double %x, {k}.5\n  ret double %y\n}}"
    for k in range(4)
]


@pytest.fixture
def processors(monkeypatch):
    """Two, and the choice of threads left as it was."""
    monkeypatch.setattr(threads, "_processors", lambda: 2)
    monkeypatch.setattr(threads, "_running", lambda: 1)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    yield
    threads.limit(None)


def tape_of(terms: int, seed: int):
    rng = np.random.default_rng(seed)
    x, y = sym("x"), sym("y")
    total = x
    for k, factor in enumerate(rng.uniform(0.5, 1.5, terms)):
        total = total * float(factor) + (call("sin", y * float(k + 1)) if k % 7 == 0 else y)
    return build_tape([total, x * y], [], ["x", "y"])


def test_same_code_on_one_thread_and_two(processors):
    texts = [lambda text=text: text for text in MODULES]
    codes = []
    for count in (1, 2):
        threads.limit(count)
        codes.append(compiling.compile_modules(texts, 1))
    assert codes[0] == codes[1]
    assert codes[0] == [engine.compile_ir(text, level=1, optimise=False) for text in MODULES]


@pytest.mark.parametrize(("running", "begun"), [(1, 3), (2, 0)])
def test_a_second_thread_needs_a_processor_of_its_own(processors, monkeypatch, running, begun):
    threads.limit(2)
    monkeypatch.setattr(threads, "_running", lambda: running)
    started = []

    class Counted(compiling._Task):
        def start(self) -> None:
            started.append(self)
            super().start()

    monkeypatch.setattr(compiling, "_Task", Counted)
    codes = compiling.compile_modules([lambda text=text: text for text in MODULES], 1)
    assert len(started) == begun
    assert codes == [engine.compile_ir(text, level=1, optimise=False) for text in MODULES]


def test_without_a_way_past_the_lock(processors, monkeypatch):
    monkeypatch.setattr(compiling, "_unlocked_emission", lambda: None)
    threads.limit(2)
    codes = compiling.compile_modules([lambda text=text: text for text in MODULES], 1)
    assert codes == [engine.compile_ir(text, level=1, optimise=False) for text in MODULES]


@pytest.mark.parametrize("wrong", [0, 3])
def test_malformed_modules_are_reported(processors, wrong):
    threads.limit(2)
    texts = list(MODULES)
    texts[wrong] = "define nonsense"
    with pytest.raises(RuntimeError):
        compiling.compile_modules([lambda text=text: text for text in texts], 1)


def test_parts_hold_every_tape_once():
    tapes = [tape_of(terms, k) for k, terms in enumerate((400, 30, 300, 200, 500, 10))]
    found = kernel.parts(tapes)
    assert len(found) == 2
    assert sorted(found[0] + found[1]) == list(range(len(tapes)))
    loads = [sum(len(tapes[k].ops) for k in part) for part in found]
    assert loads[0] >= loads[1] >= 0.3 * sum(loads)
    assert kernel.parts(tapes[:2]) == [[0, 1]]  # short
    assert kernel.parts([tape_of(1500, 0), tapes[5]]) == [[0, 1]]  # nothing to balance with


@pytest.mark.parametrize("count", [1, 2])
def test_divided_kernels_compute_what_tapes_say(processors, count):
    threads.limit(count)
    tapes = [tape_of(terms, k) for k, terms in enumerate((400, 30, 300, 200, 500, 10))]
    kernels = compile_tapes(tapes, backend="llvm", cache=False)
    again = compile_tapes(tapes, backend="llvm", cache=True)
    found = compile_tapes(tapes, backend="llvm", cache=True)
    assert not kernels.cached and found.cached
    rng = np.random.default_rng(5)
    workspace = rng.uniform(-1.0, 1.0, 40 + RUN - 1)
    index = rng.integers(0, 40, (3, 2, LANES)).astype(np.int32)
    for k, tape in enumerate(tapes):
        expected = reference.run(tape, np.zeros(0), workspace[index].transpose(1, 0, 2).reshape(2, -1))
        for each in (kernels, again, found):
            out = np.zeros((3, len(tape.outputs), LANES))
            each[k](workspace, np.zeros(1), index, out)
            np.testing.assert_allclose(
                out.transpose(1, 0, 2).reshape(len(tape.outputs), -1), expected, rtol=1e-11, atol=1e-12
            )
