"""Scripts run in processes of their own, with each instruction set that the processor has."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
from core.instruction_sets import INSTRUCTIONS

from stc.core.library import instructions

__all__ = ["assert_alike_with_all_instructions"]

_BEGIN = """
import sys
from stc.core import library
library.instructions = lambda: sys.argv[2]
"""


def assert_alike_with_all_instructions(script: str, count: int) -> None:
    """What a script prints is so many numbers, the same for each; its first argument is the folder of the tests."""
    kinds = INSTRUCTIONS[: INSTRUCTIONS.index(instructions()) + 1]
    printed = [
        subprocess.run(
            [sys.executable, "-c", _BEGIN + script, str(Path(__file__).parents[2]), kind],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for kind in kinds
    ]
    found = [np.array([float(word) for word in words]) for words in printed]
    for one in found:
        assert one.size == count
        np.testing.assert_allclose(one, found[0], rtol=1e-5, atol=1e-7 * np.abs(found[0]).max())
