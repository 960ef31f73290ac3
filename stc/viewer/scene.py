"""The displayed model: the spec's own, and a translucent copy of its bodies as the ghost.

The ghost is part of the model rather than drawn on top of it: viewers that render elsewhere, such as the one in a
browser, draw only the meshes of the model.  It touches nothing and weighs on nothing.  The whole ghost hangs
on one mocap body, by which it can be moved aside.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.fields import apply_fields
from stc.validate.pictures.camera import Framing, frame, usual_camera
from stc.validate.pictures.motion import solved_at
from stc.validate.pictures.scenery import furnish, picture_model
from stc.viewer.layout import Rectangle
from stc.viewer.motion import Motion
from stc.viewer.physics import State
from stc.viewer.shapes import FloatArray

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup

#: Name of the body that carries the ghost, prefix of the names in it, its group of geoms, its colour.
GHOST, PREFIX, GROUP = "ghost", "ghost/", 5
_COLOUR = (0.25, 0.55, 1.0, 0.35)

#: Groups of geoms that MuJoCo shows: what is hidden in the model is not a part of its ghost.
_SHOWN = 3

#: The view is from above by at least so many degrees, which parts the ghost from the body, and leaves some room.
_FROM_ABOVE, _ROOM = -14.0, 1.15

#: What a ghost does without.
_NOT_FOR_GHOSTS = (
    "lights",
    "cameras",
    "actuators",
    "sensors",
    "tendons",
    "equalities",
    "keys",
    "excludes",
    "pairs",
)


@dataclass(slots=True)
class View:
    """A direction of view.

    Attributes:
        framing: the direction, and the room that the motion takes in it.
    """

    framing: Framing

    @property
    def azimuth(self) -> float:
        """The angle of the view in degrees, as for MuJoCo's free camera."""
        return self.framing.azimuth

    @property
    def elevation(self) -> float:
        """The angle of the view in degrees, as for MuJoCo's free camera."""
        return min(self.framing.elevation, _FROM_ABOVE)

    def placed(self, width: float, height: float, free: Rectangle) -> tuple[FloatArray, float]:
        """The point to look at, (3,), and its distance, in m, for the motion to fill a free part of the picture.

        Args:
            width: of the picture, in pixels.
            height: of the picture.
            free: the part, in pixels.
        """
        distance = _ROOM * self.framing.distance(free.width / height, free.height / height)
        azimuth, elevation = np.radians(self.azimuth), np.radians(self.elevation)
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        ahead = np.array(
            [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
        )
        pixel = 2.0 * self.framing.slope * distance / height
        aside = free.left + 0.5 * free.width - 0.5 * width
        below = free.top + 0.5 * free.height - 0.5 * height
        return self.framing.lookat - pixel * (aside * right - below * np.cross(right, ahead)), distance


@dataclass(slots=True)
class Scene:
    """A model to be shown.

    Attributes:
        model: with the ghost, where the model could be doubled.
        has_ghost: whether it could.
        view: from where the whole motion is seen; None leaves it to the viewer.
        shape_key: see :attr:`stc.viewer.motion.Motion.shape_key`.
    """

    model: mujoco.MjModel
    has_ghost: bool
    view: View | None
    shape_key: tuple[tuple[str, float], ...]

    def put(self, data: mujoco.MjData, body: State, ghost: State, offset: FloatArray) -> None:
        """Write the poses of body and ghost into ``data``.

        Args:
            data: of the scene's model.
            body: the opaque model's state; its time becomes that of ``data``.
            ghost: the ghost's state.
            offset: (3,) displacement of the ghost, in m.
        """
        body.put(data)
        if self.has_ghost:
            data.qpos[len(body.qpos) :] = ghost.qpos
            data.qvel[len(body.qvel) :] = 0.0
            data.mocap_pos[-1] = offset


def make_scene(motion: Motion) -> Scene:
    """The scene of a motion.

    Args:
        motion: what is to be shown.
    """
    try:
        model, has_ghost = _doubled(motion), True
    except (ValueError, RuntimeError):  # MuJoCo cannot attach every model to itself
        model, has_ghost = picture_model(motion.setup), False
    return Scene(model, has_ghost, _view(motion, model), motion.shape_key)


def _doubled(motion: Motion) -> mujoco.MjModel:
    """The model with its ghost; coordinates of the ghost come last.

    Raises:
        ValueError: the model cannot be doubled.
    """

    setup = motion.setup
    spec = setup.description()
    for key in list(spec.keys):
        spec.delete(key)  # their positions are too short for the doubled model
    carrier = spec.worldbody.add_body(name=GHOST, mocap=True)
    furnish(spec, setup)
    spec.attach(_ghost(setup), prefix=PREFIX, frame=carrier.add_frame())
    model = spec.compile()
    plain = setup.compiled
    if model.nq != 2 * plain.nq or model.nv != 2 * plain.nv or model.nu != plain.nu or model.na != plain.na:
        raise ValueError("the doubled model has other coordinates than twice the model's")
    apply_fields(model, motion.solution)
    for index in range(1, plain.nbody):
        name = plain.body(index).name
        if name:
            model.body(PREFIX + name).pos[:] = model.body(name).pos
    model.stat.extent, model.stat.center = plain.stat.extent, plain.stat.center
    return model


def _ghost(setup: Setup) -> mujoco.MjSpec:
    """The moving bodies of a model as a translucent copy without mass and contacts."""
    ghost = setup.description()
    for kind in _NOT_FOR_GHOSTS:
        for element in list(getattr(ghost, kind)):
            ghost.delete(element)
    for element in [*ghost.worldbody.geoms, *ghost.worldbody.sites]:
        ghost.delete(element)
    for geom in list(ghost.geoms):
        if geom.group >= _SHOWN:
            ghost.delete(geom)
            continue
        geom.contype = geom.conaffinity = 0
        geom.material, geom.rgba, geom.group = "", _COLOUR, GROUP
    for site in list(ghost.sites):
        site.rgba = (0.0, 0.0, 0.0, 0.0)
    return ghost


def _view(motion: Motion, model: mujoco.MjModel) -> View | None:
    """A view of the whole motion from the direction of the model's usual camera."""
    setup = motion.setup
    plain = setup.model()
    framing = frame(plain, usual_camera(plain), solved_at(setup, np.linspace(motion.start, motion.end, 24)))
    if framing is None:
        return None
    model.vis.global_.fovy = plain.vis.global_.fovy
    return View(framing)
