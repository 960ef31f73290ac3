"""Tokens to a syntax tree, by recursive descent.

A mistake is noted and reading goes on after the next ``;``, or at the next section head or range header, so
that one run reports all of them.  Expressions bind, from loosest to tightest: ``+ -``, ``* /``, unary ``-``,
``^`` (right associative), ``'`` and ``[ ]``.
"""

from __future__ import annotations

import math

from stc.errors import Source, SpecError
from stc.language import syntax
from stc.language.diagnostics import Diagnostics, did_you_mean, nearest_name
from stc.language.lexer import Tokens, tokenize
from stc.language.words import METHODS, REPLAY_KINDS, SECTIONS

#: Parentheses, calls, indices and exponents within each other: more is refused (and never needed).
MAX_NESTING = 100

_RELATIONS = frozenset(("=", "<=", ">="))
_OPERAND_STARTS = frozenset(("name", "number", "(", "string"))


def parse(source: Source) -> syntax.SpecTree:
    """The syntax tree of a spec.

    Raises:
        SpecError: with every syntax error of the text.
    """
    diagnostics = Diagnostics(source)
    tree = parse_with_recovery(source, diagnostics)
    if diagnostics.error_count:
        raise SpecError(diagnostics.errors())
    return tree


def parse_with_recovery(source: Source, diagnostics: Diagnostics) -> syntax.SpecTree:
    """The tree of all statements that could be read; the mistakes are added to ``diagnostics``."""
    return _Parser(tokenize(source, diagnostics), diagnostics).spec()


def parse_expression(source: Source) -> syntax.Expression:
    """A text that is one expression and nothing else.

    Raises:
        SpecError: with the first syntax error.
    """
    diagnostics = Diagnostics(source)
    parser = _Parser(tokenize(source, diagnostics), diagnostics)
    expression: syntax.Expression | None = None
    try:
        expression = parser.expression()
        if parser.kind != "end":
            parser.fail_after_operand("the end")
    except _Misread:
        pass
    if diagnostics.error_count or expression is None:
        raise SpecError(diagnostics.errors())
    return expression


class _Misread(Exception):
    """Raised after a mistake has been noted, to give up the statement."""


