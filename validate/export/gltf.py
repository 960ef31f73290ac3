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
from stc.validate.export.geometry import (
    Look,
    body_names,
    local_poses,
    pose_matrix,
    same_surface,
    shown_geoms,
    surface,
)
from stc.validate.export.proportion import USUAL_RATE, intervals, require_proportion
from stc.validate.metrics import FloatArray
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco
    import trimesh

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
    wanted = USUAL_RATE if rate is None else rate
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


def _scene(
    model: mujoco.MjModel, poses: tuple[FloatArray, FloatArray]
) -> tuple[trimesh.Scene, dict[int, str]]:
    """The model in its first position, and the name of each body's node."""
    import trimesh

    scene = trimesh.Scene(base_frame="world")
    # The root of the scene has the name that MuJoCo gives to the world.
    names = body_names(model, "stage", {"world"})
    for body, name in names.items():
        frame = _UPRIGHT if body == 0 else pose_matrix(poses[0][0, body], poses[1][0, body])
        parent = "world" if body == 0 else names[int(model.body_parentid[body])]
        scene.graph.update(frame_to=name, frame_from=parent, matrix=frame)
    made: dict[tuple[Any, ...], str] = {}
    for geom, look in shown_geoms(model):
        label = model.geom(geom).name or f"geom{geom}"
        parent = names[int(model.geom_bodyid[geom])]
        matrix = pose_matrix(model.geom_pos[geom], model.geom_quat[geom])
        same = (same_surface(model, geom), look)
        if same in made:
            scene.graph.update(frame_to=f"{label}_", frame_from=parent, matrix=matrix, geometry=made[same])
            continue
        shape = surface(model, geom)
        if shape is None:
            continue
        made[same] = label
        shape.visual = trimesh.visual.TextureVisuals(material=_material(look))
        scene.add_geometry(
            shape, node_name=f"{label}_", geom_name=label, parent_node_name=parent, transform=matrix
        )
    return scene, names


def _material(look: Look) -> trimesh.visual.material.PBRMaterial:
    from trimesh.visual.material import PBRMaterial

    rgba = np.array(look.rgba)
    return PBRMaterial(
        name=look.name,
        baseColorFactor=np.round(255 * np.clip(rgba, 0.0, 1.0)).astype(np.uint8),
        metallicFactor=look.metal,
        roughnessFactor=look.rough,
        emissiveFactor=np.clip(look.glow * rgba[:3], 0.0, 1.0),
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
