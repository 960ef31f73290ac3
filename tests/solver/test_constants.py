"""The table of numbers says what the code says."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "docs" / "solver_constants.md"
ROWS = re.findall(
    r"^\| `(\w+)\.py` \| `(\w+)` \| `(.+?)` \| (.+?) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
)


def test_there_is_a_table() -> None:
    assert ROWS
    assert all(source for *_, source in ROWS)


@pytest.mark.parametrize(("module", "name", "value"), [row[:3] for row in ROWS])
def test_numbers_are_those_of_the_code(module: str, name: str, value: str) -> None:
    found = getattr(import_module(f"stc.solver.{module}"), name)
    np.testing.assert_array_equal(found, eval(value, {"np": np}))
