"""The distance between the surfaces of two geoms: spheres, capsules, boxes and planes.

A sphere is a centre with a radius around it, a capsule a segment, a box three segments added up: each is a *core*, the
sum of a centre and of segments, with a ball of some radius added (a plane is all that lies below it).  The distance of
two of them is the greatest gap that a direction sees between them: with the vector c between the centres and the half
segments e_k u_k of both,

    distance = max over unit vectors n of  n.c - sum_k e_k abs(n.u_k) - the radii,

since the support function of a sum is the sum of the support functions.  If the cores overlap, the same maximum is the
negative depth of penetration.  With the direction as an unknown, ``distance >= d`` is therefore stated exactly,
without a kink and without complementarity [Zhang, Liniger & Borrelli 2021]; any direction gives a lower bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from itertools import combinations as pairs
from itertools import product as signs_of

from stc.mechanism.dynamics import Dynamics
from stc.mechanism.kinematics import Kinematics
from stc.mechanism.mechanism import Geom
from stc.mechanism.transmissions import magnitude
from stc.mechanism.tree import WORLD, Frame
from stc.mechanism.vectors import Matrix, Vector, cross, dot, minus, plus, product, scaled, times, transposed
from stc.records import dataclass
from stc.symbolic.expr import ONE, Expr, add, call, div, mul, neg, num, sub, sum_of

#: The shapes that have a distance.
SHAPES = ("sphere", "capsule", "box", "plane")

#: Over which share of a half segment the nearest point's stop at its end is rounded, and the side of a segment that a
#: direction sees.
_ROUNDED, _SIDES = 0.1, 1e-2
#: How often the nearest points follow one another.
_SWEEPS = 3
#: The same where the bound is evaluated only, and may be rough.
_SHARP, _MANY = 1e-4, 30


@dataclass(frozen=True, slots=True)
class Separation:
    """The separation of two geoms, in the axes of their common ancestor segment.

    Attributes:
        centre: from the core of the second to that of the first.
        halves: the half lengths of the segments of both cores, and their directions.
        radii: of both together.
        normal: the normal of the plane, if one of them is a plane: the direction is then known, and its centre is a
            point on it.
    """

    centre: Vector
    halves: tuple[tuple[float, Vector], ...]
    radii: float
    normal: Vector | None = None

    @property
    def is_smooth(self) -> bool:
        """Whether the distance has no kinks: for two spheres, or a sphere and a plane."""
        return not self.halves

    @property
    def has_direction(self) -> bool:
        """Whether an exact statement needs the direction as an unknown."""
        return self.normal is None and not self.is_smooth

    def widths(self, direction: Sequence[Expr]) -> list[Expr]:
        """The projection of each half segment on a direction, e_k (n.u_k), with a sign."""
        return [mul(num(e), dot(direction, u)) for e, u in self.halves]

    def direction(self, rounded: float = _ROUNDED, sweeps: int = _SWEEPS) -> Vector:
        """An approximation of the direction of the largest gap, smooth: between approximate nearest points of the
        cores.

        Each half segment's own point moves in turn to where it is nearest to the other core, and stops smoothly at its
        ends.
        """
        if self.normal is not None:
            return self.normal
        way = self.centre
        shares: list[Expr] = [num(0.0)] * len(self.halves)
        for _ in range(sweeps if len(self.halves) > 1 else 1):
            for k, (e, u) in enumerate(self.halves):
                wanted = add(shares[k], mul(num(1.0 / e), dot(way, u)))
                share = _stopped(wanted, rounded)
                way = minus(way, scaled(mul(num(e), sub(share, shares[k])), u))
                shares[k] = share
        return scaled(div(ONE, magnitude(way)), way)

    def lower_bound(self) -> Expr:
        """A smooth function that is at most the distance while the cores do not overlap; the distance itself if that
        is smooth.
        """
        if self.is_smooth and self.normal is None:
            return sub(magnitude(self.centre), num(self.radii))
        direction = self.direction()
        return self._seen(direction, dot(direction, self.centre), _SIDES)

    def value(self) -> Expr:
        """The distance of the two shapes, too small by at most about 1e-4 of their sizes.

        It is the largest gap along any of several directions: the normals of the sides, the directions perpendicular to
        one side's normal of each shape (faces or edges are nearest along one of these), and :meth:`direction` for
        corners.  Its derivatives are large, and it takes many operations.
        """
        if self.normal is not None or self.is_smooth:
            return self._seen(self.direction(), dot(self.direction(), self.centre), _SHARP)
        sides = [u for _, u in self.halves]
        across = [cross(u, v) for u, v in pairs(sides, 2)]
        ways = [
            *sides,
            *(scaled(div(ONE, magnitude(way)), way) for way in across),
            self.direction(_SHARP, _MANY),
        ]
        gaps = [self._seen(way, _absolute(dot(way, self.centre), _SHARP**2), _SHARP) for way in ways]
        return reduce(_greater, gaps)

    def _seen(self, direction: Sequence[Expr], way: Expr, rounded: float) -> Expr:
        """The gap along a direction, from the projection of the vector between the centres."""
        sizes = [e for e, _ in self.halves]
        widths = [
            _absolute(width, rounded * e) for width, e in zip(self.widths(direction), sizes, strict=True)
        ]
        return sub(sub(way, sum_of(widths)), num(self.radii))

    def gaps(self, direction: Sequence[Expr], widths: Sequence[Expr]) -> list[Expr]:
        """Expressions whose minimum is the gap along a direction, if ``widths`` are not too small.

        Parameters
        ----------
        direction
            A unit vector, (3,).
        widths
            For each half segment but the first at least the absolute value of what :meth:`widths` gives.
        """
        gap = sub(sub(dot(direction, self.centre), sum_of(list(widths))), num(self.radii))
        if not self.halves:
            return [gap]
        first = self.widths(direction)[0]
        return [sub(gap, first), add(gap, first)]

    def corners(self) -> list[Expr]:
        """The heights of all corners of a core over a plane, less its radius."""
        assert self.normal is not None
        height = sub(dot(self.normal, self.centre), num(self.radii))
        parts = self.widths(self.normal)
        return [
            add(
                height,
                sum_of([part if sign > 0 else neg(part) for sign, part in zip(signs, parts, strict=True)]),
            )
            for signs in signs_of((-1, 1), repeat=len(parts))
        ]


def separation(dynamics: Dynamics, first: int, second: int) -> Separation:
    """The separation of two geoms of a model.

    Raises:
        ValueError: one of them has a shape without a distance, or both are planes.
    """
    geoms = dynamics.mechanism.geoms
    for index in (first, second):
        if geoms[index].kind not in SHAPES:
            raise ValueError(f"the geom `{geoms[index].name}` is a {geoms[index].kind}")
    if geoms[first].kind == "plane":
        first, second = second, first
    if geoms[first].kind == "plane":
        raise ValueError("both are planes")
    kinematics = dynamics.kinematics
    frames = dynamics.geoms[first], dynamics.geoms[second]
    common = kinematics.common(frames[0].segment, frames[1].segment)
    (turn, at), (other_turn, other_at) = [_in_segment(kinematics, frame, common) for frame in frames]
    centre = minus(at, other_at)
    halves, radius = _core(geoms[first], turn)
    if geoms[second].kind == "plane":
        return Separation(centre, halves, radius, transposed(other_turn)[2])
    more, other_radius = _core(geoms[second], other_turn)
    return Separation(centre, (*halves, *more), radius + other_radius)


def _core(geom: Geom, turn: Matrix) -> tuple[tuple[tuple[float, Vector], ...], float]:
    """The half segments of a geom's core, and the radius of the ball around it."""
    x, y, z = transposed(turn)
    if geom.kind == "sphere":
        return (), geom.size[0]
    if geom.kind == "capsule":
        return ((geom.size[1], z),), geom.size[0]
    return tuple(zip(geom.size, (x, y, z), strict=True)), 0.0


def _in_segment(kinematics: Kinematics, frame: Frame, segment: int) -> tuple[Matrix, Vector]:
    """The axes of a frame, as columns, and its origin in an ancestor segment, or in the world."""
    turn, at, here = frame.turn, frame.at, frame.segment
    while here not in (segment, WORLD):
        axes, origin = kinematics.locals[here]
        turn, at = product(axes, turn), plus(origin, times(axes, at))
        here = kinematics.tree.segments[here].parent
    return turn, at


def _greater(a: Expr, b: Expr) -> Expr:
    """The greater of two."""
    return mul(num(0.5), add(add(a, b), _absolute(sub(a, b), 0.0)))


def _stopped(share: Expr, rounded: float) -> Expr:
    """A share between -1 and 1, close to a given one: half the difference of the distances from both ends, rounded."""
    above, below = [_absolute(end, rounded) for end in (add(share, ONE), sub(share, ONE))]
    return mul(num(0.5), sub(above, below))


def _absolute(x: Expr, rounded: float) -> Expr:
    """The absolute value, rounded upwards."""
    return call("sqrt", add(mul(x, x), num(rounded**2)))


__all__ = ["SHAPES", "Separation", "separation"]
