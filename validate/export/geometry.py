"""The visible parts of a model, for files of animation: surfaces by trimesh, colours, and poses of bodies over time."""

from __future__ import annotations

from collections.abc import Iterator, Set
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.records import dataclass
from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    import mujoco
    import trimesh

#: Groups of geoms that MuJoCo shows unless told otherwise.
_SHOWN_GROUPS = 3

#: Half the size of a floor that has no end, in metres.
_FLOOR = 2.5

#: Edges sharper than this, in radians, stay edges when surfaces are shaded smoothly.
_SHARP = 0.6


def local_poses(model: mujoco.MjModel, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The position and rotation of every body in the frame of its parent.

    Args:
        model: what moves.
        positions: (k, nq).

    Returns:
        Translations (k, nbody, 3) in metres and unit quaternions (k, nbody, 4), w first, without sudden changes of
        sign from one instant to the next.
    """
    import mujoco

    data = mujoco.MjData(model)
    translations = np.zeros((len(positions), model.nbody, 3))
    rotations = np.zeros((len(positions), model.nbody, 4))
    rotations[:, 0, 0] = 1.0
    inverse, turn = np.zeros(4), np.zeros(3)
    for k, position in enumerate(positions):
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        for body in range(1, model.nbody):
            parent = int(model.body_parentid[body])
            mujoco.mju_negQuat(inverse, data.xquat[parent])
            mujoco.mju_rotVecQuat(turn, data.xpos[body] - data.xpos[parent], inverse)
            translations[k, body] = turn
            mujoco.mju_mulQuat(rotations[k, body], inverse, data.xquat[body])
    for k in range(1, len(positions)):
        flipped = np.einsum("bi,bi->b", rotations[k], rotations[k - 1]) < 0.0
        rotations[k, flipped] *= -1.0
    return translations, rotations


def pose_matrix(translation: FloatArray, quaternion: FloatArray) -> FloatArray:
    """(4, 4) the rigid motion."""
    import mujoco

    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.asarray(quaternion, dtype=float))
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation.reshape(3, 3), translation
    return made


def body_names(model: mujoco.MjModel, world: str, taken: Set[str] = frozenset()) -> dict[int, str]:
    """A unique name for each body: MuJoCo's own, ``world`` for the first, and none of the names that are taken."""
    names: dict[int, str] = {}
    for body in range(model.nbody):
        name = world if body == 0 else model.body(body).name or f"body{body}"
        names[body] = f"{name}{body}" if name in taken or name in names.values() else name
    return names


@dataclass(frozen=True, slots=True)
class Look:
    """The colour and reflection of a surface.

    Attributes:
        name: of MuJoCo's material; "paint" where it has none.
        rgba: colour and opacity, from 0 to 1.
        metal, rough: metallic factor and roughness, from 0 to 1.
        glow: light of its own, as a share of the colour.
    """

    name: str
    rgba: tuple[float, ...]
    metal: float
    rough: float
    glow: float


def shown_geoms(model: mujoco.MjModel) -> Iterator[tuple[int, Look]]:
    """The geoms that MuJoCo shows by default, with their looks."""
    for geom in range(model.ngeom):
        look = _look(model, geom)
        if model.geom_group[geom] < _SHOWN_GROUPS and look.rgba[3] > 0.0:
            yield geom, look


def _look(model: mujoco.MjModel, geom: int) -> Look:
    index, rgba = int(model.geom_matid[geom]), tuple(float(part) for part in model.geom_rgba[geom])
    if index < 0:
        return Look("paint", rgba, 0.0, 0.6, 0.0)
    # MuJoCo's rule: a geom's own colour counts where it is not the default grey.
    if np.allclose(rgba, (0.5, 0.5, 0.5, 1.0)):
        rgba = tuple(float(part) for part in model.mat_rgba[index])
    own = float(model.mat_roughness[index])
    return Look(
        model.mat(index).name or f"material{index}",
        rgba,
        max(0.0, float(model.mat_metallic[index])),
        own if own >= 0.0 else 1.0 - 0.8 * float(model.mat_shininess[index]),
        float(model.mat_emission[index]),
    )


def same_surface(model: mujoco.MjModel, geom: int) -> tuple[Any, ...]:
    """A key that is equal for geoms with equal surfaces."""
    return int(model.geom_type[geom]), int(model.geom_dataid[geom]), tuple(model.geom_size[geom])


def surface(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh | None:
    """The surface of a geom in its own frame; None for kinds that have none."""
    import mujoco
    import trimesh
    from trimesh import creation

    kinds, size = mujoco.mjtGeom, np.array(model.geom_size[geom])
    kind = kinds(int(model.geom_type[geom]))
    made: trimesh.Trimesh
    if kind == kinds.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        made = trimesh.Trimesh(
            np.array(model.mesh_vert[first : first + count], dtype=float),
            np.array(model.mesh_face[face : face + faces]),
        )
        made.merge_vertices()
    elif kind == kinds.mjGEOM_PLANE:
        half = np.where(size[:2] > 0.0, size[:2], _FLOOR)
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*half, 0.0]
        made = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])
    elif kind == kinds.mjGEOM_BOX:
        made = creation.box(extents=2.0 * size)
    elif kind == kinds.mjGEOM_SPHERE:
        made = creation.uv_sphere(radius=size[0], count=[24, 24])
    elif kind == kinds.mjGEOM_ELLIPSOID:
        made = creation.uv_sphere(radius=1.0, count=[24, 24])
        made.apply_scale(size)
    elif kind == kinds.mjGEOM_CYLINDER:
        made = creation.cylinder(radius=size[0], height=2.0 * size[1], sections=32)
    elif kind == kinds.mjGEOM_CAPSULE:
        made = creation.capsule(height=2.0 * size[1], radius=size[0], count=[24, 24])
        made.apply_translation([0.0, 0.0, -made.bounds.mean(axis=0)[2]])
    else:
        return None
    return trimesh.graph.smooth_shade(made, angle=_SHARP)
