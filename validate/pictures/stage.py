"""Images of a model in given positions."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from itertools import pairwise
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from stc.records import dataclass
from stc.validate.metrics import FloatArray
from stc.validate.pictures.camera import fit, usual_camera
from stc.validate.pictures.context import make_context

if TYPE_CHECKING:
    import mujoco

Image = npt.NDArray[np.uint8]

#: Most geoms that a scene holds: the model's own, its ghosts and the paths.
_GEOMS = 20_000


@dataclass(frozen=True, slots=True)
class Trail:
    """A curve in the scene.

    Attributes:
        points: (k, 3) in m.
        colour: red, green, blue, opacity.
        width: in pixels.
        lift: the share of its distance by which it is moved towards the camera. Its place in the image does not change,
            but it is drawn over other objects at the same place, such as the path of another motion.
    """

    points: FloatArray
    colour: tuple[float, float, float, float] = (0.95, 0.55, 0.15, 0.9)
    width: float = 2.5
    lift: float = 0.0


class Stage:
    """Renders images of a model without a screen. Use it in a ``with`` statement, since it holds an OpenGL context."""

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int = 960,
        height: int = 720,
        camera: str | None = None,
        frame: FloatArray | None = None,
    ) -> None:
        """Prepare to render.

        Args:
            model: what to show; it is not changed.
            width: of the images, in pixels.
            height: of the images.
            camera: name of one of the model's cameras; by default ``side`` or ``portrait`` or the first one, and
                where there is none a view from the side.
            frame: (k, nq) positions that fill the images: the camera keeps its direction and moves.  By default, and
                if a camera is named, the camera is not moved.

        Raises:
            ModelError: the model has no such camera.
            PictureError: there is no OpenGL.
        """
        import mujoco

        self.model = copy.copy(model)
        self.model.vis.global_.offwidth, self.model.vis.global_.offheight = width, height
        self.width, self.height = width, height
        self._camera = usual_camera(self.model, camera)
        if frame is not None and camera is None:
            fit(self.model, self._camera, frame, width / height)
        self._gl, self._context = make_context(self.model, width, height)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(self.model, maxgeom=_GEOMS)
        self._option = mujoco.MjvOption()
        self._option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
        self._data = mujoco.MjData(self.model)

    def __enter__(self) -> Stage:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the OpenGL context back."""
        self._context.free()
        self._gl.free()

    def render(
        self,
        position: FloatArray,
        ghosts: Sequence[tuple[FloatArray, float]] = (),
        trails: Sequence[Trail] = (),
    ) -> Image:
        """One image.

        Args:
            position: (nq,) where the model is.
            ghosts: further positions (nq,) to show it in, each with its opacity.
            trails: curves to draw. With any, floors mirror nothing: a mirrored curve looks like one more path.

        Returns:
            (height, width, 3) red, green and blue.
        """
        import mujoco

        model, data, scene = self.model, self._data, self._scene
        data.qpos[:] = position
        mujoco.mj_forward(model, data)
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, self._option, None, self._camera, everything, scene)
        for ghost, opacity in ghosts:
            self._add_ghost(ghost, opacity)
        for trail in trails:
            self._add_trail(trail)
        scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = not trails
        view = mujoco.MjrRect(0, 0, self.width, self.height)
        mujoco.mjr_render(view, scene, self._context)
        pixels = np.empty((self.height, self.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, view, self._context)
        return np.ascontiguousarray(pixels[::-1])

    def _add_ghost(self, position: FloatArray, opacity: float) -> None:
        import mujoco

        first = self._scene.ngeom
        self._data.qpos[:] = position
        mujoco.mj_forward(self.model, self._data)
        moving = mujoco.mjtCatBit.mjCAT_DYNAMIC
        mujoco.mjv_addGeoms(self.model, self._data, self._option, mujoco.MjvPerturb(), moving, self._scene)
        for geom in self._scene.geoms[first : self._scene.ngeom]:
            geom.rgba[3] *= opacity
            geom.reflectance = 0.0

    def _add_trail(self, trail: Trail) -> None:
        import mujoco

        scene, colour = self._scene, np.array(trail.colour, dtype=np.float32)
        eye = 0.5 * (np.array(scene.camera[0].pos) + np.array(scene.camera[1].pos))
        points = eye + (1.0 - trail.lift) * (trail.points - eye)
        for start, end in pairwise(points):
            if scene.ngeom >= scene.maxgeom:
                return
            geom = scene.geoms[scene.ngeom]
            kind = mujoco.mjtGeom.mjGEOM_LINE
            mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colour)
            mujoco.mjv_connector(geom, kind, trail.width, start, end)
            scene.ngeom += 1
