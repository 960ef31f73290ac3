"""The constraints of held contacts and equalities: positions and velocities at every frame, without redundant rows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from stc.language import syntax
from stc.language.context import Context
from stc.language.model.contact import Contacts
from stc.language.model.holdings import Equalities, Holding, Place
from stc.language.model.independence import (
    DEPENDENT,
    Matrix,
    Point,
    are_integrable,
    independent,
    pins_to_keep,
    remain_dependent,
    stacked,
)
from stc.language.model.mirror import other_side
from stc.language.model.pose_rows import Stated, Values
from stc.language.model.scope import ModelScope
from stc.problem import Correction, Fixture, FrameRange, ParameterRef, Relation, VariableRef
from stc.records import dataclass, field
from stc.symbolic.differentiate import adjoints
from stc.symbolic.expr import ZERO, Expr, neg, num, sym
from stc.time_derivatives import one_sided

#: A pinned pose that has a contact farther off its surface than this, in m, is a mistake.
OFF_SURFACE = 1e-3

#: What a link gives way by at most in one step, in m or rad.  It is far above the errors of a method whose steps are
#: fine enough to mean anything, and keeps an optimiser from leaping from one branch of a closed loop to another.
LARGEST_CORRECTION = 0.05

#: If a ball rolls in space between two fixed poses, what the rolling implies of the later one to first order is met to
#: so much, in m or rad: as equations the two would depend on each other.
NEARLY = 1e-4

UNUSED = "no step is corrected here"


@dataclass(frozen=True, slots=True)
class Stretch:
    """An interval of frames with the same held constraints, and the nonredundant rows of each.

    Attributes:
        frames: the first and the last of them.
        held: each constraint with the indices of its places and velocities that are rows.
    """

    frames: FrameRange
    held: list[tuple[Holding, list[int], list[int]]]


@dataclass(slots=True)
class Pinned:
    """The fixed poses of one frame: rows with their statements, and a pose's values if there is one."""

    rows: list[tuple[Stated, syntax.Pose]] = field(default_factory=list)
    values: Values | None = None
    statement: syntax.Pose | None = None

    def dofs(self, velocity: bool) -> list[int]:
        """The degrees of freedom whose position, or velocity, is fixed."""
        return sorted({row.dof for row, _ in self.rows if row.velocity == velocity})


