"""Scheduled contact: the `contact:` section, written out as plain statements of the language.

A contact is declared with the expressions that place it, and then listed under the ranges on which it stands:

    contact:
      sole = foot(x, z, th), half = 0.1, friction = 0.6;
      [0, 20]:  sole at 0;
      [36, n]:  sole at D;

What it stands for is text (:func:`expansion`): variables for the forces of the ground, their generalised forces
by virtual work, rows of zero acceleration while it stands, the cone of friction and the bounds of the centre of
pressure, no force and some clearance while it does not, and where it lands the impulse and the balance of every
momentum.  The text is parsed like the rest of the spec, and its statements take the place of the section.

Position and velocity are fixed at the start of each phase only; its later frames follow from the acceleration
being zero.  Fixing them on every frame would say the same several times over, and leave no unique multipliers.
"""

from __future__ import annotations

from collections.abc import Mapping

from stc.errors import Source, SpecError
from stc.language import syntax
from stc.language.contact_statements import KINDS, NEEDED, Contact, Mechanics, Phase, Writer
from stc.language.context import Context
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.parser import parse
from stc.language.show import show_expression


def without_contacts(
    tree: syntax.SpecTree, overrides: Mapping[str, float], diagnostics: Diagnostics
) -> syntax.SpecTree:
    """The tree with every contact section replaced by what it stands for; mistakes are noted."""
    if not any(section.kind == "contact" for section in tree.sections):
        return tree
    text = expansion(tree, overrides, diagnostics)
    first = next(section for section in tree.sections if section.kind == "contact")
    try:
        expanded = parse(Source("<contact>", text)).sections
    except SpecError as error:  # a name such as that of a function: told where the contact is declared
        diagnostics.error(error.diagnostics[0].message, first.start, first.end)
        expanded = []
    for section in expanded:
        _place(section, first, text)
    sections: list[syntax.Section] = []
    for section in tree.sections:
        if section is first:
            sections += expanded
        elif section.kind != "contact":
            sections.append(section)
    return syntax.SpecTree(tree.source, sections, tree.damaged)


def plain_text(tree: syntax.SpecTree, overrides: Mapping[str, float]) -> str:
    """The text of a spec with its contact sections written out as plain statements.

    Raises:
        SpecError: with the mistakes in those sections.
    """
    diagnostics = Diagnostics(tree.source)
    text = tree.source.text
    found = [section for section in tree.sections if section.kind == "contact"]
    expanded = expansion(tree, overrides, diagnostics) if found else ""
    if diagnostics.error_count:
        raise SpecError(diagnostics.errors())
    for section in reversed(found):
        ends = [statement.end for block in section.blocks for statement in block.statements]
        end = max(ends, default=section.end)
        end = text.find(";", end) + 1 or end
        text = text[: section.start] + (expanded.rstrip() if section is found[0] else "") + text[end:]
    return text


def expansion(tree: syntax.SpecTree, overrides: Mapping[str, float], diagnostics: Diagnostics) -> str:
    """The plain statements that all contact sections of a spec stand for together; mistakes are noted."""
    # Ranges and poses are worked out in a trial of the rest of the spec; its mistakes are told in the real one.
    trial = _trial(tree, overrides, diagnostics)
    contacts = _contacts(tree, trial, diagnostics)
    if diagnostics.error_count:
        return ""
    return "\n".join(Writer(contacts, Mechanics(tree, trial, contacts), trial.n).lines()) + "\n"


def _place(node: object, at: syntax.Node, text: str) -> None:
    """Give a node and all below the place of the contact section; relations remember how they are written."""
    if isinstance(node, list | tuple):
        for part in node:
            _place(part, at, text)
    elif isinstance(node, syntax.Node):
        if isinstance(node, syntax.Relation):
            node.written = text[node.start : node.end]
        node.start, node.end = at.start, at.end
        for name in node.__dataclass_fields__:
            if name not in ("start", "end"):
                _place(getattr(node, name), at, text)


# ---------------------------------------------------------------- reading the section


def _trial(tree: syntax.SpecTree, overrides: Mapping[str, float], diagnostics: Diagnostics) -> Context:
    names = [
        statement.name.name
        for block in tree.blocks("contact")
        for statement in block.statements
        if isinstance(statement, syntax.ContactDeclaration)
    ]
    unknown = [f"{name}_{part}" for name in names for part in ("fx", "fz", "my")]
    sections = [section for section in tree.sections if section.kind != "contact"]
    if unknown:
        sections += parse(Source("<contact>", f"variables: {', '.join(unknown)};")).sections
    return Context(syntax.SpecTree(tree.source, sections, tree.damaged), overrides, Diagnostics(tree.source))


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
                    found[name].phases.append(Phase(where, block.header, x, z, angle))
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
            hint = did_you_mean(name.name, known) or f"a {kind} knows {', '.join(known)}"
            _fail(diagnostics, name, f"a {kind} has no `{name.name}`", hint)
        elif (value is None) != (name.name == "soft"):
            how = "stands alone" if name.name == "soft" else f"needs a value, as in `{name.name} = 0.5`"
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
