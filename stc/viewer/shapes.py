"""Shapes drawn besides the bodies, as plain data: tubes, arrows, balls, and arcs for torques.

Every viewer of MuJoCo takes such things as ``MjvGeom`` (:mod:`stc.viewer.geoms` makes them); nothing here knows one.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from stc.records import dataclass

FloatArray = npt.NDArray[np.float64]
Colour = tuple[float, float, float, float]

#: Colours (red, green, blue, opacity): what was solved, what MuJoCo found, torques one way and the other.
SOLVED: Colour = (0.20, 0.55, 1.00, 0.90)
FOUND: Colour = (1.00, 0.62, 0.10, 0.95)
TORQUE: Colour = (0.65, 0.35, 0.95, 0.95)
FRAME: Colour = (0.75, 0.88, 1.00, 0.95)
JUMP: Colour = (1.00, 0.25, 0.35, 1.00)

#: A torque as large as the motion's largest turns its arc by this angle, in rad; it has so many pieces.
_FULL_TURN, _PIECES = 1.5 * np.pi, 10

#: Forces and torques below this share of the motion's largest are not drawn.
_LEAST = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A thing to draw.

    Attributes:
        kind: ``tube``, ``arrow`` or ``ball``.
        start: (3,) where it begins, in m; a ball's middle.
        end: (3,) where it ends; of a ball the same.
        width: radius of a tube, an arrow's shaft or a ball, in m.
        colour: red, green, blue and opacity, 0 to 1.
    """

    kind: str
    start: FloatArray
    end: FloatArray
    width: float
    colour: Colour


def polyline(points: FloatArray, colour: Colour, width: float) -> list[Shape]:
    """A tube through points (k, 3), ``width`` its radius in m; a point that is not finite leaves a gap."""
    found = []
    for start, end in pairwise(points):
        if np.all(np.isfinite(start)) and np.all(np.isfinite(end)) and not np.array_equal(start, end):
            found.append(Shape("tube", start, end, width, colour))
    return found


def balls(points: FloatArray, colour: Colour, radius: float) -> list[Shape]:
    """A ball at each of the points (k, 3)."""
    return [Shape("ball", point, point, radius, colour) for point in points]


def force_arrow(
    point: FloatArray, force: FloatArray, scale: float, size: float, colour: Colour
) -> list[Shape]:
    """An arrow for a force, pointing where it pushes, its tail at the point of application.

    Args:
        point: (3,) m.
        force: (3,) N.
        scale: length of the arrow in m per N.
        size: length of the longest arrow, in m: much shorter arrows are left out.
        colour: of the arrow.
    """
    arrow = scale * force
    length = float(np.linalg.norm(arrow))
    if not length > _LEAST * size:
        return []
    # A thick arrow that is short is only a head: the width shrinks with it.
    return [Shape("arrow", point, point + arrow, min(0.03 * size, 0.12 * length), colour)]


def torque_arc(
    centre: FloatArray, axis: FloatArray, share: float, radius: float, colour: Colour
) -> Iterator[Shape]:
    """An arc around an axis with an arrow's head at its end, in the sense in which a torque turns.

    Args:
        centre: (3,) m, on the axis.
        axis: (3,) unit vector; a positive torque turns around it by the right-hand rule.
        share: the torque as a share of the motion's largest, negative for the other sense.
        radius: of the arc, in m.
        colour: of the arc.
    """
    angle = float(np.clip(share, -1.0, 1.0)) * _FULL_TURN
    if not abs(share) > _LEAST:
        return
    across = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    up = np.cross(axis, across)
    turns = np.linspace(0.0, angle, _PIECES + 1) + 0.5 * np.pi
    points = centre + radius * (np.cos(turns)[:, None] * across + np.sin(turns)[:, None] * up)
    width = 0.09 * radius
    for start, end in pairwise(points[:-1]):
        yield Shape("tube", start, end, 0.6 * width, colour)
    yield Shape("arrow", points[-2], points[-2] + 2.2 * (points[-1] - points[-2]), width, colour)


def line_of_action(point: FloatArray, force: FloatArray, torque: FloatArray) -> FloatArray:
    """The point nearest to ``point`` about which a wrench has no torque across its force, (3,).

    For a foot that is the centre of pressure.  The wrench is a force (3,) at ``point`` and a torque (3,) about it;
    from M = r x F follows r = (F x M)/|F|^2 for the r that is perpendicular to the force.
    """
    square = float(force @ force)
    return point if square == 0.0 else point + np.cross(force, torque) / square
