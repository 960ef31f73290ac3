"""MuJoCo models that ship with stc, and the programs that build them."""

from __future__ import annotations

from pathlib import Path

_HERE = Path(__file__).resolve().parent


def names() -> list[str]:
    """File names of the bundled models, sorted, with ``/`` between folders: ``["particle.xml", ...]``."""
    return sorted(path.relative_to(_HERE).as_posix() for path in _HERE.rglob("*.xml"))


def locate(name: str) -> Path | None:
    """The path of a bundled model, or None: ``locate("particle.xml")``; the ending may be left out."""
    for candidate in (name, f"{name}.xml"):
        if candidate in names():
            return _HERE / candidate
    return None
