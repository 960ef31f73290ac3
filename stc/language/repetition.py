"""Repetition: similar statements are written once and expanded before the text is parsed.

``for k in 1..10: q{k}'' = u{k};`` stands for ten statements, ``sum(k in 1..10: m{k})`` for ten terms in parentheses.
In the repeated text, ``{k}`` is replaced by the text of k, and ``{k-1}`` by that whole number.  This module knows
nothing else of the language: any statement can be repeated, and a block in braces may contain several, range headers
and whole sections.  The resulting text is parsed like any other; its :class:`stc.errors.Source` maps its characters to
those of the spec and the values of k.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import TypeAlias

from stc.errors import Origins, Source, SpecError
from stc.language import syntax
from stc.language.diagnostics import Diagnostics
from stc.language.expression_parser import ExpressionParser, Misread
from stc.language.habits import listed
from stc.language.lexer import WORD_CHARACTER, Tokens, tokenize
from stc.records import dataclass

#: Characters that a spec may come to once it is written out.
MOST_CHARACTERS = 2_000_000

_FORM = "write `for k in 1..10: q{k} >= 0;`, `for leg in FL, FR: ...` or a block `for k in 1..10: { ... }`"
_ENDS_OF_STATEMENTS = frozenset((";", ":", "{", "}", ",", ""))
_BRACES = re.compile(r"\{([^{}]*)\}")
_QUOTED_OR_COMMENT = re.compile(r'"[^"\n]*"|#[^\n]*')

#: What the names of the repetitions around stand for: a whole number or a word.
Values: TypeAlias = Mapping[str, int | str]


def written_out(source: Source) -> Source:
    """The text of a spec with its repetitions expanded; the source itself without repetitions.

    Raises:
        SpecError: with the first mistake in how repetitions are written.
    """
    diagnostics = Diagnostics(source)
    tokens = tokenize(
        source, Diagnostics(source), repetitions=True
    )  # other mistakes are told when the whole is parsed
    reader = _Template(tokens, diagnostics)
    writer = _Writer(source, diagnostics, reader.counts)
    try:
        writer.write(reader.parts(), {})
    except Misread:
        if not reader.repeats:
            return source  # braces without repetitions are told of with all other mistakes
        raise SpecError(diagnostics.errors()) from None
    if not reader.repeats:
        return source
    return Source(
        source.name, "".join(writer.texts), source.path, source.model_file, source.carried, writer.origins
    )


@dataclass(slots=True)
class _Copied:
    """Characters that are copied; ``quoted`` within a text in quotes."""

    start: int
    end: int
    quoted: bool = False


@dataclass(slots=True)
class _Value:
    """``{k-1}``, with its braces; ``glued`` if it is a part of a name."""

    start: int
    end: int
    value: syntax.Expression
    glued: bool


@dataclass(slots=True)
class _Items:
    """One entry of what follows `in`: a word or number, or with ``last`` a range of whole numbers."""

    first: syntax.Expression
    last: syntax.Expression | None


@dataclass(slots=True)
class _Repeated:
    """A repetition of statements, or with ``is_sum`` of terms; ``start`` to ``end`` is its head."""

    start: int
    end: int
    name: str
    items: list[_Items]
    body: list[_Part]
    is_sum: bool


_Part: TypeAlias = _Copied | _Value | _Repeated


class _Template(ExpressionParser):
    """Reads a text as characters that are copied, values in braces, and repetitions of such parts."""

    def __init__(self, tokens: Tokens, diagnostics: Diagnostics) -> None:
        super().__init__(tokens, diagnostics)
        self.around: list[str] = []
        self.repeats = False
        self.counts = self._whole_constants()

    def parts(self) -> list[_Part]:
        """The parts of the whole text, with repetitions written out."""
        found: list[_Part] = []
        copied = 0
        while self.kind != "end":
            copied = self._part(found, copied)
        return [*found, _Copied(copied, len(self.text))]

    def _whole_constants(self) -> dict[str, int]:
        """The constants that are declared as a whole number, `N = 10`, except `n`, which can be overridden."""
        found: dict[str, int] = {}
        within = False
        for index, kind in enumerate(self.kinds[:-3]):
            if self.section_head_at(index):
                within = self.token_text(index) == "constants"
            elif within and kind == "name" and self.kinds[index + 1 : index + 3] == ["=", "number"]:
                ends = self.kinds[index - 1] in (",", ";", ":") and self.kinds[index + 3] in (",", ";")
                if ends and self.token_text(index + 2).isdigit() and self.token_text(index) != "n":
                    found.setdefault(self.token_text(index), int(self.token_text(index + 2)))
        return found

    def _part(self, found: list[_Part], copied: int) -> int:
        """Read one token, or the repetition or braces that it begins; returns where copied text ends."""
        start = self.starts[self.at]
        if self._at_repetition(self.at):
            self.repeats = True
            found += [_Copied(copied, start), self._repeated()]
        elif self._at_misspelt_repetition():
            self.repeats = True
            raise self.fail("a repetition is written otherwise", _FORM)
        elif self.kind == "}":
            raise self.fail("this `}` closes nothing")
        elif self.kind == "{":
            found += [_Copied(copied, start), self._value(start)]
        elif self.kind == "string" and self.around and "{" in self.token_text(self.at):
            found.append(_Copied(copied, start))
            self._string(found)
            self.advance()
        else:
            self.advance()
            return copied
        return self.ends[self.at - 1]

    # --------------------------------------------------------------------- repetitions

    def _at_repetition(self, index: int) -> bool:
        kinds = self.kinds
        words = kinds[index : index + 4]
        if words[0] != "name":
            return False
        word = self.token_text(index)
        if word == "for":
            return words[1:3] == ["name", "name"] and self.token_text(index + 2) == "in"
        return word == "sum" and words[1:] == ["(", "name", "name"] and self.token_text(index + 3) == "in"

    def _at_misspelt_repetition(self) -> bool:
        """Whether `for` begins a statement without being one of the language's."""
        if self.kind != "name" or self.token_text(self.at) != "for":
            return False
        before = self.kinds[self.at - 1] if self.at else ""
        return before in _ENDS_OF_STATEMENTS and self.kinds[self.at + 1] in ("name", "(")

    def _repeated(self) -> _Repeated:
        start = self.starts[self.at]
        is_sum = self.token_text(self.at) == "sum"
        self.move_to(self.at + 1 + is_sum)
        name = self.token_text(self.at)
        if name in self.around:
            raise self.fail(
                f"`{name}` is the name of a repetition around this one", "give each a name of its own"
            )
        self.move_to(self.at + 2)
        items = [self._items()]
        while self.kind == ",":
            self.advance()
            items.append(self._items())
        if self.kind != ":":
            raise self.fail(
                f"expected `:` before what is repeated for each `{name}`, found {self.described()}", _FORM
            )
        self.advance()
        head_end = self.ends[self.at - 1]
        if self.kinds[self.at : self.at + 2] == ["number", ":"]:
            raise self.fail("a range of a repetition has two dots", f"write `{self._dotted(items[-1])}`")
        self.around.append(name)
        body = self._terms() if is_sum else self._statements(name)
        self.around.pop()
        return _Repeated(start, head_end, name, items, body, is_sum)

    def _dotted(self, before: _Items) -> str:
        """The hint for a range written with colons."""
        return f"{self.text[before.first.start : before.first.end]}..{self.token_text(self.at)}"

    def _as_dots(self) -> str:
        """The hint for ``range(1, 4)``, of which the word is the current token."""
        ends = listed(self, self.at + 1)
        if len(ends) not in (1, 2) or not all(each.isdigit() for each in ends):
            return "as in `1..3`, both ends included"
        return f"write `{ends[0] if len(ends) == 2 else '0'}..{int(ends[-1]) - 1}`, both ends included"

    def _items(self) -> _Items:
        if self.kind in ("[", "(", "{") and len(listed(self, self.at)) > 1:
            hint = f"write them without: `{', '.join(listed(self, self.at))}`"
            raise self.fail("what is repeated over stands without brackets", hint)
        if self.kind == "name" and self.token_text(self.at) == "range" and self.kinds[self.at + 1] == "(":
            raise self.fail("a range of a repetition is written with two dots", self._as_dots())
        first = self.expression()
        last: syntax.Expression | None = None
        if self.kind == "..":
            self.advance()
            last = self.expression()
        return _Items(first, last)

    def _statements(self, name: str) -> list[_Part]:
        """A block without its braces, or one statement with its `;`."""
        if self.kind == "end":
            raise self.fail(f"nothing follows that is repeated for each `{name}`", _FORM)
        found: list[_Part] = []
        if self.kind == "{" and self._is_block():
            opening = self.at
            self.advance()
            copied = self.starts[self.at]
            while self.kind not in ("}", "end"):
                copied = self._part(found, copied)
            if self.kind == "end":
                self.move_to(opening)
                raise self.fail("this `{` is not closed", "a block ends with `}`")
            found.append(_Copied(copied, self.ends[self.at - 1]))
            self.advance()
            return found
        copied = self.starts[self.at]
        nested = self._at_repetition(self.at) and self.token_text(self.at) == "for"
        if nested:
            self._part(found, copied)
            return found
        while self.kind not in (";", "end"):
            copied = self._part(found, copied)
        if self.kind == "end":
            raise self.fail(f"expected `;` after what is repeated for each `{name}`", _FORM)
        self.advance()
        return [*found, _Copied(copied, self.ends[self.at - 1])]

    def _is_block(self) -> bool:
        """Whether a brace opens a block: it contains a statement, or braces."""
        for kind in self.kinds[self.at + 1 :]:
            if kind in (";", "{"):
                return True
            if kind == "}":
                return False
        return True

    def _terms(self) -> list[_Part]:
        """The terms of a sum, up to its closing parenthesis."""
        found: list[_Part] = []
        copied = self.starts[self.at]
        opened = 1
        while self.kind not in (";", "end"):
            opened += (self.kind == "(") - (self.kind == ")")
            if not opened:
                found.append(_Copied(copied, self.starts[self.at]))
                self.advance()
                return found
            copied = self._part(found, copied)
        raise self.fail("this sum is not closed", "a sum is written `sum(k in 1..10: m{k}*q{k})`")

    # -------------------------------------------------------------------------- values

    def _value(self, start: int) -> _Value:
        if not self.around and self.token_text(self.at + 1) not in self.counts:
            hint = "group with parentheses; `{k}` stands within `for k in 1..10: ...`"
            raise self.fail("unexpected character `{`", hint)
        self.advance()
        value = self.expression()
        if self.kind != "}":
            raise self.fail(
                f"expected `}}`, found {self.described()}", "braces hold one number or word, as in `{k-1}`"
            )
        self.advance()
        end = self.ends[self.at - 1]
        before, after = self.text[start - 1 : start], self.text[end : end + 1]
        return _Value(start, end, value, _in_a_name(before, "}") or _in_a_name(after, "{"))

    def _string(self, found: list[_Part]) -> None:
        """The parts of a text in quotes."""
        start, end = self.starts[self.at], self.ends[self.at]
        copied = start
        for braces in _BRACES.finditer(self.text, start, end):
            source = Source("", braces[1])
            inner = tokenize(source, Diagnostics(source))
            shift = braces.start(1)
            tokens = Tokens(
                self.source, inner.kinds, [s + shift for s in inner.starts], [e + shift for e in inner.ends]
            )
            reader = ExpressionParser(tokens, self.diagnostics)
            value = reader.expression()
            if reader.kind != "end":
                raise reader.fail(
                    f"expected `}}`, found {reader.described()}", "braces hold one number or word"
                )
            found += [
                _Copied(copied, braces.start(), True),
                _Value(braces.start(), braces.end(), value, True),
            ]
            copied = braces.end()
        found.append(_Copied(copied, end, True))


