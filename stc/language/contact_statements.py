"""The plain statements of a contact (:mod:`stc.language.contact` reads the section)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from stc.language import syntax
from stc.language.context import Context
from stc.language.show import show_expression, show_header
from stc.problem import ConstantRef, FrameRange, VariableRef
from stc.records import dataclass, field
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import Expr, render, sum_of, symbols

#: Per kind of contact: the pose that it takes, what its forces are called, and the options that it knows.
KINDS: Mapping[str, tuple[int, tuple[str, ...], tuple[str, ...]]] = {
    "foot": (
        3,
        ("fx", "fz", "my"),
        ("half", "reach", "friction", "clearance", "landing", "speed", "spin", "soft", "sudden"),
    ),
    "point": (2, ("fx", "fz"), ("friction", "clearance", "landing", "speed", "soft", "sudden")),
    "pin": (2, ("fx", "fz"), ("landing", "speed", "soft")),
}

#: Options that have no value.
ALONE = ("soft", "sudden")

#: What a kind cannot do without.
NEEDED: Mapping[str, tuple[str, ...]] = {"foot": ("half", "friction"), "point": ("friction",), "pin": ()}


@dataclass(slots=True)
class Phase:
    """The frames on which a contact stands, and the texts of its place, height and angle; None if x is free."""

    frames: FrameRange
    header: syntax.RangeHeader
    statement: syntax.ContactPlace
    x: str | None
    z: str
    angle: str
    landing: int = 0
    """Counts the impacts of this contact from 1; 0 where none begins the phase."""

    @property
    def first(self) -> str:
        """The text of the first frame."""
        return show_expression(self.header.first)

    @property
    def last(self) -> str:
        """The text of the last frame."""
        return show_expression(self.header.last or self.header.first)


@dataclass(slots=True)
class Contact:
    """One declared contact with its phases in the order of time."""

    name: str
    kind: str
    statement: syntax.ContactDeclaration
    options: dict[str, str]
    pose: list[str]
    phases: list[Phase] = field(default_factory=list)

    @property
    def forces(self) -> list[str]:
        """The names of its force variables."""
        return [f"{self.name}_{part}" for part in KINDS[self.kind][1]]

    def impulses(self, phase: Phase) -> list[str]:
        """The names of the impulses with which a phase begins."""
        return [f"{self.name}_{part}{phase.landing}" for part in ("jx", "jz", "jm")[: len(self.pose)]]

    @property
    def soft(self) -> bool:
        """Whether the contact lands without an impact."""
        return "soft" in self.options

    @property
    def sudden(self) -> bool:
        """Whether its force may end abruptly: that of a pin always can."""
        return self.kind == "pin" or "sudden" in self.options


# ---------------------------------------------------------------- what the mechanics say


class Mechanics:
    """The coordinates of the Lagrangian, the variables under `forces:`, and the derivatives of contact poses."""

    def __init__(self, tree: syntax.SpecTree, trial: Context, contacts: Sequence[Contact]) -> None:
        builder = trial.builder
        energies = [
            builder.build(statement.operands[0])
            for block in tree.blocks("lagrangian")
            for statement in block.statements
            if isinstance(statement, syntax.Relation)
        ]
        self.energy = sum_of(energies)
        moving = {key.name for key in symbols(self.energy) if isinstance(key, VariableRef) and key.order == 1}
        variables = trial.table.of_kind("variable")
        self.coordinates = [name for name in variables if name in moving]
        self.pose = {c.name: [builder.build(part) for part in c.statement.pose] for c in contacts}
        used = dict.fromkeys(
            name
            for block in tree.blocks("forces")
            for statement in block.statements
            if isinstance(statement, syntax.Assignment)
            for name in _variables_in(builder.build(statement.value))
        )
        own = {force for contact in contacts for force in contact.forces}
        self.drives = [name for name in used if name not in moving and name not in own]

    def share(self, contact: Contact, part: int, coordinate: str) -> str:
        """The derivative of a part of a contact's pose with respect to a coordinate, as text, or ''."""
        moved = derivative(self.pose[contact.name][part], VariableRef(coordinate))
        text = render(moved)
        return "" if text == "0" else text

    def weight(self, contact: Contact) -> str:
        """The force on a contact that supports everything; '' if it is not a constant."""
        if contact.pose[1] not in self.coordinates:
            return ""
        down = derivative(self.energy, VariableRef(contact.pose[1]))
        return render(-down) if all(isinstance(key, ConstantRef) for key in symbols(down)) else ""


