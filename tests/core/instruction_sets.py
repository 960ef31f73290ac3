"""The instruction sets that this processor has, each of which has a library of its own."""

from __future__ import annotations

import pytest

from stc.core import compiling
from stc.core.library import instructions

__all__ = ["INSTRUCTIONS", "need"]

INSTRUCTIONS = compiling.instructions()


def need(kind: str) -> None:
    """Skip the test where the processor lacks the instruction set."""
    if INSTRUCTIONS.index(kind) > INSTRUCTIONS.index(instructions()):
        pytest.skip(f"this processor has no {kind}")
