"""The table of numbers says what the code says."""

from __future__ import annotations

import ast
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


#: What is no such number: places in arrays, kinds of ends, guards against overflow, sizes that only time depends on.
OTHERS = {
    "active_set_system": {"AGAINST_DEPENDENT_ROWS"},
    "barrier_update": {"CALL_MISSING", "DOUBTFUL_SOLUTION"},
    "elastic_kernels": {"ELIMINATE", "ATTEMPT", "CALLS"},
    "filter": {"COUNT", "LARGEST", "FIRST", "ROOM"},
    "filter_line_search": {
        *(
            "SMALLEST_POWER",
            "TAKEN",
            "NOT_TAKEN",
            "CALL_MISSING",
            "NOT_FINITE",
            "REFUSED",
            "DESCENT",
            "OUTSIDE",
        )
    },
    "form_cache": {"LARGEST"},
    "inertia_correction": {
        *(
            "TRY",
            "LOOK",
            "GROW",
            "DAMP",
            "DAMP_OR_GROW",
            "DONE",
            "REFACTOR",
            "CALL_MISSING",
            "NO_SHIFT",
            "UNKNOWN",
        )
    },
    "interior": {"SMALL"},
    "iteration_calls": {"LOOK", "FACTORIZATION", "STEP_FOUND", "SEARCH", "BLOCKED"},
    "kernels": {"UNDERFLOW", "OVERFLOW"},
    "options": {"SMALLEST_TOLERANCE"},
    "products": {"EPSILON"},
    "progress_kernels": {"LARGEST_ERROR"},
    "projection_kernels": {"EVALUATE", "REMAINING", "ADVANCE", "SOLVE", "CALLS"},
    "state": {
        "ROW_OBJECTIVE",
        "ROW_VIOLATION",
        "ROW_ERROR",
        "ROW_STEP",
        "ROW_LENGTH",
        "ROW_MU",
        "ROW_SHIFT",
        "ROW",
    },
    "step_kernels": {"BLOCK"},
    "workspace": {"LONGEST_RUN"},
}


def _numbers(text: str) -> set[str]:
    """Names in capitals of a module's numbers, but for places, annotated as final, and what follows from others."""
    found = set()
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign):
            continue
        for target in node.targets:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=True))
            for name, value in pairs:
                parts = list(ast.walk(value))
                numeric = any(isinstance(p, ast.Constant) and isinstance(p.value, int | float) for p in parts)
                textual = any(isinstance(p, ast.Constant) and isinstance(p.value, str) for p in parts)
                derived = any(isinstance(p, ast.Name) and p.id.isupper() for p in parts)
                if isinstance(name, ast.Name) and name.id.isupper() and numeric and not (textual or derived):
                    found.add(name.id)
    return found


def test_the_code_has_no_other_numbers() -> None:
    listed = {(module, name) for module, name, *_ in ROWS}
    for path in sorted((PAGE.parents[1] / "stc" / "solver").glob("*.py")):
        own = {name for module, name in listed if module == path.stem}
        assert _numbers(path.read_text(encoding="utf-8")) - OTHERS.get(path.stem, set()) <= own, path.name
