"""Renders states of a model into a file; run as a process of its own by :mod:`stc.validate.certificate.pictures`.

    python -m stc.validate.certificate.render_process FOLDER

The folder holds ``model.mjb`` and ``states.npz``; ``frames.npy`` is added to it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    import mujoco

#: Room around the motion, as a share of its size.
_MARGIN = 0.12

#: Geoms in these groups are what MuJoCo shows unless told otherwise.
_SEEN_GROUPS = 3


def main(folder: Path) -> None:
    """Render every state of the folder."""
    import mujoco

    model = mujoco.MjModel.from_binary_path(str(folder / "model.mjb"))
    states = np.load(folder / "states.npz")
    simulated, solved = states["simulated"], states["solved"]
    width, height = (int(value) for value in states["size"])
    # Software renders most of this: soft shadows and many samples would take most of its time.
    model.vis.quality.offsamples = min(int(model.vis.quality.offsamples), 4)
    model.vis.quality.shadowsize = min(int(model.vis.quality.shadowsize), 2048)
    camera = view(model, np.concatenate([simulated, solved]), width / height)
    data, ghost = mujoco.MjData(model), mujoco.MjData(model)
    option = mujoco.MjvOption()
    frames = np.zeros((len(simulated), height, width, 3), np.uint8)
    with mujoco.Renderer(model, height, width) as renderer:
        for k, state in enumerate(simulated):
            data.qpos[:] = state
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera, option)
            if len(solved):
                ghost.qpos[:] = solved[k]
                mujoco.mj_forward(model, ghost)
                _add_ghost(model, ghost, option, renderer.scene)
            frames[k] = renderer.render()
    np.save(folder / "frames.npy", frames)


def _add_ghost(
    model: mujoco.MjModel, data: mujoco.MjData, option: mujoco.MjvOption, scene: mujoco.MjvScene
) -> None:
    """Add the moving bodies of another state to a scene, translucent."""
    import mujoco

    first = scene.ngeom
    category = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(model, data, option, mujoco.MjvPerturb(), category, scene)
    for k in range(first, scene.ngeom):
        scene.geoms[k].rgba[:] = (0.25, 0.75, 1.0, 0.35)
        scene.geoms[k].matid = -1


def view(model: mujoco.MjModel, states: FloatArray, aspect: float) -> mujoco.MjvCamera:
    """A camera that sees the whole motion, in the direction of the model's first fixed camera if it has one.

    Args:
        model: what moves.
        states: (k, nq) positions that it takes.
        aspect: width of the picture over its height.
    """
    import mujoco

    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    data = mujoco.MjData(model)
    fixed = [
        k for k in range(model.ncam) if int(model.cam_mode[k]) == int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
    ]
    if fixed:
        mujoco.mj_forward(model, data)
        forward = -data.cam_xmat[fixed[0]].reshape(3, 3)[:, 2]
    else:
        forward = np.array([0.0, 0.98, -0.2])
    forward = forward / np.linalg.norm(forward)
    camera.azimuth = math.degrees(math.atan2(forward[1], forward[0]))
    camera.elevation = math.degrees(math.asin(forward[2]))
    right = np.array([math.sin(math.radians(camera.azimuth)), -math.cos(math.radians(camera.azimuth)), 0.0])
    up = np.cross(right, forward)
    points = corners(model, data, states)
    across = points @ np.array([right, up, forward]).T
    middle = (across.min(axis=0) + across.max(axis=0)) / 2
    offset = np.abs(across - middle)
    tangent = math.tan(math.radians(float(model.vis.global_.fovy)) / 2)
    near = across[:, 2] - middle[2]
    needed = np.maximum(offset[:, 0] / (tangent * aspect), offset[:, 1] / tangent) * (1.0 + _MARGIN) - near
    camera.lookat[:] = middle @ np.array([right, up, forward])
    camera.distance = max(float(needed.max()), 0.05)
    return camera


def corners(model: mujoco.MjModel, data: mujoco.MjData, states: FloatArray) -> FloatArray:
    """(p, 3) corners of the boxes around everything solid that is shown, in some of the states."""
    import mujoco

    endless = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
    shown = [
        k
        for k in range(model.ngeom)
        if int(model.geom_type[k]) not in endless and model.geom_group[k] < _SEEN_GROUPS
    ]
    if not shown:
        return np.array([[-0.5, -0.5, 0.0], [0.5, 0.5, 1.0]])
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    found = []
    for k in np.unique(np.linspace(0, len(states) - 1, 25).astype(int)):
        data.qpos[:] = states[k]
        mujoco.mj_kinematics(model, data)
        for geom in shown:
            box = model.geom_aabb[geom]
            local = box[:3] + signs * box[3:]
            found.append(local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.concatenate(found)


def _command(arguments: Sequence[str]) -> None:
    main(Path(arguments[0]))


if __name__ == "__main__":
    _command(sys.argv[1:])
