"""The stance of a model: its lowest points, and a balanced pose close to a given one.

The pose in a file often has straight legs, feet that are not level, and the centre of mass beside them.  Such a pose
is hard or impossible to hold, because a straight leg cannot push.  This module bends the knees, and moves the joints
between the feet and the rest as little as necessary to level the feet below the centre of mass.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from copy import copy
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stc.fitting import Fit
from stc.language import syntax
from stc.language.model.scope import ModelScope, coordinates_of, path_of
from stc.language.model.surfaces import floor
from stc.mechanism.equalities import held
from stc.mechanism.forces import Forces, Wrench
from stc.mechanism.mechanism import Geom, Mechanism
from stc.mechanism.tree import rotation
from stc.mechanism.vectors import Vector, vector
from stc.problem import ConstantRef, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import Expr, evaluate_all, mul, num, sum_of, sym, symbols

Matrix = NDArray[np.float64]

#: Places of one body that are this much above its lowest one, in m, belong to its sole.
_SOLE = 5e-3
#: The share of a joint's range that a joint at its end, or beyond, is moved inside.
_INSIDE = 0.1
#: A joint within this share of its range from its end is at it.
_AT_END = 1e-3
#: Places that stand are level, and a centre of mass is above them, to this, in m.
_LEVEL = 1e-9
#: Joints of two poses that differ by less, in m or rad, are the same.
_SAME = 1e-6
#: The centre of mass of a pose that balances is inside of what stands by this share of its size.
_MARGIN = 0.1
_ROUNDS, _TURNS = 50, 4
#: The step of differences by which the pose is found, and the largest one of a joint in a round, in m or rad.
_STEP, _FAR = 1e-6, 0.2
#: The corners of the square around the cone of friction.
_CORNERS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
#: Forces balance to this share of what the weight is to the joint, and of the weight, with levers of 1 m.
_BALANCE, _NEARLY, _TINY = 1e-3, 1e-5, 1e-9


@dataclass(frozen=True, slots=True)
class Spot:
    """A point that may touch the floor: a point of a body, or a ball about one.

    Attributes:
        body: index of the body.
        at: position in the body's frame, in m.
        radius: radius of the ball, in m.
        friction: sliding friction on the floor.
        written: its name in the language.
        resists: the path of its geom, if that has a name and friction against turning and rolling.
        rolls: whether it is a wheel, a cylinder that a hinge without a range turns about its axis.
    """

    body: int
    at: tuple[float, float, float]
    radius: float
    friction: float
    written: str
    resists: str = ""
    rolls: bool = False


class Stance:
    """The parts of a model that can stand on its floor, and its height in its poses.

    Parameters
    ----------
    mechanism
        The model.
    start
        The pose to look at, (nq,).
    apart
        Bodies that are not looked at.
    """

    def __init__(self, mechanism: Mechanism, start: Sequence[float], apart: Container[int] = ()) -> None:
        self.mechanism = mechanism
        self.start = np.array(start, float)
        self.apart = apart
        self.scope = ModelScope(syntax.ModelFile(0, 0, ""), Path(), mechanism)
        self.fit = Fit(self.scope)
        self.floor = floor(self.scope)
        self.up = np.array(self.floor.normal)
        self.drawn = self.start.copy()
        for index, value in self._inside(0.0).items():
            self.start[mechanism.joints[index].qpos] = value
        self._keys = [VariableRef(name) for one in map(coordinates_of, mechanism.joints) for name in one.pose]
        self.spots = list(self._spots())

    # ------------------------------------------------------------------- numbers

    def _numbers(self, bodies: Sequence[Expr], q: Matrix) -> Matrix:
        """(len(bodies), k) the values of functions of the configuration in k poses, (nq, k)."""
        known: dict[object, object] = {
            ConstantRef(name): value for name, value in self.scope.constants.items()
        }
        known.update(zip(self._keys, q, strict=True))
        values = evaluate_all(list(bodies), known)
        return np.array([np.broadcast_to(np.asarray(value, float), q.shape[1:]) for value in values])

    def seen(self, q: Matrix, spots: Sequence[Spot]) -> tuple[Matrix, Matrix]:
        """(3, spots, k) the lowest points of spots in k poses, and (3, k) the centre of mass."""
        dynamics = self.scope.dynamics
        bodies = [
            part
            for spot in spots
            for part in dynamics.kinematics.place_of(dynamics.tree.frame(spot.body, vector(spot.at)))
        ]
        values = self._numbers([*bodies, *dynamics.centre_of_mass(0)], q)
        places = values[:-3].reshape(len(spots), 3, -1).transpose(1, 0, 2)
        down = np.multiply.outer(self.up, [spot.radius for spot in spots])
        return places - down[:, :, None], values[-3:]

    # --------------------------------------------------------------------- spots

    def _spots(self) -> Iterator[Spot]:
        """Points of all moving geoms with contacts whose body has a name."""
        mechanism, dynamics = self.mechanism, self.scope.dynamics
        for index, geom in enumerate(mechanism.geoms):
            name = mechanism.bodies[geom.body].name
            touches = (geom.contype or geom.conaffinity) and geom.body not in self.apart
            if dynamics.geoms[index].segment < 0 or not touches or not name:
                continue
            axes = self._numbers(
                [part for row in dynamics.kinematics.axes_of(dynamics.geoms[index]) for part in row],
                self.start[:, None],
            ).reshape(3, 3)
            turn = rotation(geom.quat)
            for at, rounded, written in _lowest(geom, axes, self.up):
                radius = rounded + geom.margin
                x, y, z = [
                    0.0 if abs(v) < 1e-9 else float(f"{v:.6g}") for v in np.array(geom.pos) + turn @ at
                ]
                place = f"point({path_of('body', name)}, {x:.6g}, {y:.6g}, {z:.6g})"
                ball = f", radius = {radius:.6g}" if radius else ""
                friction = self.floor.friction_with(geom)
                resists = path_of("geom", geom.name) if geom.condim > 3 and geom.name else ""
                rolls = self._turns_about(geom, turn[:, 2])
                yield Spot(geom.body, (x, y, z), radius, friction, written or place + ball, resists, rolls)

    def lowest(self, near: float, whole: bool = False) -> list[Spot]:
        """The lowest points in the given pose, on bodies that carry no other body with such points.

        Parameters
        ----------
        near
            How far above the lowest of all that of another body may be, in m.
        whole
            Whether a body and those that it carries are one foot, as are a heel and its toes.
        """
        if not self.spots:
            return []
        places, _ = self.seen(self.start[:, None], self.spots)
        heights = (self.up @ places[:, :, 0]).tolist()
        least: dict[int, float] = {}
        for spot, height in zip(self.spots, heights, strict=True):
            least[spot.body] = min(height, least.get(spot.body, math.inf))
        bottom = min(heights)
        found = {
            spot.written: spot
            for spot, height in zip(self.spots, heights, strict=True)
            if height < min(math.inf if whole else least[spot.body] + _SOLE, bottom + near)
        }
        carry = {above for spot in found.values() for above in self._above(spot.body)}
        touching = {spot.body for spot in found.values()}
        by_body: dict[int, list[Spot]] = {}
        for spot in found.values():
            if whole:
                *_, heel = spot.body, *[body for body in self._above(spot.body) if body in touching]
                by_body.setdefault(heel, []).append(spot)
            elif spot.body not in carry:
                by_body.setdefault(spot.body, []).append(spot)
        feet = [self._three(spots) for spots in by_body.values()]
        if not self._reach(feet):
            lowest = {spot.written: height for spot, height in zip(self.spots, heights, strict=True)}
            feet = [[min(foot, key=lambda spot: lowest[spot.written])] for foot in feet]
        return [spot for foot in feet for spot in foot]

    def _reach(self, feet: Sequence[Sequence[Spot]]) -> bool:
        """Whether joints are enough for every foot to stand flat: legs of three joints stand on points."""
        flat = sum((3, 5, 6)[min(len(foot), 3) - 1] for foot in feet)
        free = any(joint.kind == "free" for joint in self.mechanism.joints)
        return not free or flat <= 6 + len(self._between([spot for foot in feet for spot in foot]))

    def height(self) -> float:
        """The height of the lowest contact point above the floor in the given pose, in m; 0 without contact points."""
        if not self.spots:
            return 0.0
        places, _ = self.seen(self.start[:, None], self.spots)
        return float((self.up @ places[:, :, 0] - self.up @ self.floor.origin).min())

    def stands(self, near: float) -> bool:
        """Whether what is lowest are legs, carried by joints and below the root's own origin, or wheels that are not
        above it, with whatever else is as low; what is lowest of a mounted arm is its base, or something in the air.

        Parameters
        ----------
        near
            How far above the lowest of all places others may be, and the origin at least is above legs, in m.
        """
        lowest = self.lowest(near)
        legs = bool(lowest) and self.height() < -near and all(self._between([spot]) for spot in lowest)
        return legs or (self.height() < _SOLE and any(spot.rolls for spot in lowest))

    def _turns_about(self, geom: Geom, axis: Matrix) -> bool:
        """Whether a geom is a cylinder with this axis, (3,) in its body, about which a hinge turns it without end."""
        joints = [self.mechanism.joints[k] for k in self.mechanism.bodies[geom.body].joints]
        return geom.kind == "cylinder" and any(
            joint.kind == "hinge" and not joint.limited and abs(np.dot(joint.axis, axis)) > 1.0 - 1e-6
            for joint in joints
        )

    def _three(self, spots: Sequence[Spot]) -> Sequence[Spot]:
        """The three points of a body that span the largest area; more points would not determine their forces."""
        if len(spots) < 4:
            return spots
        places, _ = self.seen(self.start[:, None], spots)

        def spanned(three: tuple[int, ...]) -> float:
            a, b, c = places[:, three, 0].T
            return float(np.linalg.norm(np.cross(b - a, c - a)))

        return [spots[k] for k in max(combinations(range(len(spots)), 3), key=spanned)]

    def _above(self, body: int) -> Iterator[int]:
        """The ancestors of a body in the model's tree, the nearest first and the world last."""
        while body:
            body = self.mechanism.bodies[body].parent
            yield body

    # --------------------------------------------------------------------- poses

    def _inside(self, room: float, margin: float = _INSIDE) -> dict[int, float]:
        """Joints that are outside of their range or close to its end in the pose, and a value inside, which is a share
        of the range from that end.
        """
        found = {}
        for index, joint in enumerate(self.mechanism.joints):
            if joint.limited and joint.kind in ("hinge", "slide"):
                lower, upper = joint.bounds
                value, spare = self.start[joint.qpos], room * (upper - lower)
                if not lower + spare <= value <= upper - spare:
                    inset = margin * (upper - lower)
                    found[index] = float(np.clip(value, lower + inset, upper - inset))
        return found

    def changes(self, q: Matrix | None = None) -> list[tuple[str, float]]:
        """The paths and values of joints that differ from the model's own pose.

        Parameters
        ----------
        q
            The pose; that with all joints inside of their ranges where none is given.
        """
        q = self.start if q is None else q
        return [
            (path_of("joint", joint.name), float(q[joint.qpos]))
            for joint in self.mechanism.joints
            if joint.kind in ("hinge", "slide") and abs(q[joint.qpos] - self.drawn[joint.qpos]) > _SAME
        ]

    def bent(self, share: float = _INSIDE) -> Matrix:
        """The pose with joints at an end of their range moved inside by a share of it, since straight legs are
        singular.
        """
        q = self.start.copy()
        for index, value in self._inside(_AT_END, share).items():
            q[self.mechanism.joints[index].qpos] = value
        return q

    def balances(self, spots: Sequence[Spot]) -> bool:
        """Whether the given pose stands on some points without changes."""
        pushed = [place for spot in spots for place in self._pushed(spot)]
        places, centre = self.seen(self.start[:, None], pushed)
        heights = self.up @ places[:, :, 0]
        flat = self._flat(places[:, :, 0])
        return bool(np.ptp(heights) < 1e-3 and _encloses(flat, self._flat(centre)[:, 0]))

    def holds(self, q: Matrix, spots: Sequence[Spot]) -> bool:
        """Whether the model's motors can hold a pose at rest, (nq,), on some points that push and do not slip.

        The friction of a point is the square around its cone.  Limits of forces and torques are not looked at, so that
        an answer of no is certain; where states of actuators take part, or loops are open, the answer is yes.  Dry
        friction holds nothing: it lets a joint creep.

        Source: the weight, the springs, the controls within their ranges, the forces of the points and those of
        equality constraints balance, as linear least squares with bounds.
        """
        from scipy.optimize import lsq_linear

        mechanism, scope = self.mechanism, self.scope
        if scope.activations or not self.fit.holds(q):
            return True
        known: dict[object, object] = {
            ConstantRef(name): value for name, value in self.scope.constants.items()
        }
        known.update(zip(self._keys, q, strict=True))
        across = self._sides()
        pushes: list[VariableRef] = []
        wrenches = []
        for place in (place for spot in spots for place in self._pushed(spot)):
            ways = [self.up + place.friction * (a * across[0] + b * across[1]) for a, b in _CORNERS]
            own = [VariableRef(f"push {len(pushes) + k}") for k in range(len(ways))]
            arm = -place.radius * self.up  # a ball is pushed at its lowest point
            arms = [np.cross(arm, way) for way in ways]
            force, torque = (_combined(each, own) for each in (ways, arms))
            pushes += own
            wrenches.append(Wrench(scope.dynamics.tree.frame(place.body, vector(place.at)), force, torque))
        given, links = Forces(wrenches=wrenches), list[VariableRef]()
        for each in mechanism.equalities:
            if each.active:
                link = held(scope.dynamics, each)
                own = [VariableRef(path_of("equality", each.name, name)) for name in link.names]
                given.include(link.act([sym(key) for key in own]))
                links += own
        inputs: list[object] = [*map(VariableRef, scope.controls), *pushes, *links]
        low, high = [0.0] * len(inputs), [math.inf] * len(inputs)
        low[len(inputs) - len(links) :] = [-math.inf] * len(links)
        for actuator in mechanism.actuators:
            for index, ends in zip(actuator.controls, actuator.control_ranges, strict=True):
                low[index], high[index] = ends or (-math.inf, math.inf)
        residual = scope.dynamics.residual(given.wrenches, given.on_dofs)
        known.update(zip(inputs, np.eye(len(inputs), len(inputs) + 1, 1), strict=True))
        known.update({key: 0.0 for e in residual for key in symbols(e) if key not in known})
        values = np.array(
            [np.broadcast_to(value, len(inputs) + 1) for value in evaluate_all(residual, known)]
        )
        slopes = values[:, 1:] - values[:, :1]
        if not np.isfinite(values).all():
            return True
        upper = np.maximum(high, np.array(low) + _TINY)
        found = lsq_linear(slopes, -values[:, 0], (low, upper), tol=1e-12)
        # Forces on a finger are small beside the weight of a hand.
        return bool(
            (np.abs(found.fun) <= _BALANCE * np.abs(values[:, 0]) + _NEARLY * max(scope.weight, _TINY)).all()
        )

    def driven(self) -> list[str]:
        """The paths of the hinges and slides that actuators move, but for those of bodies that are not looked at."""
        scope, given = self.scope, self.scope.dynamics.actuation()
        inputs = set(map(VariableRef, [*scope.controls, *scope.activations]))
        return [
            path_of("joint", joint.name)
            for joint in self.mechanism.joints
            if joint.kind in ("hinge", "slide")
            and joint.body not in self.apart
            and inputs & set(symbols(given[joint.dof]))
        ]

    def _pushed(self, spot: Spot) -> list[Spot]:
        """The points at which the floor pushes on a spot: all corners of a sole, otherwise the spot itself."""
        for geom in self.mechanism.geoms:
            if geom.name and spot.written == f"foot({path_of('geom', geom.name)})":
                size, turn = np.array(geom.size), rotation(geom.quat)
                corners = [np.array(geom.pos) + turn @ (size * (a, b, -1.0)) for a, b in _CORNERS]
                return [Spot(spot.body, (x, y, z), 0.0, spot.friction, "") for x, y, z in corners]
        return [spot]

    def _sides(self) -> tuple[Matrix, Matrix]:
        """Two axes of the floor, at a right angle."""
        side = np.cross(self.up, [0.0, 1.0, 0.0] if abs(self.up[1]) < 0.9 else [1.0, 0.0, 0.0])
        side = side / np.linalg.norm(side)
        return side, np.cross(self.up, side)

    def _flat(self, places: Matrix) -> Matrix:
        """(2, k) points projected to the floor."""
        return np.array(self._sides()) @ places

    def balanced(self, spots: Sequence[Spot]) -> Matrix | None:
        """A pose that balances on some points, (nq,); None if none is found.

        The places are level and the centre of mass is above the middle of them.  Damped least squares, from the pose
        with its joints bent.
        """
        joints, q = self._between(spots), self.bent()
        moving = np.array([self.mechanism.joints[k].qpos for k in joints], int)
        if not len(moving) or not spots:
            return None
        low, high = self._ranges(joints)
        for _ in range(_ROUNDS):
            columns = np.repeat(q[:, None], len(moving) + 1, axis=1)
            columns[moving, np.arange(1, len(moving) + 1)] += _STEP
            off = self._off(columns, spots)
            if np.abs(off[:, 0]).max() < _LEVEL:
                return q
            slopes = (off[:, 1:] - off[:, :1]) / _STEP
            square = slopes @ slopes.T + 1e-10 * np.eye(len(slopes))
            step = -slopes.T @ np.linalg.solve(square, off[:, 0])
            step *= min(1.0, _FAR / max(1e-300, np.abs(step).max()))
            q[moving] = np.clip(q[moving] + step, low, high)
        return None

    def standing(self, near: float, whole: bool = False) -> tuple[Matrix | None, list[Spot]]:
        """A pose that balances on what is lowest in it, (nq,), and these places; None where none is found.

        As legs bend other places of a foot become the lowest, so that both are found in turn.

        Parameters
        ----------
        near, whole
            As of :meth:`lowest`.
        """
        stance, spots = self, self.lowest(near, whole)
        for _ in range(_TURNS):
            q = stance.balanced(spots)
            if q is None:
                return None, spots
            stance = copy(self)
            stance.start = q
            stance.spots = list(stance._spots())
            before, spots = spots, stance.lowest(near, whole)
            if [spot.written for spot in spots] == [spot.written for spot in before]:
                break
        return q, before

    def _off(self, q: Matrix, spots: Sequence[Spot]) -> Matrix:
        """How far k poses are from standing on given points, (spots + 2, k), in m.

        The first rows are the heights of the points less their mean, the last two the horizontal vector from the middle
        of the points to the centre of mass; all are 0 for a pose that stands.
        """
        places, centre = self.seen(q, spots)
        heights = np.einsum("i,isk->sk", self.up, places)
        beside = self._flat(centre) - np.array([self._flat(p) for p in np.moveaxis(places, 1, 0)]).mean(
            axis=0
        )
        return np.vstack([heights - heights.mean(axis=0), beside])

    def _ranges(self, joints: Sequence[int]) -> tuple[Matrix, Matrix]:
        """The ends of joints' ranges, with a small margin."""
        ends = []
        for k in joints:
            joint = self.mechanism.joints[k]
            lower, upper = joint.bounds if joint.limited else (-math.inf, math.inf)
            room = _AT_END * (upper - lower) if joint.limited else 0.0
            ends.append((lower + room, upper - room))
        low, high = np.array(ends).T
        return low, high

    def _between(self, spots: Sequence[Spot]) -> list[int]:
        """Hinges and slides between the points and the rest, without those that carry the whole model."""
        bodies, found = self.mechanism.bodies, set()
        for spot in spots:
            for body in (spot.body, *self._above(spot.body)):
                if bodies[body].parent:
                    found |= set(bodies[body].joints)
        return [k for k in sorted(found) if self.mechanism.joints[k].kind in ("hinge", "slide")]