def _in_a_name(character: str, brace: str) -> bool:
    return character == brace or re.fullmatch(f"[{WORD_CHARACTER}]", character) is not None


class _Writer:
    """Expands parts and records the origin of every piece."""

    def __init__(self, source: Source, diagnostics: Diagnostics, constants: Mapping[str, int]) -> None:
        self.source = source
        self.diagnostics = diagnostics
        self.constants = constants
        self.texts: list[str] = []
        self.length = 0
        self.origins = Origins(source)
        self.outermost = syntax.Node(0, 1)

    def fail(self, node: syntax.Node, message: str, hint: str = "") -> Misread:
        self.diagnostics.error(message, node.start, node.end, hint)
        return Misread()

    def put(self, text: str, start: int, end: int, values: Values) -> None:
        """Append a text that stands for the characters ``start`` to ``end`` of the spec."""
        if not text:
            return
        self.origins.add(self.length, len(text), start, end, _listed(values))
        self.texts.append(text)
        self.length += len(text)
        if self.length > MOST_CHARACTERS:
            raise self.fail(
                self.outermost, f"written out, the spec has more than {MOST_CHARACTERS} characters"
            )

    def write(self, parts: list[_Part], values: Values) -> None:
        """Append parts with the names in braces replaced."""
        for part in parts:
            if isinstance(part, _Copied):
                self._copy(part, values)
            elif isinstance(part, _Value):
                self.put(self._text(part, values), part.start, part.end, values)
            else:
                self._repeat(part, values)

    def _copy(self, part: _Copied, values: Values) -> None:
        """Append characters of the spec; without comments where they would be repeated."""
        text, start = self.source.text, part.start
        if values and not part.quoted:
            for comment in _QUOTED_OR_COMMENT.finditer(text, part.start, part.end):
                if comment[0].startswith("#"):
                    self.put(text[start : comment.start()], start, comment.start(), values)
                    start = comment.end()
        self.put(text[start : part.end], start, part.end, values)

    def _repeat(self, part: _Repeated, values: Values) -> None:
        line_start = self.source.text.rfind("\n", 0, part.start) + 1
        before = self.source.text[line_start : part.start]
        indent = before if not before.strip() else " " * len(before)
        head = part.start, part.end
        if not values:
            self.outermost = syntax.Node(*head)
        if part.is_sum:
            self.put("(", *head, values)
        written = 0
        for value in self._each(part, values):
            if written:
                self.put(" + " if part.is_sum else f"\n{indent}", *head, values)
            self.write(part.body, {**values, part.name: value})
            written += 1
        if not written and not values:
            raise self.fail(
                part.items[0].first, f"`{part.name}` stands for nothing here", "a range goes upward"
            )
        if part.is_sum:
            self.put(")" if written else "0)", *head, values)

    def _each(self, part: _Repeated, values: Values) -> list[int | str]:
        found: list[int | str] = []
        for item in part.items:
            if item.last is None:
                found.append(self._item(item.first, values))
                continue
            first, last = self._whole(item.first, values), self._whole(item.last, values)
            if last - first >= MOST_CHARACTERS:
                raise self.fail(
                    item.last, f"written out, the spec has more than {MOST_CHARACTERS} characters"
                )
            found += range(first, last + 1)
        return found

    def _item(self, node: syntax.Expression, values: Values) -> int | str:
        if isinstance(node, syntax.Name):
            return values.get(node.name, node.name)
        return self._whole(node, values)

    def _text(self, part: _Value, values: Values) -> str:
        node = part.value
        if isinstance(node, syntax.Name) and node.name not in values and node.name not in self.constants:
            known = " or ".join(f"`{name}`" for name in values)
            raise self.fail(node, f"`{node.name}` is not repeated over here", f"braces may hold {known}")
        value = values[node.name] if isinstance(node, syntax.Name) and node.name in values else None
        if value is None:
            value = self._whole(node, values)
        if isinstance(value, str) or value >= 0:
            return str(value)
        if part.glued:
            raise self.fail(
                part.value, f"this is {value} for {_listed(values)}, and a name cannot contain a minus sign"
            )
        return f"({value})"

    def _whole(self, node: syntax.Expression, values: Values) -> int:
        found = self._number(node, values)
        if found.denominator != 1:
            raise self.fail(node, f"this is {found}, no whole number{_for(values)}")
        return found.numerator

    def _number(self, node: syntax.Expression, values: Values) -> Fraction:
        if isinstance(node, syntax.Number):
            return Fraction(node.value)
        if isinstance(node, syntax.Negate):
            return -self._number(node.operand, values)
        if isinstance(node, syntax.Sum):
            terms = [(sign, self._number(term, values)) for sign, term in node.terms]
            return sum((-v if sign == "-" else v for sign, v in terms), Fraction(0))
        if isinstance(node, syntax.Product):
            result = Fraction(1)
            for operator, part in node.factors:
                value = self._number(part, values)
                if operator == "/" and not value:
                    raise self.fail(part, f"this is 0{_for(values)}, and divides")
                result = result * value if operator == "*" else result / value
            return result
        if isinstance(node, syntax.Name):
            value_of = values.get(node.name)
            if isinstance(value_of, int):
                return Fraction(value_of)
            if value_of is not None:
                raise self.fail(node, f"`{node.name}` is the word `{value_of}` here, no number")
            if node.name in self.constants:
                self.origins.counts[node.name] = self.constants[node.name]
                return Fraction(self.constants[node.name])
        hint = (
            "write a whole number, as in `1..10`, or a constant that is declared as one, `constants: N = 10;`"
        )
        what = f"`{node.name}`" if isinstance(node, syntax.Name) else "this number"
        raise self.fail(node, f"{what} is not known here", hint)


def _listed(values: Values) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values.items())


def _for(values: Values) -> str:
    return f" for {_listed(values)}" if values else ""
