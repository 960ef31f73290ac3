"""The lexer: characters to tokens.

A token's kind is ``number``, ``name``, ``string``, ``prime`` (one or more ``'``), ``end``, or for every
operator and delimiter its own text.  Tokens are kept as parallel lists, which makes lexing fast in Python.
"""

from __future__ import annotations

import re

from stc.errors import Source
from stc.language.diagnostics import Diagnostics
from stc.records import dataclass

_LETTER = r"A-Za-z_\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u024f\u0370-\u03ff\u1f00-\u1fff"
#: What names are made of after their first letter, as the inside of a class of a regular expression.
WORD_CHARACTER = f"{_LETTER}0-9"
_TOKEN = re.compile(
    rf"""(?P<blank>(?:[\s\ufeff]+|\#[^\n]*)+)
    |(?P<name>[{_LETTER}][{WORD_CHARACTER}]*)
    |(?P<number>(?:[0-9]+(?:\.(?!\.)[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
    |(?P<slip>\*\*|[=!]=|:=|&&|\|\||[<>](?!=)|[≤≥−–·×÷’′″²³“”])
    |(?P<operator><=|>=|\.\.|[-+*/^()\[\],;:=.{{}}])
    |(?P<prime>'+)
    |(?P<string>"[^"\n]*")
    """,
    re.VERBOSE,
)

# What people type that the language writes otherwise: the kind it is read as, and the advice.
_SLIPS: dict[str, tuple[str, str]] = {
    "**": ("^", "powers are written `^`"),
    "==": ("=", "an equality is written `=`"),
    "!=": ("=", "only `=`, `<=` and `>=` relate two expressions"),
    ":=": ("=", "a definition is written `=`"),
    "<": ("<=", "inequalities are not strict: write `<=`"),
    ">": (">=", "inequalities are not strict: write `>=`"),
    "&&": (";", "every relation is a statement of its own; end it with `;`"),
    "||": (";", "every relation is a statement of its own; alternatives cannot be stated"),
    "≤": ("<=", "write `<=`"),
    "≥": (">=", "write `>=`"),
    "−": ("-", "write the plain minus `-`"),
    "–": ("-", "write the plain minus `-`"),
    "·": ("*", "write `*`"),
    "×": ("*", "write `*`"),
    "÷": ("/", "write `/`"),
    "’": ("prime", "write the plain `'`"),
    "′": ("prime", "write the plain `'`"),
    "″": ("prime", "write two plain `'`"),
    "²": ("", "write `^2`"),
    "³": ("", "write `^3`"),
    "“": ("", 'write plain quotes `"`'),
    "”": ("", 'write plain quotes `"`'),
}


_BRACES_HINT = "group with parentheses; braces belong to repetitions, as in `for k in 1..3: q{k} >= 0;`"


@dataclass(slots=True)
class Tokens:
    """Kinds, first characters and ends of all tokens; the last one is of kind ``end`` and empty."""

    source: Source
    kinds: list[str]
    starts: list[int]
    ends: list[int]

    def text(self, index: int) -> str:
        """The characters of a token."""
        return self.source.text[self.starts[index] : self.ends[index]]


def tokenize(source: Source, diagnostics: Diagnostics, *, repetitions: bool = False) -> Tokens:
    """Split a text into tokens; other characters are added to ``diagnostics`` and skipped.

    Braces are tokens only with ``repetitions``: a text whose repetitions are written out has none.
    """
    kinds: list[str] = []
    starts: list[int] = []
    ends: list[int] = []
    text = source.text
    position, length = 0, len(text)
    match = _TOKEN.match
    while position < length:
        found = match(text, position)
        if found is None or (text[position] in "{}" and not repetitions):
            position = _bad_character(text, position, diagnostics)
            continue
        kind = found.lastgroup or ""
        end = found.end()
        if kind != "blank":
            if kind == "operator":
                kind = found.group()
            elif kind == "slip":
                slip = found.group()
                kind, advice = _SLIPS[slip]
                diagnostics.error(f"`{slip}` is not part of the language", position, end, advice)
            if kind:
                kinds.append(kind)
                starts.append(position)
                ends.append(end)
        position = end
    kinds.append("end")
    starts.append(length)
    ends.append(length)
    return Tokens(source, kinds, starts, ends)


def _bad_character(text: str, position: int, diagnostics: Diagnostics) -> int:
    """Add a mistake for characters that start no token; returns where to continue."""
    if text[position] == '"':
        end = text.find("\n", position)
        end = len(text) if end < 0 else end
        hint = "text in quotes ends with `\"` on the same line; a second derivative is written with two `'`"
        diagnostics.error("a quote is not closed", position, position + 1, hint)
        return position + 1
    end = position + 1
    while end < len(text) and text[end] == text[position]:
        end += 1
    shown = text[position]
    if not shown.isprintable():
        shown = f"U+{ord(shown):04X}"
    hint = {
        "{": _BRACES_HINT,
        "}": _BRACES_HINT,
        "&": "every relation is a statement of its own; end it with `;`",
        "|": "every relation is a statement of its own; alternatives cannot be stated",
        "%": "comments start with `#`",
        "$": "constants are set from outside with `--set name=value`",
        "\\": "a statement may go on over several lines without any mark",
        "`": "write the plain `'`",
        "?": "formulas for several stretches of frames stand under range headers, as in `[0, 10]: u = 1;`; "
        "a choice by an unknown x is, smoothly, `b + (a - b)*(1 + tanh(x/e))/2`",
        "!": "comments start with `#`",
        "°": "angles are in radians: 30 degrees are `30*pi/180`",
    }.get(shown, "")
    diagnostics.error(f"unexpected character `{shown}`", position, end, hint)
    return end
