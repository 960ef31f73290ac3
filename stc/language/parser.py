"""The parser of sections and statements: recursive descent from tokens to a syntax tree.

After a mistake, reading continues after the next ``;``, or at the next section head or range header, so
that one run reports all of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

from stc.errors import Source, SpecError
from stc.language import syntax
from stc.language.diagnostics import Diagnostics, did_you_mean, nearest_name
from stc.language.expression_parser import (
    MAXIMUM_HINT,
    OPERAND_STARTS,
    RELATIONS,
    ExpressionParser,
    Misread,
)
from stc.language.habits import list_hint, vector_hint
from stc.language.lexer import Tokens, tokenize
from stc.language.words import (
    COMPLEMENTS,
    KEYFRAME,
    MAXIMISING,
    POSE_WORDS,
    REPLAY_KINDS,
    SECTION_SYNONYMS,
    SECTIONS,
)
from stc.trajectory import METHODS

#: Words outside of comments without which nothing is repeated.
_PERHAPS_REPEATS = re.compile(r"^[^#\n]*\b(?:for|sum)\b", re.MULTILINE)

#: What may follow the name of a pose.
_POSE_OPTIONS = ("mirrored", "grounded", "turned")


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
    """The tree of all readable statements; mistakes are added to ``diagnostics``.

    Raises:
        SpecError: with the mistakes in how repetitions are written, where there are any.
    """
    if _PERHAPS_REPEATS.search(source.text) is not None:
        from stc.language.repetition import written_out

        source = diagnostics.source = written_out(source)
    return _Parser(tokenize(source, diagnostics), diagnostics).spec()


def parse_expression(source: Source) -> syntax.Expression:
    """A text that consists of a single expression.

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
    except Misread:
        pass
    if diagnostics.error_count or expression is None:
        raise SpecError(diagnostics.errors())
    return expression


def _spared(found: syntax.Relation) -> syntax.Expression:
    """The distance of an inequality from equality."""
    low, high = found.operands if found.operators == ["<="] else reversed(found.operands)
    if isinstance(low, syntax.Number) and low.value == 0.0:
        return high
    return syntax.Sum(found.start, found.end, [("+", high), ("-", low)])


