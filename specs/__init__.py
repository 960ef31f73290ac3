"""Specs that ship with stc: ``stc list`` names them, ``stc solve NAME`` solves one."""

from __future__ import annotations

from pathlib import Path

_HERE = Path(__file__).resolve().parent


def names() -> list[str]:
    """Names of the bundled specs, sorted: file names without ``.stc``."""
    return sorted(path.stem for path in _HERE.glob("*.stc"))


def locate(name: str) -> Path | None:
    """The path of a bundled spec, or None: ``locate("particle_jet")``; the ending may be there or not."""
    stem = name.removesuffix(".stc")
    return _HERE / f"{stem}.stc" if stem in names() else None


def title(name: str) -> str:
    """The first sentence of a bundled spec's opening comment: one line for a list, without a final dot.

    Raises:
        KeyError: there is no such spec.
    """
    path = locate(name)
    if path is None:
        raise KeyError(name)
    words: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        words.append(line.lstrip("# ").strip())
    return " ".join(words).split(". ")[0].rstrip(".")
