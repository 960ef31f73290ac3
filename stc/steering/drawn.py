"""The scene of the page as arrays: the model's surfaces once, and where its bodies are for each motion."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from stc.solution import Solution
from stc.steering.posed_body import FloatArray, moving_bodies, state_of
from stc.steering.session import Session
from stc.validate.export.geometry import same_surface, shown_geoms, surface
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import Setup

#: Instants of a motion that the page gets, at most; between them it interpolates.
INSTANTS = 81


def scene_of(session: Session) -> dict[str, Any]:
    """The part of the scene that is sent to the page once: surfaces of the model, handles and sliders."""
    import mujoco

    setup = session.shown()
    model = setup.compiled
    meshes: list[dict[str, str]] = []
    known: dict[tuple[Any, ...], int] = {}
    geoms = []
    for geom, look in shown_geoms(model):
        key = same_surface(model, geom)
        if key not in known:
            shape = surface(model, geom)
            if shape is None:
                continue
            known[key] = len(meshes)
            meshes.append(
                {
                    "vertices": _packed(shape.vertices, "<f4"),
                    "normals": _packed(shape.vertex_normals, "<f4"),
                    "faces": _packed(shape.faces, "<u4"),
                }
            )
        geoms.append(
            {
                "mesh": known[key],
                "body": int(model.geom_bodyid[geom]),
                "position": model.geom_pos[geom].tolist(),
                "rotation": model.geom_quat[geom].tolist(),
                "colour": list(look.rgba),
                "floor": bool(model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE),
            }
        )
    moving = moving_bodies(model)
    parents = {int(model.body_parentid[body]) for body in moving}
    return {
        "type": "scene",
        "name": session.model.name,
        "file": "" if session.target is None else str(session.target),
        "meshes": meshes,
        "geoms": geoms,
        "bodies": int(model.nbody),
        "followed": sorted({*moving[:1], *(body for body in moving if body not in parents)}),
        "handles": [
            {
                "key": handle.key,
                "label": handle.label,
                "kind": handle.kind,
                "frame": handle.frame,
                "knobs": [session.knobs.knobs[name].label for name in handle.knobs],
                "names": list(handle.knobs),
            }
            for handle in session.handles.values()
        ],
        "sliders": [
            {
                "name": slider.name,
                "label": slider.label,
                "note": slider.note,
                "low": slider.low,
                "high": slider.high,
                "structural": slider.structural,
            }
            for slider in session.sliders
        ],
    }


def motion_of(session: Session, told: Callable[[Solution], dict[str, Any]]) -> bytes:
    """The newest motion as one message: the length of the header, the header as JSON, then (k, bodies, 7) numbers.

    Args:
        session: whose motion it is.
        told: what else the header says of it.
    """
    setup = session.shown()
    solution: Solution = setup.solution
    count = min(INSTANTS, max(2, solution.n + 1))
    times = np.linspace(float(solution.time[0]), float(solution.time[-1]), count)
    poses = _poses(setup, times)
    header = {
        "type": "motion",
        "start": float(times[0]),
        "end": float(times[-1]),
        "instants": count,
        "frames": {
            str(handle.frame): float(solution.time[min(handle.frame, solution.n)])
            for handle in session.handles.values()
        },
        "handles": [np.round(point, 6).tolist() for point in session.points(setup).values()],
        "values": {name: solution.constants[name] for name in session.knobs.knobs},
        "solved": solution.status == "optimal",
        "objective": solution.objective,
        **told(solution),
    }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + poses.astype("<f4").tobytes()


def _poses(setup: Setup, times: FloatArray) -> FloatArray:
    """(k, bodies, 7) where every body is in the world: place in m and unit quaternion, w first."""
    import mujoco

    data = state_of(setup.compiled)
    found = np.zeros((len(times), setup.compiled.nbody, 7))
    for k, position in enumerate(solved_at(setup, times)):
        data.qpos[:] = position
        mujoco.mj_kinematics(setup.compiled, data)
        found[k, :, :3], found[k, :, 3:] = data.xpos, data.xquat
    return found


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()
