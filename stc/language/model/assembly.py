"""A model's part of a problem: its equations, bounds, poses and contacts, without rows that others imply."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np

from stc.language import syntax
from stc.language.context import Context
from stc.language.model.contact import Contact, Contacts, Phase
from stc.language.model.independence import Matrix, Point, independent, pins_to_keep, stacked
from stc.language.model.poses import Poses, Stated, Values
from stc.language.model.start import way_between
from stc.language.model.scope import ModelScope
from stc.language.model.statements import bounds, equations_of_motion, replay_lines
from stc.problem import ConstantRef, FrameRange, Guess, Jump, ObjectiveTerm, Relation, ReplayChannel
from stc.records import dataclass, field
from stc.symbolic.expr import ZERO, Expr, evaluate

#: A pinned pose that has a contact farther off its surface than this, in m, is a mistake.
OFF_SURFACE = 1e-3


@dataclass(slots=True)
class Pinned:
    """What poses say of one frame: rows with the statement that each is of, and a pose's values where there is one."""

    rows: list[tuple[Stated, syntax.Pose]] = field(default_factory=list)
    values: Values | None = None
    statement: syntax.Pose | None = None

    def dofs(self, velocity: bool) -> list[int]:
        """The degrees of freedom whose place, or velocity, is pinned."""
        return sorted({row.dof for row, _ in self.rows if row.velocity == velocity})


class ModelStatements:
    """What a model brings to a problem under way."""

    def __init__(self, context: Context, scope: ModelScope) -> None:
        assert context.builder.paths is not None
        self.context, self.scope, self.paths = context, scope, context.builder.paths
        self.contacts = Contacts(context, scope, self.paths)
        self.pinned: dict[int, Pinned] = {}
        self.periodic: list[tuple[Stated, syntax.Pose, FrameRange]] = []
        self.poses: Poses | None = None

    def jumps(self) -> list[Jump]:
        """What contacts let jump."""
        return self.contacts.jumps()

    def complete(self) -> None:
        """Once the definitions are known: options of contacts, poses."""
        self.contacts.complete()
        self.poses = Poses(self.context, self.scope)

    def pose(self, statement: syntax.Pose, where: FrameRange) -> list[Relation]:
        """The rows of a pose under `constraints:`; those of a single frame wait for :meth:`relations`."""
        assert self.poses is not None
        if statement.base.name == "periodic":
            rows = self.poses.rows(statement) or []
            self.periodic += [(row, statement, where) for row in rows]
            return []
        if where.first != where.last:
            return self.poses.relations(statement, where)
        pinned = self.pinned.setdefault(where.first, Pinned())
        for row in self.poses.rows(statement) or []:
            pinned.rows.append((row, statement))
        if statement.base.name != "rest":
            pinned.values = self.poses.values(statement) or pinned.values
            pinned.statement = statement
        return []

    def relations(self, forces: Mapping[int, list[Expr]]) -> Iterator[Relation]:
        """Everything that the model states; ``forces`` are what the spec adds, by degree of freedom."""
        context, contacts = self.context, self.contacts
        yield from equations_of_motion(context, self.scope, contacts.wrenches(), dict(forces))
        yield from bounds(context, self.scope)
        yield from contacts.relations()
        yield from contacts.impacts()
        independence = _Independence(self)
        yield from independence.standing()
        yield from independence.anchors()
        yield from independence.pins()
        for row, statement, _ in self.periodic:
            yield Relation(row.body, ZERO, ZERO, FrameRange(0, 0), context.span(statement), row.text)

    def objective(self) -> list[ObjectiveTerm]:
        """What the speed of landings costs."""
        found = []
        for body, phase in self.contacts.prices():
            where = FrameRange(phase.frames.first, phase.frames.first)
            span = self.context.span(phase.statement)
            found.append(ObjectiveTerm(body, False, where, span, "landing"))
        return found

    def guesses(self) -> Iterator[Guess]:
        """From one pinned pose to the next, thrown up where nothing stands; contacts that bear the weight."""
        known = {frame: pinned.values for frame, pinned in self.pinned.items() if pinned.values is not None}
        yield from way_between(self.context, self.scope, known, self.contacts.flights())
        yield from self.contacts.guesses()

    def replay(self) -> list[ReplayChannel]:
        """The lines of the replay that the model and its contacts bring."""
        return [*replay_lines(self.context, self.scope), *self.contacts.replay_lines()]


