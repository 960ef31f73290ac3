"""Contact that nobody schedules: when a point touches, sticks and slides is left to the solver.

At the end of every step three pairs decide, of which each is a force and what it works against.  A point pushes only
where it touches: its gap g and its pressure p are not negative, and g p = 0.  Friction f is within Coulomb's cone, and
dissipates the most it can: with the velocity v along the surface, and s for its size,

    |f| <= mu p,    |v| <= s,    f.v + mu p s = 0

The two cones are each other's dual, so that the sum is never negative; it is zero where v = 0 (the point sticks, with
any friction in the cone) or f = -mu p v/|v| (it slides), and nothing else.  In flight all forces are zero, and it says
nothing.  Stated as one product of cones friction is two rows in the plane and in space; directions that a pyramid would
have are not needed (second-order cone complementarity; the law of maximal dissipation: Stewart and Trinkle 1996,
Anitescu and Potra 1997; as constraints of an optimisation Posa, Cantu and Tedrake 2014).

Both products may be as large as a constant, which the solve brings down (Scholtes 2001): at zero there would be no
point with room on all sides, and no multipliers.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from stc.language.model.scope import RELAXATION
from stc.mechanism.vectors import Vector, dot, vector
from stc.problem import ConstantRef, FrameRange, Relation, VariableRef
from stc.symbolic.expr import ZERO, Expr, mul, neg, num, sub, sum_of, sym

if TYPE_CHECKING:
    from stc.language.model.contact import Contacts
    from stc.language.model.schedule import Contact, Phase

#: In m/s for each m: how far friction may be from its law, where a force may act at a distance.
RATE = 10.0
#: Of a slip in m/s: where nothing moves the cone of velocities would have no inside.
STILL = 1e-3


def free_contacts(contacts: Contacts) -> Iterator[Relation]:
    """The rows of all contacts that are free."""
    for contact in contacts.free():
        assert contact.free is not None
        yield from _laws(contacts, contact, contact.free)
        yield from _first_frame(contacts, contact, contact.free)


def _laws(contacts: Contacts, contact: Contact, phase: Phase) -> Iterator[Relation]:
    """Touching, pushing, sticking and sliding, at the end of every step."""
    where, span = FrameRange(1, phase.frames.last), contacts.context.span(phase.statement)
    force, normal = _force(contact), vector(phase.surface.normal)
    pressure, slip = dot(normal, force), sym(VariableRef(contact.slip))
    (gap,) = contacts.heights_above(contact, phase.surface)
    friction = mul(contact.options["friction"], pressure)
    allowed = mul(sym(ConstantRef(RELAXATION)), num(contacts.scope.weight))

    def row(body: Expr, lower: Expr | None, upper: Expr | None, text: str) -> Relation:
        return Relation(body, lower, upper, where, span, f"{contact.name} {text}")

    yield row(gap, ZERO, None, f"is not below the {phase.surface.name}")
    yield row(pressure, ZERO, None, "pushes")
    yield row(mul(pressure, gap), None, allowed, "pushes where it touches")
    along = [
        (dot(vector(tangent), force), rate)
        for tangent, rate in zip(phase.surface.tangents, contacts.velocities(contact, phase), strict=False)
        if rate is not ZERO
    ]
    if not along:
        yield Relation(slip, ZERO, ZERO, contacts.context.everywhere, span, f"{contact.name} cannot slide")
        return
    allowed = mul(num(RATE), allowed)
    if len(along) == 1:
        for sign in (1.0, -1.0):
            yield row(sub(friction, mul(num(sign), along[0][0])), ZERO, None, "does not slip")
    else:
        yield from contacts.cone(contact, phase, _force(contact), where)
    if not contact.says("slides"):
        for _, rate in along:
            body, text = mul(pressure, rate), f"{contact.name} stands still where it touches"
            yield Relation(body, neg(allowed), allowed, where, span, text)
        return
    still = num(STILL)
    squares = sum_of([rate * rate for _, rate in along])
    speed = sub(sub(mul(slip, slip), mul(still, still)), squares)
    yield row(slip, ZERO, None, "slides at no negative speed")
    yield row(speed, ZERO, ZERO, "slides as fast as it moves")
    power = sum_of([*(mul(part, rate) for part, rate in along), mul(friction, sub(slip, still))])
    yield row(power, None, allowed, "rubs against its sliding, as much as it can")


def _first_frame(contacts: Contacts, contact: Contact, phase: Phase) -> Iterator[Relation]:
    """Nothing acts before the first step: what frame 0 is given is that step's."""
    where, span = FrameRange(0, 0), contacts.context.span(phase.statement)
    for name in (*contact.forces, *([contact.slip] if contact.says("slides") else [])):
        body = sub(sym(VariableRef(name)), sym(VariableRef(name, 0, 1, 1)))
        yield Relation(body, ZERO, ZERO, where, span, f"{name} at the start is that of the first step")


def _force(contact: Contact) -> Vector:
    x, y, z = [sym(VariableRef(name)) for name in contact.forces]
    return x, y, z
