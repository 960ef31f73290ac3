"""The table of numbers says what the code says."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

from stc.solver import constants

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "solver_constants.md"
CORE = ROOT / "stc" / "core" / "iteration"
ROWS = re.findall(
    r"^\| `(\w+)\.(py|c|h)` \| `(\w+)` \| `(.+?)` \| (.+?) \|$",
    PAGE.read_text(encoding="utf-8"),
    re.MULTILINE,
)
DEFINED = re.compile(r"^#define (\w+) \(?(-?[0-9][\w.+-]*)\)?(?= |$)", re.MULTILINE)
ENUMERATED = re.compile(r"(?<=[ {])([A-Z_]+) = (-?[0-9]+)(?=[,; ])")


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
        assert getattr(import_module(f"stc.solver.{module}"), name) == eval(value)
    elif value.startswith("{"):
        text = (CORE / f"{module}.{kind}").read_text(encoding="utf-8")
        listed = re.search(rf"double {name}\[\w+\] = \{{([^}}]*)\}}", text)
        assert listed is not None
        assert [float(v) for v in listed[1].split(",")] == [float(v) for v in value[1:-1].split(",")]
    else:
        assert _defined(CORE / f"{module}.{kind}")[name] == float(value)


SHARED = {
    name: float(value)
    for name, value in vars(constants).items()
    if name.isupper() and isinstance(value, int | float)
}


@pytest.mark.parametrize("path", sorted(CORE.glob("*.[ch]")), ids=lambda path: path.name)
def test_numbers_that_python_and_the_core_share_are_the_same(path: Path) -> None:
    for name, value in _defined(path).items():
        if name in SHARED:
            assert value == SHARED[name], name


#: What is no such number: places in arrays, kinds of ends, guards against overflow, sizes that only time depends on.
OTHERS = {
    "form_cache": {"LARGEST"},
    "interior": {"SMALL"},
    "options": {"SMALLEST_TOLERANCE"},
    "products": {"EPSILON"},
    "projection": {"AGAINST_DEPENDENT_ROWS"},
    "workspace": {"LONGEST_RUN", "ROOM"},
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
    "conditions": {"NO_BOUND"},
    "iteration": {"EPSILON"},
    "line_search": {"SMALLEST_POWER"},
    "points": {"SMALLEST_PRODUCT", "LARGEST_PRODUCT"},
    "progress": {"LARGEST_ERROR", "LOW"},  # the latter is minus TOO_FAR
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