class Standing:
    """States the held constraints, without redundant rows of them and of fixed poses.

    Args:
        pinned: poses by frame.
        periodic: rows that relate the first frame and the last one.
    """

    def __init__(
        self,
        context: Context,
        scope: ModelScope,
        equalities: Equalities,
        contacts: Contacts,
        pinned: Mapping[int, Pinned],
        periodic: Sequence[tuple[Stated, syntax.Pose]],
    ) -> None:
        self.context, self.scope, self.contacts = context, scope, contacts
        self.pinned, self.periodic = pinned, periodic
        links = [self._placed(one) for one in equalities.holdings()]
        self.holdings = [*links, *(self._placed(one) for one in contacts.holdings())]
        self.width = scope.mechanism.n_freedoms
        self.numbers = {k: v for k, v in self.context.constants.values.items() if v is not None}
        self._points: dict[int, Point] = {}
        self._known_at: dict[int, tuple[list[Holding], bool]] = {}
        self.generic = self._generic(links)
        self.drawn = self._drawn()
        if not np.isfinite(self.drawn.numbers(self.zeros)).all():
            self.drawn = self.drawn.aside()
        self._check_links(links)
        self.stretches = list(self._stretches())
        self._check_freedom()

    def _placed(self, one: Holding) -> Holding:
        """The same constraint with its place, if a fixed pose determines it."""
        for frame, pinned in sorted(self.pinned.items()):
            if pinned.values is not None and one.frames.first <= frame <= one.frames.last:
                values = pinned.values
                return replace(one, places=[place.known(values) for place in one.places])
        return one

    def _generic(self, links: Sequence[Holding]) -> Point:
        """A generic configuration, in which nothing is aligned by chance, and the model's loops are closed: what an
        open one has to say across the plane in which it moves, a closed one has not.
        """
        rng = np.random.default_rng(1)
        values: dict[str, float] = {}
        for one in self.scope.coordinates:
            reference = one.joint.reference
            for name, value in zip(one.positions, reference):
                values[name] = value + float(rng.normal(scale=0.3))
            if one.rotation is not None:
                q = np.array(reference[len(one.positions) :]) + rng.normal(size=4, scale=0.1)
                values.update(zip(one.rotation.quaternion, (q / np.linalg.norm(q)).tolist()))
        point = Point(self.scope, values, self.numbers)
        places = [place for one in links for place in one.places if place.zero is not None]
        moved = np.abs(point.jacobian([place.rate for place in places])).max(axis=1, initial=0.0) > DEPENDENT
        #: Of the constraints with known places each row, and whether any joint changes it.
        self.rows = [(place, bool(changes)) for place, changes in zip(places, moved, strict=True)]
        #: What is zero where they hold.
        self.zeros = [place.zero for place, _ in self.rows if place.zero is not None]
        return self._closed(point)

    def _closed(self, point: Point) -> Point:
        """A configuration close by in which the model's loops are closed, as far as joints can."""
        rows = [place for place, changes in self.rows if changes]
        return point.closed(
            [place.zero for place in rows if place.zero is not None], [place.rate for place in rows]
        )

    def _check_links(self, links: Sequence[Holding]) -> None:
        """Check that there is a configuration in which the model's equality constraints hold.

        What no joint changes is told: it has no effect in MuJoCo either.
        """
        named = [one.name for one in links for place in one.places if place.zero is not None]
        moved = np.array([changes for _, changes in self.rows], bool)
        starts = [self.generic, self.drawn, *(self._at(frame) for frame in self.pinned)]
        offs = [np.abs(self._closed(start).numbers(self.zeros)) for start in starts] if self.zeros else []
        least = min(offs, key=lambda off: float((off * moved).max()), default=np.zeros(0))
        statement, told = self.scope.statement, set[str]()
        for name, off, changes in zip(named, least.tolist(), moved.tolist(), strict=True):
            if off > OFF_SURFACE and name not in told:
                told.add(name)
                if changes:
                    message = (
                        f"`{name}` cannot hold: the nearest pose that was found is {off:.3g} m or rad off"
                    )
                    self.context.error(statement, message, "even without the ranges of joints")
                else:
                    message = f"`{name}` is {off:.3g} m or rad off in a direction in which no joint moves what it ties"
                    self.context.diagnostics.warning(message, statement.start, statement.end)

    def _check_freedom(self) -> None:
        """Tell where a flight begins from contacts that leave the centre of mass too little freedom to be pushed up.

        That is so if the motions they allow are fewer than its directions, and none of them raises it in a fixed pose.
        """
        momentum = list(self.scope.dynamics.momentum())
        taken = {stretch.frames.first for stretch in self.stretches}
        for stretch in self.stretches:
            rows = [one.velocities[k] for one, _, kept in stretch.held for k in kept]
            first, last = stretch.frames.first, stretch.frames.last
            pinned = [k for k, one in self.pinned.items() if first <= k <= last and one.values is not None]
            free = self.width - len(rows)
            directions = np.linalg.matrix_rank(self.generic.jacobian(momentum), DEPENDENT)
            if last == self.context.n or last in taken or not pinned or free >= directions:
                continue
            at = self._at(pinned[0])
            _, sizes, ways = np.linalg.svd(at.jacobian(rows))
            allowed = ways[int((sizes > DEPENDENT * sizes.max()).sum()) :]
            up = at.jacobian(momentum)[2]
            if np.linalg.norm(allowed @ up) > DEPENDENT * np.linalg.norm(up):
                continue
            names = ", ".join(f"`{one.name}`" for one, _, _ in stretch.held)
            span = stretch.held[-1][0].span
            self.context.diagnostics.warning(
                f"a flight begins at frame {last}, where {names} still hold {len(rows)} of {self.width} degrees of "
                "freedom: what remains does not lift the centre of mass from this pose",
                span.start,
                span.end,
                "let some of them leave earlier",
            )

    def _drawn(self) -> Point:
        """The model's first keyframe, or the pose of its file."""
        q = next((k.qpos for k in self.scope.mechanism.keyframes if k.name), self.scope.mechanism.start)
        values = {
            name: q[one.joint.qpos + k] for one in self.scope.coordinates for k, name in enumerate(one.pose)
        }
        return Point(self.scope, values, self.numbers)

    def _at(self, frame: int) -> Point:
        """The fixed pose of a frame, or the generic one."""
        pinned = self.pinned.get(frame)
        if pinned is None or pinned.values is None:
            return self.generic
        if frame not in self._points:
            numbers = {name: self.context.number(body) for name, body in pinned.values.items()}
            self._points[frame] = Point(self.scope, numbers, self.numbers)
        return self._points[frame]

    # ------------------------------------------------------------- what is held when

    def _stretches(self) -> Iterator[Stretch]:
        """Intervals of steps with the same held constraints, in the order of time."""
        known: dict[tuple[int, ...], list[tuple[Holding, list[int], list[int]]]] = {}
        steps = []
        for step in range(max(self.context.n, 1)):
            holding = [one for one in self.holdings if one.stands(step)]
            # Of those that can stand for each other the one that holds on is kept: its rows begin nowhere on the way.
            holding.sort(key=lambda one: (one.frames.first, -one.frames.last))
            steps.append(tuple([id(one) for one in holding]))
            if steps[-1] not in known:
                known[steps[-1]] = self._kept(holding)
        first = 0
        for key, run in groupby(steps):
            last = first + len(list(run))
            if key:
                yield Stretch(FrameRange(first, min(last, self.context.n)), known[key])
            first = last
        for one in self.holdings:  # what holds at a single frame
            frame = one.frames.first
            if one.frames.last == frame and self.context.n:
                there = [
                    o for o in self.holdings if o.frames.first <= frame <= o.frames.last and o is not one
                ]
                yield Stretch(FrameRange(frame, frame), self._kept([*there, one])[-1:])

    def _kept(self, holding: Sequence[Holding]) -> list[tuple[Holding, list[int], list[int]]]:
        lasting = [[k for k, place in enumerate(one.places) if not place.start] for one in holding]
        of_places = [[one.places[k].rate for k in some] for one, some in zip(holding, lasting, strict=True)]
        at = self._telling(holding)
        places = self._independent(holding, of_places, at)
        velocities = self._independent(holding, [one.velocities for one in holding], at)
        return [
            (one, [some[k] for k in placed], moving)
            for one, some, placed, moving in zip(holding, lasting, places, velocities, strict=True)
        ]

    def _telling(self, holding: Sequence[Holding]) -> Point:
        """The configuration that tells which rows are independent: a fixed pose whose dependent rows remain so, or the
        generic one.
        """
        rates = [rate for one in holding for rate in one.velocities]
        first = max((one.frames.first for one in holding), default=0)
        last = min((one.frames.last for one in holding), default=0)
        for frame, pinned in sorted(self.pinned.items()):
            if rates and pinned.values is not None and first <= frame <= last:
                at = self._at(frame)
                here, elsewhere = (
                    np.linalg.matrix_rank(point.jacobian(rates), DEPENDENT) for point in (at, self.generic)
                )
                if here < elsewhere and remain_dependent(at, rates):
                    return at
        return self.generic

    def _independent(
        self, holding: Sequence[Holding], rates: Sequence[Sequence[Expr]], at: Point
    ) -> list[list[int]]:
        """The rows of each constraint that earlier ones do not imply."""
        found: list[list[int]] = []
        for count, one in enumerate(holding):
            before = [rates[k][row] for k, rows in enumerate(found) for row in rows]
            seen = self._seen(one.frames)
            rows, given = at.jacobian(rates[count]), at.jacobian(before)
            found.append(independent(rows, given, (seen.jacobian(rates[count]), seen.jacobian(before))))
        return found

    def _seen(self, frames: FrameRange) -> Point:
        """The pose of some frames if one is fixed there, else another fixed pose or one of the model."""
        posed = [frame for frame, pinned in sorted(self.pinned.items()) if pinned.values is not None]
        there = [frame for frame in posed if frames.first <= frame <= frames.last]
        return self._at((there or posed)[0]) if posed else self.drawn

    # ------------------------------------------------------------------------- rows

    def relations(self) -> Iterator[Relation]:
        """Positions, velocities and accelerations of held constraints."""
        for stretch in self.stretches:
            for one, places, velocities in stretch.held:
                held = [one.places[k] for k in places]
                if self.context.method != "central":
                    yield from self._in_place(one, held, stretch.frames)
                    yield from self._still(one, velocities, stretch.frames)
                    yield from self._unaccelerated(one, velocities, stretch.frames)
                elif len(places) == len(velocities):
                    # Velocities and accelerations are differences of places, and vanish with those.
                    yield from self._in_place(one, held, stretch.frames)
                else:
                    first = FrameRange(stretch.frames.first, stretch.frames.first)
                    yield from self._in_place(one, held, first)
                    yield from self._still(one, velocities, first)
                    yield from self._unaccelerated(one, velocities, stretch.frames)
                for k, load in enumerate(one.loads):
                    if k not in velocities:
                        text = f"{one.name} bears nothing along what holds without it"
                        yield Relation(load, ZERO, ZERO, stretch.frames, one.span, text)
        yield from self._starts()
        yield from self._limits()

    def fixtures(self, poses: Iterable[int]) -> Iterator[Fixture]:
        """The held constraints for the guess; ``poses`` are frames with known poses, which determine the places of
        feet.
        """
        idle = {id(place) for place, changes in self.rows if not changes}
        for one in self.holdings:
            first, last = one.frames.first, one.frames.last
            reference = min([frame for frame in poses if first <= frame <= last], default=first)
            lasting = [
                place for place in (*one.places, *one.nearly) if not place.start and id(place) not in idle
            ]
            known = [(place.zero, place.rate) for place in lasting if place.zero is not None]
            same = [(place.change, place.rate) for place in lasting if place.change is not None]
            for some in filter(None, (known, same)):
                yield Fixture(one.frames, reference, [e for e, _ in some], [rate for _, rate in some])

    def _in_place(self, one: Holding, places: Sequence[Place], frames: FrameRange) -> Iterator[Relation]:
        text = f"{one.name} holds its place"
        for place in places:
            if place.zero is not None:
                for where in self._from_start(one, frames):
                    yield Relation(place.zero, ZERO, ZERO, where, one.span, text, on_frames=True)
            elif place.change is not None:
                # It joins each frame to the next one; where the last is the first one again, one says nothing new.
                last = frames.last - 1 - (frames.last == self.context.n and self._comes_back(one))
                if last >= frames.first:
                    where = FrameRange(frames.first, last)
                    yield Relation(place.change, ZERO, ZERO, where, one.span, text, on_frames=True)

    def _still(self, one: Holding, velocities: Sequence[int], frames: FrameRange) -> Iterator[Relation]:
        for k in velocities:
            for where in self._from_start(one, frames):
                text = f"{one.name} holds still"
                yield Relation(one.velocities[k], ZERO, ZERO, where, one.span, text, on_frames=True)

    def _unaccelerated(
        self, one: Holding, velocities: Sequence[int], frames: FrameRange
    ) -> Iterator[Relation]:
        for k in velocities:
            text = f"{one.name} holds: its acceleration is zero"
            yield Relation(one.accelerations[k], ZERO, ZERO, frames, one.span, text)

    def _from_start(self, one: Holding, frames: FrameRange) -> Iterator[FrameRange]:
        """The frames; without the first one of a periodic motion if the last one implies it."""
        if frames.first > 0 or not self._is_repeated(one):
            yield frames
        elif frames.last > 0:
            yield FrameRange(1, 1)  # either side of it, where it jumps
            yield FrameRange(1, frames.last)

    def _starts(self) -> Iterator[Relation]:
        """Places that are fixed only at the start of a constraint, without redundant ones."""
        for one in self.holdings:
            starting = [place for place in one.places if place.start]
            frame = one.frames.first
            if not starting or (frame == 0 and self._is_repeated(one)):
                continue
            point = self._at(frame)
            others = [o for o in self.holdings if o.frames.first <= frame <= o.frames.last and o is not one]
            given = [self._held(o, frame, point) for o in others]
            given.append(point.jacobian([p.rate for p in one.places if p.zero is not None and not p.start]))
            rows = point.jacobian([place.rate for place in starting])
            for k in independent(rows, stacked(given, self.width)):
                zero = starting[k].zero
                assert zero is not None
                yield Relation(
                    zero, ZERO, ZERO, FrameRange(frame, frame), one.span, f"{one.name} begins at its place"
                )

    # ------------------------------------------------------------------ corrections

    def corrections(self) -> list[Correction]:
        """The relaxations of the links of positions and velocities that are held."""
        if self.context.method == "central":
            return []
        found = []
        for stretch in self.stretches:
            if stretch.frames.first == stretch.frames.last:
                continue
            for one, places, velocities in stretch.held:
                rates = {f"correction.{one.path}.{k}": one.places[k].rate for k in places}
                found.append(self._correction(rates, 0, stretch.frames))
                rates = {f"correction.{one.path}.v{k}": one.velocities[k] for k in velocities}
                found.append(self._correction(rates, 1, stretch.frames))
        return [one for one in found if one.unknowns]

    def _correction(self, rates: Mapping[str, Expr], order: int, frames: FrameRange) -> Correction:
        seeds = [(rate, sym(VariableRef(name))) for name, rate in rates.items()]
        keys = [key for one in self.scope.coordinates for key in one.rates]
        gradients = adjoints(seeds, {sym(key) for key in keys})
        shares = {}
        for key in keys:
            share = gradients.get(sym(key), ZERO)
            if share is not ZERO:
                # The velocities of an orientation are variables of their own, and no first derivatives.
                shares[key.name, order if key.order else order - 1] = share
        return Correction(frames, tuple(rates), shares)

    def _limits(self) -> Iterator[Relation]:
        """Bounds on corrections; zero if there is no link to correct."""
        used: dict[str, list[FrameRange]] = {}
        for correction in self.corrections():
            for name in correction.unknowns:
                used.setdefault(name, []).append(correction.range)
        span, n = self.context.span(self.scope.statement), self.context.n
        beside = self.context.method != "hermite-simpson"
        for name, ranges in used.items():
            body, at = sym(VariableRef(name)), 0
            for where in sorted(ranges, key=lambda one: one.first):
                if where.first - beside >= at:
                    yield Relation(body, ZERO, ZERO, FrameRange(at, where.first - beside), span, UNUSED)
                at = where.last
            yield Relation(body, ZERO, ZERO, FrameRange(at, n), span, UNUSED)
            if not beside:
                yield Relation(body, ZERO, ZERO, self.context.everywhere, span, UNUSED, on_frames=True)
            if not name.rpartition(".")[2].startswith("v"):
                limit = num(LARGEST_CORRECTION)
                text = f"no step is corrected by more than {LARGEST_CORRECTION} m or rad"
                for where in ranges:
                    within = FrameRange(where.first, where.last - beside)
                    yield Relation(body, neg(limit), limit, within, span, text)

    # -------------------------------------------------------------------- periodic

    def _repeated(self, one: Holding) -> Holding | None:
        """The constraint at the last frame that periodicity maps to this one at the first frame."""
        if not self.periodic or one.frames.first > 0:
            return None
        name = one.name
        if any(statement.mirrored for _, statement in self.periodic):
            name = other_side(name, {other.name for other in self.holdings})
        last = [o for o in self.holdings if o.name == name and o.frames.last == self.context.n]
        return last[0] if last else None

    def _is_repeated(self, one: Holding) -> bool:
        """Whether the rows of the last frame imply it at the first one too."""
        return self._repeated(one) is not None

    def _comes_back(self, one: Holding) -> bool:
        """Whether the contact holds throughout a periodic motion, so that its last step is redundant."""
        names: list[str] = []
        at: Holding | None = one
        while at is not None and at.frames.last == self.context.n and at.name not in names:
            names.append(at.name)
            at = self._repeated(at)
        return at is not None and at.name == one.name and bool(names) and one.name == min(names)

    # ------------------------------------------------------------------------- poses

    def pins(self) -> Iterator[Relation]:
        """The rows of fixed poses, without those that held constraints imply."""
        for frame, pinned in sorted(self.pinned.items()):
            point = self._at(frame)
            holding = [one for one in self.holdings if one.frames.first <= frame <= one.frames.last]
            self._check(holding, frame, pinned)
            held = [self._held(one, frame, point) for one in holding]
            known, certain = self._known(frame)
            rolling = [point.jacobian(one.velocities) for one in known]
            exact = pins_to_keep(stacked([*held, *rolling], self.width), pinned.dofs(False))
            held += rolling if certain else [np.eye(self.width)[exact]]
            nearly = pins_to_keep(stacked(held, self.width), pinned.dofs(False))
            for row, statement in pinned.rows:
                if not row.velocity and row.dof in {*exact, *nearly}:
                    off = ZERO if row.dof in exact else num(NEARLY)
                    where, span = FrameRange(frame, frame), self.context.span(statement)
                    yield Relation(row.body, neg(off), off, where, span, row.text)
            yield from self._velocity_pins(frame, pinned, holding, point)

    def _known(self, frame: int) -> tuple[list[Holding], bool]:
        """What is held since a fixed pose that the fixed pose of a frame fits, and whether that says where it is.

        Without slip a sole on two balls, or a ball in a plane, is as far away as it has turned. In space the place of a
        single ball depends on the way.
        """
        if frame not in self._known_at:
            known = []
            for one in self.holdings:
                if one.frames.first < frame <= one.frames.last:
                    moved, _ = self._moved(one, frame)
                    known += [one] if moved is not None and np.linalg.norm(moved) <= OFF_SURFACE else []
            rates = [rate for one in known for rate in one.velocities]
            self._known_at[frame] = known, bool(known) and are_integrable(self.generic, rates)
        return self._known_at[frame]

    def _velocity_pins(
        self, frame: int, pinned: Pinned, holding: Sequence[Holding], point: Point
    ) -> Iterator[Relation]:
        """Pinned velocities, on either side of an impact."""
        lands = any(one.landing and one.frames.first == frame for one in holding)
        for side in ("before", "after") if lands else ("",):
            there = holding
            if side == "before":
                there = [one for one in holding if one.frames.first < frame]
            elif side == "after":
                there = [one for one in holding if one.frames.last > frame]
            still = stacked([point.jacobian(one.velocities) for one in there], self.width)
            keep = pins_to_keep(still, pinned.dofs(True))
            for row, statement in pinned.rows:
                if row.velocity and row.dof in keep:
                    body = one_sided(row.body, side) if side else row.body
                    where, span = FrameRange(frame, frame), self.context.span(statement)
                    yield Relation(body, ZERO, ZERO, where, span, row.text)

    def _held(self, one: Holding, frame: int, point: Point) -> Matrix:
        """The derivative of fixed places at a frame with respect to the coordinates, if they are known."""
        held = [place for place in one.places if place.zero is not None and not place.start]
        return point.jacobian([place.rate for place in held])

    def _check(self, holding: Sequence[Holding], frame: int, pinned: Pinned) -> None:
        """Check that the contacts of a fixed pose are on their surfaces and at their places."""
        if pinned.statement is None or pinned.values is None:
            return
        point = self._at(frame)
        for one in holding:
            if one.frames.first < frame:
                self._check_held(one, frame, pinned.statement)
            elif one.height is not None:
                off = float(point.numbers([one.height])[0])
                if abs(off) > OFF_SURFACE:
                    where = "above" if off > 0 else "below"
                    message = f"`{one.name}` is {abs(off):.4g} m {where} the {one.surface} in this pose"
                    hint = f"let it stand at another frame, or write `{pinned.statement.base.name} grounded`"
                    self.context.error(pinned.statement, message, hint)

        for contact in self.contacts.free():
            assert contact.free is not None
            surface = contact.free.surface
            off = float(point.numbers(list(self.contacts.heights_above(contact, surface))).min())
            if off < -OFF_SURFACE:
                message = f"`{contact.name}` is {-off:.4g} m below the {surface.name} in this pose"
                hint = "what is free stays above its surface, a plane without edges: it cannot come from beside a step"
                self.context.error(pinned.statement, message, hint)

    def _check_held(self, one: Holding, frame: int, statement: syntax.Pose) -> None:
        """Check that a fixed pose agrees with the places of held constraints."""
        point = self._at(frame)
        zeros = [place.zero for place in one.places if place.zero is not None]
        off, move, what = float(np.abs(point.numbers(zeros)).max(initial=0.0)), "", "off its place"
        certain = off > OFF_SURFACE
        moved, about = self._moved(one, frame)
        if moved is not None:
            away = float(np.linalg.norm(moved))
            certain |= away > OFF_SURFACE and not about
            off = max(off, away) if away > OFF_SURFACE + about else off
            what = "off where it can have rolled" if about else what
            x, y = (0.0 if abs(part) < 1e-4 else float(f"{-part:.3g}") for part in moved[:2])
            move = f": moved by ({x:g}, {y:g}, 0) it does" if abs(moved[2]) <= OFF_SURFACE else ""
        if off > OFF_SURFACE:
            since = f"where it holds since frame {one.frames.first}"
            message = f"`{one.name}` is {off:.4g} {what} in this pose, {since}"
            hint = f"let it stand on fewer frames, or state a pose that it fits{move}"
            if certain:
                self.context.error(statement, message, hint)
            else:
                self.context.diagnostics.warning(message, statement.start, statement.end, hint)

    def _moved(self, one: Holding, frame: int) -> tuple[Matrix | None, float]:
        """How far a held constraint is from where it should be at a frame with a fixed pose, (3,), and how uncertain
        that is, in m; None if that is not known.
        """
        begin = self.pinned.get(one.frames.first)
        if begin is None or begin.values is None:
            return None, 0.0
        at, rolled, about = (one.at, np.zeros(3), 0.0) if one.at else self._rolled(one, frame)
        if not at:
            return None, 0.0
        return self._at(frame).numbers(at) - self._at(one.frames.first).numbers(at) - rolled, about

    def _rolled(self, one: Holding, frame: int) -> tuple[Sequence[Expr], Matrix, float]:
        """The middle of a ball, how far it has rolled since it stands, (3,), and how uncertain that is, in m.

        If another ball of its body stands as long, it is certain.  The way of a single ball is not known, only the turn
        between both poses; it is taken to be short, and nothing is said of wheels, which may have turned several times.
        """
        known, first = self.contacts.contacts, one.frames.first
        ball = known.get(one.name)
        nothing: tuple[Sequence[Expr], Matrix, float] = ((), np.zeros(3), 0.0)
        dynamics = self.contacts.scope.dynamics
        if ball is None or not ball.radius or not dynamics.tree.segments[ball.frame.segment].joint.limited:
            return nothing
        axes = [part for row in dynamics.kinematics.axes_of(ball.frame) for part in row]
        turn = (self._at(frame).numbers(axes).reshape(3, 3)) @ self._at(first).numbers(axes).reshape(3, 3).T
        angle = math.acos(min(max(0.5 * (np.trace(turn) - 1.0), -1.0), 1.0))
        axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        length = float(np.linalg.norm(axis))
        if length:
            axis *= ball.radius * angle / length
        phase = next(phase for phase in ball.phases if phase.frames.first == first)
        paired = any(
            other is not ball and other.radius and other.frame.segment == ball.frame.segment
            and any(phase.frames.first <= first and frame <= phase.frames.last for phase in other.phases)
            for other in known.values()
        )  # fmt: skip
        at = self.contacts.paths.place(ball.frame)[0]
        about = 0.0 if paired else OFF_SURFACE + ball.radius * angle**2
        return at, np.cross(axis, np.array(phase.surface.normal)), about

    # ------------------------------------------------------------------------ forces

    def idle_forces(self) -> Iterator[Relation]:
        """Contact force components without effect, such as those perpendicular to a planar model, are zero."""
        contacts = self.contacts
        for contact, parts in contacts.components():
            rows = self.generic.jacobian([rate for _, rate in parts])
            span = self.context.span(contact.statement)
            for index, ((name, _), row) in enumerate(zip(parts, rows, strict=True)):
                if row.any():
                    continue
                text = f"{name} does nothing"
                yield Relation(sym(VariableRef(name)), ZERO, ZERO, self.context.everywhere, span, text)
                for frame in contacts.impact_frames():
                    for other, _, names in contacts.struck(frame):
                        if other is contact:
                            impulse = sym(ParameterRef(names[index]))
                            yield Relation(impulse, ZERO, ZERO, FrameRange(0, 0), span, text)
