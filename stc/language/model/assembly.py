"""A model's part of a problem: its equations, bounds, poses and contacts, without rows that others imply."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np

from stc.language import syntax
from stc.language.context import Context
from stc.language.model.contact import Contacts
from stc.language.model.holdings import Equalities, Holding
from stc.language.model.independence import Matrix, Point, independent, pins_to_keep, stacked
from stc.language.model.mirror import other_side
from stc.language.model.poses import REFERENCE, Poses, Stated, Values
from stc.language.model.scope import ModelScope
from stc.language.model.start import fixed_coordinates, way_between
from stc.language.model.statements import (
    activations,
    bounds,
    equations_of_motion,
    own_forces,
    replay_lines,
)
from stc.problem import (
    FrameRange,
    Guess,
    Jump,
    ObjectiveTerm,
    ParameterRef,
    Relation,
    ReplayChannel,
    VariableRef,
)
from stc.records import dataclass, field
from stc.symbolic.expr import ZERO, Expr, sym

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
        self.equalities = Equalities(context, scope)
        self.pinned: dict[int, Pinned] = {}
        self.periodic: list[tuple[Stated, syntax.Pose]] = []
        self.guessed: dict[int, Values] = {}
        self.poses: Poses | None = None

    def jumps(self) -> list[Jump]:
        """What contacts let jump."""
        return self.contacts.jumps()

    def complete(self) -> None:
        """Once the definitions are known: options of contacts, poses."""
        self.contacts.complete()
        self.poses = Poses(self.context, self.scope, self.contacts.heights)

    def pose(self, statement: syntax.Pose, where: FrameRange) -> list[Relation]:
        """The rows of a pose under `constraints:`; those of a single frame wait for :meth:`relations`."""
        assert self.poses is not None
        if statement.base.name == "periodic":
            rows = self.poses.rows(statement) or []
            self.periodic += [(row, statement) for row in rows]
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

    def relations(self, given: Mapping[str, list[Expr]]) -> Iterator[Relation]:
        """Everything that the model states; ``given`` are forces that the spec adds, by the coordinate's variable."""
        context, contacts = self.context, self.contacts
        forces = self.equalities.forces()
        forces.wrenches += contacts.wrenches()
        for dof, force in own_forces(self.scope, given):
            forces.push(dof, force)
        yield from equations_of_motion(context, self.scope, forces)
        yield from activations(context, self.scope)
        yield from bounds(context, self.scope)
        yield from contacts.relations()
        yield from contacts.impacts()
        independence = _Independence(self)
        yield from independence.idle_forces()
        yield from independence.standing()
        yield from independence.anchors()
        yield from independence.pins()
        for row, statement in self.periodic:
            yield Relation(row.body, ZERO, ZERO, FrameRange(0, 0), context.span(statement), row.text)

    def objective(self) -> list[ObjectiveTerm]:
        """What the speed of landings costs."""
        found = []
        for body, phase in self.contacts.prices():
            where = FrameRange(phase.frames.first, phase.frames.first)
            span = self.context.span(phase.statement)
            found.append(ObjectiveTerm(body, False, where, span, "landing"))
        return found

    def guess(self, pose: syntax.Pose, where: FrameRange) -> list[Guess]:
        """A pose under `guess:`: as it stands on a range; at a single frame the way between poses leads through it."""
        assert self.poses is not None
        if where.first != where.last:
            return self.poses.guesses(pose, where)
        values = self.poses.values(pose)
        if values is not None:
            self.guessed[where.first] = values
        return []

    def guesses(self, relations: Sequence[Relation]) -> Iterator[Guess]:
        """From pose to pose, pinned or guessed, thrown up where nothing stands; contacts that bear the weight.

        Args:
            relations: those of the spec, which may fix single coordinates at a frame.
        """
        pinned = {frame: one.values for frame, one in self.pinned.items() if one.values is not None}
        known = self.guessed | pinned
        assert self.poses is not None
        for _, statement in self.periodic[:1]:
            known.setdefault(0, self.poses.usual())
            known.setdefault(self.context.n, self.poses.repeated(known[0], statement))
        known = known or {0: self.poses.named[REFERENCE]}
        for frame, values in fixed_coordinates(self.scope, relations).items():
            known[frame] = values | known.get(frame, {})
        yield from way_between(self.context, self.scope, known, self.contacts.flights())
        yield from self.contacts.guesses()

    def replay(self) -> list[ReplayChannel]:
        """The lines of the replay that the model and its contacts bring."""
        return [*replay_lines(self.context, self.scope), *self.contacts.replay_lines()]


