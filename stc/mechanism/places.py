"""In which file and on which line the elements of a model stand, also of models that include others.

MuJoCo remembers the line of each element, but not whether that is a line of the file itself or of an included one.
So the files are looked through once: which of them has such an element on such a line.
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

    def of(self, info: str, kind: str, name: str) -> Place | None:
        """The place of an element from what MuJoCo remembers of it (``line 12``)."""
        found = re.search(r"line (\d+)", info or "")
        tags = _TAGS.get(kind, {kind})
        if found is None:
            known = [each for each in self._elements if each.tag in tags and name and each.name == name]
            return Place(known[0].file, known[0].line) if known else None
        line = int(found.group(1))
        here = [each for each in self._elements if each.line == line and each.tag in tags]
        here = [each for each in here if each.name == name] or here
        return Place(here[0].file, line) if here else None

    def first(self, tag: str) -> Place | None:
        """The place of the last element with a tag: of several, MuJoCo lets the last one count."""
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