def _variables_in(e: Expr) -> list[str]:
    return [key.name for key in symbols(e) if isinstance(key, VariableRef)]


# ------------------------------------------------------------------------- writing it out

Line = tuple[str, syntax.Node | None]
"""A line of the statements that contacts stand for, and the contact statement it comes from; None for a heading."""


class Writer:
    """Writes all contacts of a spec as sections of plain statements."""

    def __init__(self, contacts: Sequence[Contact], mechanics: Mechanics, n: int) -> None:
        self.contacts, self.mechanics, self.n = contacts, mechanics, n

    def lines(self) -> Iterator[Line]:
        """The sections, line by line."""
        yield "variables:", None
        for contact in self.contacts:
            yield f"  {', '.join(contact.forces)};", contact.statement
        landings = [
            (contact, phase) for contact in self.contacts for phase in contact.phases if phase.landing
        ]
        if landings:
            yield "parameters:", None
        for contact, phase in landings:
            yield f"  {', '.join(contact.impulses(phase))};", phase.statement
        yield from _section("definitions", self.shares())
        yield from _section("forces", self.generalised())
        yield from _section("jumps", self.jumps())
        yield from _section("guess", self.guesses())
        yield "constraints:", None
        for contact in self.contacts:
            yield from self.statements(contact)
        yield from self.impacts()
        yield from _section("objective", self.prices())

    def shares(self) -> Iterator[Line]:
        """The elapsed share of each flight at frame i."""
        for contact in self.contacts:
            for number, (before, after) in enumerate(zip(contact.phases, contact.phases[1:]), 1):
                first = "i" if before.last == "0" else f"(i - {_term(before.last)})"
                share = f"{contact.name}_s{number} = {first}/({after.first} - {_term(before.last)})"
                yield f"  {share};", after.statement

    def generalised(self) -> Iterator[Line]:
        """`q: ...;` for each coordinate that moves a contact."""
        for coordinate in self.mechanics.coordinates:
            terms = [(t, c) for c in self.contacts for t in self.terms(c, c.forces, coordinate)]
            if terms:
                text = " + ".join(term for term, _ in terms)
                yield f"  {coordinate}: {text};", terms[0][1].statement

    def terms(self, contact: Contact, names: Sequence[str], coordinate: str) -> list[str]:
        """The generalised force or impulse on a coordinate, by virtual work."""
        found = []
        for part, name in enumerate(names):
            share = self.mechanics.share(contact, part, coordinate)
            if share:
                found.append(name if share == "1" else f"({share})*{name}")
        return found

    def switches(self) -> Iterator[tuple[Phase, int, str, list[str]]]:
        """Frames at which a contact ends or begins: its phase, number, text, and the quantities that jump."""
        drives = self.mechanics.drives
        for contact in self.contacts:
            for phase in contact.phases:
                if phase.frames.first > 0:
                    speeds = [f"{q}'" for q in self.mechanics.coordinates] if phase.landing else []
                    all_forces = [force for c in self.contacts for force in c.forces]
                    yield phase, phase.frames.first, phase.first, [*speeds, *all_forces, *drives]
                if phase.frames.last < self.n:
                    jumping = [c for c in self.contacts if c is not contact or c.sudden]
                    forces = [force for c in jumping for force in c.forces]
                    yield phase, phase.frames.last, phase.last, [*forces, *drives]

    def jumps(self) -> Iterator[Line]:
        """The jumps: motors where a contact ends, forces as well where one begins, velocities at an impact."""
        for phase, _, frame, names in sorted(self.switches(), key=lambda switch: switch[1]):
            if names:
                yield f"  [{frame}]: {', '.join(names)};", phase.statement

    def guesses(self) -> Iterator[Line]:
        """The guess: supporting the weight, flying along a parabola."""
        for contact in self.contacts:
            weight = self.mechanics.weight(contact)
            for phase in contact.phases:
                lines = [f"{p} = {v};" for p, v in self.at(contact, phase) if p in self.mechanics.coordinates]
                if weight and contact.kind != "pin":
                    lines.append(f"{contact.forces[1]} = {weight};")
                if lines:
                    yield f"  {show_header(phase.header)} {' '.join(lines)}", phase.statement
            for number, (before, after) in enumerate(zip(contact.phases, contact.phases[1:]), 1):
                lines = []
                s = f"{contact.name}_s{number}"
                if contact.pose[0] in self.mechanics.coordinates and before.x and after.x:
                    lines.append(f"{contact.pose[0]} = {_between(before.x, after.x, s)};")
                if contact.pose[1] in self.mechanics.coordinates:
                    hop = f"4*{contact.options['half']}*{s}*(1 - {s})" if "half" in contact.options else "0"
                    lines.append(f"{contact.pose[1]} = {_plus(_between(before.z, after.z, s), hop)};")
                if len(contact.pose) > 2 and contact.pose[2] in self.mechanics.coordinates:
                    lines.append(f"{contact.pose[2]} = {_between(before.angle, after.angle, s)};")
                if lines:
                    yield f"  [{before.last}, {after.first}]: {' '.join(lines)}", after.statement

    def at(self, contact: Contact, phase: Phase) -> list[tuple[str, str]]:
        """Each part of the pose that a phase fixes, with its value."""
        values = [phase.x, phase.z, phase.angle][: len(contact.pose)]
        return [(part, value) for part, value in zip(contact.pose, values) if value is not None]

    def statements(self, contact: Contact) -> Iterator[Line]:
        """One contact's constraints, phase by phase and flight by flight."""
        previous: Phase | None = None
        for phase in contact.phases:
            yield from self.flight(contact, previous, phase)
            for line in self.standing(contact, phase):
                yield line, phase.statement
            previous = phase
        yield from self.flight(contact, previous, None)

    def standing(self, contact: Contact, phase: Phase) -> Iterator[str]:
        """The statements of one phase, and of its start."""
        pose = [_whole(part) for part in contact.pose]
        yield f"  {show_header(phase.header)}"
        yield "    " + " ".join(f"{part}'' = 0;" for part in pose)
        for line in _cone(contact, contact.forces):
            yield f"    {line}"
        yield f"  [{phase.first}]:"
        yield "    " + " ".join(f"{part} = {value};" for part, value in self.at(contact, phase))
        if not phase.landing:
            yield "    " + " ".join(f"{part}' = 0;" for part in pose)
        else:
            yield "    " + " ".join(f"after({part}') = 0;" for part in pose)
            limits = ["speed", "speed", "spin"][: len(pose)]
            found = [
                f"-{contact.options[limit]} <= before({part}') <= {contact.options[limit]};"
                for part, limit in zip(pose, limits)
                if limit in contact.options
            ]
            if found:
                yield "    " + " ".join(found)

    def flight(self, contact: Contact, before: Phase | None, after: Phase | None) -> Iterator[Line]:
        """The statements between two phases, or before the first or after the last: no force, and clearance."""
        phase = after or before
        assert phase is not None
        for line in self.flying(contact, before, after):
            yield line, phase.statement

    def flying(self, contact: Contact, before: Phase | None, after: Phase | None) -> Iterator[str]:
        """The lines of a flight."""
        first = 0 if before is None else before.frames.last
        last = self.n if after is None else after.frames.first
        if first == last:
            return
        yield f"  [{before.last if before else 0}, {after.first if after else 'n'}]:"
        yield "    " + " ".join(f"{force} = 0;" for force in contact.forces)
        if contact.kind == "pin":
            return
        _, z, *angle = (_whole(part) for part in contact.pose)
        if before is None or after is None:
            ground = (before or after or contact.phases[0]).z
        else:
            s = f"{contact.name}_s{contact.phases.index(after)}"
            ground = _between(before.z, after.z, s)
            if "clearance" in contact.options:
                ground = _plus(ground, f"16*{contact.options['clearance']}*{s}^2*(1 - {s})^2")
        # Where it lifts off and lands its height is fixed: a bound there would leave no inside.
        low, high = first + (before is not None), last - (after is not None)
        if low > high:
            return
        yield f"  [{f'{before.last} + 1' if before else 0}, {f'{after.first} - 1' if after else 'n'}]:"
        ends = [f"{z} {sign} {contact.options['half']}*sin({angle[0]})" for sign in "-+"] if angle else [z]
        for end in ends:
            yield f"    {end} >= {ground};"

    def prices(self) -> Iterator[Line]:
        """The cost of the landing speed."""
        for contact in self.contacts:
            for phase in contact.phases:
                if phase.landing and "landing" in contact.options:
                    speeds = [f"before({_whole(part)}')^2" for part in contact.pose[:2]]
                    if len(contact.pose) > 2:
                        speeds.append(f"({contact.options['half']}*before({_whole(contact.pose[2])}'))^2")
                    price = f"{contact.options['landing']}*({' + '.join(speeds)})"
                    yield f"  [{phase.first}]: {price};", phase.statement

    def impacts(self) -> Iterator[Line]:
        """The statements of landings: impulses within their cones, and the balance of every momentum."""
        landing: dict[int, list[tuple[Contact, Phase]]] = {}
        for contact in self.contacts:
            for phase in contact.phases:
                if phase.landing:
                    landing.setdefault(phase.frames.first, []).append((contact, phase))
        for frame in sorted(landing):
            first = landing[frame][0][1]
            yield f"  [{first.first}]:", first.statement
            for contact, phase in landing[frame]:
                for line in _cone(contact, contact.impulses(phase)):
                    yield f"    {line}", phase.statement
            for coordinate in self.mechanics.coordinates:
                given = [
                    term
                    for contact, phase in landing[frame]
                    for term in self.terms(contact, contact.impulses(phase), coordinate)
                ]
                terms = " + ".join([f"before(momentum({coordinate}))", *given])
                yield f"    after(momentum({coordinate})) = {terms};", first.statement


