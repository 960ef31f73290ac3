"""Limits of time."""

from __future__ import annotations

import time

import pytest

from stc.deadline import look, using
from stc.errors import EndedError


def test_processor_time_is_limited_inside_a_context() -> None:
    """What waits uses none; the limit ends with the context, and an outer one holds inside."""
    with using(0.05):
        time.sleep(0.1)
        look()
        with using(1000.0), pytest.raises(EndedError):
            _look_on()
    look()


def _look_on() -> None:
    while True:
        look()
