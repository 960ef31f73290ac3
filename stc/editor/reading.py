"""One version of a spec's text, read as far as it can be."""

from __future__ import annotations

import logging
import re
from pathlib import Path

from stc.errors import Diagnostic, Source, SpecError, StcError
from stc.language.context import Context
from stc.language.diagnostics import Diagnostics
from stc.language.elaborate import elaborator
from stc.language.lexer import Tokens, tokenize
from stc.language.parser import parse_with_recovery
from stc.language.syntax import SpecTree
from stc.language.words import SECTIONS
from stc.records import dataclass

_log = logging.getLogger(__name__)
_HEAD = re.compile(rf"\b({'|'.join(SECTIONS)})\s*:")
_COMMENT = re.compile(r"#[^\n]*")
#: What may follow each other in the path of a thing of the model.
_PATH_PARTS = ("name", "string", "*")


@dataclass(slots=True, eq=False)
class Reading:
    """One version of a text, parsed.

    All offsets here and in :mod:`stc.editor.names` count the characters of the text as it is written.

    Attributes:
        source: the text as it is written.
        diagnostics: its mistakes and warnings.
        tokens: of the text with its repetitions written out, where that could be done.
        tree: all statements that could be read; None where repetitions could not be written out.
        context: the names and constants of the spec; None where there is no tree.
    """

    source: Source
    diagnostics: list[Diagnostic]
    tokens: Tokens
    tree: SpecTree | None = None
    context: Context | None = None

    def word_at(self, offset: int) -> tuple[str, int, int]:
        """The name, path, or text in quotes around a character, with its first character and its end; or ``""``.

        In what is repeated it is the one of the first repetition.
        """
        for at in (offset, offset - 1):  # the character before counts where a word has just ended
            origins = self.tokens.source.origins
            place = at if origins is None else origins.first(at)
            index = None if place is None or at < 0 else self._token_at(place)
            if index is not None and self.tokens.kinds[index] in ("name", "string"):
                return self._path_around(index)
        return "", offset, offset

    def _token_at(self, offset: int) -> int | None:
        spans = zip(self.tokens.starts, self.tokens.ends)
        return next((k for k, (start, end) in enumerate(spans) if start <= offset < end), None)

    def _path_around(self, index: int) -> tuple[str, int, int]:
        kinds = self.tokens.kinds
        first = last = index
        while first > 1 and kinds[first - 1] == "." and kinds[first - 2] in _PATH_PARTS:
            first -= 2
        while kinds[last + 1] == "." and kinds[last + 2] in _PATH_PARTS:
            last += 2
        text = "".join(self.tokens.text(k) for k in range(first, last + 1))
        return text, *self.tokens.source.place(self.tokens.starts[first], self.tokens.ends[last])

    def comment_at(self, offset: int) -> str:
        """The comment that ends the line of a character, without its ``#``."""
        line = self.source.line(self.source.position(offset)[0])
        outside = re.sub(r'"[^"]*"', lambda quoted: " " * len(quoted.group()), line)
        at = outside.find("#")
        return "" if at < 0 else line[at + 1 :].strip()

    @property
    def folder(self) -> Path:
        """The folder in which files named by the spec are looked up."""
        return Path(self.source.path).parent if self.source.path else Path()


def section_at(text: str, offset: int) -> str:
    """The section that a character of a text stands in; ``""`` before the first one."""
    heads = _HEAD.findall(_COMMENT.sub("", text[:offset]))
    return str(heads[-1]) if heads else ""


def read(source: Source) -> Reading:
    """Parse a text. Its mistakes are among the diagnostics of the result; no exception is raised for them."""
    diagnostics = Diagnostics(source)
    found = Reading(source, [], tokenize(source, Diagnostics(source), repetitions=True))
    more: list[Diagnostic] = []
    if not source.text.strip():
        return found
    try:
        found.tree = parse_with_recovery(source, diagnostics)
        found.tokens = tokenize(found.tree.source, Diagnostics(found.tree.source))
        found.context = context = elaborator(found.tree, {}, None, diagnostics)
        context.problem()
    except SpecError as error:
        more += error.diagnostics
    except StcError as error:
        more.append(Diagnostic("error", str(error)))
    except RecursionError:
        more.append(Diagnostic("error", "this is nested too deep: name fewer things through others"))
    except Exception as error:  # a defect of the program must not end the editing
        _log.exception("reading %s", source.name)
        more.append(Diagnostic("error", f"stc itself failed ({type(error).__name__}: {error})"))
    found.diagnostics = [*diagnostics.items, *more]
    return found