def _section(name: str, lines: Iterator[Line]) -> Iterator[Line]:
    found = list(lines)
    if found:
        yield f"{name}:", None
        yield from found


def _whole(text: str) -> str:
    """A text that can be followed by a prime."""
    return text if text.isidentifier() else f"({text})"


def _cone(contact: Contact, names: Sequence[str]) -> Iterator[str]:
    """Text of the cone: no pulling, friction, and for a foot the centre of pressure within its reach."""
    if contact.kind == "pin":
        return
    along, up, *turning = names
    yield f"{up} >= 0;"
    friction = contact.options["friction"]
    yield f"{along} <= {friction}*{up}; -{along} <= {friction}*{up};"
    if turning:
        reach = contact.options.get("reach", contact.options["half"])
        yield f"{turning[0]} <= {reach}*{up}; -{turning[0]} <= {reach}*{up};"


def _plus(first: str, second: str) -> str:
    """The text of a sum."""
    return second if first == "0" else first if second == "0" else f"{first} + {second}"


def _term(text: str) -> str:
    return text if text.replace("*", "").replace(".", "").isalnum() else f"({text})"


def _between(first: str, last: str, share: str) -> str:
    """Text of the interpolation between two values."""
    if first == last:
        return first
    if first == "0":
        return f"{_term(last)}*{share}"
    return f"{first} + ({last} - {_term(first)})*{share}"