class _Parser:
    def __init__(self, tokens: Tokens, diagnostics: Diagnostics) -> None:
        self.source = tokens.source
        self.text = tokens.source.text
        self.kinds, self.starts, self.ends = tokens.kinds, tokens.starts, tokens.ends
        self.diagnostics = diagnostics
        self.at = 0
        self.kind = self.kinds[0]
        self.depth = 0
        self.damaged: set[str] = set()

    # ------------------------------------------------------------- token level

    def advance(self) -> None:
        self.at += 1
        self.kind = self.kinds[self.at]

    def move_to(self, index: int) -> None:
        self.at = index
        self.kind = self.kinds[index]

    def token_text(self, index: int) -> str:
        return self.text[self.starts[index] : self.ends[index]]

    def described(self) -> str:
        """The current token as a message names it."""
        return "the end of the file" if self.kind == "end" else f"`{self.token_text(self.at)}`"

    def fail(self, message: str, hint: str = "") -> _Misread:
        """Note a mistake at the current token (at the end of the file: at what was read last)."""
        index = self.at
        if self.kind == "end" and index > 0:
            index -= 1
        self.diagnostics.error(
            message, self.starts[index], max(self.ends[index], self.starts[index] + 1), hint
        )
        return _Misread()

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
        if self.kinds[index] != "[":
            return -1
        level = 0
        while True:
            kind = self.kinds[index]
            if kind == "[":
                level += 1
            elif kind == "]":
                level -= 1
                if level == 0:
                    return index + 1 if self.kinds[index + 1] == ":" else -1
            elif kind in ("end", ";", ":"):
                return -1
            index += 1

    def end_statement(self, what: str) -> None:
        """Read the ``;`` after ``what``; where the line ends instead, note that and take it as read."""
        if self.kind == ";":
            self.advance()
            return
        on_new_line = self.on_new_line()
        starts_something = (
            self.kind == "end"
            or self.section_head_at(self.at)
            or self.range_header_end(self.at) >= 0
            or (on_new_line and self.kind in ("name", "number", "-", "("))
        )
        if not starts_something:
            self.fail_after_operand("`;`")
        last = self.at - 1
        self.diagnostics.error(f"expected `;` after {what}", self.ends[last], self.ends[last] + 1)

    def fail_after_operand(self, what: str) -> None:
        """Raise for a token that cannot follow an expression."""
        previous = self.kinds[self.at - 1] if self.at else ""
        touching = self.at > 0 and self.starts[self.at] == self.ends[self.at - 1]
        hint = ""
        if self.kind == "string":
            hint = "a second derivative is written with two `'`"
        elif self.kind in ("name", "(") and previous in ("number", ")", "]", "prime"):
            hint = "write `*` to multiply"
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
        elif self.kind in _RELATIONS:
            hint = "relations are statements of `constraints:`"
        elif self.kind == ":":
            hint = did_you_mean(self.token_text(self.at - 1), SECTIONS) if previous == "name" else ""
        raise self.fail(f"expected an operator or {what}, found {self.described()}", hint)

    def skip_statement(self, start: int, declares: bool) -> None:
        """Go on after the next ``;``, or at the next section head or range header."""
        index = max(self.at, start)
        # a mistake on the first token of a statement must not stop the reader in its place
        if index == start and self.kinds[index] not in (";", "end"):
            index += 1
        kinds = self.kinds
        while kinds[index] not in (";", "end"):
            if self.section_head_at(index) or (kinds[index] == "[" and self.range_header_end(index) >= 0):
                break
            index += 1
        if declares:
            self.damaged.update(self.token_text(k) for k in range(start, index) if kinds[k] == "name")
        self.move_to(index + 1 if kinds[index] == ";" else index)

    # ---------------------------------------------------------------- sections

    def spec(self) -> syntax.SpecTree:
        sections: list[syntax.Section] = []
        while self.kind != "end":
            if self.kind == "name" and self.kinds[self.at + 1] == ":":
                section = self.section()
                if section is not None:
                    sections.append(section)
            else:
                known = ", ".join(f"`{name}:`" for name, kind in SECTIONS.items() if kind.supported)
                self.fail(
                    f"expected a section such as `constants:`, found {self.described()}",
                    f"sections are {known}",
                )
                self.skip_to_head()
        return syntax.SpecTree(self.source, sections, frozenset(self.damaged))

    def skip_to_head(self) -> None:
        """Go to the next thing that looks like a section head."""
        index = self.at + (self.kind != "end")
        while self.kinds[index] != "end":
            after_statement = self.kinds[index - 1] == ";"
            if self.kinds[index] == "name" and self.kinds[index + 1] == ":":
                if after_statement or self.token_text(index) in SECTIONS:
                    break
            index += 1
        self.move_to(index)

    def section(self) -> syntax.Section | None:
        start, end = self.starts[self.at], self.ends[self.at + 1]
        name = self.token_text(self.at)
        name_end = self.ends[self.at]
        kind = SECTIONS.get(name)
        if kind is None:
            ranged = self.range_header_end(self.at + 2) >= 0
            meant = nearest_name(
                name, [word for word, section in SECTIONS.items() if section.ranged or not ranged]
            )
            known = ", ".join(f"`{word}`" for word, section in SECTIONS.items() if section.supported)
            hint = f"did you mean `{meant}`?" if meant else f"sections are {known}"
            self.diagnostics.error(f"there is no section `{name}`", start, name_end, hint)
            if meant is None:
                self.skip_to_head()
                return None
            name, kind = meant, SECTIONS[meant]
        if not kind.supported:
            message = f"this version of stc has no `{name}:` section yet"
            self.diagnostics.error(message, start, name_end, "write its equations under `constraints:`")
            self.skip_to_head()
            return None
        self.move_to(self.at + 2)
        statement = getattr(self, f"{name}_statement")
        blocks = [syntax.Block(start, end, None, [])]
        while self.kind != "end":
            if self.kind == "name" and self.kinds[self.at + 1] == ":":
                break
            first = self.at
            try:
                if self.kind == "[" and self.range_header_end(first) >= 0:
                    header = self.range_header()
                    if not kind.ranged:
                        message = f"`{name}:` takes no range headers"
                        self.diagnostics.error(message, header.start, header.end)
                    else:
                        blocks.append(syntax.Block(header.start, header.end, header, []))
                elif self.kind == ";":
                    self.advance()
                else:
                    statement(blocks[-1].statements)
            except _Misread:
                self.depth = 0
                self.skip_statement(first, kind.declares)
        return syntax.Section(start, end, name, blocks)

    def range_header(self) -> syntax.RangeHeader:
        start = self.starts[self.at]
        colon = self.range_header_end(self.at)
        self.advance()
        last: syntax.Expression | None = None
        try:
            first = self.expression()
            if self.kind == ",":
                self.advance()
                last = self.expression()
            if self.kind != "]":
                found = self.described()
                raise self.fail(
                    f"expected `,` or `]` in a range header, found {found}", "a range is `[a, b]:` or `[k]:`"
                )
        except _Misread:
            # the header is lost, the statements under it are not: nothing is assumed about their frames
            self.depth = 0
            first = syntax.Name(start, self.ends[colon], "?")
            last = None
        self.move_to(colon + 1)
        return syntax.RangeHeader(start, self.ends[colon], first, last)

    # -------------------------------------------------------------- statements

    def name(self, what: str) -> syntax.Name:
        if self.kind != "name":
            raise self.fail(f"expected {what}, found {self.described()}")
        node = syntax.Name(self.starts[self.at], self.ends[self.at], self.token_text(self.at))
        self.advance()
        return node

    def declarations(self, into: list[syntax.Statement], what: str, valued: bool) -> None:
        while True:
            name = self.name(f"the name of a {what}")
            value: syntax.Expression | None = None
            if self.kind in ("prime", "["):
                raise self.fail(f"a {what} is declared by its name alone, found {self.described()}")
            if self.kind == "=":
                if not valued:
                    self.diagnostics.error(
                        f"a {what} is declared without a value",
                        self.starts[self.at],
                        self.ends[self.at],
                        f"a starting value belongs under `guess:`, a fixed one under "
                        f"{'`constraints:`' if what == 'variable' else '`constants:`'}",
                    )
                self.advance()
                value = self.expression()
            into.append(
                syntax.Declaration(name.start, self.ends[self.at - 1], name, value if valued else None)
            )
            if self.kind == ",":
                self.advance()
                continue
            if self.kind == ";":
                self.advance()
                return
            last = self.at - 1
            head_follows = self.kind == "end" or self.section_head_at(self.at)
            if head_follows:
                self.diagnostics.error(
                    f"expected `;` after the last {what}", self.ends[last], self.ends[last] + 1
                )
                return
            if self.kind == "name" and (self.on_new_line() or value is None):
                self.diagnostics.error(
                    f"expected `,` or `;` after `{name.name}`", self.ends[last], self.ends[last] + 1
                )
                continue
            if value is not None and self.kind in _OPERAND_STARTS:
                self.fail_after_operand("`,` or `;`")
            raise self.fail(f"expected `,` or `;` after `{name.name}`, found {self.described()}")

    def constants_statement(self, into: list[syntax.Statement]) -> None:
        self.declarations(into, "constant", True)

    def variables_statement(self, into: list[syntax.Statement]) -> None:
        self.declarations(into, "variable", False)

    def parameters_statement(self, into: list[syntax.Statement]) -> None:
        self.declarations(into, "parameter", False)

    def assignment(self, into: list[syntax.Statement], what: str, hint: str) -> None:
        name = self.name(f"the name of a {what}")
        if self.kind in ("prime", "["):
            raise self.fail(f"expected `=` after `{name.name}`, found {self.described()}", hint)
        self.expect("=", f"`=` after `{name.name}`")
        value = self.expression()
        into.append(syntax.Assignment(name.start, self.ends[self.at - 1], name, value))
        self.end_statement(f"the {what}")

    def definitions_statement(self, into: list[syntax.Statement]) -> None:
        self.assignment(into, "definition", "a definition is a plain name")

    def guess_statement(self, into: list[syntax.Statement]) -> None:
        hint = "derivatives start from differences of the guessed values; frames go into a header before it"
        self.assignment(into, "guess", hint)

    def relation(self) -> syntax.Relation:
        start = self.starts[self.at]
        operands = [self.expression()]
        operators: list[str] = []
        while self.kind in _RELATIONS:
            operators.append(self.kind)
            self.advance()
            operands.append(self.expression())
        return syntax.Relation(start, self.ends[self.at - 1], operands, operators)

    def constraints_statement(self, into: list[syntax.Statement]) -> None:
        into.append(self.relation())
        self.end_statement("the constraint")

    def objective_statement(self, into: list[syntax.Statement]) -> None:
        into.append(self.relation())
        self.end_statement("the objective term")

    def jumps_statement(self, into: list[syntax.Statement]) -> None:
        start = self.starts[self.at]
        quantities = [self.expression()]
        while self.kind == ",":
            self.advance()
            quantities.append(self.expression())
        into.append(syntax.JumpList(start, self.ends[self.at - 1], quantities))
        self.end_statement("the last quantity")

    def method_statement(self, into: list[syntax.Statement]) -> None:
        start = self.starts[self.at]
        words = [self.name(f"a method ({', '.join(METHODS)})").name]
        while self.kind == "-":
            self.advance()
            words.append(self.name("the rest of the method's name").name)
        into.append(syntax.MethodChoice(start, self.ends[self.at - 1], "-".join(words)))
        self.end_statement("the method")

    def string(self, what: str) -> str:
        if self.kind != "string":
            raise self.fail(f"expected {what}, found {self.described()}")
        text = self.token_text(self.at)[1:-1]
        self.advance()
        return text

    def replay_statement(self, into: list[syntax.Statement]) -> None:
        start = self.starts[self.at]
        word = self.name("`model`, `joint`, `actuator`, `compare` or `set`")
        if word.name == "model":
            self.expect("=", "`=` after `model`")
            path = self.string('the name of a model file in quotes, as in `model = "cart.xml";`')
            into.append(syntax.ModelFile(start, self.ends[self.at - 1], path))
            self.end_statement("the model")
            return
        if word.name not in REPLAY_KINDS:
            known = ("model", *REPLAY_KINDS)
            hint = did_you_mean(word.name, known) or "lines start with " + ", ".join(
                f"`{name}`" for name in known
            )
            self.diagnostics.error(f"`{word.name}` is no kind of replay line", word.start, word.end, hint)
            raise _Misread
        path_parts = [self.path_part(word.name)]
        while self.kind == ".":
            self.advance()
            path_parts.append(self.path_part(word.name))
        self.expect("=", f"`=` after the path of `{word.name}`")
        value = self.expression()
        into.append(syntax.Channel(start, self.ends[self.at - 1], word.name, tuple(path_parts), value))
        self.end_statement("the replay line")

    def path_part(self, kind: str) -> str:
        if self.kind == "string":
            return self.string("a name")
        return self.name(f"a name of the model (in quotes where it is not a plain word) after `{kind}`").name

    # ------------------------------------------------------------- expressions

    def expression(self) -> syntax.Expression:
        """A sum of products, as far as it goes."""
        if self.depth >= MAX_NESTING:
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
        kinds, starts, ends = self.kinds, self.starts, self.ends
        at, kind = self.at, self.kind
        node: syntax.Expression
        if kind == "name":
            self.advance()
            name = self.token_text(at)
            if self.kind == "(":
                node = self.call(at, name)
            else:
                node = syntax.Name(starts[at], ends[at], name)
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
            if self.kind != ")":
                self.fail_unclosed(at, ")")
            self.advance()
        else:
            raise self.fail_operand()
        while self.kind == "prime" or self.kind == "[":
            if self.kind == "prime":
                count = 2 if self.token_text(self.at) == "″" else ends[self.at] - starts[self.at]
                if isinstance(node, syntax.Prime):
                    node = syntax.Prime(starts[at], ends[self.at], node.operand, node.order + count)
                else:
                    node = syntax.Prime(starts[at], ends[self.at], node, count)
                self.advance()
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
            if self.depth >= MAX_NESTING:
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

    def call(self, at: int, name: str) -> syntax.Expression:
        opening = self.at
        self.advance()
        arguments: list[syntax.Expression] = []
        if self.kind != ")":
            arguments.append(self.expression())
            while self.kind == ",":
                self.advance()
                arguments.append(self.expression())
        if self.kind != ")":
            self.fail_unclosed(opening, ")")
        self.advance()
        return syntax.Call(self.starts[at], self.ends[self.at - 1], name, arguments)

    def fail_operand(self) -> _Misread:
        previous = self.token_text(self.at - 1) if self.at else ""
        after = f" after `{previous}`" if self.at else ""
        hint = ""
        if self.kind in ("*", "/") and previous == self.kind:
            hint = "powers are written `^`" if previous == "*" else "comments start with `#`"
        elif self.kind == "prime":
            hint = "a `'` follows what it differentiates"
        elif self.kind == "string":
            hint = "only `replay:` takes text in quotes"
        elif self.kind == "[":
            hint = "a range header is `[a, b]:`, with a `:` at its end"
        return self.fail(f"expected an expression{after}, found {self.described()}", hint)

    def fail_unclosed(self, opening: int, closing: str) -> None:
        line = self.source.position(self.starts[opening])[0]
        here = self.source.position(self.starts[self.at])[0]
        where = "" if line == here else f" on line {line}"
        opened = self.token_text(opening)
        if self.kind in _OPERAND_STARTS:
            self.fail_after_operand(f"`{closing}`")
        hint = f"to close the `{opened}`{where}"
        raise self.fail(f"expected an operator or `{closing}`, found {self.described()}", hint)
