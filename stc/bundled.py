"""Find the file of a spec from a name given by the user: a path, or the name of a bundled spec."""

from __future__ import annotations

import os
from pathlib import Path

from stc import specs
from stc.errors import Source, UsageError

SUFFIX = ".stc"
SOLUTION_SUFFIXES = (".npz", ".csv")


def is_solution(name: str | os.PathLike[str]) -> bool:
    """Whether a file name is that of a solution (and not of a spec)."""
    return Path(name).suffix.lower() in SOLUTION_SUFFIXES


def find_spec(name: str | os.PathLike[str]) -> Path:
    """The file of a spec: an existing path (``.stc`` may be left out), else a bundled spec's name.

    Raises:
        UsageError: neither exists; the hint suggests the closest file or bundled name.
    """
    if not str(name).strip():
        raise UsageError("the spec is empty: no path, no name, no text", "`stc list` names the bundled specs")
    path = Path(name)
    candidates = (path, path.with_name(path.name + SUFFIX)) if path.name else ()
    for candidate in candidates:
        if candidate.is_file() or candidate.is_fifo():  # `stc solve <(make_spec)`
            return candidate
    plain = len(path.parts) == 1
    bundled = specs.locate(str(name)) if plain else None
    if bundled is not None:
        return bundled
    if path.is_dir():
        raise UsageError(f"`{name}` is a folder, not a spec")
    if path.suffix not in ("", SUFFIX):
        raise UsageError(f"there is no file `{name}`")
    hint = (
        f"did you mean `{near}`?" if (near := _nearest(path, plain)) else "`stc list` names the bundled specs"
    )
    where = "neither a file nor among the bundled ones" if plain else "no such file"
    raise UsageError(f"there is no spec `{name}`: {where}", hint)


def with_text(source: Source) -> Source:
    """The source, if it contains anything but blanks.

    Raises:
        UsageError: it does not.
    """
    if not source.text.strip():
        what = source.name if source.path else "the text of the spec"
        raise UsageError(f"{what} is empty", "a spec has sections: `constants: n = 60; variables: x; ...`")
    return source


def _nearest(path: Path, plain: bool) -> str | None:
    """The file beside ``path``, or for a plain name the bundled spec, with the most similar name."""
    from difflib import get_close_matches

    beside = [file.stem for file in path.parent.glob("*" + SUFFIX)] if path.parent.is_dir() else []
    bundled = specs.names() if plain else []
    near = get_close_matches(path.name.removesuffix(SUFFIX), [*bundled, *beside], n=1, cutoff=0.65)
    if not near:
        return None
    return near[0] if near[0] in bundled else str(path.with_name(near[0] + SUFFIX))
