"""The file and line of each element of a model, also in included files.

MuJoCo records the lines of elements of the main file and of attached models.  For included files, and for free joints
written ``<freejoint/>``, the element is searched by its name, or else by its number in its section or by the element
that it belongs to.
"""

from __future__ import annotations

import re
from collections.abc import Collection
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

#: Kinds whose elements stand in a section of that name, in the model's order.
_SECTIONS = {"actuator", "tendon", "equality"}


@dataclass(frozen=True, slots=True)
class _Element:
    tag: str
    parent: str
    name: str
    file: str
    line: int


class Places:
    """The elements of a model file, of those that it includes, and of models whose parts it attaches.

    Parameters
    ----------
    name, text
        Of the model file.
    """

    def __init__(self, name: str, text: str) -> None:
        self._name = name
        self._elements: list[_Element] = []
        self._seen: set[Path] = set()
        self._attached: set[str] = set()
        self._met: dict[str, int] = {}
        self._look_through(name, text, Path(name).parent, "")

    def of(self, info: str, kind: str, name: str, owner: Place | None = None) -> Place | None:
        """The place of an element.

        Elements of a kind are to be asked for in the model's order, so that those of included files that have no name
        are found as well: MuJoCo keeps no lines of these.

        Parameters
        ----------
        info
            MuJoCo's record of it, such as ``line 12``.
        kind
            ``body``, ``joint``, ...
        name
            Its name, possibly empty.
        owner
            The place of the body that it belongs to, used if its own is not known.
        """
        tags = _TAGS.get(kind, {kind})
        found = re.search(r"line (\d+)", info or "")
        line = int(found.group(1)) if found is not None else 0
        if line:  # of the main file, or of one that is attached
            own = [each for each in self._elements if each.line == line and each.tag in tags]
            own.sort(key=lambda each: each.file != self._name)
            here = [each for each in own if each.file == self._name or each.file in self._attached] or own
            # Parts that are attached or repeated have names that are made of theirs.
            named = [each for each in here if each.name and each.name in name]
            here = [each for each in here if each.name == name] or named or here
        elif name:
            here = [each for each in self._elements if each.name == name and each.tag in tags]
        else:
            here = self._next_without_name(kind, tags) if kind in _SECTIONS else []
        return Place(here[0].file, here[0].line) if here else owner

    def _next_without_name(self, kind: str, tags: Collection[str]) -> list[_Element]:
        """The next element of a kind that has no name and stands in an included file."""
        every = [
            each
            for each in self._elements
            if each.tag in tags and each.parent == kind and not each.name
            if each.file != self._name and each.file not in self._attached
        ]
        number = self._met.get(kind, 0)
        self._met[kind] = number + 1
        return every[number : number + 1]

    def first(self, tag: str) -> Place | None:
        """The place of the last element with a tag, which is the valid one in MuJoCo."""
        known = [each for each in self._elements if each.tag == tag and each.file not in self._attached]
        return Place(known[-1].file, known[-1].line) if known else None

    def _look_through(self, name: str, text: str, folder: Path, parent: str) -> None:
        """The elements of a file; those at the top of an included one belong to the element that includes it."""
        parser = expat.ParserCreate()
        above: list[str] = []

        def start(tag: str, attributes: dict[str, str]) -> None:
            line = parser.CurrentLineNumber
            over = above[-1] if above else ""
            self._elements.append(_Element(tag, over, attributes.get("name", ""), name, line))
            # What has no parent is the root of a file.
            above.append(tag if above or not parent else parent)
            if tag == "include" and "file" in attributes:
                self._read(folder / attributes["file"], folder, over)
            elif tag == "model" and "file" in attributes:
                path = folder / attributes["file"]
                self._attached.add(str(path))
                self._read(path, path.parent, "")

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda _: above.pop()
        try:
            parser.Parse(text.encode(), True)
        except expat.ExpatError:
            return  # MuJoCo's reader forgives more; the lines found so far stay

    def _read(self, path: Path, folder: Path, parent: str) -> None:
        if path in self._seen:
            return
        self._seen.add(path)
        try:
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return
        self._look_through(str(path), text, folder, parent)
