"""The surfaces for contacts: planes of the model, faces of boxes, and planes through sites.

They are fixed to the world or to a body that moves without turning, so that their normals are constant.  A geom's
margin is the distance at which its contacts begin to push; its surface is counted as that much farther out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stc.language.model.paths import PathError, parts_of
from stc.language.model.scope import ModelScope, quoted
from stc.mechanism.mechanism import Geom, Site
from stc.mechanism.tree import WORLD, Frame, drawn_pose, rotation
from stc.mechanism.vectors import Vector, dot, vector
from stc.records import dataclass
from stc.symbolic.expr import ZERO, Expr, num, sub

Axis = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Surface:
    """A plane in the world, or in a body that does not turn.

    Attributes:
        name: its name in messages.
        normal, tangents: unit vectors.
        origin: origin of the coordinates along it; zero for a plane that moves, which has it in its frame.
        margin: of its geom, with which it lies above the geom's own face.
        friction, condim, priority: of its geom; the first is sliding friction.
        frame, path: of a plane that moves, its origin in its body, and the geom or site to which it belongs.
    """

    name: str
    normal: Axis
    tangents: tuple[Axis, Axis]
    origin: Axis
    friction: float
    condim: int = 3
    priority: int = 0
    frame: Frame | None = None
    path: tuple[str, str] = ("", "")
    margin: float = 0.0

    def friction_with(self, geom: Geom | None) -> float:
        """The sliding friction of a geom on this surface, as MuJoCo combines the two; of no geom, the surface's own.

        Where one has the higher priority its own counts, else the larger of both.  There is none where the contact has
        one dimension (``condim``).
        """
        if geom is None:
            return self.friction
        if geom.priority < self.priority:
            friction, condim = self.friction, self.condim
        elif geom.priority > self.priority:
            friction, condim = geom.friction[0], geom.condim
        else:
            friction, condim = max(self.friction, geom.friction[0]), max(self.condim, geom.condim)
        return friction if condim > 1 else 0.0

    def height(self, at: Vector) -> Expr:
        """The distance of a place from the plane."""
        return sub(dot(vector(self.normal), at), num(float(np.dot(self.normal, self.origin))))

    def along(self, at: Vector) -> tuple[Expr, Expr]:
        """The coordinates of a place along the plane's axes."""
        x, y = self.tangents
        return (
            sub(dot(vector(x), at), num(float(np.dot(x, self.origin)))),
            sub(dot(vector(y), at), num(float(np.dot(y, self.origin)))),
        )


def floor(scope: ModelScope) -> Surface:
    """The model's first fixed plane that faces upwards; the plane z = 0 if there is none."""
    for geom in scope.mechanism.geoms:
        if geom.kind == "plane" and _is_fixed(scope, geom):
            turn, at = _face(scope, geom)
            if turn[2, 2] > 0.5:
                # Coordinates along the floor are those of the world where it is level.
                level = abs(turn[2, 2] - 1.0) < 1e-12
                origin = np.array([0.0, 0.0, at[2]]) if level else at
                return _surface(geom.name or "floor", np.eye(3) if level else turn, origin, geom)
    return _surface("floor", np.eye(3), np.zeros(3), None)


def surface_of(scope: ModelScope, path: str) -> Surface:
    """The surface of a geom: a plane, or the face of a box that faces upwards most; or that of a site, whose z axis is
    the normal.

    Raises:
        PathError: there is no such geom or site, it turns, or it has no flat face.
    """
    kind, *rest = parts_of(path)
    things: dict[str, Sequence[Geom | Site]] = {"geom": scope.mechanism.geoms, "site": scope.mechanism.sites}
    if kind not in things or len(rest) != 1:
        names = [geom.name for geom in scope.mechanism.geoms if geom.name]
        raise PathError(
            f"`{path}` is not a surface",
            f"write one of {', '.join(f'`geom.{quoted(n)}`' for n in names[:8])}",
        )
    thing = next((one for one in things[kind] if one.name == rest[0]), None)
    if thing is None:
        names = [one.name for one in things[kind] if one.name]
        raise PathError(f"the model has no {kind} `{rest[0]}`", f"its {kind}s are {', '.join(names[:12])}")
    if isinstance(thing, Geom) and thing.kind not in ("plane", "box"):
        raise PathError(
            f"the geom `{rest[0]}` is a {thing.kind}", "contacts stand on planes and on faces of boxes"
        )
    turn, at = _face(scope, thing)
    if _is_fixed(scope, thing):
        return _surface(rest[0], turn, at, thing)
    frame = scope.dynamics.tree.frames[thing.body]
    if any(part is not ZERO for part in scope.dynamics.kinematics.rate_of(frame)):
        where = f" ({thing.place})" if isinstance(thing, Geom) and thing.place else ""
        hint = (
            "contacts stand on what nothing moves, or what slides without turning; hold on to a body that turns by an "
            "`<equality>` of the model"
        )
        raise PathError(f"the {kind} `{rest[0]}` turns{where}: standing on it cannot be stated", hint)
    # Its body has the same axes throughout.
    body, origin = drawn_pose(scope.mechanism, thing.body)
    there = scope.dynamics.tree.frame(thing.body, vector((body.T @ (at - origin)).tolist()))
    return replace(_surface(rest[0], turn, np.zeros(3), thing), frame=there, path=(kind, rest[0]))


def _face(scope: ModelScope, thing: Geom | Site) -> tuple[np.ndarray, np.ndarray]:
    """Axes of a face, as columns with the normal last, and a point of it, where the bodies are drawn."""
    turn, at = _pose(scope, thing)
    if not isinstance(thing, Geom):
        return turn, at
    if thing.kind == "plane":
        return turn, at + thing.margin * turn[:, 2]
    upwards = int(np.argmax(np.abs(turn[2])))
    sign = 1.0 if turn[2, upwards] > 0 else -1.0
    normal = sign * turn[:, upwards]
    ahead = turn[:, (upwards + 1) % 3] if upwards != 2 else turn[:, 0]
    face = np.array([ahead, np.cross(normal, ahead), normal]).T
    return face, at + (thing.size[upwards] + thing.margin) * normal


def _is_fixed(scope: ModelScope, thing: Geom | Site) -> bool:
    return scope.dynamics.tree.frames[thing.body].segment == WORLD


def _pose(scope: ModelScope, thing: Geom | Site) -> tuple[np.ndarray, np.ndarray]:
    """Axes, as columns, and position of a geom or site, where the bodies are drawn."""
    turn, at = drawn_pose(scope.mechanism, thing.body)
    return turn @ rotation(thing.quat), at + turn @ np.array(thing.pos)


def _surface(name: str, turn: np.ndarray, origin: np.ndarray, thing: Geom | Site | None) -> Surface:
    """A surface with the friction of a geom; a site has none of its own, so that the contact's geom tells it."""

    def axis(k: int) -> Axis:
        x, y, z = [0.0 if abs(part) < 1e-15 else float(part) for part in turn[:, k]]
        return x, y, z

    x, y, z = [float(part) for part in origin]
    along = (axis(0), axis(1))
    if not isinstance(thing, Geom):
        return Surface(name, axis(2), along, (x, y, z), 1.0, priority=-1 if isinstance(thing, Site) else 0)
    friction = thing.friction[0]
    return Surface(
        name, axis(2), along, (x, y, z), friction, thing.condim, thing.priority, margin=thing.margin
    )
