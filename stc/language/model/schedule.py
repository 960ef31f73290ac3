"""The parser of the `contact:` section of a spec with a model: contacts, their places and frames."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stc.language import syntax
from stc.language.context import Context
from stc.language.diagnostics import did_you_mean
from stc.language.model.paths import PathError, Paths, parts_of
from stc.language.model.scope import FORCES, SLIP, ModelScope, path_of
from stc.language.model.surfaces import Surface, floor, surface_of
from stc.mechanism.mechanism import Geom, index_of
from stc.mechanism.tree import Frame, rotation
from stc.mechanism.vectors import Vector, vector
from stc.problem import FrameRange
from stc.records import dataclass, field
from stc.symbolic.expr import Expr, is_literal, num

FloatArray = NDArray[np.float64]

#: A ball of a spec that is at most this far from the model's, in m, is that ball; one that is farther from it than
#: `_NEAR` is another one.
_SAME, _NEAR = 1e-4, 0.02

OPTIONS = ("friction", "reach", "clearance", "landing", "speed", "radius", "soft", "sudden", "slides")
#: Which way a contact slides, along the axis of its surface along which it can move.
WAYS = {"forward": 1, "backward": -1}
#: How high above a straight way a contact is carried in the middle of its flight, in m, where nothing is said.
CLEARANCE = 0.01


@dataclass(slots=True)
class Phase:
    """Frames on which a contact stands.

    Attributes:
        frames: the first and last frame.
        statement: the line of the section.
        surface: the surface on which it stands.
        place: the coordinates along the surface's two axes if they are given, and for a foot its yaw.
        landing: number of the impact with which it begins, from 1; 0 without an impact.
        way: 1 if it slides along the surface's axis, -1 if it slides against it; 0 if it stands.
    """

    frames: FrameRange
    statement: syntax.ContactPlace
    surface: Surface
    place: list[Expr]
    landing: int = 0
    way: int = 0


@dataclass(slots=True)
class Contact:
    """One declared contact.

    Attributes:
        frame: its place in the model; for a sphere the centre.
        radius: radius of a rolling sphere, with its margin; else 0.
        margin: the margin of its geom, as far as it is known.
        half: half lengths of a sole along its own axes.
        free: for a contact under ``free:``, a phase over the whole motion; None for a contact with ranges.
    """

    name: str
    kind: str
    statement: syntax.ContactDeclaration
    path: tuple[str, ...]
    frame: Frame
    radius: float = 0.0
    margin: float = 0.0
    half: tuple[float, float] = (0.0, 0.0)
    options: dict[str, Expr] = field(default_factory=dict)
    phases: list[Phase] = field(default_factory=list)
    free: Phase | None = None

    @property
    def slip(self) -> str:
        """The variable for the sliding speed of a free contact."""
        return f"{self.name}_{SLIP}"

    @property
    def forces(self) -> list[str]:
        """The names of its force variables."""
        return [f"{self.name}_{part}" for part in FORCES[self.kind]]

    @property
    def glides(self) -> bool:
        """Whether it is a point without friction: nothing holds it along its surface."""
        return self.kind == "point" and is_literal(self.options["friction"], 0.0)

    def arm(self, surface: Surface) -> float:
        """The distance from the centre of a ball to where it touches a surface: half way between the two, as in MuJoCo,
        where margins hold them apart.
        """
        return self.radius + 0.5 * (surface.margin - self.margin)

    def down(self, surface: Surface) -> Vector:
        """The way from the centre of a ball to where it touches a surface."""
        return vector([-self.arm(surface) * part for part in surface.normal])

    def touching(self, surface: Surface) -> tuple[str, ...]:
        """The path of the place at which its force acts in the replay."""
        ball = self.radius and self.path[0] == "body"
        return (*self.path[:-1], repr(self.arm(surface))) if ball else self.path

    def slides_on(self, phase: Phase) -> bool:
        """Whether it may move along its surface on the frames of a phase."""
        return bool(phase.way) or self.glides

    def says(self, word: str) -> bool:
        """Whether an option without a value is given."""
        return any(option.name == word for option, _ in self.statement.options)

    def ends(self, frame: int) -> bool:
        """Whether a phase ends at a frame."""
        return any(phase.frames.last == frame for phase in self.phases)

    def impulses(self, which: str) -> list[str]:
        """The names of the parameters of an impact, selected by their suffix."""
        return [
            f"{self.name}_{part.replace('f', 'j').replace('m', 'i')}{which}" for part in FORCES[self.kind]
        ]


def _declarations(tree: syntax.SpecTree) -> list[syntax.ContactDeclaration]:
    return [
        statement
        for block in tree.blocks("contact")
        for statement in block.statements
        if isinstance(statement, syntax.ContactDeclaration)
    ]


class Schedule:
    """The contacts of a spec with a model, and their phases.

    Frames are known from the start; options and places once the definitions are.
    """

    def __init__(self, context: Context, scope: ModelScope, paths: Paths) -> None:
        self.context, self.scope, self.paths = context, scope, paths
        self.contacts: dict[str, Contact] = {}
        for statement in _declarations(context.tree):
            self._declare(statement)
        for block in context.tree.blocks("contact"):
            where = context.range(block)
            for found in block.statements:
                if isinstance(found, syntax.ContactPlace) and where is not None:
                    self._schedule(found, where, block)
        for contact in self.contacts.values():
            self._order(contact)

    # ------------------------------------------------------------------ reading

    def _declare(self, statement: syntax.ContactDeclaration) -> None:
        kind = statement.kind.name
        if kind not in FORCES:
            hint = did_you_mean(kind, FORCES) or "kinds of contact are `point`, `foot` and `pin`"
            self.context.error(statement.kind, f"there is no contact `{kind}`", hint)
            return
        options = self.scope.mechanism.options
        if kind != "pin" and "contact" in options.disabled:
            line = f" ({options.place})" if options.place else ""
            message = (
                f"nothing gives the force of `{statement.name.name}`: a flag of the model's options{line} "
            )
            hint = (
                'take `contact="disable"` or `constraint="disable"` out of the model, or hold on by a `pin`'
            )
            self.context.error(statement, message + "switches contacts off", hint)
            return
        for option, _ in statement.options:
            if option.name not in OPTIONS:
                hint = did_you_mean(option.name, OPTIONS) or f"options are {', '.join(OPTIONS)}"
                self.context.error(option, f"a contact has no option `{option.name}`", hint)
        where = statement.pose[0]
        if kind == "point" and len(statement.pose) == 4:
            where = syntax.Call(statement.kind.start, statement.pose[-1].end, "point", statement.pose)
        if (len(statement.pose) != 1 and not isinstance(where, syntax.Call)) or not isinstance(
            where, syntax.Name | syntax.Call
        ):
            hint = (
                f"name a place of the model, as in `{kind}({'geom.sole' if kind == 'foot' else 'site.FL'})`"
            )
            self.context.error(statement, f"`{kind}` takes one place", hint)
            return
        try:
            found = self._placed(statement, kind, where)
        except PathError as error:
            self.context.error(where, error.message, error.hint)
            return
        self.contacts[statement.name.name] = found

    def _placed(self, statement: syntax.ContactDeclaration, kind: str, where: syntax.Expression) -> Contact:
        """A contact with its place.

        Raises:
            PathError: the place cannot be that of a contact.
        """
        name = statement.name.name
        rolls = next((option for option in statement.options if option[0].name == "radius"), None)
        if isinstance(where, syntax.Call):
            frame, path = self.point(where)
            radius = 0.0 if rolls is None or kind != "point" else self._radius(*rolls)
            path = (*path, repr(radius)) if radius else path
            margin = self._nearest_ball(where, path, radius) if radius else 0.0
            return Contact(name, kind, statement, path, frame, radius, margin)
        assert isinstance(where, syntax.Name)
        of, *rest = parts_of(where.name)
        named = rest[0] if len(rest) == 1 else ""
        index = index_of(self.scope.mechanism.sites, named) if of == "site" else None
        if rolls is not None and index is not None and kind == "point":
            site, radius = self.scope.mechanism.sites[index], self._radius(*rolls)
            body = self.scope.mechanism.bodies[site.body].name
            path = ("body", body, *map(repr, site.pos), repr(radius))
            margin = self._nearest_ball(where, path, radius)
            return Contact(name, kind, statement, path, self.paths.frame(of, named), radius, margin)
        index = index_of(self.scope.mechanism.geoms, named) if of == "geom" else None
        if rolls is not None and (index is None or self.scope.mechanism.geoms[index].kind != "capsule"):
            raise PathError(
                "`radius` is of a ball about a site or a point of a body",
                "write `point(body.NAME, x, y, z)`",
            )
        if of not in ("site", "geom", "body") or len(rest) != 1:
            raise PathError(
                f"`{where.name}` is not a site, geom or body of the model", "write `site.NAME` or `geom.NAME`"
            )
        frame = self.paths.frame(of, rest[0])
        if of != "geom":
            if kind == "foot":
                raise PathError(
                    "`foot` needs a box geom, on whose lower face it stands", "write `foot(geom.NAME)`"
                )
            return Contact(name, kind, statement, (of, rest[0]), frame)
        assert index is not None
        geom = self.scope.mechanism.geoms[index]
        if kind == "foot":
            if geom.kind != "box":
                raise PathError(
                    f"the geom `{rest[0]}` is a {geom.kind}, not a box",
                    "the sole of a foot is the lower face of a box",
                )
            x, y, z = geom.size
            below = vector(_along(geom, -(z + geom.margin)))
            sole = self.scope.dynamics.tree.frame(geom.body, below, geom.quat)
            return Contact(name, kind, statement, (of, rest[0]), sole, half=(x, y))
        if geom.kind != "sphere":
            raise PathError(
                f"the geom `{rest[0]}` is a {geom.kind}, which does not touch at a single point",
                self._instead(geom),
            )
        radius = geom.size[0] + geom.margin
        return Contact(name, kind, statement, (of, rest[0]), frame, radius, geom.margin)

    def _instead(self, geom: Geom) -> str:
        """A hint for a contact at a geom that is not a sphere."""
        body = self.scope.mechanism.bodies[geom.body].name
        if geom.kind == "cylinder" and body:
            x, y, z = geom.pos
            place = f"point({path_of('body', body)}, {x:.6g}, {y:.6g}, {z:.6g})"
            return (
                f"a wheel rolls as a ball about its axle: `{place}, radius = {geom.size[0]:.6g}`. "
                "A site, or a point without a radius, sticks to the floor and does not roll"
            )
        if geom.kind == "capsule" and body:
            ends = [f"`point({path_of('body', body)}, {_written(end)})`" for end in _balls(geom)]
            radius = f"`radius = {geom.size[0] + geom.margin:.6g}`"
            return f"its ends are balls: {' and '.join(ends)}, each with {radius}"
        return "put a site where it touches, or write `point(body.NAME, x, y, z)`"

    def _nearest_ball(self, where: syntax.Expression, path: Sequence[str], radius: float) -> float:
        """The margin of the model's ball that this is, 0 if it is none; a warning if it is close to one, but beside it,
        since MuJoCo's contacts are at that one.
        """
        of, at, mechanism = path[1], np.array(path[2:5], float), self.scope.mechanism
        balls = [
            (float(np.linalg.norm(ball - at)), abs(geom.size[0] + geom.margin - radius), ball, geom)
            for geom in mechanism.geoms
            if mechanism.bodies[geom.body].name == of and (geom.contype or geom.conaffinity)
            for ball in _balls(geom)
        ]
        if not balls:
            return 0.0
        away, wider, ball, geom = min(balls, key=lambda one: max(one[:2]))
        if max(away, wider) >= _NEAR:
            return 0.0
        if max(away, wider) <= _SAME:
            return geom.margin
        message = (
            f"the model touches the floor {1e3 * max(away, wider):.2g} mm beside this ball, with one "
            f"at `point({path_of('body', of)}, {_written(ball)}), radius = {geom.size[0] + geom.margin:.6g}`"
        )
        self.context.diagnostics.warning(message, where.start, where.end)
        return geom.margin

    def point(self, call: syntax.Call) -> tuple[Frame, tuple[str, ...]]:
        """The frame of ``point(body.NAME, x, y, z)``, and the path of its body.

        Raises:
            PathError: the call has another form.
        """
        numbers = [self.context.constants.value_of(part) for part in call.arguments[1:]]
        if None in numbers:
            raise PathError(
                "the place of a contact must be known before the solve", "x, y and z are constants"
            )
        place = [float(x or 0.0) for x in numbers]
        frame, body = self.paths.point(call, [num(x) for x in place])
        return frame, ("body", body, *(repr(x) for x in place))

    def _radius(self, option: syntax.Name, value: syntax.Expression | None) -> float:
        """The radius of a ball about a point of a body.

        Raises:
            PathError: it is not known before solving, or negative.
        """
        number = None if value is None else self.context.constants.value_of(value)
        if number is None or number < 0.0:
            raise PathError(
                "the radius of a ball is a constant, 0 or more", f"write `{option.name} = 0.02`, in m"
            )
        return float(number)

    def free(self) -> list[Contact]:
        """The contacts under ``free:``."""
        return [contact for contact in self.contacts.values() if contact.free is not None]

    def _schedule(self, statement: syntax.ContactPlace, where: FrameRange, block: syntax.Block) -> None:
        contact = self.contacts.get(statement.name.name)
        if contact is None:
            if (
                statement.name.name not in self.context.tree.damaged
                and not self.context.diagnostics.error_count
            ):
                hint = (
                    did_you_mean(statement.name.name, list(self.contacts))
                    or "declare it, as in `FL = point(site.FL);`"
                )
                self.context.error(statement.name, f"there is no contact `{statement.name.name}`", hint)
            return
        if block.header is None and not block.free:
            hint = "write `[a, b]:` before it, or `free:` to leave that to the solver"
            self.context.error(statement, "a contact stands on a range of frames", hint)
            return
        try:
            surface = floor(self.scope) if statement.on is None else surface_of(self.scope, statement.on.name)
        except PathError as error:
            self.context.error(statement.on or statement, error.message, error.hint)
            return
        phase = Phase(where, statement, surface, [], way=self._way(contact, statement, block))
        if not block.free:
            contact.phases.append(phase)
        else:
            self._free(contact, phase)

    def _way(self, contact: Contact, statement: syntax.ContactPlace, block: syntax.Block) -> int:
        """The direction in which a contact slides on a range of frames; 0 if it stands."""
        word = statement.slides
        if word is None:
            return 0
        if block.free:
            hint = f"write `slides` among the options of `{contact.name}`: it may slide then, either way"
            self.context.error(word, f"which way `{contact.name}` slides is left to the solver", hint)
        elif word.name not in WAYS:
            hint = (
                did_you_mean(word.name, WAYS)
                or "along the axis of its surface it slides `forward`, or `backward`"
            )
            self.context.error(word, f"nothing slides `{word.name}`", hint)
        elif contact.kind != "point":
            hint = "let the corners of its sole slide, each as a `point(body.NAME, x, y, z)`"
            self.context.error(word, f"a {contact.kind} stands, and cannot slide", hint)
        elif statement.at:
            self.context.error(statement, f"`{contact.name}` slides, and has no place", "leave out `at`")
        return WAYS.get(word.name, 0)

    def _free(self, contact: Contact, phase: Phase) -> None:
        """Let the solver decide when a contact stands."""
        statement, name = phase.statement, contact.name
        if contact.free is not None:
            self.context.error(statement, f"`{name}` is free already", "one line is enough")
        elif contact.kind == "pin":
            self.context.error(statement, "a pin cannot be free", "it is held over a range of frames")
        elif contact.kind == "foot" and contact.says("slides"):
            hint = "let the corners of its sole slide, each as a `point(body.NAME, x, y, z)`"
            self.context.error(contact.statement, "a foot stands, and cannot slide", hint)
        elif statement.at:
            hint = "where it comes down is the solver's choice too; a range of frames can have a place"
            self.context.error(statement, f"`{name}` is free, and has no place", hint)
        else:
            contact.free = phase

    def _order(self, contact: Contact) -> None:
        contact.phases.sort(key=lambda phase: phase.frames.first)
        standing = [*contact.phases, *filter(None, [contact.free])]
        for phase in standing:
            if phase.surface.frame is not None and contact.kind == "pin":
                message, hint = "a pin holds on to the world", "let a point or a foot stand there"
                self.context.error(phase.statement, message, hint)
            elif (phase.surface.frame or standing[0].surface.frame) and phase.surface != standing[0].surface:
                message = f"`{contact.name}` stands on what moves, and on another surface as well"
                self.context.error(phase.statement, message, "declare a contact for each of the two")
        if contact.free is not None and contact.phases:
            message = f"`{contact.name}` is free, and stands on {contact.phases[0].frames} as well"
            hint = "leave all of its frames to the solver, or none"
            self.context.error(contact.phases[0].statement, message, hint)
        for before, after in pairwise(contact.phases):
            joins = before.way != after.way and before.surface == after.surface
            if after.frames.first < before.frames.last + (not joins):
                message = f"`{contact.name}` stands already on {before.frames}"
                hint = (
                    f"two ranges in which it stands may not share a frame: write one for both, from frame "
                    f"{before.frames.first} to {max(before.frames.last, after.frames.last)}"
                )
                self.context.error(after.statement, message, hint)
        landed = 0
        touched = 0
        for phase in contact.phases:
            if phase.frames.first > touched and not contact.says("soft"):
                landed += 1
                phase.landing = landed
            touched = phase.frames.last

    def landings(self) -> list[str]:
        """The names of all impulses, parameters of the problem."""
        return [
            name for frame in self.impact_frames() for _, _, names in self.struck(frame) for name in names
        ]

    def impact_frames(self) -> list[int]:
        """The frames at which something lands."""
        return sorted({p.frames.first for c in self.contacts.values() for p in c.phases if p.landing})

    def struck(self, frame: int) -> list[tuple[Contact, Phase, list[str]]]:
        """Everything that lands at a frame or already stands, with the parameters of its impulses."""
        impact = self.impact_frames().index(frame) + 1
        found = []
        for contact in self.contacts.values():
            for phase in contact.phases:
                if phase.landing and phase.frames.first == frame:
                    found.append((contact, phase, contact.impulses(str(phase.landing))))
                elif phase.frames.first < frame < phase.frames.last:
                    found.append((contact, phase, contact.impulses(f"_impact{impact}")))
        return found

    def complete(self) -> None:
        """Evaluate options and places, which may use definitions."""
        for contact in self.contacts.values():
            for option, value in contact.statement.options:
                if value is not None:
                    contact.options[option.name] = self._built(value)
            contact.options.setdefault("clearance", num(CLEARANCE))
            if "friction" not in contact.options:
                contact.options["friction"] = num(self._friction(contact))
            for phase in contact.phases:
                most = {"point": 2, "foot": 3, "pin": 3}[contact.kind]
                if len(phase.statement.at) > most:
                    self.context.error(
                        phase.statement, f"the place of `{contact.name}` has at most {most} numbers"
                    )
                phase.place = [self._built(part) for part in phase.statement.at[:most]]

    def _built(self, node: syntax.Expression) -> Expr:
        self.context.builder.poisoned = False
        return self.context.builder.build(node)

    def _friction(self, contact: Contact) -> float:
        """The friction of the pair of geoms, combined as in MuJoCo; the least of them for several surfaces."""
        index = index_of(self.scope.mechanism.geoms, contact.path[1]) if contact.path[0] == "geom" else None
        geom = None if index is None else self.scope.mechanism.geoms[index]
        standing = contact.phases if contact.free is None else [contact.free]
        return min((phase.surface.friction_with(geom) for phase in standing), default=1.0)


def _along(geom: Geom, distance: float) -> FloatArray:
    """The place on a geom's z axis that is so far from its middle, in its body's frame."""
    return np.array(geom.pos) + distance * rotation(geom.quat)[:, 2]


def _balls(geom: Geom) -> list[FloatArray]:
    """The centres of the balls with which a geom touches, in its body's frame."""
    ends = {"sphere": [0.0], "capsule": [geom.size[1], -geom.size[1]]}.get(geom.kind, [])
    return [_along(geom, end) for end in ends]


def _written(at: FloatArray) -> str:
    """A place in the language, without the rounding errors of turns."""
    return ", ".join(f"{v:.6g}" if abs(v) > 1e-9 else "0" for v in at)


__all__ = ["Contact", "Phase", "Schedule"]