class _Parser(ExpressionParser):
    def __init__(self, tokens: Tokens, diagnostics: Diagnostics) -> None:
        super().__init__(tokens, diagnostics)
        self.damaged: set[str] = set()
        self.pose_names = self._pose_names()

    def _pose_names(self) -> set[str]:
        """The names that `poses:` sections declare, which may form a statement alone."""
        found: set[str] = set()
        within = False
        for index, kind in enumerate(self.kinds[:-1]):
            if self.section_head_at(index):
                within = self.token_text(index) == "poses"
            elif within and kind == "name" and self.kinds[index + 1] == "=":
                if index and self.kinds[index - 1] in (";", ":"):
                    found.add(self.token_text(index))
        return found

    def end_statement(self, what: str) -> None:
        """Read the ``;`` after ``what``; at the end of a line without one, add a mistake and continue."""
        if self.takes(";"):
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

    def skip_statement(self, start: int, declares: bool) -> None:
        """Skip to after the next ``;``, or to the next section head or range header."""
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
        """Skip to the next apparent section head."""
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
            meant = SECTION_SYNONYMS.get(name.lower()) or nearest_name(
                name, [word for word, section in SECTIONS.items() if section.ranged or not ranged]
            )
            known = ", ".join(f"`{word}`" for word, section in SECTIONS.items() if section.supported)
            hint = f"did you mean `{meant}`?" if meant else f"sections are {known}"
            if name.lower() in MAXIMISING:
                meant, hint = "objective", MAXIMUM_HINT
            self.diagnostics.error(f"there is no section `{name}`", start, name_end, hint)
            if meant is None:
                self.skip_to_head()
                return None
            name, kind = meant, SECTIONS[meant]
        if not kind.supported:
            message = f"this version of stc has no `{name}:` section yet"
            hint = "write its equations under `constraints:`"
            self.diagnostics.error(message, start, name_end, hint)
            self.skip_to_head()
            return None
        self.move_to(self.at + 2)
        statement = getattr(self, f"{name}_statement")
        blocks = [syntax.Block(start, end, None, [])]
        while self.kind != "end":
            if self.kind == "name" and self.kinds[self.at + 1] == ":":
                # lines of `forces:` look like section heads, and so does `free:` under `contact:`
                if name == "contact" and self.token_text(self.at) == "free":
                    blocks.append(syntax.Block(self.starts[self.at], self.ends[self.at + 1], None, [], True))
                    self.move_to(self.at + 2)
                    continue
                if name != "forces" or self.token_text(self.at) in SECTIONS:
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
                    blocks[-1].statements += statement()
            except Misread:
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
            last = self.expression() if self.takes(",") else None
            if self.kind != "]":
                wanted = "`,` or `]`" if last is None else "`]`"
                message = f"expected {wanted} in a range header, found {self.described()}"
                raise self.fail(message, "a range is `[a, b]:` or `[k]:`")
        except Misread:
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

    def declarations(self, what: str, valued: bool) -> Iterator[syntax.Statement]:
        while True:
            if self.kind == "number" and (hint := self.decimal_hint(self.at - 1)):
                raise self.fail(f"expected the name of a {what}, found {self.described()}", hint)
            name = self.name_or_path(f"the name of a {what}")
            value: syntax.Expression | None = None
            if self.kind in ("prime", "[", "(", ".."):
                hint = vector_hint(self, name.name)
                raise self.fail(f"a {what} is declared by its name alone, found {self.described()}", hint)
            if valued and self.kind == "=" and (hint := list_hint(self, name.name)):
                self.advance()
                raise self.fail(f"a {what} is a number, not a list", hint)
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
            yield syntax.Declaration(name.start, self.end, name, value if valued else None)
            if self.takes(","):
                continue
            if self.takes(";"):
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
            if value is not None and self.kind in OPERAND_STARTS:
                self.fail_after_operand("`,` or `;`")
            raise self.fail(f"expected `,` or `;` after `{name.name}`, found {self.described()}")

    def constants_statement(self) -> Iterator[syntax.Statement]:
        return self.declarations("constant", True)

    def variables_statement(self) -> Iterator[syntax.Statement]:
        return self.declarations("variable", False)

    def parameters_statement(self) -> Iterator[syntax.Statement]:
        return self.declarations("parameter", False)

    def name_or_path(self, what: str) -> syntax.Name:
        """A name, or the path of an element of the model."""
        name = self.name(what)
        return self.path(self.at - 1) if self.kind == "." else name

    def ended(self, statement: syntax.Statement, what: str) -> list[syntax.Statement]:
        """A statement that has been read, and the ``;`` after it."""
        self.end_statement(what)
        return [statement]

    def assignment(self, what: str, sign: str = "=", hint: str = "") -> syntax.Assignment:
        """``name = value``, the name or path being ``what``; ``hint`` is for what has primes or an index."""
        name = self.name_or_path(what)
        if hint and self.kind in ("prime", "["):
            raise self.fail(f"expected `=` after `{name.name}`, found {self.described()}", hint)
        self.expect(sign, f"`{sign}` after `{name.name}`")
        value = self.expression()
        return syntax.Assignment(name.start, self.end, name, value)

    def definitions_statement(self) -> list[syntax.Statement]:
        found = self.assignment("the name of a definition", hint="a definition is a plain name")
        return self.ended(found, "the definition")

    def guess_statement(self) -> list[syntax.Statement]:
        if self.pose_at_hand():
            return self.ended(self.pose(), "the pose")
        if self.kind == "name" and self.kinds[self.at + 1] == ";":
            name = self.name("the name of a data set")
            return self.ended(syntax.GuessFrom(name.start, name.end, name), "the guess")
        hint = "derivatives start from differences of the guessed values; frames go into a header before it"
        return self.ended(self.assignment("the name of a guess", hint=hint), "the guess")

    def relation(self) -> syntax.Relation:
        start = self.starts[self.at]
        operands = [self.expression()]
        operators: list[str] = []
        while self.kind in RELATIONS:
            operators.append(self.kind)
            self.advance()
            operands.append(self.expression())
        return syntax.Relation(start, self.ends[self.at - 1], operands, operators)

    def constraints_statement(self) -> list[syntax.Statement]:
        if self.pose_at_hand():
            return self.ended(self.pose(), "the pose")
        found = self.relation()
        return (
            self.complementarity(found) if self.word == COMPLEMENTS else self.ended(found, "the constraint")
        )

    def pose_at_hand(self) -> bool:
        """Whether a pose follows: a single name of one, or something that only poses have."""
        if self.kind != "name":
            return False
        following = self.at + 1
        while self.kinds[following] == "." and self.kinds[following + 1] in ("name", "string"):
            following += 2
        path = following > self.at + 1
        first = self.token_text(self.at)
        if path and first != KEYFRAME:
            return False
        kind = self.kinds[following]
        if kind == "name":
            return self.token_text(following) in _POSE_OPTIONS
        of_pose = path or first in POSE_WORDS or first in self.pose_names
        return of_pose and (kind == ";" or (kind == "+" and self.kinds[following + 1] == "("))

    def pose(self) -> syntax.Pose:
        """``keyframe.stand + (D, 0, 0) turned pi about z grounded``, in any order."""
        start = self.starts[self.at]
        found = syntax.Pose(start, start, self.name_or_path("the name of a pose, as in `keyframe.stand`"))
        while True:
            if self.takes("+"):
                shift = self.expression()
                if not isinstance(shift, syntax.Vector):
                    hint = "write three components in parentheses, as in `keyframe.stand + (0.5, 0, 0)`"
                    self.diagnostics.error("a pose is moved by a vector", shift.start, shift.end, hint)
                    raise Misread
                found.shift = shift
            elif self.takes("mirrored"):
                found.mirrored = True
            elif self.takes("grounded"):
                found.grounded = True
            elif self.takes("turned"):
                found.angle = self.expression()
                if not self.takes("about"):
                    raise self.fail(
                        f"expected `about` and an axis, found {self.described()}", "as in `about z`"
                    )
                found.axis = self.factor()
            else:
                break
        found.end = self.end
        return found

    def complementarity(self, one: syntax.Relation) -> list[syntax.Statement]:
        """``0 <= a complements b >= 0``: both relations, and their product."""
        self.advance()
        both = one, self.relation()
        self.end_statement("the constraint")
        start, end = one.start, both[1].end
        wrong = next(
            (found for found in both if len(found.operators) != 1 or found.operators[0] == "="), None
        )
        if wrong is not None:
            hint = f"both sides are one inequality each, as in `0 <= a {COMPLEMENTS} b >= 0`"
            self.diagnostics.error(
                f"what `{COMPLEMENTS}` joins are inequalities", wrong.start, wrong.end, hint
            )
            return []
        spared = syntax.Product(start, end, [("*", _spared(found)) for found in both])
        written = syntax.statement_text(self.diagnostics.source, syntax.Node(start, end))
        product = syntax.Relation(start, end, [spared, syntax.Number(start, end, 0.0)], ["<="], written, True)
        return [*both, product]

    def objective_statement(self) -> list[syntax.Statement]:
        return self.ended(self.relation(), "the objective term")

    def lagrangian_statement(self) -> list[syntax.Statement]:
        return self.ended(self.relation(), "the Lagrangian")

    def model_statement(self) -> list[syntax.Statement]:
        start = self.starts[self.at]
        path = self.string('the name of a model file in quotes, as in `model: "robot.xml";`')
        listed: dict[str, list[syntax.Name]] = {"with": [], "without": []}
        wanted = {
            "with": "what to add to the model, as in `with floor`",
            "without": "what to leave out of the model, as in `without fluid`",
        }
        while (word := self.word) in listed:
            self.advance()
            listed[word] += self.separated(partial(self.name, wanted[word]))
        found = syntax.ModelFile(start, self.end, path, listed["without"], listed["with"])
        return self.ended(found, "the model")

    def poses_statement(self) -> list[syntax.Statement]:
        name = self.name("the name of a pose, as in `crouch = keyframe.stand, joint.knee = 1.9;`")
        self.expect("=", f"`=` after `{name.name}`")
        pose = self.pose()
        change = partial(self.assignment, "a coordinate, as in `joint.knee = 1.9`")
        changes = self.separated(change) if self.takes(",") else []
        return self.ended(syntax.PoseDefinition(name.start, self.end, name, pose, changes), "the pose")

    def forces_statement(self) -> list[syntax.Statement]:
        return self.ended(self.assignment("the name of a coordinate, as in `q: u - c*q';`", ":"), "the force")

    def contact_statement(self) -> list[syntax.Statement]:
        name = self.name("the name of a contact, as in `sole = foot(x, z, th), half = 0.1, friction = 0.6;`")
        if not self.takes("="):
            return self.ended(self.contact_place(name), "the place of the contact")
        kind = self.name("a kind of contact, as in `foot(x, z, th)`")
        self.expect("(", f"`(` after `{kind.name}`")
        pose = self.separated(self.expression)
        self.expect(")", "`)` after the pose of the contact")
        options = self.separated(self.contact_option) if self.takes(",") else []
        found = syntax.ContactDeclaration(name.start, self.end, name, kind, pose, options)
        return self.ended(found, "the contact")

    def contact_option(self) -> tuple[syntax.Name, syntax.Expression | None]:
        option = self.name("an option, as in `friction = 0.6`")
        return option, self.expression() if self.takes("=") else None

    def contact_place(self, name: syntax.Name) -> syntax.ContactPlace:
        on: syntax.Name | None = None
        if self.takes("on"):
            on = self.name_or_path("a surface of the model, as in `on geom.box`")
        at = self.separated(self.expression) if self.takes("at") else []
        for surplus in at[3:]:
            self.diagnostics.error("a place has three numbers at most", surplus.start, surplus.end)
            raise Misread
        slides = self.name("which way, as in `slides forward`") if self.takes("slides") else None
        return syntax.ContactPlace(name.start, self.end, name, at, on, slides)

    def jumps_statement(self) -> list[syntax.Statement]:
        start = self.starts[self.at]
        quantities = self.separated(self.expression)
        return self.ended(syntax.JumpList(start, self.end, quantities), "the last quantity")

    def data_statement(self) -> list[syntax.Statement]:
        from stc.language.data_parser import data_statement

        return self.ended(*data_statement(self))

    def method_statement(self) -> list[syntax.Statement]:
        start = self.starts[self.at]
        text = self.name(f"a method ({', '.join(METHODS)})").name
        while self.kind == "-" or (self.kind == "name" and not self.section_head_at(self.at)):
            joined = self.kind == "-" or self.kinds[self.at - 1] == "-"
            text += self.token_text(self.at) if joined else f" {self.token_text(self.at)}"
            self.advance()
        return self.ended(syntax.MethodChoice(start, self.end, text), "the method")

    def string(self, what: str) -> str:
        if self.kind != "string":
            raise self.fail(f"expected {what}, found {self.described()}")
        text = self.token_text(self.at)[1:-1]
        self.advance()
        return text

    def replay_statement(self) -> list[syntax.Statement]:
        start = self.starts[self.at]
        word = self.name("`model`, `joint`, `actuator`, `apply`, `contact`, `compare` or `set`")
        if word.name == "model":
            self.expect("=", "`=` after `model`")
            path = self.string('the name of a model file in quotes, as in `model = "cart.xml";`')
            return self.ended(syntax.ModelFile(start, self.end, path), "the model")
        if word.name not in REPLAY_KINDS:
            known = ("model", *REPLAY_KINDS)
            hint = did_you_mean(word.name, known) or "lines start with " + ", ".join(
                f"`{name}`" for name in known
            )
            self.diagnostics.error(f"`{word.name}` is not a kind of replay line", word.start, word.end, hint)
            raise Misread
        path_parts = [self.path_part(word.name)]
        while self.takes("."):
            path_parts.append(self.path_part(word.name))
        self.expect("=", f"`=` after the path of `{word.name}`")
        value = self.expression()
        found = syntax.Channel(start, self.end, word.name, tuple(path_parts), value)
        return self.ended(found, "the replay line")

    def path_part(self, kind: str) -> str:
        if self.kind == "string":
            return self.string("a name")
        return self.name(f"a name of the model (in quotes where it is not a plain word) after `{kind}`").name
