"""The moving model as a binary glTF file: geometry by trimesh, the motion as keyframes of the bodies' nodes.

Every body of the model is a node below its parent's, with a translation and a rotation over time where it moves
against its parent, so that the joints of the animation are those of the model.  MuJoCo's z points up, glTF's y: a
root node converts between them.  See the glTF 2.0 specification, sections 3.5 and 3.11.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.atomic import replacing
from stc.validate.export.proportion import intervals, require_proportion
from stc.validate.metrics import FloatArray
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco
    import trimesh

#: Groups of geoms that MuJoCo shows unless told otherwise.
_SHOWN_GROUPS = 3

#: Keyframes per second where no other number is asked for.
_USUAL_RATE = 60.0

#: Half the size of a floor that has no end, in metres.
_FLOOR = 2.5

#: Edges sharper than this, in radians, stay edges when surfaces are shaded smoothly.
_SHARP = 0.6

#: Turns z up into y up.
_UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])

#: glTF's constants for 32-bit floating point.
_FLOAT = 5126


def write(setup: Setup, path: Path, rate: float | None = None) -> None:
    """Write the solved motion.

    Args:
        setup: the motion and its model.
        path: the file, ``.glb``.
        rate: keyframes per second; None takes 60, or the frames if there are more.

    Raises:
        UsageError: with this rate the file is out of proportion.
        OSError: the file cannot be written.
    """
    solution = setup.solution
    wanted = _USUAL_RATE if rate is None else rate
    require_proportion(solution.duration * wanted, 7 * setup.compiled.nbody, f"a rate of {wanted:g} Hz")
    count = max(intervals(solution.duration, wanted), solution.n if rate is None else 0, 1)
    times = np.linspace(solution.time[0], solution.time[-1], count + 1)
    poses = local_poses(setup.compiled, solved_at(setup, times))
    scene, nodes = _scene(setup.compiled, poses)

    def animate(buffers: MutableMapping[Any, bytes], tree: dict[str, Any]) -> None:
        _animate(buffers, tree, nodes, times - times[0], poses, solution.name)

    from trimesh.exchange.gltf import export_glb

    with replacing(path) as temporary:
        temporary.write_bytes(export_glb(scene, include_normals=True, buffer_postprocessor=animate))


def local_poses(model: mujoco.MjModel, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The pose of every body in its parent's frame.

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


def _scene(
    model: mujoco.MjModel, poses: tuple[FloatArray, FloatArray]
) -> tuple[trimesh.Scene, dict[int, str]]:
    """The model in its first position, and the name of each body's node."""
    import trimesh

    scene = trimesh.Scene(base_frame="world")
    names: dict[int, str] = {}
    for body in range(model.nbody):
        name = model.body(body).name or f"body{body}"
        # The root of the scene has the name that MuJoCo gives to the world.
        names[body] = (
            "stage" if body == 0 else name if name not in ("world", *names.values()) else f"{name}{body}"
        )
        frame = _UPRIGHT if body == 0 else _matrix(poses[0][0, body], poses[1][0, body])
        parent = "world" if body == 0 else names[int(model.body_parentid[body])]
        scene.graph.update(frame_to=names[body], frame_from=parent, matrix=frame)
    made: dict[tuple[Any, ...], str] = {}
    for geom in range(model.ngeom):
        rgba = _colour(model, geom)
        if model.geom_group[geom] >= _SHOWN_GROUPS or rgba[3] <= 0.0:
            continue
        shape = _shape(model, geom)
        if shape is None:
            continue
        label = model.geom(geom).name or f"geom{geom}"
        same = (_shape_key(model, geom), int(model.geom_matid[geom]), tuple(rgba))
        matrix = _matrix(model.geom_pos[geom], model.geom_quat[geom])
        if same in made:
            scene.graph.update(
                frame_to=f"{label}_",
                frame_from=names[int(model.geom_bodyid[geom])],
                matrix=matrix,
                geometry=made[same],
            )
            continue
        made[same] = label
        shape.visual = trimesh.visual.TextureVisuals(material=_material(model, geom, rgba))
        scene.add_geometry(
            shape,
            node_name=f"{label}_",
            geom_name=label,
            parent_node_name=names[int(model.geom_bodyid[geom])],
            transform=matrix,
        )
    return scene, names


