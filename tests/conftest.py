"""What every test shares: examples that repeat, and what a test needs of the machine.

Property tests draw the same examples on every run, without a deadline.  A test that cannot run without something
that a bare machine lacks says so, as in ``@pytest.mark.needs("opengl")``, and is skipped there with the reason.
Matrix products run on one thread: the threads of several test processes would wait for one another, busily.
"""

from __future__ import annotations

import ctypes
import functools
import gc
import os
import sys
from collections import Counter

import pytest
from hypothesis import settings

os.environ.setdefault(
    "OPENBLAS_NUM_THREADS", "1"
)  # read when NumPy is imported, here and in programs that tests start
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None, max_examples=50)
settings.load_profile("repeatable")


def _loads(*libraries: str) -> bool:
    """Whether one of these libraries can be loaded."""
    for library in libraries:
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return True
    return False


def _without_opengl() -> str:
    """Why nothing can be rendered, by the libraries alone.

    Whether they render is not asked, nor is the program: where the libraries are there and nothing is rendered, tests
    fail.
    """
    if not sys.platform.startswith("linux"):  # elsewhere OpenGL comes with the system
        return ""
    if _loads("libEGL.so.1") and _loads("libOpenGL.so.0", "libGL.so.1"):
        return ""
    if _loads("libOSMesa.so.8", "libOSMesa.so.6"):
        return ""
    return "there is no OpenGL (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri libopengl0)"


def _without_terminal() -> str:
    """Why no pseudo-terminal can be had."""
    try:
        for end in os.openpty():
            os.close(end)
    except OSError as error:
        return f"there is no terminal device, as where /dev/pts is not mounted ({error.strerror})"
    return ""


@functools.cache
def _lacking(need: str) -> str:
    return {"opengl": _without_opengl, "terminal": _without_terminal}[need]()


@pytest.hookimpl(tryfirst=True)  # before those with marks that are not asked for are left out
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of the cases of some tests only every n-th is run daily.

    The files with most slow tests come first, so that no processor is left with one of them at the end.
    """
    cases: Counter[str] = Counter()
    for item in items:
        if mark := item.get_closest_marker("daily_every"):
            test = item.nodeid.partition("[")[0]
            if cases[test] % mark.args[0]:
                item.add_marker(pytest.mark.nightly)
            cases[test] += 1
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -slow[item.path])  # stable


def pytest_collection_finish() -> None:
    """Searches for unreachable cycles leave out the thousands of tests, which stay to the end."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)  # before the test's fixtures are made
def pytest_runtest_setup(item: pytest.Item) -> None:
    for mark in item.iter_markers("needs"):
        for need in mark.args:
            if reason := _lacking(need):
                pytest.skip(reason)
