"""The parser of expressions: recursive descent over tokens.

Operators from lowest to highest precedence: ``+ -``, ``* /``, unary ``-``, ``^`` (right associative), ``'`` and
``[ ]``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

from stc.language import syntax
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.habits import components_hint, conditional_hint, listed
from stc.language.lexer import Tokens
from stc.language.words import CONDITIONALS, DEGREES, MAXIMISING, MINIMISING, SECTIONS, UNITS

#: Parentheses, calls, indices and exponents within each other: more is refused (and never needed).
MAX_NESTING = 100

MAXIMUM_HINT = "what stands under `objective:` is minimised: for the largest `e`, write `-(e)`"

RELATIONS = frozenset(("=", "<=", ">="))
OPERAND_STARTS = frozenset(("name", "number", "(", "string"))


T = TypeVar("T")


class Misread(Exception):
    """Raised after a mistake has been added, to abandon the statement."""


class ExpressionParser:
    """Reads expressions from tokens; a parser of statements builds on it."""

    def __init__(self, tokens: Tokens, diagnostics: Diagnostics) -> None:
        self.source = tokens.source
        self.text = tokens.source.text
        self.kinds, self.starts, self.ends = tokens.kinds, tokens.starts, tokens.ends
        self.diagnostics = diagnostics
        self.at = 0
        self.kind = self.kinds[0]
        self.depth = 0
        self._header_ends = self._find_header_ends()

    # ------------------------------------------------------------- token level

    def advance(self) -> None:
        self.at += 1
        self.kind = self.kinds[self.at]

    def move_to(self, index: int) -> None:
        self.at = index
        self.kind = self.kinds[index]

    def token_text(self, index: int) -> str:
        return self.text[self.starts[index] : self.ends[index]]

    @property
    def word(self) -> str:
        """The current token's text if it is a name; else empty."""
        return self.token_text(self.at) if self.kind == "name" else ""

    def takes(self, word: str) -> bool:
        """Whether the current token is a certain word or sign; if so, it has been read."""
        found = word in (self.word, self.kind)
        if found:
            self.advance()
        return found

    def separated(self, read: Callable[[], T]) -> list[T]:
        """The things of a list with commas between them, each of which ``read`` reads; one at least."""
        found = [read()]
        while self.takes(","):
            found.append(read())
        return found

    @property
    def end(self) -> int:
        """Where the token that was read last ends in the text, in characters from its beginning."""
        return self.ends[self.at - 1]

    def described(self) -> str:
        """The current token as a message names it."""
        return "the end of the file" if self.kind == "end" else f"`{self.token_text(self.at)}`"

    def fail(self, message: str, hint: str = "") -> Misread:
        """Add a mistake at the current token (at the end of the file: at the last token)."""
        index = self.at
        if self.kind == "end" and index > 0:
            index -= 1
        self.diagnostics.error(
            message, self.starts[index], max(self.ends[index], self.starts[index] + 1), hint
        )
        return Misread()

    def expect(self, kind: str, what: str) -> None:
        if self.kind != kind:
            raise self.fail(f"expected {what}, found {self.described()}")
        self.advance()

    def on_new_line(self) -> bool:
        """Whether a line ends between the token before and the current one."""
        return "\n" in self.text[self.ends[self.at - 1] : self.starts[self.at]] if self.at else True

    def section_head_at(self, index: int) -> bool:
        return (
            self.kinds[index] == "name"
            and self.kinds[index + 1] == ":"
            and self.token_text(index) in SECTIONS
        )

    def range_header_end(self, index: int) -> int:
        """If a range header starts at this token, the index of its ``:``; else -1."""
        return self._header_ends.get(index, -1)

    def _find_header_ends(self) -> dict[int, int]:
        """For every token that starts a range header, the index of the ``:`` at its end; once for all of them."""
        found: dict[int, int] = {}
        kinds = self.kinds
        opened: list[int] = []
        for index, kind in enumerate(kinds):
            if kind == "[":
                opened.append(index)
            elif kind == "]" and opened:
                start = opened.pop()
                if kinds[index + 1] == ":":
                    found[start] = index + 1
            elif kind in (";", ":"):
                opened.clear()
        return found

    def fail_after_operand(self, what: str) -> None:
        """Raise for a token that cannot follow an expression."""
        previous = self.kinds[self.at - 1] if self.at else ""
        touching = self.at > 0 and self.starts[self.at] == self.ends[self.at - 1]
        hint = ""
        if self.kind == "string":
            hint = "a second derivative is written with two `'`"
        elif self.kind == "name" and previous == "number" and self.token_text(self.at) in DEGREES:
            hint = f"angles are in radians: `{self.token_text(self.at - 1)}*pi/180`"
        elif self.kind == "name" and previous == "number" and self.token_text(self.at) in UNITS:
            hint = "units are not written; write `*` to multiply"
        elif self.kind == "(" and self.at > 2 and self.kinds[self.at - 2] == ".":
            hint = (
                "a column of a motion is a number at the time of its statement: remove the `(...)`; "
                "a function of something else is a table: `f = table(data.x, data.y);` under `data:`"
            )
        elif self.kind in ("name", "(") and previous in ("number", ")", "]", "prime"):
            hint = "write `*` to multiply"
        elif self.kind == "name" and self.token_text(self.at - 1) in MAXIMISING:
            hint = MAXIMUM_HINT
        elif self.kind == "name" and self.token_text(self.at - 1) in MINIMISING:
            hint = "what stands under `objective:` is minimised: write it alone"
        elif self.kind == ",":
            hint = self.decimal_hint(self.at)
        elif self.kind == "number" and previous in (")", "]", "prime"):
            hint = "write `*` to multiply, `^` for a power"
        elif self.kind == "number" and touching:
            hint = "a name cannot hold a `.`" if self.token_text(self.at).startswith(".") else ""
        elif self.kind in ("name", "number"):
            hint = "is an operator missing between the two?"
        elif self.kind == ")":
            hint = "this `)` closes nothing"
        elif self.kind == "]":
            hint = "this `]` closes nothing"
        elif self.kind in RELATIONS:
            hint = "relations are statements of `constraints:`"
        elif self.kind == ":":
            hint = did_you_mean(self.token_text(self.at - 1), SECTIONS) if previous == "name" else ""
        raise self.fail(f"expected an operator or {what}, found {self.described()}", hint)

    def decimal_hint(self, comma: int) -> str:
        """The hint for a `,` within a number; empty for other tokens."""
        around = self.kinds[comma - 1 : comma + 2]
        close = self.ends[comma - 1] == self.starts[comma] and self.ends[comma] == self.starts[comma + 1]
        if comma < 1 or not close or around != ["number", ",", "number"]:
            return ""
        whole, rest = self.token_text(comma - 1), self.token_text(comma + 1)
        if len(rest) == 3 and rest.isdigit() and not whole.startswith("0"):
            return f"thousands are not separated: write `{whole}{rest}`, or `{whole}.{rest}` with a decimal point"
        return f"the decimal point is a `.`: write `{whole}.{rest}`"

    # ------------------------------------------------------------- expressions

    def expression(self) -> syntax.Expression:
        """A sum of products, as far as it goes."""
        if self.depth > MAX_NESTING:  # the statement itself is the first
            hint = "name inner parts under `definitions:`"
            raise self.fail(f"parentheses or powers are nested more than {MAX_NESTING} deep", hint)
        self.depth += 1
        kinds, starts, ends = self.kinds, self.starts, self.ends
        start = starts[self.at]
        terms: list[tuple[str, syntax.Expression]] = []
        sign = "+"
        while True:
            factor_start = starts[self.at]
            term = self.factor()
            kind = self.kind
            if kind == "*" or kind == "/":
                factors = [("*", term)]
                while kind == "*" or kind == "/":
                    self.advance()
                    factors.append((kind, self.factor()))
                    kind = self.kind
                term = syntax.Product(factor_start, ends[self.at - 1], factors)
            terms.append((sign, term))
            if kind != "+" and kind != "-":
                break
            sign = kind
            self.at += 1
            self.kind = kinds[self.at]
        self.depth -= 1
        return terms[0][1] if len(terms) == 1 else syntax.Sum(start, ends[self.at - 1], terms)

    def factor(self) -> syntax.Expression:
        """Unary signs, an operand with its primes and indices, and its exponent."""
        start = self.at
        while self.kind == "-" or self.kind == "+":
            self.advance()
        if self.at - start > MAX_NESTING:
            raise self.fail(f"more than {MAX_NESTING} signs in a row")
        kinds, starts, ends = self.kinds, self.starts, self.ends
        at, kind = self.at, self.kind
        node: syntax.Expression
        if kind == "name":
            if self.token_text(at) in CONDITIONALS and kinds[at + 1] in ("(", "name"):
                raise self.fail(f"there is no `{self.token_text(at)}`", conditional_hint(self))
            self.advance()
            if self.kind == ".":
                node = self.path(at)
            elif self.kind == "(":
                node = self.call(at, self.token_text(at))
                if self.kind == "." and isinstance(node, syntax.Call):
                    fields = self.path_parts()
                    node = syntax.Member(starts[at], ends[self.at - 1], node, fields)
            else:
                node = syntax.Name(starts[at], ends[at], self.token_text(at))
        elif kind == "number":
            value = float(self.token_text(at))
            if math.isinf(value):
                raise self.fail(
                    "this number is too large", "the largest is 1.797e308; infinite bounds are `inf`"
                )
            node = syntax.Number(starts[at], ends[at], value)
            self.advance()
        elif kind == "(":
            self.advance()
            node = self.expression()
            if self.kind == "," and (not self.decimal_hint(self.at) or self.kinds[self.at + 2] == ","):
                node = self.vector(at, node)
            if self.kind != ")":
                self.fail_unclosed(at, ")")
            self.advance()
        else:
            raise self.fail_operand()
        after = self.at
        while self.kind == "prime" or self.kind == "[":
            if self.at - after > MAX_NESTING:
                raise self.fail("too many primes and indices on one expression")
            if self.kind == "prime":
                count = 2 if self.token_text(self.at) == "″" else ends[self.at] - starts[self.at]
                if isinstance(node, syntax.Prime):
                    node = syntax.Prime(starts[at], ends[self.at], node.operand, node.order + count)
                else:
                    node = syntax.Prime(starts[at], ends[self.at], node, count)
                self.advance()
                if self.kind == "(" and isinstance(node.operand, syntax.Name):  # the slope of a table
                    node = self.call(at, node.operand.name + "'" * node.order)
            elif self.range_header_end(self.at) >= 0:
                break
            else:
                opening = self.at
                self.advance()
                index = self.expression()
                if self.kind != "]":
                    self.fail_unclosed(opening, "]")
                node = syntax.Index(starts[at], ends[self.at], node, index)
                self.advance()
        if self.kind == "^":
            if self.depth > MAX_NESTING:  # the statement itself is the first
                raise self.fail(f"parentheses or powers are nested more than {MAX_NESTING} deep")
            self.advance()
            self.depth += 1
            exponent = self.factor()
            self.depth -= 1
            node = syntax.Power(starts[at], ends[self.at - 1], node, exponent)
        for sign in range(at - 1, start - 1, -1):
            if kinds[sign] == "-":
                node = syntax.Negate(starts[sign], ends[self.at - 1], node)
        return node

    def path(self, at: int) -> syntax.Name:
        """The path of an element of the model, of which the first word, at token ``at``, has been read."""
        parts = [self.token_text(at), *self.path_parts()]
        return syntax.Name(self.starts[at], self.ends[self.at - 1], ".".join(parts))

    def path_parts(self) -> list[str]:
        """The parts of a path that follow, each after a dot."""
        parts: list[str] = []
        while self.kind == ".":
            self.advance()
            if self.kind not in ("name", "string", "*"):
                hint = "a path is words with dots between them, as in `joint.knee`; others stand in quotes"
                raise self.fail(f"expected a name after `.`, found {self.described()}", hint)
            text = self.token_text(self.at)
            plain = self.kind != "string" or not text[1:-1].isidentifier()
            parts.append(text if plain else text[1:-1])
            self.advance()
        return parts

    def vector(self, opening: int, first: syntax.Expression) -> syntax.Vector:
        """The rest of a vector, of which the first component has been read."""
        self.advance()
        items = [first, *self.separated(self.expression)]
        return syntax.Vector(self.starts[opening], self.ends[min(self.at, len(self.ends) - 1)], items)

    def call(self, at: int, name: str) -> syntax.Expression:
        opening = self.at
        self.advance()
        arguments = [] if self.kind == ")" else self.separated(self.expression)
        if self.kind != ")":
            self.fail_unclosed(opening, ")")
        self.advance()
        return syntax.Call(self.starts[at], self.ends[self.at - 1], name, arguments)

    def fail_operand(self) -> Misread:
        previous = self.token_text(self.at - 1) if self.at else ""
        after = f" after `{previous}`" if previous not in ("", ";", ":") else ""
        hint = ""
        if self.kind in ("*", "/") and previous == self.kind:
            hint = "powers are written `^`" if previous == "*" else "comments start with `#`"
        elif self.kind == "prime":
            hint = "a `'` follows what it differentiates"
        elif self.kind == "string":
            hint = "only `replay:` takes text in quotes"
        elif self.kind == "[":
            if len(listed(self, self.at)) > 1:
                return self.fail("an expression is a number, not a list", components_hint(self))
            hint = "a range header is `[a, b]:`, with a `:` at its end"
        return self.fail(f"expected an expression{after}, found {self.described()}", hint)

    def fail_unclosed(self, opening: int, closing: str) -> None:
        line = self.source.position(self.starts[opening])[0]
        here = self.source.position(self.starts[self.at])[0]
        where = "" if line == here else f" on line {line}"
        opened = self.token_text(opening)
        if self.kind in OPERAND_STARTS:
            self.fail_after_operand(f"`{closing}`")
        hint = f"to close the `{opened}`{where}"
        if self.kind in RELATIONS:
            hint = "a relation is a statement of its own; it has no value"
        elif self.kind == "," and opened == "[":
            hint = "an index is one number; a range header is `[a, b]:`, with a `:` at its end"
        raise self.fail(f"expected an operator or `{closing}`, found {self.described()}", hint)