class _Independence:
    """Leaves out rows of contacts and poses that others imply."""

    def __init__(self, statements: ModelStatements) -> None:
        self.s = statements
        self.context, self.scope, self.contacts = statements.context, statements.scope, statements.contacts
        self.width = statements.scope.mechanism.n_freedoms
        self.numbers = {k: v for k, v in self.context.constants.values.items() if v is not None}
        self._points: dict[object, Point] = {}
        self._generic: Point | None = None

    def _point(self, values: Values) -> Point:
        known = {ConstantRef(name): value for name, value in self.numbers.items()}
        numbers = {name: float(evaluate(body, known)) for name, body in values.items()}
        return Point(self.scope, numbers, self.numbers)

    @property
    def generic(self) -> Point:
        """A configuration at which nothing is aligned by chance."""
        if self._generic is None:
            rng = np.random.default_rng(1)
            values: dict[str, float] = {}
            for one in self.scope.coordinates:
                reference = one.joint.reference
                for name, value in zip(one.positions, reference):
                    values[name] = value + float(rng.normal(scale=0.3))
                if one.rotation is not None:
                    q = np.array(reference[len(one.positions) :]) + rng.normal(size=4, scale=0.1)
                    values.update(zip(one.rotation.quaternion, (q / np.linalg.norm(q)).tolist()))
            self._generic = Point(self.scope, values, self.numbers)
        return self._generic

    def _at(self, frame: int) -> Point:
        pinned = self.s.pinned.get(frame)
        if pinned is None or pinned.values is None:
            return self.generic
        if frame not in self._points:
            self._points[frame] = self._point(pinned.values)
        return self._points[frame]

    def _unit(self, dofs: Sequence[int]) -> Matrix:
        return np.eye(self.width)[list(dofs)]

    def _standing(self, frame: int, begun: bool) -> list[tuple[Contact, Phase]]:
        """Contacts that stand at a frame, the earliest first; ``begun``: before it."""
        found = [
            (contact, phase)
            for contact in self.contacts.contacts.values()
            for phase in contact.phases
            if phase.frames.first <= frame <= phase.frames.last
            and not (begun and phase.frames.first == frame)
        ]
        return sorted(found, key=lambda one: one[1].frames.first)

    # ----------------------------------------------------------- accelerations

    def standing(self) -> Iterator[Relation]:
        """Zero accelerations of standing contacts; of several on one rigid body those that say different things."""
        known: dict[tuple[int, ...], dict[int, list[int]]] = {}
        frames: dict[int, list[tuple[int, tuple[int, ...]]]] = {}
        phases = [(c, p) for c in self.contacts.contacts.values() for p in c.phases]
        for frame in range(self.context.n + 1):
            standing = self._standing(frame, begun=False)
            key = tuple([id(phase) for _, phase in standing])
            if key not in known:
                known[key] = self._kept(standing)
            for _, phase in standing:
                frames.setdefault(id(phase), []).append((frame, tuple(known[key][id(phase)])))
        for contact, phase in phases:
            bodies = self.contacts.accelerations(contact, phase)
            span = self.context.span(phase.statement)
            for rows, run in groupby(frames.get(id(phase), []), key=lambda one: one[1]):
                numbers = [frame for frame, _ in run]
                where = FrameRange(numbers[0], numbers[-1])
                for index in rows:
                    text = f"{contact.name} stands: its acceleration is zero"
                    yield Relation(bodies[index], ZERO, ZERO, where, span, text)

    def _kept(self, standing: Sequence[tuple[Contact, Phase]]) -> dict[int, list[int]]:
        given = stacked([], self.width)
        found = {}
        for contact, phase in standing:
            rows = self.generic.jacobian(self.contacts.velocities(contact, phase))
            found[id(phase)] = kept = independent(rows, given)
            given = np.vstack([given, rows[kept]])
        return found

    # ------------------------------------------------------ places and velocities

    def anchors(self) -> Iterator[Relation]:
        """What fixes places and velocities where phases begin, beside what is pinned or stands there already."""
        periodic = bool(self.s.periodic)
        placed: dict[int, Matrix] = {}
        moving: dict[int, Matrix] = {}
        for contact, phase, positions, velocities in self.contacts.anchors():
            frame = phase.frames.first
            if periodic and frame == 0 and self._stands_at_end(contact):
                continue  # the last frame's phase has fixed them
            point, span = self._at(frame), self.context.span(phase.statement)
            where = FrameRange(frame, frame)
            if frame not in placed:
                begun = [self._velocity_rows(one, point) for one in self._standing(frame, begun=True)]
                pinned = self.s.pinned.get(frame, Pinned())
                placed[frame] = stacked([*begun, self._unit(pinned.dofs(False))], self.width)
                moving[frame] = stacked([*begun, self._unit(pinned.dofs(True))], self.width)
            rates = [self.context.builder.derivative(body, 1) for body in positions]
            for bodies, rows, given, text in (
                (positions, point.jacobian(rates), placed, "stands at its place"),
                (velocities, point.jacobian(velocities), moving, "stands still"),
            ):
                kept = independent(rows, given[frame])
                for index in kept:
                    yield Relation(bodies[index], ZERO, ZERO, where, span, f"{contact.name} {text}")
                given[frame] = np.vstack([given[frame], rows[kept]])
            self._check_place(contact, phase, positions, point)

    def _stands_at_end(self, contact: Contact) -> bool:
        return any(phase.frames.last == self.context.n and phase.frames.first > 0 for phase in contact.phases)

    def _velocity_rows(self, one: tuple[Contact, Phase], point: Point) -> Matrix:
        return point.jacobian(self.contacts.velocities(*one))

    def _check_place(self, contact: Contact, phase: Phase, positions: Sequence[Expr], point: Point) -> None:
        """A pinned pose has its contacts on their surfaces."""
        pinned = self.s.pinned.get(phase.frames.first)
        if pinned is None or pinned.statement is None or pinned.values is None:
            return
        off = point.numbers(positions[:1])[0] if contact.kind != "pin" else 0.0
        if abs(off) > OFF_SURFACE:
            where = "above" if off > 0 else "below"
            message = f"`{contact.name}` is {abs(off):.4g} m {where} the {phase.surface.name} in this pose"
            hint = f"let it stand at another frame, or write `{pinned.statement.base.name} grounded`"
            self.context.error(pinned.statement, message, hint)

    # ----------------------------------------------------------------- poses

    def pins(self) -> Iterator[Relation]:
        """The rows of pinned poses, but for those that standing contacts imply."""
        for frame, pinned in sorted(self.s.pinned.items()):
            standing = self._standing(frame, begun=True)
            point = self._at(frame)
            held = stacked([self._held(one, point) for one in standing], self.width)
            still = stacked([self._velocity_rows(one, point) for one in standing], self.width)
            keep = {
                False: set(pins_to_keep(held, pinned.dofs(False))),
                True: set(pins_to_keep(still, pinned.dofs(True))),
            }
            for row, statement in pinned.rows:
                if row.dof in keep[row.velocity]:
                    where = FrameRange(frame, frame)
                    yield Relation(row.body, ZERO, ZERO, where, self.context.span(statement), row.text)

    def _held(self, one: tuple[Contact, Phase], point: Point) -> Matrix:
        """How the places that a contact has held since its phase began change with the coordinates."""
        contact, phase = one
        begin = self.s.pinned.get(phase.frames.first)
        if contact.kind == "pin" or (begin is not None and begin.values is not None):
            return self._velocity_rows(one, point)
        rates = [self.context.builder.derivative(body, 1) for body in self.contacts.positions(contact, phase)]
        return point.jacobian(rates)
