"""Pausing the collector leaves it as it was; what becomes of memory that is freed."""

from __future__ import annotations

import gc
import subprocess
import sys

import pytest

from stc.memory import without_collection

FAULTS = """
import resource
import sys
import numpy as np
from stc.memory import keep_freed_memory

if sys.argv[1] == "kept":
    keep_freed_memory()
def use():
    arrays = [np.ones(2**18) for _ in range(16)]  # 2 MB each: smaller ones than the system has large pages for
    return len(arrays)
for _ in range(3):
    use()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    use()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_it_is_off_inside_and_as_before_after() -> None:
    assert gc.isenabled()
    with without_collection():
        assert not gc.isenabled()
        with without_collection():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()


def test_a_failure_turns_it_on_again() -> None:
    with pytest.raises(RuntimeError), without_collection():
        raise RuntimeError
    assert gc.isenabled()


def faults(how: str) -> int:
    """Pages that the system had to provide while arrays came and went, 8192 of them in use at a time."""
    run = subprocess.run([sys.executable, "-c", FAULTS, how], capture_output=True, text=True, check=True)
    return int(run.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="asks the GNU C library")
def test_kept_memory_is_used_again() -> None:
    given_back = faults("given back")
    if given_back < 8192:
        pytest.skip("this C library keeps it anyway")
    assert faults("kept") < given_back / 10
