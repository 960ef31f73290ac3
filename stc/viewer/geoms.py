"""Shapes as the geoms that MuJoCo's viewers draw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.viewer.shapes import Shape

if TYPE_CHECKING:
    import mujoco

#: The browser takes no more geoms than this in one picture.
MOST = 1024


class Geoms:
    """Converts shapes to geoms, and reuses geoms of shapes that are shown again."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Shape, mujoco.MjvGeom]] = {}

    def of(self, shapes: Sequence[Shape]) -> list[mujoco.MjvGeom]:
        """One geom per shape, in order; only the last :data:`MOST` shapes have one."""
        shown = shapes[max(0, len(shapes) - MOST) :]
        # The shape is kept along with its geom so that its identity cannot pass to another one.
        known = {id(shape): self._known.get(id(shape)) or (shape, make_geom(shape)) for shape in shown}
        self._known = known
        return [known[id(shape)][1] for shape in shown]


def make_geom(shape: Shape) -> mujoco.MjvGeom:
    """A geom that looks like a shape."""
    import mujoco

    geom = mujoco.MjvGeom()
    fill_geom(geom, shape)
    return geom


def fill_geom(geom: mujoco.MjvGeom, shape: Shape) -> None:
    """Make an existing geom look like a shape."""
    import mujoco

    kinds = {
        "tube": mujoco.mjtGeom.mjGEOM_CAPSULE,
        "arrow": mujoco.mjtGeom.mjGEOM_ARROW,
        "ball": mujoco.mjtGeom.mjGEOM_SPHERE,
    }
    kind, colour = kinds[shape.kind], np.array(shape.colour, dtype=np.float32)
    size = np.full(3, shape.width)
    mujoco.mjv_initGeom(geom, kind, size, np.array(shape.start), np.eye(3).ravel(), colour)
    if shape.kind != "ball":
        mujoco.mjv_connector(geom, kind, shape.width, np.array(shape.start), np.array(shape.end))
    geom.category = int(mujoco.mjtCatBit.mjCAT_DECOR)
    # What is not a body throws no shadow, and is seen in the dark.
    geom.emission, geom.castshadow = 0.4, 0
