"""The table of numbers says what the code says."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "solver_constants.md"
CORE = ROOT / "stc" / "core" / "iteration"
ROWS = re.findall(
    r"^\| `(\w+)\.(py|c|h)` \| `(\w+)` \| `(.+?)` \| (.+?) \|$",
    PAGE.read_text(encoding="utf-8"),
    re.MULTILINE,
)
DEFINED = re.compile(r"^#define (\w+) \(?(-?[0-9][\w.+-]*)\)?(?= |$)", re.MULTILINE)
ENUMERATED = re.compile(r"^ +(\w+) = (-?[0-9]+),", re.MULTILINE)


def _defined(path: Path) -> dict[str, float]:
    """The numbers that a file in C gives names to, those in hexadecimal included."""
    text = path.read_text(encoding="utf-8")
    return {
        name: float.fromhex(value) if "0x" in value else float(value)
        for pattern in (DEFINED, ENUMERATED)
        for name, value in pattern.findall(text)
    }


def test_there_is_a_table() -> None:
    assert ROWS
    assert all(source for *_, source in ROWS)


@pytest.mark.parametrize(("module", "kind", "name", "value"), [row[:4] for row in ROWS])
def test_numbers_are_those_of_the_code(module: str, kind: str, name: str, value: str) -> None:
    if kind == "py":
        found = getattr(import_module(f"stc.solver.{module}"), name)
    else:
        found = _defined(CORE / f"{module}.{kind}")[name]
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


#: The same of the core.
OTHERS_OF_THE_CORE = {
    "conditions": {"NONE"},
    "inertia_correction": {"TRY", "DAMP", "INERTIA_CORRECTION_LOOK", "DAMP_OR_GROW", "GROW", "UNKNOWN"},
    "kernels": {"UNDERFLOW", "OVERFLOW"},
    "line_search": {"SMALLEST_POWER", "EPSILON"},
    "progress": {"LARGEST_ERROR"},
    "state": {"LOW"},  # minus TOO_FAR
}


def test_the_code_has_no_other_numbers() -> None:
    listed = {(module, name) for module, kind, name, *_ in ROWS if kind == "py"}
    for path in sorted((ROOT / "stc" / "solver").glob("*.py")):
        own = {name for module, name in listed if module == path.stem}
        assert _numbers(path.read_text(encoding="utf-8")) - OTHERS.get(path.stem, set()) <= own, path.name


def test_the_core_has_no_other_numbers() -> None:
    """A number that Python knows as well is listed with its module there."""
    listed = {name for *_, name, _, _ in ROWS}
    for path in sorted(CORE.glob("*.[ch]")):
        names = {name for name, _ in DEFINED.findall(path.read_text(encoding="utf-8"))}
        unknown = {
            name
            for name in names - OTHERS_OF_THE_CORE.get(path.stem, set())
            if not any(name == one or name.endswith(f"_{one}") for one in listed)
        }
        assert not unknown, path.name
