"""What weighs: solids with a shape and a mass, and the mass, centre and inertia of a body made of them.

Shapes are :class:`trimesh.Trimesh`, and the volume integrals are trimesh's.  Each shape is integrated in its own
frame and moved afterwards, so that a box's centre is where it was put and not some 1e-17 beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum

import numpy as np
import trimesh
from trimesh.inertia import transform_inertia

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Solid:
    """A shape of uniform density.

    Attributes:
        shape: closed surface in its own frame, m.
        mass: kg.
        place: where the shape's frame stands in the body's frame, m; the axes are parallel.
    """

    shape: trimesh.Trimesh
    mass: float
    place: Point = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Inertia:
    """Mass properties of a rigid body.

    Attributes:
        mass: kg.
        centre: of mass, in the body's frame, m.
        moments: of inertia about the axes x, y, z through the centre of mass, kg m^2; products of inertia vanish.
    """

    mass: float
    centre: Point
    moments: Point


def inertia_of(solids: Sequence[Solid]) -> Inertia:
    """Mass, centre and moments of inertia of solids that are fixed to each other.

    Raises:
        ValueError: a shape is not closed, or the body's principal axes are not parallel to x, y and z.
    """
    mass = fsum(solid.mass for solid in solids)
    moved = [_centre(solid) for solid in solids]
    if len(solids) == 1:
        return Inertia(mass, moved[0], _moments(_tensor(solids[0])))
    weights = [solid.mass for solid in solids]
    centre = np.array([fsum(w * x for w, x in zip(weights, axis)) / mass for axis in zip(*moved)])
    tensor = np.zeros((3, 3))
    for solid, point in zip(solids, moved, strict=True):
        shift = np.eye(4)
        shift[:3, 3] = np.array(point) - centre
        tensor += transform_inertia(shift, _tensor(solid), parallel_axis=True, mass=solid.mass)
    return Inertia(mass, _point(centre), _moments(tensor))


def _centre(solid: Solid) -> Point:
    """The solid's centre of mass in the body's frame; what is zero but for rounding is zero."""
    size = float(np.max(np.abs(solid.shape.bounds)))
    own = np.where(np.abs(solid.shape.center_mass) < 1e-15 * max(1.0, size), 0.0, solid.shape.center_mass)
    return _point(own + np.array(solid.place))


def _tensor(solid: Solid) -> np.ndarray:
    """(3, 3) inertia about the solid's centre of mass."""
    if not solid.shape.is_volume:
        raise ValueError("a solid needs a closed surface whose faces all point outwards")
    shape = solid.shape.copy()
    shape.density = solid.mass / shape.volume
    return np.array(shape.moment_inertia)


def _moments(tensor: np.ndarray) -> Point:
    diagonal = np.diag(tensor)
    if np.max(np.abs(tensor - np.diag(diagonal))) > 1e-14 * np.max(diagonal):
        raise ValueError("the body's principal axes must be parallel to x, y and z")
    return _point(diagonal)


def _point(values: np.ndarray) -> Point:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
