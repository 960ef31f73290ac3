"""The specs and models that ship inside the package, and how a user's name for a spec finds its file."""

from __future__ import annotations

import os
from pathlib import Path

from stc.errors import UsageError

SUFFIX = ".stc"


def specs_folder() -> Path:
    """The folder of the bundled specs."""
    import stc.specs

    return Path(stc.specs.__path__[0])


def models_folder() -> Path:
    """The folder of the bundled MuJoCo models."""
    import stc.models

    return Path(stc.models.__path__[0])


def spec_paths() -> dict[str, Path]:
    """Every bundled spec's file by name, in alphabetical order."""
    return {path.stem: path for path in sorted(specs_folder().rglob("*" + SUFFIX))}


def summary(path: Path) -> str:
    """What a spec says about itself: its first comment line without the ``#``, or an empty text."""
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            text = line.strip()
            if text.startswith("#"):
                return text.lstrip("#").strip()
            if text:
                break
    return ""


def find_spec(name: str | os.PathLike[str]) -> Path:
    """The file that a user means: an existing path (``.stc`` may be left out), else a bundled spec's name.

    Raises:
        UsageError: neither exists; the hint offers the nearest file or bundled name.
    """
    path = Path(name)
    for candidate in (path, path.with_name(path.name + SUFFIX)) if path.name else ():
        if candidate.is_file():
            return candidate
    if path.is_dir():
        raise UsageError(f"{path} is a folder, not a spec")
    bundled = spec_paths()
    wanted = path.name.removesuffix(SUFFIX)
    is_plain_name = len(path.parts) == 1
    if is_plain_name and wanted in bundled:
        return bundled[wanted]
    if path.suffix not in ("", SUFFIX):
        raise UsageError(f"there is no file {path}")

    from difflib import get_close_matches

    if is_plain_name:
        neighbours = [file.name for file in Path().glob("*" + SUFFIX)]
        near = get_close_matches(
            wanted, [*bundled, *(n.removesuffix(SUFFIX) for n in neighbours)], n=1, cutoff=0.5
        )
        near = [n if n in bundled else n + SUFFIX for n in near]
        message = f"there is no spec `{name}`, neither a file nor among the bundled ones"
    else:
        neighbours = [file.name for file in path.parent.glob("*" + SUFFIX)] if path.parent.is_dir() else []
        near = [str(path.parent / n) for n in get_close_matches(path.name, neighbours, n=1, cutoff=0.5)]
        message = f"there is no file {path}"
    hint = f"did you mean `{near[0]}`?" if near else "`stc list` names the bundled specs"
    raise UsageError(message, hint)
