"""The position and direction of the camera."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.metrics import FloatArray
from stc.validate.model import find_object, names_of

if TYPE_CHECKING:
    import mujoco

#: Cameras that are taken when none is asked for, in this order.
_USUAL = ("side", "portrait")

#: The motion fills this share of the image.
_FILLED = 0.8

#: Groups of geoms that MuJoCo shows.
_SHOWN_GROUPS = 3


def usual_camera(model: mujoco.MjModel, name: str | None = None) -> mujoco.MjvCamera:
    """A camera of the model by its name, or the default one.

    Raises:
        ModelError: there is none of this name.
    """
    import mujoco

    camera = mujoco.MjvCamera()
    known = names_of(model, "camera")
    if name is None:
        name = next((usual for usual in _USUAL if usual in known), known[0] if known else None)
    if name is None:
        mujoco.mjv_defaultFreeCamera(model, camera)
        camera.azimuth, camera.elevation = 90.0, -8.0
    else:
        camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        camera.fixedcamid = find_object(model, "camera", name, f"camera {name}")
    return camera


@dataclass(frozen=True, slots=True)
class Framing:
    """A direction of view and the size of a motion in it.

    Attributes:
        lookat: (3,) the middle of the motion, m.
        azimuth, elevation: of the view in degrees, as MuJoCo's free camera has them.
        slope: half the visible height at a distance of one metre, in m.
        across, along, depth: (m,) places of corners of the bodies, in m from the middle: to the side and up or down,
            without sign, and towards the camera.
    """

    lookat: FloatArray
    azimuth: float
    elevation: float
    slope: float
    across: FloatArray
    along: FloatArray
    depth: FloatArray

    def distance(self, width: float, height: float = 1.0) -> float:
        """The distance of the camera from the middle, in m, at which the motion fills a part of the image.

        Args:
            width: of the part, over the height of the whole image.
            height: of the part, over the same.
        """
        filled = _FILLED * self.slope
        needed = np.maximum(self.across / (filled * width), self.along / (filled * height))
        return float((self.depth + needed).max())


def fit(model: mujoco.MjModel, camera: mujoco.MjvCamera, positions: FloatArray, aspect: float) -> None:
    """Move a camera along its direction of view so that the model fills the image in all given positions.

    Args:
        model: its field of view becomes the camera's.
        camera: is changed; one that moves with a body is left alone.
        positions: (k, nq).
        aspect: width of the image over its height.
    """
    import mujoco

    framing = frame(model, camera, positions)
    if framing is not None:
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat = framing.lookat
        camera.distance = framing.distance(aspect)
        camera.azimuth, camera.elevation = framing.azimuth, framing.elevation


def frame(model: mujoco.MjModel, camera: mujoco.MjvCamera, positions: FloatArray) -> Framing | None:
    """The size of a model in some positions, seen in the direction of a camera.

    Args:
        model: its field of view becomes the camera's.
        camera: gives the direction.
        positions: (k, nq).

    Returns:
        None if the camera moves with a body or is tilted, or if nothing is visible.
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    if camera.type == mujoco.mjtCamera.mjCAMERA_FIXED:
        index = camera.fixedcamid
        if model.cam_bodyid[index] != 0 or model.cam_mode[index] != mujoco.mjtCamLight.mjCAMLIGHT_FIXED:
            return None
        axes = data.cam_xmat[index].reshape(3, 3)
        right, up, back = axes[:, 0], axes[:, 1], axes[:, 2]
        if abs(right[2]) > 1e-6:  # a tilted horizon is wanted as it is
            return None
        model.vis.global_.fovy = model.cam_fovy[index]
    else:
        azimuth, elevation = math.radians(camera.azimuth), math.radians(camera.elevation)
        ahead = [
            math.cos(azimuth) * math.cos(elevation),
            math.sin(azimuth) * math.cos(elevation),
            math.sin(elevation),
        ]
        back = -np.array(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        up = np.cross(right, ahead)
    corners = _corners(model, data, positions)
    if not len(corners):
        return None
    places = [corners @ axis for axis in (right, up, back)]
    middle = [float(0.5 * (place.min() + place.max())) for place in places]
    across, along, depth = (place - centre for place, centre in zip(places, middle, strict=True))
    return Framing(
        middle[0] * right + middle[1] * up + middle[2] * back,
        math.degrees(math.atan2(-back[1], -back[0])),
        math.degrees(math.asin(float(np.clip(-back[2], -1.0, 1.0)))),
        math.tan(math.radians(model.vis.global_.fovy) / 2.0),
        np.abs(across),
        np.abs(along),
        depth,
    )


def _corners(model: mujoco.MjModel, data: mujoco.MjData, positions: FloatArray) -> FloatArray:
    """(m, 3) corners of the boxes around all that is seen of the bodies in all positions."""
    import mujoco

    seen = (model.geom_bodyid > 0) & (model.geom_group < _SHOWN_GROUPS) & (model.geom_rbound > 0.0)
    signs = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, 8).T
    boxes = model.geom_aabb[seen]
    local = boxes[:, None, :3] + signs * boxes[:, None, 3:]
    found = []
    for position in positions:
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        turned = np.einsum("gij,gcj->gci", data.geom_xmat[seen].reshape(-1, 3, 3), local)
        found.append((data.geom_xpos[seen][:, None, :] + turned).reshape(-1, 3))
    return np.concatenate(found)
