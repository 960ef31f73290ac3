"""Shapes that the models are put together from.  Every one is trimesh's own work; these are names for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from trimesh import creation

Profile = Sequence[tuple[float, float]]


def lathe(profile: Profile, sections: int = 48) -> trimesh.Trimesh:
    """A body of revolution about z from a profile of points (radius, height), bottom first.

    A profile from axis to axis makes a solid; one that ends where it starts makes a ring.
    """
    return creation.revolve(np.array(profile), sections=sections)


def rod(radius: float, start: Sequence[float], end: Sequence[float], sections: int = 32) -> trimesh.Trimesh:
    """A round rod from one point to another."""
    return creation.cylinder(radius=radius, segment=np.array([start, end]), sections=sections)


def pin(radius: float, width: float, at: Sequence[float], sections: int = 32) -> trimesh.Trimesh:
    """A round pin of this width along y, with its centre at a point: the axle of a planar joint."""
    x, y, z = at
    return rod(radius, (x, y - width / 2, z), (x, y + width / 2, z), sections)


def knob(
    radius: float, width: float, at: Sequence[float], bevel: float, sections: int = 32
) -> trimesh.Trimesh:
    """A pin with bevelled edges."""
    half = width / 2
    profile = [(0.0, -half), (radius - bevel, -half), (radius, bevel - half)]
    shape = lathe([*profile, *((r, -z) for r, z in reversed(profile))], sections)
    return turned(shape, (1.0, 0.0, 0.0), -np.pi / 2).apply_translation(at)


def ball(radius: float, at: Sequence[float], sections: int = 24) -> trimesh.Trimesh:
    """A sphere."""
    return creation.uv_sphere(radius=radius, count=(sections // 2, sections)).apply_translation(at)


def slab(size: Sequence[float], corner: float, bevel: float, at: Sequence[float]) -> trimesh.Trimesh:
    """A block with rounded upright edges and a bevelled top: the convex hull of four round feet.

    Args:
        size: lengths along x, y and z.
        corner: radius of the upright edges.
        bevel: radius of the top edge, less than ``corner``.
        at: centre of the lower face.
    """
    height = size[2]
    turn = np.linspace(0.0, np.pi / 2, 5)
    edge = [
        (corner - bevel + bevel * float(np.cos(a)), height - bevel + bevel * float(np.sin(a))) for a in turn
    ]
    foot = lathe([(0.0, 0.0), (corner, 0.0), *edge, (0.0, height)], sections=32)
    along = [
        (sx * (size[0] / 2 - corner), sy * (size[1] / 2 - corner), 0.0) for sx in (1, -1) for sy in (1, -1)
    ]
    feet = [foot.copy().apply_translation(np.array(place) + np.array(at)) for place in along]
    return together(*feet).convex_hull


def turned(shape: trimesh.Trimesh, axis: Sequence[float], angle: float) -> trimesh.Trimesh:
    """The same shape after a turn about an axis through the origin, by an angle in rad."""
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(angle * np.array(axis)).as_matrix()
    return shape.apply_transform(turn)


def together(*shapes: trimesh.Trimesh) -> trimesh.Trimesh:
    """Several shapes as one mesh."""
    joined = trimesh.util.concatenate(shapes)
    assert isinstance(joined, trimesh.Trimesh)
    return joined
