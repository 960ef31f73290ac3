"""The file and line of each element of a model, also in included files.

MuJoCo records the lines of elements of the main file.  For included files, and for free joints written
``<freejoint/>``, the element is searched by its name, or else by the element that it belongs to.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.parsers import expat

from stc.mechanism.mechanism import Place
from stc.records import dataclass

#: Elements that make a thing of a kind, where they are not called like the kind.
_TAGS = {
    "body": {"worldbody", "body", "link", "composite", "flexcomp", "replicate", "attach", "frame"},
    "joint": {"joint", "freejoint"},
    "actuator": {
        "general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion",
        "plugin", "dcmotor", "pid", "orientation",
    },
    "tendon": {"fixed", "spatial"},
    "equality": {"connect", "weld", "joint", "tendon", "flex", "flexvert", "flexstrain", "distance"},
    "geom": {"geom", "collision", "visual"},
    "flex": {"flex", "flexcomp", "composite"},
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Element:
    tag: str
    name: str
    file: str
    line: int


class Places:
    """The elements of a model file and of those that it includes."""

    def __init__(self, name: str, text: str) -> None:
        self._elements: list[_Element] = []
        self._seen: set[Path] = set()
        self._look_through(name, text, Path(name).parent)

    def of(self, info: str, kind: str, name: str, owner: Place | None = None) -> Place | None:
        """The place of an element.

        Args:
            info: MuJoCo's record of it, such as ``line 12``.
            kind: ``body``, ``joint``, ...
            name: its name, possibly empty.
            owner: the place of the body that it belongs to, used if its own is not known.
        """
        tags = _TAGS.get(kind, {kind})
        found = re.search(r"line (\d+)", info or "")
        line = int(found.group(1)) if found is not None else 0
        if line:
            here = [each for each in self._elements if each.line == line and each.tag in tags]
        else:
            here = [each for each in self._elements if name and each.name == name and each.tag in tags]
        here = [each for each in here if each.name == name] or here
        return Place(here[0].file, here[0].line) if here else owner

    def first(self, tag: str) -> Place | None:
        """The place of the last element with a tag, which is the valid one in MuJoCo."""
        known = [each for each in self._elements if each.tag == tag]
        return Place(known[-1].file, known[-1].line) if known else None

    def _look_through(self, name: str, text: str, folder: Path) -> None:
        parser = expat.ParserCreate()

        def start(tag: str, attributes: dict[str, str]) -> None:
            line = parser.CurrentLineNumber
            self._elements.append(_Element(tag, attributes.get("name", ""), name, line))
            if tag == "include" and "file" in attributes:
                self._include(folder / attributes["file"], folder)

        parser.StartElementHandler = start
        try:
            parser.Parse(text.encode(), True)
        except expat.ExpatError:
            return  # MuJoCo's reader forgives more; the lines found so far stay

    def _include(self, path: Path, folder: Path) -> None:
        if path in self._seen:
            return
        self._seen.add(path)
        try:
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return
        self._look_through(str(path), text, folder)