def _combined(ways: Sequence[Matrix], by: Sequence[VariableRef]) -> Vector:
    """The sum of constant vectors, each times an unknown."""
    x, y, z = (
        sum_of([mul(num(way[i]), sym(key)) for way, key in zip(ways, by, strict=True)]) for i in range(3)
    )
    return x, y, z


def _encloses(places: Matrix, point: Matrix) -> bool:
    """Whether the convex hull of points in the plane, (2, k), has a sufficiently large interior."""
    if places.shape[1] < 3:
        return False
    middle = places.mean(axis=1)
    size = np.linalg.norm(places - middle[:, None], axis=0).max()
    around = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
    ways = np.array([np.cos(around), np.sin(around)])
    # In every direction some place is farther than the point.
    return bool(((ways.T @ places).max(axis=1) - ways.T @ point > _MARGIN * size).all())


def _lowest(geom: Geom, axes: Matrix, up: Matrix) -> list[tuple[Matrix, float, str]]:
    """The candidate lowest points of a geom in its frame; the radius of a ball about each; its name, if it has one.

    Args:
        axes: of the geom in the world, as columns.
        up: the floor's normal.
    """
    size = np.array(geom.size)
    down = -axes.T @ up
    if geom.kind == "sphere":
        return [(np.zeros(3), size[0], f"point({path_of('geom', geom.name)})" if geom.name else "")]
    if geom.kind == "capsule":
        return [(np.array([0.0, 0.0, sign * size[1]]), size[0], "") for sign in (1.0, -1.0)]
    if geom.kind == "ellipsoid":
        return [(size**2 * down / math.sqrt(down @ (size**2 * down)), 0.0, "")]
    if geom.kind == "cylinder":
        across = down * [1.0, 1.0, 0.0]
        length = float(np.linalg.norm(across))
        if length < 1e-3:  # it stands on an end
            turns = [
                np.array([math.cos(a), math.sin(a), 0.0])
                for a in (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0)
            ]
        elif length > 1.0 - 1e-6:
            # It lies, and rolls: a ball about its axis touches where it does.  The load of a wheel is at its middle,
            # that of a roller, which is wider, at both of its ends.
            ends = (0.0,) if size[1] < size[0] else (size[1], -size[1])
            return [(np.array([0.0, 0.0, end]), size[0], "") for end in ends]
        else:
            turns = [across / length]
        return [
            (size[0] * side + np.array([0.0, 0.0, sign * size[1]]), 0.0, "")
            for side in turns
            for sign in (1.0, -1.0)
        ]
    if geom.kind == "mesh":
        hull: Matrix = np.array(geom.corners).reshape(-1, 3)
        low = hull @ down
        hull = hull[low > low.max(initial=-math.inf) - _SOLE]
        if not len(hull):
            return []
        around = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
        side = np.cross(down, np.eye(3)[np.argmin(np.abs(down))])
        ways = np.outer(np.cos(around), side) + np.outer(np.sin(around), np.cross(down, side))
        chosen = [int((hull @ down).argmax()), *(hull @ ways.T).argmax(axis=0).tolist()]
        return [(hull[k], 0.0, "") for k in dict.fromkeys(chosen)]
    if geom.kind == "box":
        if geom.name and down[2] < -1.0 + 1e-6:
            return [(np.array([0.0, 0.0, -size[2]]), 0.0, f"foot({path_of('geom', geom.name)})")]
        axis = int(np.abs(down).argmax())
        if abs(down[axis]) > 1.0 - 1e-6:
            # It lies on a face: two corners and the middle of the opposite edge, about its centre; three corners would
            # have the centre on the edge between two of them, and no load on the third.
            long, short = sorted({0, 1, 2} - {axis}, key=lambda k: -size[k])
            face: Matrix = np.zeros((3, 3))
            face[:, axis] = np.sign(down[axis])
            face[:, long], face[:, short] = (1.0, 1.0, -1.0), (1.0, -1.0, 0.0)
            return [(size * end, 0.0, "") for end in face]
        corners = [np.array([x, y, z]) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
        return [(size * corner, 0.0, "") for corner in corners]
    return []
