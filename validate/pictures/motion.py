"""The positions of a model at any time of a motion, solved or simulated, and the paths of its parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup

#: Points of a path.
_PATH_POINTS = 100


def solved_at(setup: Setup, times: FloatArray) -> FloatArray:
    """(k, nq) the solved motion at some times; joints that are not tied stay at the model's initial position."""
    import mujoco

    found = np.tile(mujoco.MjData(setup.compiled).qpos, (len(times), 1))
    found[:, setup.reference.positions] = setup.reference.at_times(times)[0]
    return found


def simulated_at(motion: Replay, times: FloatArray) -> FloatArray:
    """(k, nq) a replay at some times; where it broke down, its last position."""
    finite = np.isfinite(motion.path).all(axis=1)
    known, path = motion.time[finite], motion.path[finite]
    return np.stack([np.interp(times, known, column) for column in path.T], axis=1)


def paths(setup: Setup, motion: Replay | None = None) -> list[FloatArray]:
    """World paths, (k, 3) each, of the sites, geoms and bodies that the spec compares.

    If it compares none, these are the centres of mass of the outermost bodies.

    Args:
        setup: the motion.
        motion: a replay of it, to follow that instead.
    """
    times = np.linspace(setup.solution.time[0], setup.solution.time[-1], _PATH_POINTS)
    return follow(setup, solved_at(setup, times) if motion is None else simulated_at(motion, times))


def follow(
    setup: Setup, positions: FloatArray, places: Sequence[tuple[str, int]] | None = None
) -> list[FloatArray]:
    """World points, (k, 3) each, of some places of the model in positions (k, nq).

    Args:
        setup: the motion.
        positions: MuJoCo's ``qpos``.
        places: MuJoCo's array of world positions and the index in it, by default :func:`usual_places`.
    """
    import mujoco

    places = usual_places(setup) if places is None else places
    data = mujoco.MjData(setup.compiled)
    found = [np.zeros((len(positions), 3)) for _ in places]
    for k, position in enumerate(positions):
        data.qpos[:] = position
        mujoco.mj_kinematics(setup.compiled, data)
        mujoco.mj_comPos(setup.compiled, data)
        for path, (array, index) in zip(found, places):
            path[k] = getattr(data, array)[index]
    return found


def usual_places(setup: Setup) -> Sequence[tuple[str, int]]:
    """The places that a spec compares, or the outermost bodies: MuJoCo's array of positions and the index in it."""
    import mujoco

    arrays = {"site": "site_xpos", "geom": "geom_xpos", "body": "xpos", "com": "subtree_com"}
    found: dict[tuple[str, int], None] = {}
    for output in setup.outputs:
        kind, *rest = output.line.path
        if kind in arrays and len(rest) == 2:
            object_type = "body" if kind == "com" else kind
            number = getattr(mujoco.mjtObj, f"mjOBJ_{object_type.upper()}")
            found[arrays[kind], int(mujoco.mj_name2id(setup.compiled, number, rest[0]))] = None
    if found:
        return list(found)
    parents = set(setup.compiled.body_parentid[1:].tolist())
    moving = setup.compiled.body_weldid  # 0 for what is fixed to the world
    return [
        ("xipos", body) for body in range(1, setup.compiled.nbody) if body not in parents and moving[body]
    ]
