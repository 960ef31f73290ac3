"""Constants that C and Python both have are the same: headers and sources give them by names that end alike."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from types import ModuleType

import stc.solver.kkt
from stc.core import compiling

_ENUM = re.compile(r"enum \{(.*?)\};", re.DOTALL)
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_ENTRY = re.compile(r"\b([A-Z][A-Z0-9_]*) = ([^,]+)")
_DEFINED = re.compile(r"^#define ([A-Z][A-Z0-9_]*) (\S.*)$", re.MULTILINE)


def stated(folder: str) -> dict[str, dict[str, float]]:
    """Of each file, without its suffix, its constants; what is no number, or made of other files', is left out."""
    found: dict[str, dict[str, float]] = {}
    for path in sorted((compiling.FOLDER / folder).glob("*.[ch]")):
        names = found.setdefault(path.stem, {})
        text = _COMMENT.sub("", path.read_text())
        entries = [entry for part in _ENUM.findall(text) for entry in _ENTRY.findall(part)]
        for name, value in [*entries, *_DEFINED.findall(text)]:
            try:
                made = float.fromhex(value) if "0x" in value else eval(value, {}, dict(names))
            except (NameError, SyntaxError, ValueError, TypeError):
                continue
            if isinstance(made, int | float):
                names[name] = made
    return found


def modules() -> Iterator[str]:
    for module in pkgutil.walk_packages(stc.solver.kkt.__path__, "stc.solver.kkt."):
        yield module.name


#: Of the modules whose functions are in a file of another name.
FILES = {
    "couplings": "arranging",
    "levels": "arranging",
    "segments": "arranging",
    "multifrontal": "kkt",
    "contract": "kkt",
}


def test_constants_agree() -> None:
    """Those of the iteration: see ``tests/solver/test_constants.py``."""
    compared = 0
    files = stated("")
    for name in modules():
        stem = name.rpartition(".")[2]
        file = FILES.get(stem, stem)
        module = importlib.import_module(name)
        for constant, value in files.get(file, {}).items():
            short = constant.removeprefix(f"{file.upper()}_")
            given = vars(module).get(short, vars(module).get(f"_{short}"))
            if isinstance(given, int | float) and not isinstance(given, bool) and _is_own(module, short):
                assert given == value, f"{short} of {name} and {constant} in {file}"
                compared += 1
    assert compared >= 8


def _is_own(module: ModuleType, name: str) -> bool:
    """Whether a module assigns a name itself, and does not import it."""
    return (
        re.search(rf"^(?:[^#\n]*, )?_?{name}\b[^\n=]*=[^=]", inspect.getsource(module), re.MULTILINE)
        is not None
    )
