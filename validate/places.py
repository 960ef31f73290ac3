"""The places at which external forces act on a model: a point of a body, a site, or the contact point of a geom.

=============================  ==================================================================================
``body.NAME``                  the origin of the body's frame
``body.NAME.X.Y.Z``            the point at X, Y, Z (numbers, in m) of that frame
``body.NAME.X.Y.Z.R``          the point of a ball of radius R about that point that is closest to the ground
``site.NAME``                  the site
``geom.NAME``                  of a sphere its point nearest to the ground, half way between both where margins hold
                               them apart, of a box the middle of its lower face (along its own z) with the geom's
                               margin; of all others their middle
=============================  ==================================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError, find_object, nearest

if TYPE_CHECKING:
    import mujoco

_ARRAYS = {"body": "xpos", "site": "site_xpos", "geom": "geom_xpos"}
KINDS = tuple(_ARRAYS)

#: How far ahead the ground is looked for under a sphere, in m.
_FAR = 1e3

#: A plane whose normal has this much along the world's z axis is level.
_LEVEL = 1.0 - 1e-12


@dataclass(frozen=True, slots=True)
class Place:
    """A place on a model.

    Attributes:
        kind: ``body``, ``site`` or ``geom``.
        index: of that object in the model.
        body: the body that it moves with.
        offset: in the object's frame, in m.
        radius: of a sphere, whose touching point it is; 0 elsewhere.
        grounds: fixed geoms that the sphere may touch, unless all are level; of a ball about a point of a body planes
            and boxes alone.
    """

    kind: str
    index: int
    body: int
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    radius: float = 0.0
    grounds: tuple[int, ...] = ()

    @property
    def array(self) -> str:
        """The array of a simulation that has the object's own place in the world."""
        return _ARRAYS[self.kind]

    @property
    def at_origin(self) -> bool:
        """Whether the place is the origin of its body's frame."""
        return self.kind == "body" and not any(self.offset) and not self.radius

    def point(self, model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
        """(3,) its position in the world, in m, once the kinematics are up to date."""
        centre = np.array(getattr(data, self.array)[self.index])
        if any(self.offset):
            frames = {"body": data.xmat, "site": data.site_xmat, "geom": data.geom_xmat}[self.kind]
            centre = centre + frames[self.index].reshape(3, 3) @ np.array(self.offset)
        return centre + self.radius * self._down(model, data, centre) if self.radius else centre

    def _down(self, model: mujoco.MjModel, data: mujoco.MjData, centre: FloatArray) -> FloatArray:
        """(3,) the direction from the centre of a sphere to the nearest ground."""
        import mujoco

        best, found, segment = _FAR, np.array([0.0, 0.0, -1.0]), np.zeros(6)
        for ground in self.grounds:
            if self.kind == "geom":
                distance = mujoco.mj_geomDistance(model, data, self.index, ground, best, segment)
                way = segment[:3] - centre
            else:
                way = _nearest_point(model, data, ground, centre) - centre
                distance = float(np.linalg.norm(way))
            if distance < best and way.any():
                best, found = distance, way / np.linalg.norm(way)
        return found


def find_place(model: mujoco.MjModel, path: Sequence[str], written: str) -> Place:
    """The place that a path names; ``written`` is the replay line for the message.

    Raises:
        ModelError: the model has no such place.
    """
    import mujoco

    kind, *rest = path
    if not rest:
        raise ModelError(f"{written}: the name of the {kind} is missing")
    index = find_object(model, kind, rest[0], written)
    numbers = rest[1:]
    if numbers and (kind != "body" or len(numbers) not in (3, 4)):
        raise ModelError(f"{written}: a point in a body is written body.{rest[0]}.X.Y.Z")
    if kind == "body":
        try:
            at = tuple(float(number) for number in numbers) or (0.0, 0.0, 0.0)
        except ValueError:
            raise ModelError(f"{written}: a point in a body is given by three numbers") from None
        if len(at) == 3:
            return Place("body", index, index, at)
        own = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == index]
        flat = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_BOX))
        found = _sloping(model, _grounds(model, own))
        grounds = tuple([ground for ground in found if int(model.geom_type[ground]) in flat])
        return Place("body", index, index, at[:3], radius=at[3], grounds=grounds)
    if kind == "site":
        return Place("site", index, int(model.site_bodyid[index]))
    return _geom(model, index)


def require_kind(kind: str, written: str) -> None:
    """Raise an error for a path whose first word is not a kind of place.

    Raises:
        ModelError: it is none.
    """
    known = ["joint", *KINDS]
    if kind not in known:
        raise ModelError(
            f"{written}: a force acts on a joint, a body, a site or a geom, not on {kind}{nearest(kind, known)}"
        )


def _geom(model: mujoco.MjModel, index: int) -> Place:
    import mujoco

    kinds, body, kind = mujoco.mjtGeom, int(model.geom_bodyid[index]), int(model.geom_type[index])
    if kind == int(kinds.mjGEOM_BOX):
        below = float(model.geom_size[index, 2] + model.geom_margin[index])
        return Place("geom", index, body, (0.0, 0.0, -below))
    if kind != int(kinds.mjGEOM_SPHERE):
        return Place("geom", index, body)
    grounds = _grounds(model, [index])
    apart = model.geom_margin[index] + max([model.geom_margin[ground] for ground in grounds], default=0.0)
    radius = float(model.geom_size[index, 0] + 0.5 * apart)
    return Place("geom", index, body, radius=radius, grounds=_sloping(model, grounds))


def _grounds(model: mujoco.MjModel, geoms: Sequence[int]) -> tuple[int, ...]:
    """Fixed geoms that one of some geoms may touch."""
    return tuple(
        [
            ground
            for ground in range(model.ngeom)
            if model.body_weldid[model.geom_bodyid[ground]] == 0
            and any(_meets(model, geom, ground) for geom in geoms)
        ]
    )


def _sloping(model: mujoco.MjModel, grounds: tuple[int, ...]) -> tuple[int, ...]:
    """The same geoms; none where all of them are level planes."""
    return () if all(_is_level(model, ground) for ground in grounds) else grounds


def _nearest_point(model: mujoco.MjModel, data: mujoco.MjData, ground: int, centre: FloatArray) -> FloatArray:
    """(3,) the point of a plane or a box that is nearest to a point outside of it."""
    import mujoco

    at, turn = data.geom_xpos[ground], data.geom_xmat[ground].reshape(3, 3)
    local = turn.T @ (centre - at)
    if int(model.geom_type[ground]) == int(mujoco.mjtGeom.mjGEOM_PLANE):
        local[2] = 0.0
    else:
        local = np.clip(local, -model.geom_size[ground], model.geom_size[ground])
    return np.asarray(at + turn @ local)


def _meets(model: mujoco.MjModel, first: int, second: int) -> bool:
    """Whether two geoms may touch."""
    paired = {(int(a), int(b)) for a, b in zip(model.pair_geom1, model.pair_geom2)}
    types, affinities = model.geom_contype, model.geom_conaffinity
    return bool(
        types[first] & affinities[second]
        or types[second] & affinities[first]
        or paired & {(first, second), (second, first)}
    )


def _is_level(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a fixed geom is a horizontal plane."""
    import mujoco

    if int(model.geom_type[geom]) != int(mujoco.mjtGeom.mjGEOM_PLANE):
        return False
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(data.geom_xmat[geom][8]) >= _LEVEL
