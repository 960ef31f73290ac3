"""Scheduled contact in three dimensions: the statements of the `contact:` section of a spec with a model.

A contact is a place of the model (``point(site.FL)``, ``foot(geom.sole)``, ``pin(site.grip)``) that stands on a surface
over some ranges of frames.  While it stands its acceleration is zero, and its force, a variable along the world's axes,
is within its cone: for a point the cone of Coulomb's friction; for the sole of a foot the cone of wrenches that a
rectangle can transmit, with the centre of pressure inside and friction against turning (Caron, Pham and Nakamura 2015).
While it does not stand it has no force, and a clearance from the surface.  At a landing with speed, an impulse within
the same cone stops it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from stc.language import syntax
from stc.language.model.cones import sole_cone
from stc.language.model.holdings import Equalities, Holding, Place, one_frame_on, unchanged
from stc.language.model.mirror import other_side
from stc.language.model.schedule import Contact, Phase, Schedule
from stc.language.model.scope import FORCES
from stc.language.model.surfaces import Surface, floor
from stc.mechanism.forces import Wrench
from stc.mechanism.impact import impact
from stc.mechanism.vectors import ORIGIN, Vector, cross, dot, minus, negative, plus, vector
from stc.problem import (
    FrameRange,
    Guess,
    IndexRef,
    Jump,
    ParameterRef,
    Relation,
    ReplayChannel,
    VariableRef,
)
from stc.symbolic.expr import ONE, ZERO, Expr, call, div, mul, neg, num, sub, sum_of, sym
from stc.time_derivatives import one_sided

#: Share of the weight by which friction may exceed its cone where a contact bears nothing.
NEGLIGIBLE = 1e-4

#: The normals of the sides of the pyramid in which the impulses of points are.  Four give up more of the friction, and
#: with 16 solves take longer (docs/ablation.md).
PYRAMID = tuple((math.cos(math.pi * k / 4), math.sin(math.pi * k / 4)) for k in range(8))


class Contacts(Schedule):
    """The statements of all contacts of a spec with a model: forces, constraints, guesses and replay lines.

    Attributes:
        periodic: the statement that relates the last frame to the first, if there is one.
    """

    periodic: syntax.Pose | None = None

    # ------------------------------------------------------------------- forces

    def wrenches(self) -> list[Wrench]:
        """The forces of all contacts on the model."""
        return [
            wrench
            for contact in self.contacts.values()
            for wrench in self._wrench(contact, _variables(contact.forces))
        ]

    def _wrench(
        self, contact: Contact, parts: Sequence[Expr], surface: Surface | None = None
    ) -> Iterator[Wrench]:
        """The wrench of force variables at a contact's place."""
        force: Vector = (parts[0], parts[1], parts[2])
        torque: Vector = (parts[3], parts[4], parts[5]) if len(parts) > 3 else ORIGIN
        surface = surface or self.surface(contact)
        if contact.radius:
            torque = plus(torque, cross(contact.down(surface), force))
        yield Wrench(contact.frame, force, torque)
        if surface.frame is not None:  # It does not turn: only the force does anything to its body.
            yield Wrench(surface.frame, negative(force))

    def surface(self, contact: Contact) -> Surface:
        """The surface on which a contact stands first; the floor for one that never stands."""
        standing = contact.free or next(iter(contact.phases), None)
        return standing.surface if standing else floor(self.scope)

    def _seen(self, contact: Contact, surface: Surface) -> tuple[Vector, Vector, Vector]:
        """Position, velocity and acceleration of a contact's place, as seen from a surface."""
        place = self.paths.place(contact.frame)
        if surface.frame is None:
            return place
        at, velocity, acceleration = [
            minus(own, other) for own, other in zip(place, self.paths.place(surface.frame), strict=True)
        ]
        for lower, higher in ((at, velocity), (velocity, acceleration)):
            for e, rate in zip(lower, higher, strict=True):
                if e.args:
                    self.paths.derivatives.setdefault(e, rate)
        return at, velocity, acceleration

    def components(self) -> Iterator[tuple[Contact, list[tuple[str, Expr]]]]:
        """The force variables of every contact, each with the velocity conjugate to it."""
        for contact in self.contacts.values():
            surface = self.surface(contact)
            velocity = self._seen(contact, surface)[1]
            turning = self.paths.turning(contact.frame)[0]
            if contact.radius:
                velocity = plus(velocity, cross(turning, contact.down(surface)))
            rates = [*velocity, *turning][: len(contact.forces)]
            yield contact, list(zip(contact.forces, rates, strict=True))

    def jumps(self) -> list[Jump]:
        """The jumps: controls where a contact ends or begins, the other contacts' forces too, velocities at an
        impact.
        """
        found: dict[tuple[int, str, int], Jump] = {}
        everything = [force for contact in self.contacts.values() for force in contact.forces]
        for contact in self.contacts.values():
            for phase in contact.phases:
                span = self.context.span(phase.statement)
                first, last = phase.frames.first, phase.frames.last
                names = [(name, 0) for name in self.scope.controls]
                if first > 0:
                    jumping = [*names, *((force, 0) for force in everything)]
                    if phase.landing:
                        jumping += self._speeds()
                    for name, order in jumping:
                        found.setdefault((first, name, order), Jump(first, name, order, span))
                if last < self.context.n:
                    # Pressure and friction fade until a foot lifts off; what holds a pin can let go at once.
                    others = [
                        force
                        for one in self.contacts.values()
                        if one.kind == "pin" or one.says("sudden") or not one.ends(last)
                        for force in one.forces
                    ]
                    for name, order in [*names, *((force, 0) for force in others)]:
                        found.setdefault((last, name, order), Jump(last, name, order, span))
        return list(found.values())

    def _speeds(self) -> Iterator[tuple[str, int]]:
        for one in self.scope.coordinates:
            yield from ((name, 1) for name in one.positions)
            if one.rotation is not None:
                yield from ((name, 0) for name in one.rotation.velocity)

    # --------------------------------------------------------------- statements

    def relations(self) -> Iterator[Relation]:
        """Cones, flights and landings; :mod:`stc.language.model.assembly` has the constraints of standing contacts."""
        for contact in self.contacts.values():
            forces = _variables(contact.forces)
            for phase in contact.phases:
                yield from self.cone(contact, phase, forces, phase.frames)
                if phase.landing and "speed" in contact.options:
                    most = contact.options["speed"]
                    where = FrameRange(phase.frames.first, phase.frames.first, phase.frames.span)
                    for rate in self.velocities(contact, phase, "before"):
                        text = f"{contact.name} lands at no more than its speed"
                        yield Relation(rate, neg(most), most, where, self.context.span(phase.statement), text)
            for before, after in pairwise([None, *contact.phases, None]):
                yield from self._flight(contact, before, after)

    def _flight(self, contact: Contact, before: Phase | None, after: Phase | None) -> Iterator[Relation]:
        """The statements of a flight between two phases, before the first, or after the last: no force, and
        clearance.
        """
        first = 0 if before is None else before.frames.last
        last = self.context.n if after is None else after.frames.first
        phase = after or before
        if contact.free is not None or first == last:
            return
        span = self.context.span(contact.statement if phase is None else phase.statement)
        for name in contact.forces:
            body = sym(VariableRef(name))
            yield Relation(body, ZERO, ZERO, FrameRange(first, last), span, f"{name} = 0 in flight")
        # In a periodic motion, what stands at the other end comes from the floor here, or comes down to it.
        leaves = before is not None or self._stands_beyond(contact, 0)
        lands = after is not None or self._stands_beyond(contact, self.context.n)
        low, high = first + leaves, last - lands
        if contact.kind == "pin" or low > high or not (phase or leaves or lands):
            return
        surface = self.surface(contact) if phase is None else phase.surface
        written = any(option.name == "clearance" for option, _ in contact.statement.options)
        for index, height in enumerate(self.heights_above(contact, surface)):
            room = height
            # From one surface to the other in an arch; where one of them is beyond the motion, half of it is within, if
            # a clearance is asked for.
            begin = first if leaves else 2 * first - last
            end = last if lands else 2 * last - first
            share = div(sub(sym(IndexRef()), num(float(begin))), num(float(end - begin)))
            left = sub(ONE, share)
            if before is not None and after is not None and before.surface != after.surface:
                start = list(self.heights_above(contact, before.surface))[index]
                room = mul(left, start) + mul(share, height)
            arch = mul(mul(share, share), mul(left, left))
            if not ((leaves and lands) or written):
                arch = ZERO
            room = sub(room, mul(mul(num(16.0), contact.options["clearance"]), arch))
            text = f"{contact.name} is clear of the {surface.name} in flight"
            yield Relation(room, ZERO, None, FrameRange(low, high), span, text)

    def _stands_beyond(self, contact: Contact, frame: int) -> bool:
        """Whether a periodic motion has a contact on its surface at its first or last frame, since it, or its mirror
        image, stands at the other one.
        """
        if self.periodic is None:
            return False
        name = other_side(contact.name, set(self.contacts)) if self.periodic.mirrored else contact.name
        ends = [(phase.frames.last, phase.frames.first) for phase in self.contacts[name].phases]
        return any(end[frame > 0] == self.context.n - frame for end in ends)

    def heights_above(self, contact: Contact, surface: Surface) -> Iterator[Expr]:
        """Distances from a surface: of a point or sphere, or of the corners of a sole."""
        at = self._seen(contact, surface)[0]
        if contact.kind != "foot":
            yield sub(surface.height(at), num(contact.radius))
            return
        axes = self.scope.dynamics.kinematics.axes_of(contact.frame)
        for x in (-contact.half[0], contact.half[0]):
            for y in (-contact.half[1], contact.half[1]):
                corner = plus(at, tuple([axes[k][0] * x + axes[k][1] * y for k in range(3)]))  # type: ignore[arg-type]
                yield surface.height(corner)

    def places(self, contact: Contact, phase: Phase) -> list[Place]:
        """The functions that are constant while a contact stands."""
        surface, given = phase.surface, phase.place
        at, velocity, _ = self._seen(contact, surface)
        if contact.kind == "pin":
            return [_place(part, velocity[k], given[k : k + 1]) for k, part in enumerate(at)]
        up = dot(vector(surface.normal), velocity)
        found = [Place(up, sub(surface.height(at), num(contact.radius)))]
        if contact.slides_on(phase):
            return found
        for k, (along, tangent) in enumerate(zip(surface.along(at), surface.tangents, strict=True)):
            rate = dot(vector(tangent), velocity)
            if not contact.radius:
                found.append(_place(along, rate, given[k : k + 1]))
            elif given[k : k + 1]:
                found.append(Place(rate, sub(along, given[k]), start=True))
        if contact.kind == "foot":
            axes = self.scope.dynamics.kinematics.axes_of(contact.frame)
            turning = self.paths.turning(contact.frame)[0]
            upright: Vector = (axes[0][2], axes[1][2], axes[2][2])
            for tangent in surface.tangents:
                rate = dot(vector(tangent), cross(turning, upright))
                found.append(Place(rate, dot(vector(tangent), upright)))
            # The yaw of the sole's long axis within the surface.
            ahead: Vector = (axes[0][0], axes[1][0], axes[2][0])
            x, y = [dot(vector(tangent), ahead) for tangent in surface.tangents]
            rate = dot(vector(surface.normal), turning)
            if len(given) > 2:
                zero = sub(mul(y, call("cos", given[2])), mul(x, call("sin", given[2])))
                found.append(Place(rate, zero))
            else:
                turned = sub(mul(x, one_frame_on(y)), mul(y, one_frame_on(x)))
                found.append(Place(rate, change=turned))
        return found

    def _centre(self, contact: Contact, phase: Phase) -> list[Place]:
        """The position of a rolling ball along its surface, as long as it does not turn."""
        at, velocity, _ = self._seen(contact, phase.surface)
        return [
            _place(along, dot(vector(tangent), velocity), phase.place[k : k + 1])
            for k, (along, tangent) in enumerate(
                zip(phase.surface.along(at), phase.surface.tangents, strict=True)
            )
        ]

    def velocities(self, contact: Contact, phase: Phase, side: str = "") -> list[Expr]:
        """The velocity of the contact point along the surface's axes; for a foot its angular velocity too."""
        velocity = self._seen(contact, phase.surface)[1]
        turning = self.paths.turning(contact.frame)[0]
        return self._on_side(self._of_contact(contact, phase, velocity, turning), side)

    def accelerations(self, contact: Contact, phase: Phase) -> list[Expr]:
        """The rates of :meth:`velocities`."""
        acceleration = self._seen(contact, phase.surface)[2]
        turning = self.paths.turning(contact.frame)[1]
        return self._of_contact(contact, phase, acceleration, turning)

    @staticmethod
    def _of_contact(contact: Contact, phase: Phase, moved: Vector, turned: Vector) -> list[Expr]:
        normal = phase.surface.normal
        if contact.radius:
            moved = plus(moved, cross(turned, contact.down(phase.surface)))
        if contact.kind == "pin":
            return list(moved)
        found = [dot(vector(axis), moved) for axis in (*phase.surface.tangents, normal)]
        return found + list(turned) if contact.kind == "foot" else found

    @staticmethod
    def _on_side(bodies: Sequence[Expr], side: str) -> list[Expr]:
        return [one_sided(body, side) for body in bodies] if side else list(bodies)

    def cone(
        self, contact: Contact, phase: Phase, parts: Sequence[Expr], where: FrameRange, what: str = "force"
    ) -> Iterator[Relation]:
        """The cone: no pulling, and friction; for a foot the cone of wrenches of its sole."""
        if contact.kind == "pin":
            return
        surface, friction = phase.surface, contact.options["friction"]
        force: Vector = (parts[0], parts[1], parts[2])
        up = dot(vector(surface.normal), force)
        span = self.context.span(contact.statement)
        yield Relation(up, ZERO, None, where, span, f"{contact.name} pushes ({what})")
        along = [dot(vector(tangent), force) for tangent in surface.tangents]
        rates = self.velocities(contact, phase, "after" if what == "impulse" else "")
        moving = [k for k in (0, 1) if rates[k] is not ZERO]
        if contact.glides:
            yield from self.slippery(contact, phase, parts, where, what)
            return
        if phase.way:
            if len(moving) != 1:
                message = f"`{contact.name}` can slide in more than one direction, or in none"
                hint = "a schedule states sliding in a plane, along one line"
                self.context.error(phase.statement, message, hint)
                return
            way, text = num(float(phase.way)), f"{contact.name} has friction against its sliding ({what})"
            rubbing = along[moving[0]] + mul(way, mul(friction, up))
            yield Relation(rubbing, ZERO, ZERO, where, span, text)
            yield Relation(
                mul(way, rates[moving[0]]), ZERO, None, where, span, f"{contact.name} slides that way"
            )
            return
        if contact.kind == "point" and what == "impulse" and moving:
            # What stands already may take no part of an impact, and a round cone has no inside at its apex: a pyramid
            # whose edges are on the cone has one.  In a plane it is the cone.
            ways: Sequence[tuple[float, ...]] = PYRAMID if len(moving) == 2 else ((1.0,), (-1.0,))
            share = friction if len(moving) == 1 else mul(num(math.cos(math.pi / len(ways))), friction)
            for one in ways:
                sideways = sum_of(mul(num(part), along[k]) for part, k in zip(one, moving, strict=True))
                within = sub(mul(share, up), sideways)
                yield Relation(within, ZERO, None, where, span, f"{contact.name} does not slip ({what})")
            return
        if contact.kind == "point":
            # A force of no account may be beyond the cone: at its apex, where feet lift off, it has no inside.
            spare = num((NEGLIGIBLE * self.scope.weight) ** 2)
            within = sub(
                mul(mul(friction, friction), mul(up, up)) + spare, along[0] * along[0] + along[1] * along[1]
            )
            yield Relation(within, ZERO, None, where, span, f"{contact.name} does not slip ({what})")
            return
        axes = self.scope.dynamics.kinematics.axes_of(contact.frame)
        columns: list[Vector] = [(axes[0][k], axes[1][k], axes[2][k]) for k in (0, 1)]
        along = [dot(column, force) for column in columns]
        torque: Vector = (parts[3], parts[4], parts[5])
        tip, tilt = [dot(column, torque) for column in columns]
        turn = dot(vector(surface.normal), torque)
        reach = contact.options.get("reach", ONE)
        half = mul(reach, num(contact.half[0])), mul(reach, num(contact.half[1]))
        for body, text in sole_cone(along, up, (tip, tilt, turn), half, friction):
            yield Relation(body, ZERO, None, where, span, f"{contact.name} {text} ({what})")

    def slippery(
        self, contact: Contact, phase: Phase, parts: Sequence[Expr], where: FrameRange, what: str = "force"
    ) -> Iterator[Relation]:
        """No force along the surface, of a point without friction."""
        rates = self.velocities(contact, phase, "after" if what == "impulse" else "")
        for tangent, rate in zip(phase.surface.tangents, rates, strict=False):
            if rate is not ZERO:
                along = dot(vector(tangent), (parts[0], parts[1], parts[2]))
                text = f"{contact.name} has no friction ({what})"
                yield Relation(along, ZERO, ZERO, where, self.context.span(contact.statement), text)

    def holdings(self) -> Iterator[Holding]:
        """Every phase of every contact as a :class:`Holding`."""
        for contact in self.contacts.values():
            for phase in contact.phases:
                places = self.places(contact, phase)
                slides = contact.slides_on(phase)
                moved = slice(2, 3) if slides else slice(None)  # what slides is held along the normal alone
                yield Holding(
                    name=contact.name,
                    path=contact.name,
                    frames=phase.frames,
                    span=self.context.span(phase.statement),
                    places=places,
                    nearly=self._centre(contact, phase) if contact.radius and not slides else [],
                    velocities=self.velocities(contact, phase)[moved],
                    accelerations=self.accelerations(contact, phase)[moved],
                    landing=bool(phase.landing),
                    at=()
                    if contact.radius or slides or phase.surface.frame
                    else self.paths.place(contact.frame)[0],
                    height=None if contact.kind == "pin" else places[0].zero,
                    surface=phase.surface.name,
                )

    def impacts(self, equalities: Equalities) -> Iterator[Relation]:
        """The statements of landings: impulses of all held constraints, those of contacts within their cones, and the
        balance of every momentum.
        """
        for count, frame in enumerate(self.impact_frames(), 1):
            where = FrameRange(frame, frame)
            forces = equalities.impulses(count)
            struck = self.struck(frame)
            for contact, phase, names in struck:
                parts: list[Expr] = [sym(ParameterRef(name)) for name in names]
                forces.wrenches += self._wrench(contact, parts, phase.surface)
                yield from self.cone(contact, phase, parts, where, "impulse")
            landing = next(phase for _, phase, _ in struck if phase.frames.first == frame)
            span = self.context.span(landing.statement)
            change: list[Expr] = []
            for name, order in self._speeds():
                after, before = (sym(VariableRef(name, order, 1, 0, side)) for side in ("after", "before"))
                change.append(sub(after, before))
            for row in impact(self.scope.dynamics, change, forces):
                yield Relation(row, ZERO, ZERO, where, span, "momentum at the impact")

    def prices(self) -> Iterator[tuple[Expr, Phase]]:
        """The cost of landing speeds."""
        for contact in self.contacts.values():
            for phase in contact.phases:
                if phase.landing and "landing" in contact.options:
                    speeds = self.velocities(contact, phase, "before")[
                        2 if contact.slides_on(phase) else 0 : 3
                    ]
                    if contact.kind == "foot":  # of its edges
                        axes = self.scope.dynamics.kinematics.axes_of(contact.frame)
                        turning = self.paths.turning(contact.frame)[0]
                        columns: list[Vector] = [(axes[0][k], axes[1][k], axes[2][k]) for k in (1, 0)]
                        rolls = self._on_side([dot(column, turning) for column in columns], "before")
                        speeds += [
                            mul(num(reach), roll) for reach, roll in zip(contact.half, rolls, strict=True)
                        ]
                    yield mul(contact.options["landing"], sum_of([speed * speed for speed in speeds])), phase

    # -------------------------------------------------------- guesses and replay

    def guesses(self) -> Iterator[Guess]:
        """The guess of contact forces: equal shares of the weight."""
        weight = self.scope.weight
        bearing = [c for c in self.contacts.values() if c.kind != "pin"]
        for contact in bearing:
            for phase in contact.phases:
                if phase.surface.normal[2] <= 0.0:
                    continue  # It bears no weight.
                for frame in range(phase.frames.first, phase.frames.last + 1):
                    count = sum(p.frames.first <= frame <= p.frames.last for c in bearing for p in c.phases)
                    where = FrameRange(frame, min(frame + 1, phase.frames.last))
                    yield Guess(
                        contact.forces[2],
                        num(weight / max(1, count)),
                        where,
                        self.context.span(phase.statement),
                    )

    def heights(self, frame: int | None) -> list[Expr]:
        """How far every place of contact is above the surface on which it stands at a frame; if none does, or without
        a frame, above the floor.
        """
        able = [one for one in self.contacts.values() if one.kind != "pin"]
        standing = [
            (one, phase.surface)
            for one in able
            for phase in one.phases
            if frame is not None and phase.frames.first <= frame <= phase.frames.last
        ]
        ground = floor(self.scope)
        pairs = standing or [(one, ground) for one in able if self.surface(one).frame is None]
        return [
            div(height, num(surface.normal[2]))
            for one, surface in pairs
            if surface.frame is None and surface.normal[2] > 0.0
            for height in self.heights_above(one, surface)
        ]

    def flights(self) -> list[tuple[int, int]]:
        """First and last frames of the intervals in which nothing stands."""
        ends = sorted((p.frames.first, p.frames.last) for c in self.contacts.values() for p in c.phases)
        found, reached = [], 0
        for first, last in [*ends, (self.context.n, self.context.n)]:
            if first > reached:
                found.append((reached, first))
            reached = max(reached, last)
        return found

    def replay_lines(self) -> Iterator[ReplayChannel]:
        """The replay lines of forces that MuJoCo's own contacts supply."""
        for contact in self.contacts.values():
            span, surface = self.context.span(contact.statement), self.surface(contact)
            place = contact.touching(surface)
            for part, name in zip(FORCES[contact.kind], contact.forces, strict=True):
                yield ReplayChannel("contact", (*place, part), sym(VariableRef(name)), span)
            if surface.frame is not None:
                for part, name in zip(FORCES["point"], contact.forces, strict=False):
                    yield ReplayChannel("contact", (*surface.path, part), neg(sym(VariableRef(name))), span)


def _place(at: Expr, rate: Expr, given: Sequence[Expr]) -> Place:
    """A coordinate that is held at a given value, or at that of the first frame."""
    return Place(rate, sub(at, given[0])) if given else Place(rate, change=unchanged(at))


def _variables(names: Sequence[str]) -> list[Expr]:
    return [sym(VariableRef(name)) for name in names]


__all__ = ["Contacts"]
