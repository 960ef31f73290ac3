"""Answers to what an editor asks about a place in a text, in terms of characters and words, not of the protocol."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from stc.editor.last_solution import LastSolution, values_in
from stc.editor.names import Known, file_of
from stc.editor.reading import Reading, section_at
from stc.editor.words import WORDS, words_in
from stc.language.lexer import WORD_CHARACTER
from stc.records import dataclass
from stc.trajectory import METHODS

__all__ = ["Completion", "Target", "completions", "hover", "outline", "targets"]

#: What is typed of a path before its last part.
_TYPED_PATH = re.compile(rf'((?:[{WORD_CHARACTER}]+|"[^"\n]*")\.)+(?=(?:[{WORD_CHARACTER}]*|"[^"\n]*)$)')
_TYPED_NUMBER = re.compile(rf"(?<![{WORD_CHARACTER}])[0-9.]+$")
#: So many formulas of a name that is defined on several ranges are shown.
_MOST_FORMULAS = 4


@dataclass(frozen=True, slots=True)
class Completion:
    """A word that can be written: ``kind`` is one of :class:`stc.editor.names.Known`, or ``word`` or ``section``."""

    word: str
    kind: str
    about: str


@dataclass(frozen=True, slots=True)
class Target:
    """The place at which a name is declared.

    It is a range of characters of the spec (``file`` is None), or a line of a file, counted from 1.
    """

    file: Path | None
    start: int = 0
    end: int = 0
    line: int = 1


def completions(names: Mapping[str, Known], text: str, offset: int) -> list[Completion]:
    """The completions at a character of the text.

    Args:
        names: of this text or of a recent one.
        text: as it is now.
        offset: of the place in it.
    """
    line = text[text.rfind("\n", 0, offset) + 1 : offset]
    outside = re.sub(r'"[^"]*"', "", line)
    if "#" in outside:
        return []
    path = _TYPED_PATH.search(line)
    if path is not None:
        return list(_next_parts(names, path.group()))
    if outside.count('"') or _TYPED_NUMBER.search(line):
        return []
    section = section_at(text, offset)
    own = {known.name: known for known in names.values() if "." not in known.name}
    heads = sorted({name.partition(".")[0] for name in names if "." in name} - own.keys())
    return [
        *(Completion(known.name, known.kind, known.about) for known in own.values()),
        *(Completion(head, "path", f"`{head}.` of the model") for head in heads),
        *(Completion(word, "section" if meaning.startswith("section") else "word", meaning)
          for word, meaning in words_in(section).items() if word not in own and word not in heads),
    ]  # fmt: skip


def _next_parts(names: Mapping[str, Known], path: str) -> Iterator[Completion]:
    """The parts that may follow the beginning of a path, which ends with a dot."""
    seen = set()
    for name, known in names.items():
        if name.startswith(path):
            found = re.match(r'"[^"]*"|[^.]+', name[len(path) :])
            if found is not None and found.group() not in seen:
                seen.add(found.group())
                whole = name == path + found.group()
                yield Completion(found.group(), known.kind if whole else "path", known.about if whole else "")
    if path in ("joint.", "actuator.") and seen:
        yield Completion("*", "path", "each in turn")


def hover(
    reading: Reading, names: Mapping[str, Known], offset: int, last: LastSolution
) -> tuple[str, int, int] | None:
    """The description, in Markdown, of the word at a character of the text, and the range of that word.

    None if the word has no meaning in the language.
    """
    word, start, end = reading.word_at(offset)
    known = names.get(word) or _thing(names, word)
    if known is None:
        if section_at(reading.source.text, offset) == "method":
            word = next((method for method in METHODS if word in method.split("-")), word)
        return (WORDS[word], start, end) if word in WORDS else None
    lines = [f"**{known.name}**, {known.kind}" if known.kind != "path" else f"**{known.name}**"]
    if known.written:
        shown = known.written[:_MOST_FORMULAS] + ["..."] * (len(known.written) > _MOST_FORMULAS)
        lines.append("```stc\n" + "\n".join(shown) + "\n```")
    if known.about:
        lines.append(known.about)
    if known.value is not None:
        lines.append(f"value {known.value:.9g}")
    if known.place is not None:
        lines.append(f"`{Path(known.place.file).name}`, line {known.place.line}")
    found = last.of(Path(reading.source.path)) if reading.source.path else None
    values = values_in(found[1], known.name) if found is not None else []
    if found is not None and values:
        file, solution = found
        earlier = "" if solution.source == reading.source.text else ", of another text"
        lines.append(f"in `{file.name}` ({solution.status}{earlier}): " + "; ".join(values))
    return "\n\n".join(lines), start, end


def _thing(names: Mapping[str, Known], word: str) -> Known | None:
    """The thing of the model that a part of a path stands for, known by the paths of its fields; None without one."""
    fields = (known for name, known in names.items() if "." in word and name.startswith(f"{word}."))
    field = next(fields, None)
    if field is None:
        return None
    return Known(word, "path", field.about.rpartition("; ")[2], places=field.places, place=field.place)


def targets(reading: Reading, names: Mapping[str, Known], offset: int) -> list[Target]:
    """The declarations of the word at a character of the text, in the text or in the model's file; for the name of a
    file, that file.
    """
    word, _, _ = reading.word_at(offset)
    if word.startswith('"') and word.count('"') == 2 and word.endswith('"'):
        file = file_of(reading, word.strip('"'))
        return [] if file is None else [Target(file)]
    known = names.get(word) or _thing(names, word)
    if known is None:
        return []
    if known.place is not None:
        return [Target(Path(known.place.file).resolve(), line=known.place.line)]
    return [Target(None, start, end) for start, end in known.places]


@dataclass(slots=True)
class Heading:
    """A section of the outline, from its head to the next one, with the names that it declares."""

    name: str
    head: tuple[int, int]
    end: int
    names: list[Known]


def outline(reading: Reading, names: Mapping[str, Known]) -> list[Heading]:
    """The sections of a text in its order, each with what it declares."""
    if reading.tree is None:
        return []
    place = reading.tree.source.place
    heads = sorted({(place(section.start, section.end), section.kind) for section in reading.tree.sections})
    ends = [*(head[0] for head, _ in heads[1:]), len(reading.source.text)]
    found = [Heading(kind, head, end, []) for (head, kind), end in zip(heads, ends)]
    for known in names.values():
        for start, _ in known.places if known.written else ():
            within = [each for each in found if each.head[1] <= start < each.end]
            if within and known not in within[0].names:
                within[0].names.append(known)
    return found
