"""Calls shared between threads: every one is made once, phase by phase, and the numbers are those of one thread."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from stc.codegen import threads
from stc.core.calls import Bound, chain
from stc.core.functions import function
from stc.errors import UsageError

_place = function("gather_place")
_total = function("gather_total")
_copy = function("gather_copy")


@pytest.fixture
def two(monkeypatch):
    """Two threads whatever the environment says and the machine has."""
    monkeypatch.setattr(threads, "_processors", lambda: 2)
    monkeypatch.delenv("STC_THREADS", raising=False)
    threads.limit(2)
    yield
    threads.limit(None)


def _job(pieces: int, size: int, seed: int):
    rng = np.random.default_rng(seed)
    source, other = rng.standard_normal((2, pieces, size))
    into = np.zeros((pieces, size))
    sums, total, status = np.zeros(pieces), np.zeros(1), np.zeros((pieces, 1))
    places, one = np.arange(max(size, pieces), dtype=np.int32), np.ones(1)
    phases = [
        [_place.bind(size, source[k], other[k], into[k]) for k in range(pieces)],
        [_total.bind(size, places, one, into[k], sums[k : k + 1], status[k]) for k in range(pieces)],
        [_total.bind(pieces, places, one, sums, total, status[0])],
    ]
    return phases, into, total


@pytest.mark.parametrize("size", [1, 300, 20_000])
def test_same_bits_as_on_one_thread(two, size):
    pieces = 13
    shared, into, total = _job(pieces, size, 7)
    alone, expected_into, expected_total = _job(pieces, size, 7)
    call = threads.parallel(shared)
    reference = chain([part for phase in alone for part in phase])
    assert call.native
    for _ in range(60 if size > 1000 else 400):  # more calls than it is tried both ways
        call()
        reference()
        assert total[0] == expected_total[0]
    assert (into == expected_into).all()


def test_two_callers_at_once(two):
    """Only one of them is helped, both get their results."""
    jobs = [_job(8, 2000, seed) for seed in (1, 2)]
    calls = [threads.parallel(phases) for phases, _, _ in jobs]

    def repeat(call: Bound) -> None:
        for _ in range(300):
            call()

    callers = [threading.Thread(target=repeat, args=(call,)) for call in calls]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    for seed, (_, into, total) in zip((1, 2), jobs, strict=True):
        phases, expected, expected_total = _job(8, 2000, seed)
        repeat(chain([part for phase in phases for part in phase]))
        assert (into == expected).all()
        assert total[0] == expected_total[0]


def test_joins_a_chain_and_nests(two):
    phases, _, total = _job(4, 50, 3)
    first = np.zeros(1)
    inner = threads.parallel(phases)
    outer = threads.parallel([[inner], [_copy.bind(1, total, first)]])
    chained = chain([outer, _copy.bind(1, first, total)])
    assert chained.native
    for _ in range(20):
        chained()
        assert first[0] == total[0]


def test_one_thread_is_a_chain(two):
    phases, _, total = _job(4, 50, 3)
    threads.limit(1)
    call = threads.parallel(phases)
    call()
    assert call.native
    assert total[0] != 0.0
    python = threads.parallel([[Bound.of_python(list, ()), Bound.of_python(list, ())]])
    assert not python.native
    python()


def _offered() -> int:
    """How often the second thread has been asked."""
    return threads._helper().pool.offers


def test_a_limit_holds_for_calls_prepared_before(two):
    phases, into, _ = _job(6, 500, 5)
    reference, expected, _ = _job(6, 500, 5)
    known = threads.record()
    call, alone = threads.parallel(phases, known), chain([part for phase in reference for part in phase])
    for limit, asked in ((1, False), (2, True), (1, False), (None, True)):
        threads.limit(limit)
        known[:] = 10, 2**40, 1
        before = _offered()
        for _ in range(3):
            call()
            alone()
        assert (_offered() > before) == asked
    assert (into == expected).all()


def test_lists_of_the_same_work_share_what_they_learn(two):
    known = threads.record()
    first, second = (threads.parallel(_job(6, 500, seed)[0], known) for seed in (1, 2))
    before = _offered()
    first()
    assert list(known) == list(threads.record())  # memory was cold
    for _ in range(4):
        first()
    assert known[0] == 4 and min(known[1:3]) > 0
    assert before + 2 <= _offered() <= before + 4  # the first run, and all but one of the others at most
    for alone, helped, asked in ((1, 10**12, 0), (10**12, 1, 1)):
        other = threads.parallel(_job(6, 500, 3)[0], known)
        for call in (other, second):
            known[:3] = 10, alone, helped
            before = _offered()
            call()
            assert _offered() == before + asked


@pytest.mark.parametrize("pays", [False, True])
def test_now_and_then_it_is_tried_the_other_way(two, pays):
    known = threads.record()
    call = threads.parallel(_job(6, 50, 4)[0], known)
    call()
    tries = []
    for number in range(100):
        known[1:3] = (2**60, 1) if pays else (1, 2**60)
        before = _offered()
        call()
        if (_offered() > before) != pays:
            tries.append(number)
    assert len(tries) == 4 and len(set(np.diff(tries))) == 1


def test_a_better_way_is_taken(two):
    known = threads.record()
    call = threads.parallel(_job(6, 50, 4)[0], known)
    call()
    while (known[0] == 0) or known[2] <= known[1]:  # until a try alone takes far less than with help
        known[1:3] = 2**40, 2**40 - 1
        call()
    assert known[1] < 2**40 - 1
    before = _offered()
    call()
    assert _offered() == before


def test_how_many(monkeypatch):
    monkeypatch.setattr(threads, "_processors", lambda: 8)
    for text, count in (("", 2), ("1", 1), ("2", 2), ("16", 2)):
        monkeypatch.setenv("STC_THREADS", text)
        assert threads.allowed() == count
    monkeypatch.setattr(threads, "_processors", lambda: 1)
    assert threads.allowed() == 1
    for text in ("0", "-1", "two"):
        monkeypatch.setenv("STC_THREADS", text)
        with pytest.raises(UsageError, match="STC_THREADS"):
            threads.allowed()
    with pytest.raises(UsageError):
        threads.limit(0)


SCRIPT = """
import os, sys, numpy as np
from stc.codegen import threads
threads._processors = lambda: 2
from stc.core.functions import function
add = function("gather_fold")  # the last number of a row to each of the others
x = np.zeros((6, 1001))
x[:, -1] = 1.0
last, each = np.full(1000, 1000, dtype=np.int32), np.arange(1000, dtype=np.int32)
call = threads.parallel([[add.bind(1000, last, each, row) for row in x]])
for _ in range(50):
    call()
child = os.fork() if hasattr(os, "fork") else 0
for _ in range(50):
    call()
assert (x[:, :-1] == 100.0).all()
if child:
    assert os.waitpid(child, 0)[1] == 0
print("done" if child else "child")
"""


def test_child_processes_and_the_end_of_the_program():
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, "STC_THREADS": "2"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert sorted(run.stdout.split()) in (["child", "done"], ["child"])