class _Independence:
    """Leaves out rows of contacts, equality constraints and poses that others imply."""

    def __init__(self, statements: ModelStatements) -> None:
        self.s = statements
        self.context, self.scope = statements.context, statements.scope
        self.holdings = [*statements.equalities.holdings(), *statements.contacts.holdings()]
        self.width = statements.scope.mechanism.n_freedoms
        self.numbers = {k: v for k, v in self.context.constants.values.items() if v is not None}
        self._points: dict[int, Point] = {}
        self._generic: Point | None = None

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
        """The pinned pose of a frame, or the generic one."""
        pinned = self.s.pinned.get(frame)
        if pinned is None or pinned.values is None:
            return self.generic
        if frame not in self._points:
            numbers = {name: self.context.number(body) for name, body in pinned.values.items()}
            self._points[frame] = Point(self.scope, numbers, self.numbers)
        return self._points[frame]

    def _unit(self, dofs: Sequence[int]) -> Matrix:
        return np.eye(self.width)[list(dofs)]

    def _holding(self, frame: int, begun: bool) -> list[Holding]:
        """What holds at a frame, the earliest first; ``begun``: what has begun before it."""
        found = [
            one
            for one in self.holdings
            if one.frames.first <= frame <= one.frames.last and not (begun and one.frames.first == frame)
        ]
        return sorted(found, key=lambda one: one.frames.first)

    def idle_forces(self) -> Iterator[Relation]:
        """Parts of contact forces that can do nothing, such as those across the plane of a planar model, are zero."""
        for contact, parts in self.s.contacts.components():
            rows = self.generic.jacobian([rate for _, rate in parts])
            for (name, _), row in zip(parts, rows, strict=True):
                if not row.any():
                    span = self.context.span(contact.statement)
                    yield Relation(
                        sym(VariableRef(name)),
                        ZERO,
                        ZERO,
                        self.context.everywhere,
                        span,
                        f"{name} does nothing",
                    )
                    for phase in contact.phases:
                        if phase.landing:
                            index = contact.forces.index(name)
                            impulse = sym(ParameterRef(contact.impulses(phase)[index]))
                            yield Relation(
                                impulse, ZERO, ZERO, FrameRange(0, 0), span, f"{name} does nothing"
                            )

    # ----------------------------------------------------------- accelerations

    def standing(self) -> Iterator[Relation]:
        """Zero accelerations of what holds; of several on one rigid body those that say different things."""
        known: dict[tuple[int, ...], list[list[int]]] = {}
        frames: dict[int, list[tuple[int, list[int]]]] = {id(one): [] for one in self.holdings}
        for frame in range(self.context.n + 1):
            holding = self._holding(frame, begun=False)
            key = tuple([id(one) for one in holding])
            if key not in known:
                known[key] = self._kept(holding)
            for one, kept in zip(holding, known[key], strict=True):
                frames[id(one)].append((frame, kept))
        for one in self.holdings:
            for rows, run in groupby(frames[id(one)], key=lambda part: part[1]):
                numbers = [frame for frame, _ in run]
                where = FrameRange(numbers[0], numbers[-1])
                for index in rows:
                    text = f"{one.name} holds: its acceleration is zero"
                    yield Relation(one.accelerations[index], ZERO, ZERO, where, one.span, text)

    def _kept(self, holding: Sequence[Holding]) -> list[list[int]]:
        given = stacked([], self.width)
        found = []
        for one in holding:
            rows = self.generic.jacobian(one.velocities)
            kept = independent(rows, given)
            given = np.vstack([given, rows[kept]])
            found.append(kept)
        return found

    # ------------------------------------------------------ places and velocities

    def anchors(self) -> Iterator[Relation]:
        """What fixes places and velocities where something begins to hold, beside what is pinned or holds already."""
        placed: dict[int, Matrix] = {}
        moving: dict[int, Matrix] = {}
        for one in self.holdings:
            frame = one.frames.first
            if self.s.periodic and frame == 0 and self._fixed_at_end(one):
                continue  # what has fixed it there holds here, too
            point, where = self._at(frame), FrameRange(frame, frame)
            if frame not in placed:
                begun = [point.jacobian(other.velocities) for other in self._holding(frame, begun=True)]
                pinned = self.s.pinned.get(frame, Pinned())
                placed[frame] = stacked([*begun, self._unit(pinned.dofs(False))], self.width)
                moving[frame] = stacked([*begun, self._unit(pinned.dofs(True))], self.width)
            for bodies, rows, given, text in (
                (one.places, self._rates(one, point), placed, "holds its place"),
                (one.starts, point.jacobian(one.starts), moving, "holds still"),
            ):
                kept = independent(rows, given[frame])
                for index in kept:
                    yield Relation(bodies[index], ZERO, ZERO, where, one.span, f"{one.name} {text}")
                given[frame] = np.vstack([given[frame], rows[kept]])
            self._check_place(one, point)

    def _rates(self, one: Holding, point: Point) -> Matrix:
        """How the places that are held change with the coordinates."""
        return point.jacobian([self.context.builder.derivative(body, 1) for body in one.places])

    def _fixed_at_end(self, one: Holding) -> bool:
        """Whether what the first frame repeats is fixed where a later phase begins.

        A phase that lasts throughout is followed to the one that it repeats in turn, mirrored on the other side.
        """
        mirrored = any(statement.mirrored for _, statement in self.s.periodic)
        seen: list[str] = []
        name = one.name
        while name not in seen:
            seen.append(name)
            if mirrored:
                name = other_side(name, {other.name for other in self.holdings})
            last = [o for o in self.holdings if o.name == name and o.frames.last == self.context.n]
            if not last:
                return False
            if last[0].frames.first > 0:
                return True
        return False

    def _check_place(self, one: Holding, point: Point) -> None:
        """A pinned pose has its contacts on their surfaces."""
        pinned = self.s.pinned.get(one.frames.first)
        if one.height is None or pinned is None or pinned.statement is None or pinned.values is None:
            return
        off = float(point.numbers([one.height])[0])
        if abs(off) > OFF_SURFACE:
            where = "above" if off > 0 else "below"
            message = f"`{one.name}` is {abs(off):.4g} m {where} the {one.surface} in this pose"
            hint = f"let it stand at another frame, or write `{pinned.statement.base.name} grounded`"
            self.context.error(pinned.statement, message, hint)

    # ----------------------------------------------------------------- poses

    def pins(self) -> Iterator[Relation]:
        """The rows of pinned poses, but for those that follow from what has been held since before."""
        for frame, pinned in sorted(self.s.pinned.items()):
            holding = self._holding(frame, begun=True)
            point = self._at(frame)
            for one in holding if pinned.statement is not None else ():
                self._check_held(one, frame, pinned.statement)
            held = stacked([self._held(one, point) for one in holding], self.width)
            still = stacked([point.jacobian(one.velocities) for one in holding], self.width)
            keep = {
                False: set(pins_to_keep(held, pinned.dofs(False))),
                True: set(pins_to_keep(still, pinned.dofs(True))),
            }
            for row, statement in pinned.rows:
                if row.dof in keep[row.velocity]:
                    where = FrameRange(frame, frame)
                    yield Relation(row.body, ZERO, ZERO, where, self.context.span(statement), row.text)

    def _check_held(self, one: Holding, frame: int, statement: syntax.Pose | None) -> None:
        """A pinned pose has what is held where it has been held since before."""
        begin, point = self.s.pinned.get(one.frames.first), self._at(frame)
        off = np.abs(point.numbers(one.places)).max(initial=0.0)
        if one.at and begin is not None and begin.values is not None:
            moved = point.numbers(one.at) - self._at(one.frames.first).numbers(one.at)
            off = max(off, float(np.linalg.norm(moved)))
        if off > OFF_SURFACE and statement is not None:
            since = f"where it holds since frame {one.frames.first}"
            message = f"`{one.name}` is {off:.4g} off its place in this pose, {since}"
            hint = "let it stand on fewer frames, or state a pose that it fits"
            self.context.error(statement, message, hint)

    def _held(self, one: Holding, point: Point) -> Matrix:
        """How the places that have been held since something began change with the coordinates."""
        begin = self.s.pinned.get(one.frames.first)
        if one.whole or (begin is not None and begin.values is not None):
            return point.jacobian(one.velocities)
        return self._rates(one, point)
