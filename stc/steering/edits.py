"""Changes of a text at given places, with everything else of it left as it is."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from stc.records import dataclass


@dataclass(frozen=True, slots=True)
class Edit:
    """Other characters for those from ``start`` to ``end`` (excluded) of a text; with both equal, an insertion."""

    start: int
    end: int
    text: str


def edited(text: str, edits: Iterable[Edit]) -> str:
    """The text with all edits made; insertions at one place follow each other in the order given.

    Raises:
        ValueError: two edits overlap.
    """
    pieces: list[str] = []
    at = 0
    for edit in sorted(edits, key=lambda edit: (edit.start, edit.end)):
        if edit.start < at:
            raise ValueError(f"two edits change the character {edit.start}")
        pieces += (text[at : edit.start], edit.text)
        at = edit.end
    return "".join([*pieces, text[at:]])


def replaced(text: str, start: int, end: int, word: str) -> list[Edit]:
    """Edits that put a word in the place of another one; a comment that stands aligned behind it stays where it is.

    Only a line on which nothing else follows but punctuation keeps its comment's column, as long as there is room.
    """
    edits = [Edit(start, end, word)]
    rest = text[end:].partition("\n")[0]
    before, hash_, _ = rest.partition("#")
    blanks = len(before) - len(before.rstrip(" "))
    if hash_ and blanks > 2 and not before.strip(" ,;"):
        room = max(2, blanks - (len(word) - (end - start)))
        at = end + len(before)
        edits.append(Edit(at - blanks, at, " " * room))
    return edits


def number(value: float) -> str:
    """A number as a spec writes it: the shortest digits that mean this value, without a point where it is whole."""
    if value == round(value) and abs(value) < 1e15:
        return str(round(value))
    return repr(float(value))


def difference(old: str, new: str, name: str) -> str:
    """The difference of two texts in the format of ``diff -u``, with two lines of context."""
    lines = difflib.unified_diff(
        old.splitlines(), new.splitlines(), f"{name} (on disk)", f"{name} (steered)", lineterm="", n=2
    )
    return "\n".join(lines)
