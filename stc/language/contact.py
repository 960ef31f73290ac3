"""Scheduled contact: the `contact:` section, translated into plain statements of the language.

A contact is declared with the expressions that place it, and then listed under the ranges on which it stands:

    contact:
      sole = foot(x, z, th), half = 0.1, friction = 0.6;
      [0, 20]:  sole at 0;
      [36, n]:  sole at D;

The translation is text (:class:`Expansion`): variables for the ground forces, their generalised forces by virtual work,
zero acceleration while the contact stands, the friction cone and the bounds of the centre of pressure, no force and
some clearance while it does not stand, and at a landing the impulse and the balance of every momentum.  The text is
parsed like the rest of the spec, and its statements replace the section; each keeps the position of its original line
for messages.

Position and velocity are fixed only at the start of each phase; the later frames follow from the zero acceleration.
Fixing them on every frame would be redundant, and leave multipliers undetermined.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping

from stc.errors import Source, SpecError
from stc.language import syntax
from stc.language.constants import Constants
from stc.language.contact_statements import ALONE, KINDS, NEEDED, Contact, Line, Mechanics, Phase, Writer
from stc.language.context import Context
from stc.language.definition_values import define
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.parser import parse
from stc.language.show import show_expression


def without_contacts(
    tree: syntax.SpecTree, overrides: Mapping[str, float], diagnostics: Diagnostics
) -> syntax.SpecTree:
    """The tree with every contact section replaced by its plain statements; mistakes are added."""
    if not any(section.kind == "contact" for section in tree.sections):
        return tree
    found = expansion(tree, overrides, diagnostics)
    first = next(section for section in tree.sections if section.kind == "contact")
    expanded: list[syntax.Section] = []
    damaged = tree.damaged
    if found is None:  # its mistakes are told; that nothing declares its forces is none
        damaged = damaged | set(_forces(tree))
    else:
        try:
            expanded = parse(Source("<contact>", found.text)).sections
        except SpecError as error:  # a name such as that of a function
            wrong = error.diagnostics[0]
            at = found.origin(wrong.span.start if wrong.span is not None else 0) or first
            diagnostics.error(wrong.message, at.start, at.end)
        for section in expanded:
            found.place(section, first)
    sections: list[syntax.Section] = []
    for section in tree.sections:
        if section is first:
            sections += expanded
        elif section.kind != "contact":
            sections.append(section)
    return syntax.SpecTree(tree.source, sections, damaged)


def plain_text(tree: syntax.SpecTree, overrides: Mapping[str, float]) -> str:
    """The text of a spec with its contact sections written out as plain statements.

    Raises:
        SpecError: with the mistakes in those sections.
    """
    diagnostics = Diagnostics(tree.source)
    text = tree.source.text
    found = [section for section in tree.sections if section.kind == "contact"]
    written = expansion(tree, overrides, diagnostics) if found else None
    expanded = "" if written is None else written.text
    if diagnostics.error_count:
        raise SpecError(diagnostics.errors())
    for section in reversed(found):
        ends = [statement.end for block in section.blocks for statement in block.statements]
        end = max(ends, default=section.end)
        end = text.find(";", end) + 1 or end
        text = text[: section.start] + (expanded.rstrip() if section is found[0] else "") + text[end:]
    return text


def expansion(
    tree: syntax.SpecTree, overrides: Mapping[str, float], diagnostics: Diagnostics
) -> Expansion | None:
    """The plain statements of all contact sections of a spec; None after mistakes, which are added."""
    # Ranges and poses are worked out in a trial of the rest of the spec; its mistakes are told in the real one.
    trial = _trial(tree, overrides)
    contacts = _contacts(tree, trial, diagnostics)
    _check_expressions(tree, trial, diagnostics)
    if diagnostics.error_count:
        return None
    return Expansion(Writer(contacts, Mechanics(tree, trial, contacts), trial.n).lines())


class Expansion:
    """The translation of contact sections: its text, and for each line the original statement."""

    def __init__(self, lines: Iterable[Line]) -> None:
        texts, self._starts, self._origins = [], list[int](), list[syntax.Node | None]()
        at = 0
        for text, origin in lines:
            texts.append(f"{text}\n")
            self._starts.append(at)
            self._origins.append(origin)
            at += len(text) + 1
        self.text = "".join(texts)

    def origin(self, offset: int) -> syntax.Node | None:
        """The original statement for the character of the text at an offset; None for the head of a section."""
        return self._origins[bisect_right(self._starts, offset) - 1]

    def place(self, node: object, otherwise: syntax.Node) -> None:
        """Set the position of a node and all its parts to its original statement; relations keep their text."""
        if isinstance(node, list | tuple):
            for part in node:
                self.place(part, otherwise)
        elif isinstance(node, syntax.Node):
            if isinstance(node, syntax.Relation):
                node.written = self.text[node.start : node.end]
            at = self.origin(node.start) or otherwise
            node.start, node.end = at.start, at.end
            for name in node.__dataclass_fields__:
                if name not in ("start", "end"):
                    self.place(getattr(node, name), otherwise)


# ---------------------------------------------------------------- reading the section


def _declarations(tree: syntax.SpecTree) -> list[syntax.ContactDeclaration]:
    return [
        statement
        for block in tree.blocks("contact")
        for statement in block.statements
        if isinstance(statement, syntax.ContactDeclaration)
    ]


def _forces(tree: syntax.SpecTree) -> list[str]:
    """The names of all force variables that contacts can add."""
    return [f"{one.name.name}_{part}" for one in _declarations(tree) for part in ("fx", "fz", "my")]


def _trial(tree: syntax.SpecTree, overrides: Mapping[str, float]) -> Context:
    """The rest of the spec, as far as its definitions."""
    unknown = _forces(tree)
    sections = [section for section in tree.sections if section.kind != "contact"]
    if unknown:
        sections += parse(Source("<contact>", f"variables: {', '.join(unknown)};")).sections
    trial = Context(syntax.SpecTree(tree.source, sections, tree.damaged), overrides, Diagnostics(tree.source))
    define(trial, lambda expression: any(_is_integral(part) for part in syntax.walk(expression)))
    return trial


def _is_integral(node: syntax.Expression) -> bool:
    return isinstance(node, syntax.Call) and node.function == "integral"


def _check_expressions(tree: syntax.SpecTree, trial: Context, diagnostics: Diagnostics) -> None:
    """Add mistakes in the expressions of poses, options and places, at their positions."""
    builder = trial.builder
    builder.diagnostics = diagnostics
    for block in tree.blocks("contact"):
        for statement in block.statements:
            found: list[syntax.Expression] = []
            if isinstance(statement, syntax.ContactDeclaration):
                found = [*statement.pose, *(value for _, value in statement.options if value is not None)]
            elif isinstance(statement, syntax.ContactPlace):
                found = statement.at
            for expression in found:
                builder.poisoned = False
                builder.build(expression)
            if isinstance(statement, syntax.ContactDeclaration):
                _check_options(statement, trial.constants, diagnostics)
    builder.poisoned = False


def _check_options(
    statement: syntax.ContactDeclaration, constants: Constants, diagnostics: Diagnostics
) -> None:
    """Add a mistake for each negative option."""
    for name, value in statement.options:
        number = None if value is None else constants.value_of(value)
        if value is not None and number is not None and not number >= 0.0:
            _fail(diagnostics, value, f"`{name.name}` is {number:.12g}", "it has to be 0 or more")


def _contacts(tree: syntax.SpecTree, trial: Context, diagnostics: Diagnostics) -> list[Contact]:
    found: dict[str, Contact] = {}
    for block in tree.blocks("contact"):
        for statement in block.statements:
            if isinstance(statement, syntax.ContactDeclaration):
                if block.header is not None:
                    _fail(diagnostics, statement, "a contact is declared before any range header")
                contact = _declared(statement, diagnostics)
                if contact is not None:
                    found[contact.name] = contact
    ranges = trial.positions
    ranges.diagnostics = diagnostics
    for block in tree.blocks("contact"):
        for statement in block.statements:
            if not isinstance(statement, syntax.ContactPlace):
                continue
            name = statement.name.name
            if name not in found:
                hint = did_you_mean(name, list(found)) or "declare it first, as in `sole = foot(x, z, th)`"
                _fail(diagnostics, statement.name, f"there is no contact `{name}`", hint)
            elif block.free:
                hint = 'name a model, as in `model: "robot.xml";`, or write rows with `0 <= gap complements force >= 0`'
                _fail(
                    diagnostics,
                    statement,
                    "contacts of a model can be free, those of a Lagrangian cannot",
                    hint,
                )
            elif statement.slides is not None:
                hint = "state its normal force and its friction by hand, under `constraints:`"
                _fail(diagnostics, statement.slides, "contacts of a Lagrangian stand, and cannot slide", hint)
            elif block.header is None:
                hint = "put the frames into a range header before it, as in `[0, 20]: sole at 0;`"
                _fail(diagnostics, statement, "a contact stands on a range of frames", hint)
            else:
                where = ranges.frames(block.header)
                if where is not None:
                    places = [show_expression(place) for place in statement.at]
                    if len(places) > len(found[name].pose):
                        _fail(diagnostics, statement, f"a {found[name].kind} takes no angle")
                    x, (z, angle) = (places[0] if places else None), [*places[1:], "0", "0"][:2]
                    found[name].phases.append(Phase(where, block.header, statement, x, z, angle))
    for contact in found.values():
        _order(contact, diagnostics)
    return list(found.values())


def _fail(diagnostics: Diagnostics, node: syntax.Node, message: str, hint: str = "") -> None:
    diagnostics.error(message, node.start, node.end, hint)


def _declared(statement: syntax.ContactDeclaration, diagnostics: Diagnostics) -> Contact | None:
    kind = statement.kind.name
    if kind not in KINDS:
        hint = did_you_mean(kind, KINDS) or f"kinds are {', '.join(KINDS)}"
        _fail(diagnostics, statement.kind, f"there is no kind of contact `{kind}`", hint)
        return None
    count, _, known = KINDS[kind]
    if len(statement.pose) != count:
        takes = "x, z and its angle" if count == 3 else "x and z"
        _fail(diagnostics, statement.kind, f"a {kind} takes {takes}, not {len(statement.pose)} expressions")
        return None
    options: dict[str, str] = {}
    for name, value in statement.options:
        if name.name not in known:
            hint = did_you_mean(name.name, known) or f"a {kind} has the options {', '.join(known)}"
            _fail(diagnostics, name, f"a {kind} has no `{name.name}`", hint)
        elif (value is None) != (name.name in ALONE):
            how = "stands alone" if name.name in ALONE else f"needs a value, as in `{name.name} = 0.5`"
            _fail(diagnostics, name, f"`{name.name}` {how}")
        options[name.name] = "" if value is None else _atom(value)
    for needed in NEEDED[kind]:
        if needed not in options:
            _fail(diagnostics, statement, f"a {kind} needs `{needed} = ...`")
    pose = [show_expression(part) for part in statement.pose]
    return Contact(statement.name.name, kind, statement, options, pose)


def _atom(node: syntax.Expression) -> str:
    text = show_expression(node)
    return text if isinstance(node, syntax.Name | syntax.Number | syntax.Call) else f"({text})"


def _order(contact: Contact, diagnostics: Diagnostics) -> None:
    contact.phases.sort(key=lambda phase: phase.frames.first)
    if not contact.phases:
        _fail(
            diagnostics, contact.statement, f"`{contact.name}` stands nowhere", "list it under a range header"
        )
    for before, after in zip(contact.phases, contact.phases[1:]):
        if after.frames.first <= before.frames.last:
            message = f"`{contact.name}` stands on {before.frames} and {after.frames}, with no frames between"
            _fail(diagnostics, after.header, message)
    landings = 0
    for phase in contact.phases:
        if phase.frames.first > 0 and not contact.soft:
            landings += 1
            phase.landing = landings
