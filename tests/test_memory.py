"""Pausing the collector leaves it as it was."""

from __future__ import annotations

import gc

import pytest

from stc.memory import without_collection


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