def _matrix(translation: FloatArray, quaternion: FloatArray) -> FloatArray:
    """(4, 4) the rigid motion."""
    import mujoco

    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.asarray(quaternion, dtype=float))
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation.reshape(3, 3), translation
    return made


def _shape_key(model: mujoco.MjModel, geom: int) -> tuple[Any, ...]:
    return int(model.geom_type[geom]), int(model.geom_dataid[geom]), tuple(model.geom_size[geom])


def _shape(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh | None:
    """The surface of a geom in its own frame; None for kinds that glTF cannot represent."""
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


def _colour(model: mujoco.MjModel, geom: int) -> FloatArray:
    material = int(model.geom_matid[geom])
    plain = np.array(model.geom_rgba[geom], dtype=float)
    # MuJoCo's rule: a geom's own colour counts where it is not the default grey.
    if material >= 0 and np.allclose(plain, (0.5, 0.5, 0.5, 1.0)):
        return np.array(model.mat_rgba[material], dtype=float)
    return plain


def _material(model: mujoco.MjModel, geom: int, rgba: FloatArray) -> trimesh.visual.material.PBRMaterial:
    from trimesh.visual.material import PBRMaterial

    index = int(model.geom_matid[geom])
    metal, rough, glow = 0.0, 0.6, 0.0
    name = f"geom{geom}"
    if index >= 0:
        name = model.mat(index).name or f"material{index}"
        metal = max(0.0, float(model.mat_metallic[index]))
        own = float(model.mat_roughness[index])
        rough = own if own >= 0.0 else 1.0 - 0.8 * float(model.mat_shininess[index])
        glow = float(model.mat_emission[index])
    return PBRMaterial(
        name=name,
        baseColorFactor=np.round(255 * np.clip(rgba, 0.0, 1.0)).astype(np.uint8),
        metallicFactor=metal,
        roughnessFactor=rough,
        emissiveFactor=np.clip(glow * rgba[:3], 0.0, 1.0),
        alphaMode="BLEND" if rgba[3] < 1.0 else "OPAQUE",
    )


# ---------------------------------------------------------------------------------------------------- animation


def _animate(
    buffers: MutableMapping[Any, bytes],
    tree: dict[str, Any],
    names: dict[int, str],
    times: FloatArray,
    poses: tuple[FloatArray, FloatArray],
    title: str,
) -> None:
    """Add an animation to a glTF tree whose geometry is complete."""
    index = {node.get("name"): k for k, node in enumerate(tree["nodes"])}
    translations, rotations = poses
    clock = _accessor(buffers, tree, "times", "SCALAR", times[:, None])
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    for body, name in names.items():
        node = index[name]
        if body == 0:
            continue
        # An animated node has parts and no matrix.
        tree["nodes"][node].pop("matrix", None)
        x, y, z = (float(value) for value in translations[0, body])
        w, i, j, k = (float(value) for value in rotations[0, body])
        tree["nodes"][node].update(translation=[x, y, z], rotation=[i, j, k, w])
        for path, kind, values in (
            ("translation", "VEC3", translations[:, body]),
            ("rotation", "VEC4", rotations[:, body][:, [1, 2, 3, 0]]),
        ):
            if np.abs(values - values[0]).max() < 1e-9:
                continue
            output = _accessor(buffers, tree, f"{name} {path}", kind, values)
            channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
            samplers.append({"input": clock, "output": output, "interpolation": "LINEAR"})
    if channels:
        tree["animations"] = [{"name": title, "channels": channels, "samplers": samplers}]


def _accessor(
    buffers: MutableMapping[Any, bytes], tree: dict[str, Any], key: str, kind: str, values: FloatArray
) -> int:
    """Append an array to the file's data, and return the index by which the tree refers to it."""
    data = np.ascontiguousarray(values, dtype="<f4")
    buffers[f"animation {key}"] = data.tobytes()
    tree["accessors"][f"animation {key}"] = {
        "bufferView": len(buffers) - 1,
        "byteOffset": 0,
        "componentType": _FLOAT,
        "count": len(data),
        "type": kind,
        "min": data.min(axis=0).tolist(),
        "max": data.max(axis=0).tolist(),
    }
    return len(tree["accessors"]) - 1
