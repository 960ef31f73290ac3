"""Contact without a schedule: the solver decides when a point or a sole touches.

The laws hold at the end of every step, as products of a force and a conjugate quantity.  A point pushes only while it
touches: its gap g and its pressure p are nonnegative, and g p = 0.  Friction f is within Coulomb's cone, |f| <= mu p.

As with a schedule, a point does not slip while it touches: p v = 0, with the velocity v along the surface, in that step
and in the next one; otherwise it would touch down on every other frame and slip between.  A sole stands flat: its gap
is that of all corners, and its wrench in the cone of a rectangle.  A point that ``slides`` may move, and then friction
dissipates the most it can: with the speed s,

    |v| <= s,    f.v + mu p s = 0

The cones |f| <= mu p and |v| <= s are each other's dual, so that the sum is never negative; it is zero where v = 0 (the
point sticks, with any friction in the cone) or f = -mu p v/|v| (it slides), and nothing else.  In space friction is
this one product of cones and needs no pyramid's directions (second-order cone complementarity; the law of maximal
dissipation: Stewart and Trinkle 1996, Anitescu and Potra 1997; as constraints of an optimisation Posa, Cantu and
Tedrake 2014).  A speed r that goes to zero with the relaxation rounds the tip of the cone of velocities, and a wide
limit keeps s from drifting off where no force asks for it: r^2 <= s^2 - v.v <= r^2 + 1, in m^2/s^2.  In the plane the
sum is that of two products of numbers, 2 (f v + mu p s) = (mu p + f) (s + v) + (mu p - f) (s - v).

Two methods reduce the products to zero, each where it performed better (docs/complementarity.md).
The laws of standing contacts and of those that slide in three dimensions are relaxed by a constant, which the solve
reduces (Scholtes 2001, :mod:`stc.solving.complementarity`): at zero no point has room on all sides.  What slides in the
plane is stated by complementary pairs, whose products are an exact penalty (:mod:`stc.solver.complementarity`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from stc.language.model.scope import RELAXATION
from stc.language.statements import complementary_relations
from stc.mechanism.vectors import Vector, dot, vector
from stc.problem import ConstantRef, FrameRange, FreeContact, Guess, Relation, VariableRef
from stc.symbolic.expr import ONE, ZERO, Expr, call, div, mul, neg, num, sub, substitute, sum_of, sym, symbols

if TYPE_CHECKING:
    from stc.language.model.contact import Contacts
    from stc.language.model.pose_rows import Values
    from stc.language.model.schedule import Contact, Phase

#: By how many m/s friction may be off its law where a force may act at a distance of 1 m.
RATE = 10.0
#: What touches in the first and the last pose begins with this part of an equal share of the weight, and with nothing
#: if it is as far as this, in m, from doing so.
LOADED, TOUCHES = 0.3, 0.01


def laws(contacts: Contacts, free: Sequence[FreeContact]) -> Iterator[Relation]:
    """The relations of gap, pressure and friction for the contacts under ``free:``."""
    for contact, found in zip(contacts.free(), free, strict=True):
        assert contact.free is not None
        yield from _laws(contacts, contact, contact.free, found)
        yield from _first_frame(contact, found)


def free_contacts(contacts: Contacts) -> list[FreeContact]:
    """The gap, pressure and slip of each free contact."""
    found = []
    for contact in contacts.free():
        phase = contact.free
        assert phase is not None
        # Corners of a sole that are one in the plane of a planar model count once.
        gaps = list(dict.fromkeys(contacts.heights_above(contact, phase.surface)))
        pressure = dot(vector(phase.surface.normal), _force(contact))
        x, y, _, *turning = contacts.velocities(contact, phase)
        along = [x, y]
        if turning:
            along.append(dot(vector(phase.surface.normal), (turning[0], turning[1], turning[2])))
        span = contacts.context.span(phase.statement)
        if contact.glides:
            along = []
        sticks = not contact.says("slides") and not contact.glides
        by_pairs = not sticks and len(_along(contact, along)) == 1
        found.append(
            FreeContact(
                contact.name, gaps, pressure, along, contacts.scope.weight, span, sticks, not by_pairs
            )
        )
    return found


def loads(contacts: Contacts, free: Sequence[FreeContact], known: Mapping[int, Values]) -> Iterator[Guess]:
    """The guess of pressure: a part of the weight for what touches in the first and the last pose.

    Without any load the first steps would have to find all forces at once, among many that balance the weight.

    Args:
        contacts: all contacts.
        free: those under ``free:``, from :func:`free_contacts`.
        known: poses, or parts of them, by frame.
    """
    context = contacts.context
    ends = [{VariableRef(name): value for name, value in known.get(k, {}).items()} for k in (0, context.n)]
    for contact, found in zip(contacts.free(), free, strict=True):
        assert contact.free is not None
        gaps = [substitute(gap, pose) for pose in ends for gap in found.gaps]
        if found.relaxed and contact.free.surface.normal[2] > 0.0 and all(map(context.is_fixed, gaps)):
            share: Expr = num(LOADED * found.weight / len(free))
            for gap in gaps:
                near = sub(ONE, div(gap, num(TOUCHES)))  # and nothing where that is negative
                share = mul(share, mul(num(0.5), near + call("sqrt", mul(near, near))))
            yield Guess(contact.forces[2], share, context.everywhere, found.span)


def _laws(contacts: Contacts, contact: Contact, phase: Phase, found: FreeContact) -> Iterator[Relation]:
    """Touching, pushing, sticking and sliding, at the end of every step."""
    where, pressure, surface = FrameRange(1, phase.frames.last), found.pressure, phase.surface

    def row(body: Expr, lower: Expr | None, upper: Expr | None, text: str) -> Relation:
        return Relation(body, lower, upper, where, found.span, f"{contact.name} {text}")

    along, forces = _along(contact, found.slip), [sym(VariableRef(name)) for name in contact.forces]
    friction = mul(contact.options["friction"], pressure)
    if not found.relaxed:
        yield from _pairs(contact, found, where, friction, *along[0])
        return
    allowed = mul(sym(ConstantRef(RELAXATION)), num(found.weight))
    for gap in found.gaps:
        yield row(gap, ZERO, None, f"is not below the {surface.name}")
    yield row(pressure, ZERO, None, "pushes")
    yield row(mul(pressure, sum_of(found.gaps)), None, allowed, "pushes only where it touches")
    if contact.glides:
        yield from contacts.slippery(contact, phase, forces, where)
        if contact.says("slides"):
            yield row(sym(VariableRef(contact.slip)), ZERO, ZERO, "has no friction")
        return
    if len(along) == 1 and contact.kind == "point":
        for sign in (1.0, -1.0):
            yield row(sub(friction, mul(num(sign), along[0][0])), ZERO, None, "has friction within its cone")
    else:
        yield from contacts.cone(contact, phase, forces, where)
    allowed = mul(num(RATE), allowed)
    moving = [rate for rate in found.slip if rate is not ZERO]
    if found.sticks:
        for rate in moving:
            yield row(mul(pressure, rate), neg(allowed), allowed, "does not slip where it touches")
            if contact.kind == "point":
                body, before = mul(pressure, _in_the_next_step(rate)), FrameRange(1, phase.frames.last - 1)
                text = f"{contact.name} stands still until it has left"
                yield Relation(body, neg(allowed), allowed, before, found.span, text)
        return
    slip, still = sym(VariableRef(contact.slip)), mul(num(RATE), sym(ConstantRef(RELAXATION)))
    squares = sum_of([mul(still, still), *(mul(rate, rate) for rate in moving)])
    yield row(slip, ZERO, None, "has a sliding speed of at least 0")
    yield row(sub(mul(slip, slip), squares), ZERO, ONE, "has the sliding speed of its point")
    power = sum_of([*(mul(part, rate) for part, rate in along), mul(friction, sub(slip, still))])
    yield row(power, None, allowed, "has full friction against its sliding")


def _along(contact: Contact, slip: Sequence[Expr]) -> list[tuple[Expr, Expr]]:
    """The force and the velocity of a contact along each axis of its surface in which it can move."""
    assert contact.free is not None
    force = _force(contact)
    return [
        (dot(vector(tangent), force), rate)
        for tangent, rate in zip(contact.free.surface.tangents, slip, strict=False)
        if rate is not ZERO
    ]


def _pairs(
    contact: Contact, found: FreeContact, where: FrameRange, friction: Expr, force: Expr, rate: Expr
) -> Iterator[Relation]:
    """Touching and sliding along a line, each side scaled: by the weight, 1 m and 10 m/s."""

    def pair(one: Expr, other: Expr, text: str) -> list[Relation]:
        return complementary_relations(
            div(one, num(found.weight)), other, where, found.span, f"{contact.name} {text}"
        )

    slip = sym(VariableRef(contact.slip))
    for gap in found.gaps:
        yield from pair(found.pressure, gap, "pushes only where it touches")
    text = f"{contact.name} has the sliding speed of its point"
    yield Relation(sub(mul(slip, slip), mul(rate, rate)), None, ONE, where, found.span, text)
    for sign in (num(1.0), num(-1.0)):
        room, ahead = friction + mul(sign, force), div(slip + mul(sign, rate), num(RATE))
        yield from pair(room, ahead, "has friction against its sliding")


def _first_frame(contact: Contact, found: FreeContact) -> Iterator[Relation]:
    """No forces before the first step: values at frame 0 are those of that step."""
    where = FrameRange(0, 0)
    for name in (*contact.forces, *([contact.slip] if contact.says("slides") else [])):
        body = sub(sym(VariableRef(name)), sym(VariableRef(name, 0, 1, 1)))
        yield Relation(body, ZERO, ZERO, where, found.span, f"{name} at the start is that of the first step")


def _force(contact: Contact) -> Vector:
    x, y, z = [sym(VariableRef(name)) for name in contact.forces[:3]]
    return x, y, z


def _in_the_next_step(e: Expr) -> Expr:
    """The value of an expression at the end of the next step."""
    keys = [key for key in symbols(e) if isinstance(key, VariableRef)]
    return substitute(e, {key: sym(replace(key, shift=key.shift + 1)) for key in keys})
