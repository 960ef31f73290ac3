"""The surfaces for contacts: planes of the model, and faces of fixed boxes.

A geom's margin is the distance at which its contacts begin to push; its surface is counted as that much farther out.
"""

from __future__ import annotations

import numpy as np

from stc.language.model.paths import PathError, parts_of
from stc.language.model.scope import ModelScope, quoted
from stc.mechanism.mechanism import Geom, index_of
from stc.mechanism.tree import drawn_pose, rotation
from stc.mechanism.vectors import Vector, dot, vector
from stc.records import dataclass
from stc.symbolic.expr import Expr, num, sub

Axis = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Surface:
    """A plane in the world.

    Attributes:
        name: its name in messages.
        normal, tangents: unit vectors.
        origin: origin of the coordinates along it.
        friction, condim, priority: of its geom; the first is sliding friction.
    """

    name: str
    normal: Axis
    tangents: tuple[Axis, Axis]
    origin: Axis
    friction: float
    condim: int = 3
    priority: int = 0

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
            turn, at = _pose(scope, geom)
            if turn[2, 2] > 0.5:
                # Coordinates along the floor are those of the world where it is level.
                level = abs(turn[2, 2] - 1.0) < 1e-12
                at = at + geom.margin * turn[:, 2]
                origin = np.array([0.0, 0.0, at[2]]) if level else at
                return _surface(geom.name or "floor", np.eye(3) if level else turn, origin, geom)
    return _surface("floor", np.eye(3), np.zeros(3), None)


def surface_of(scope: ModelScope, path: str) -> Surface:
    """The surface of a geom: a plane, or the face of a box that faces upwards most.

    Raises:
        PathError: there is no such geom, it moves, or it has no flat face.
    """
    kind, *rest = parts_of(path)
    names = [geom.name for geom in scope.mechanism.geoms if geom.name]
    if kind != "geom" or len(rest) != 1:
        raise PathError(
            f"`{path}` is not a surface",
            f"write one of {', '.join(f'`geom.{quoted(n)}`' for n in names[:8])}",
        )
    index = index_of(scope.mechanism.geoms, rest[0])
    if index is None:
        raise PathError(f"the model has no geom `{rest[0]}`", f"its geoms are {', '.join(names[:12])}")
    geom = scope.mechanism.geoms[index]
    if not _is_fixed(scope, geom):
        where = f" ({geom.place})" if geom.place else ""
        hint = "contacts stand on what nothing moves; hold on to a body that moves by an `<equality>` of the model"
        raise PathError(f"the geom `{rest[0]}` moves{where}: standing on it cannot be stated", hint)
    if geom.kind not in ("plane", "box"):
        raise PathError(
            f"the geom `{rest[0]}` is a {geom.kind}", "contacts stand on planes and on faces of boxes"
        )
    turn, at = _pose(scope, geom)
    if geom.kind == "box":
        upwards = int(np.argmax(np.abs(turn[2])))
        sign = 1.0 if turn[2, upwards] > 0 else -1.0
        normal = sign * turn[:, upwards]
        at = at + (geom.size[upwards] + geom.margin) * normal
        ahead = turn[:, (upwards + 1) % 3] if upwards != 2 else turn[:, 0]
        turn = np.array([ahead, np.cross(normal, ahead), normal]).T
    else:
        at = at + geom.margin * turn[:, 2]
    return _surface(rest[0], turn, at, geom)


def _is_fixed(scope: ModelScope, geom: Geom) -> bool:
    return scope.dynamics.tree.frames[geom.body].segment < 0


def _pose(scope: ModelScope, geom: Geom) -> tuple[np.ndarray, np.ndarray]:
    """Axes, as columns, and position of a fixed geom."""
    turn, at = drawn_pose(scope.mechanism, geom.body)
    return turn @ rotation(geom.quat), at + turn @ np.array(geom.pos)


def _surface(name: str, turn: np.ndarray, origin: np.ndarray, geom: Geom | None) -> Surface:
    def axis(k: int) -> Axis:
        x, y, z = [0.0 if abs(part) < 1e-15 else float(part) for part in turn[:, k]]
        return x, y, z

    x, y, z = [float(part) for part in origin]
    own = (1.0,) if geom is None else (geom.friction[0], geom.condim, geom.priority)
    return Surface(name, axis(2), (axis(0), axis(1)), (x, y, z), *own)
