"""Shapes drawn flat over the picture, for Studio's desktop window.

Studio 4.0.0 on the desktop crashes now and then when it is given geoms besides the model's (a segmentation fault in
Filament; the same geoms are safe in a browser).  There the shapes are projected and drawn with Dear ImGui, so that
nothing hides them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stc.records import dataclass
from stc.viewer.shapes import Colour, FloatArray, Shape

#: An arrow's head in shares of its shaft's radius, as wide and as long as MuJoCo draws it.
_HEAD_WIDTH, _HEAD_LENGTH = 2.0, 5.0

#: Lines shorter than this, in pixels, are left out.
_SHORTEST = 0.5

#: Nothing is wider than twice this, in pixels.
_WIDEST = 12.0


@dataclass(frozen=True, slots=True)
class Eye:
    """A camera and the picture that it takes.

    Attributes:
        position: (3,) in m.
        forward, up: (3,) unit vectors.
        slope: half the picture's height at a distance of one metre, in m.
        width, height: of the picture, in pixels.
    """

    position: FloatArray
    forward: FloatArray
    up: FloatArray
    slope: float
    width: float
    height: float

    @staticmethod
    def of(camera: Any, width: float, height: float) -> Eye:
        """The eye of an ``mjvGLCamera``."""
        slope = 0.5 * (camera.frustum_top - camera.frustum_bottom) / camera.frustum_near
        vectors = [np.array(vector, dtype=np.float64) for vector in (camera.pos, camera.forward, camera.up)]
        return Eye(vectors[0], vectors[1], vectors[2], float(slope), width, height)

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixel coordinates of points (k, 3) in the picture.

        Returns:
            (k, 2) pixels from the left and from the top; (k,) pixels per metre at each point, NaN where it lies
            behind the eye.
        """
        right = np.cross(self.forward, self.up)
        ahead = points - self.position
        depth = ahead @ self.forward
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(depth > 1e-6, 0.5 * self.height / (self.slope * depth), np.nan)
            across, along = scale * (ahead @ right), scale * (ahead @ self.up)
        return np.stack([0.5 * self.width + across, 0.5 * self.height - along], axis=1), scale


def draw(canvas: Any, vector: Any, eye: Eye, shapes: Sequence[Shape]) -> None:
    """Draw shapes.

    Args:
        canvas: a draw list of Dear ImGui.
        vector: Dear ImGui's class of points, ``Vec2``.
        eye: the camera.
        shapes: the shapes.
    """
    if not shapes:
        return
    starts, scales = eye.project(np.array([shape.start for shape in shapes]))
    ends, end_scales = eye.project(np.array([shape.end for shape in shapes]))
    for shape, a, b, scale, end_scale in zip(shapes, starts, ends, scales, end_scales):
        if not (np.isfinite(scale) and np.isfinite(end_scale)):
            continue
        colour = packed(shape.colour)
        width = min(shape.width * float(scale), _WIDEST)
        start, end = vector(float(a[0]), float(a[1])), vector(float(b[0]), float(b[1]))
        if shape.kind == "ball":
            canvas.AddCircleFilled(start, max(1.0, width), colour)
        elif shape.kind == "tube":
            if np.hypot(*(b - a)) < _SHORTEST:
                continue
            canvas.AddLine(start, end, colour, max(1.5, 2.0 * width))
        else:
            _arrow(canvas, vector, a, b, max(1.0, width), colour)


def packed(colour: Colour) -> int:
    """A colour as Dear ImGui packs it: a byte each of red, green, blue and opacity, red lowest."""
    red, green, blue, opacity = (round(255 * min(max(part, 0.0), 1.0)) for part in colour)
    return red | green << 8 | blue << 16 | opacity << 24


def _arrow(canvas: Any, vector: Any, a: FloatArray, b: FloatArray, width: float, colour: int) -> None:
    """A shaft and a triangle."""
    along = b - a
    length = float(np.hypot(*along))
    if length < 1.0:
        return
    along = along / length
    aside = np.array([-along[1], along[0]])
    neck = b - min(_HEAD_LENGTH * width, 0.7 * length) * along
    canvas.AddLine(
        vector(float(a[0]), float(a[1])), vector(float(neck[0]), float(neck[1])), colour, 2.0 * width
    )
    corners = [b, neck + _HEAD_WIDTH * width * aside, neck - _HEAD_WIDTH * width * aside]
    canvas.AddTriangleFilled(*(vector(float(x), float(y)) for x, y in corners), colour)
