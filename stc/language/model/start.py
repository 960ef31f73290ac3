"""The guess for a motion of a model: interpolation between its fixed poses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from stc.language.context import Context
from stc.language.model.pose_rows import Values
from stc.language.model.scope import Coordinates, ModelScope
from stc.problem import FrameRange, Guess, IndexRef, Relation, VariableRef
from stc.symbolic.expr import ONE, Expr, call, div, mul, neg, num, sub, sum_of, sym


def way_between(
    context: Context, scope: ModelScope, known: Mapping[int, Values], flights: Sequence[tuple[int, int]]
) -> Iterator[Guess]:
    """The guess of all coordinates: interpolation between known poses, with the shortest rotation between orientations.

    While nothing touches, the root follows a ballistic arc to the next contact, or falls from its known position.  A
    body on the world that turns about a hinge by more than half a turn does so in flight: no feet stand meanwhile.

    Args:
        known: poses by frame, one at least that gives all coordinates; others may give a few.
        flights: first and last frames of stretches without contact.
    """
    for one in scope.coordinates:
        for name in one.positions:
            places = _places(known, [name])
            if one.joint.kind == "hinge" and not scope.mechanism.bodies[one.joint.body].parent:
                places = list(_turned_in_flight(name, places, flights, context))
            yield from _straight(name, places, context)
        if one.rotation is not None:
            yield from _turning(one, _places(known, one.rotation.quaternion), context)
    root = scope.coordinates[0] if scope.coordinates else None
    if root is not None and root.joint.kind == "free":
        for first, last in flights:
            yield _thrown(context, scope, root.positions[2], _places(known, [root.positions[2]]), first, last)


def fixed_coordinates(scope: ModelScope, relations: Sequence[Relation]) -> dict[int, Values]:
    """Values of single coordinates at single frames that equations fix, by frame.

    Of an orientation three components are enough: of the two quaternions that have them, the fourth one positive.
    """
    names = {name for one in scope.coordinates for name in one.pose}
    found: dict[int, Values] = {}
    for relation in relations:
        key = relation.body.payload if relation.body.op == "sym" else None
        if (
            relation.is_equality
            and relation.lower is not None
            and relation.range.first == relation.range.last
            and isinstance(key, VariableRef)
            and key == VariableRef(key.name)
            and key.name in names
        ):
            found.setdefault(relation.range.first, {})[key.name] = relation.lower
    for values in found.values():
        for rotation in scope.rotations:
            given = [name for name in rotation.quaternion if name in values]
            if len(given) == 3:
                (missing,) = set(rotation.quaternion) - set(given)
                rest = sub(ONE, sum_of([mul(values[name], values[name]) for name in given]))
                values[missing] = call("sqrt", rest)
    return found


def _places(known: Mapping[int, Values], names: Sequence[str]) -> list[tuple[int, Values]]:
    """The frames at which all of some coordinates are known, with their values."""
    return [(frame, known[frame]) for frame in sorted(known) if all(name in known[frame] for name in names)]


def _thrown(
    context: Context,
    scope: ModelScope,
    height: str,
    places: Sequence[tuple[int, Values]],
    first: int,
    last: int,
) -> Guess:
    """The height of the root in a flight: an arc above the interpolation, or a fall if one end is open."""
    before = max([place for place in places if place[0] <= first], default=places[0], key=lambda p: p[0])
    after = min([place for place in places if place[0] >= last], default=places[-1], key=lambda p: p[0])
    index = sym(IndexRef())
    since, until = sub(index, num(float(first))), sub(num(float(last)), index)
    if places[-1][0] <= first and last == context.n:
        arc = neg(mul(since, since))
    elif places[0][0] >= last and first == 0:
        arc = neg(mul(until, until))
    else:
        arc = mul(since, until)
    pull = num(-0.5 * scope.mechanism.options.gravity[2])
    thrown = mul(mul(pull, mul(context.builder.step, context.builder.step)), arc)
    base = _between(before[0], before[1][height], after[0], after[1][height])
    return Guess(height, base + thrown, FrameRange(first, last), context.span(scope.statement))


def _turned_in_flight(
    name: str, places: Sequence[tuple[int, Values]], flights: Sequence[tuple[int, int]], context: Context
) -> Iterator[tuple[int, Values]]:
    """The places of an angle, with those at the ends of flights between two that are more than half a turn apart."""
    yield from places[:1]
    for (a, begin), (b, end) in pairwise(places):
        within = [one for one in flights if a <= one[0] < one[1] <= b]
        turn = context.number(end[name]) - context.number(begin[name])
        turned, whole = 0, sum(last - first for first, last in within)
        for first, last in within if abs(turn) > math.pi else []:
            for frame in (first, last):
                turned += (last - first) * (frame == last)
                share = num(turned / whole)
                if a < frame < b:
                    yield frame, {name: begin[name] + mul(share, sub(end[name], begin[name]))}
        yield b, end


def _between(first: int, a: Expr, last: int, b: Expr) -> Expr:
    """Linear interpolation over frames."""
    if first == last:
        return a
    share = div(sub(sym(IndexRef()), num(float(first))), num(float(last - first)))
    return a + mul(share, sub(b, a))


def _stretches(places: Sequence[tuple[int, object]], n: int) -> Iterator[tuple[int, int]]:
    """Numbers of neighbouring places, the first and the last one alone where the motion goes on beyond them."""
    if places[0][0] > 0 or len(places) == 1:
        yield 0, 0
    yield from pairwise(range(len(places)))
    if places[-1][0] < n and len(places) > 1:
        yield len(places) - 1, len(places) - 1


def _range(places: Sequence[tuple[int, object]], a: int, b: int, n: int) -> FrameRange:
    if a != b:
        return FrameRange(places[a][0], places[b][0])
    if len(places) == 1:
        return FrameRange(0, n)
    return FrameRange(0, places[0][0]) if a == 0 else FrameRange(places[a][0], n)


def _straight(name: str, places: Sequence[tuple[int, Values]], context: Context) -> Iterator[Guess]:
    assert context.model is not None
    span = context.span(context.model.statement)
    for a, b in _stretches(places, context.n):
        body = _between(places[a][0], places[a][1][name], places[b][0], places[b][1][name])
        yield Guess(name, body, _range(places, a, b, context.n), span)


def _turning(one: Coordinates, places: Sequence[tuple[int, Values]], context: Context) -> Iterator[Guess]:
    """The shortest rotation from each orientation to the next, at a constant rate."""
    assert one.rotation is not None
    assert context.model is not None
    span = context.span(context.model.statement)
    names = one.rotation.quaternion
    ends = [np.array([context.number(values[name]) for name in names]) for _, values in places]
    for k in range(1, len(ends)):  # the nearer of the two quaternions of the same pose
        if ends[k] @ ends[k - 1] < 0:
            ends[k] = -ends[k]
    for a, b in _stretches(places, context.n):
        half = math.acos(min(1.0, max(-1.0, float(ends[a] @ ends[b]))))
        if half < 1e-7:  # an arc cosine is no more exact than the root of a rounding error
            bodies: list[Expr] = [num(float(part)) for part in ends[a]]
        else:
            first, last = places[a][0], places[b][0]
            share = div(sub(sym(IndexRef()), num(float(first))), num(float(last - first)))
            left = call("sin", mul(num(half), sub(num(1.0), share)))
            right = call("sin", mul(num(half), share))
            scale = 1.0 / math.sin(half)
            bodies = [
                mul(num(scale * float(p)), left) + mul(num(scale * float(q)), right)
                for p, q in zip(ends[a], ends[b], strict=True)
            ]
        where = _range(places, a, b, context.n)
        yield from (Guess(name, body, where, span) for name, body in zip(names, bodies, strict=True))
