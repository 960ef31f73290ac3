"""Geoms that touch although the spec has no contact: what they give is in the replay and not in the solution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.contact import can_touch
from stc.validate.contact_meter import contact_jacobian, touchable

if TYPE_CHECKING:
    from collections.abc import Iterator

    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup

#: Geoms that are less than this, in m, inside one another may stand at a bound that keeps them apart.
_TOUCHES = 1e-6

#: The replay is looked at in so many places.
_LOOKED_AT = 500

#: So many pairs are named.
_NAMED = 3


def unmentioned_contacts(setup: Setup, motion: Replay) -> tuple[list[str], list[str]]:
    """Which geoms that tied joints move touch where no ``contact`` line is given, and when first, in words.

    Args:
        setup: the motion.
        motion: its open-loop replay, which stands for the joints that are not tied.

    Returns:
        Those that touch in the solved motion, or come so near that they do in the replay; those that do in the replay
        only, as what goes astray may.
    """
    if len(setup.contact) or not can_touch(setup.compiled):
        return [], []
    model = setup.model()
    solved = _first_touches(setup, model, _solved_poses(setup, motion))
    near = _first_touches(setup, touchable(setup.model()), _solved_poses(setup, motion))
    replayed = _first_touches(setup, model, _replayed_poses(motion))
    only = {pair: time for pair, time in replayed.items() if pair not in solved}
    hit = {pair: time for pair, time in only.items() if pair in near}
    astray = {pair: time for pair, time in only.items() if pair not in near}
    in_replay = "touch in the replay, not in the solution,"
    return (
        [*_sentences(model, solved, "touch"), *_sentences(model, hit, f"come within 1 mm and {in_replay}")],
        _sentences(model, astray, in_replay),
    )


def _solved_poses(setup: Setup, motion: Replay) -> Iterator[tuple[float, FloatArray]]:
    """Time and (nq,) position at each frame, as far as it is known."""
    pose = np.array(setup.compiled.qpos0)
    for frame, position in enumerate(motion.positions):
        known = np.isfinite(position)
        if not known.all() and not setup.all_tied:
            return
        part = "after" if frame < setup.solution.n else "before"
        pose[known] = position[known]
        pose[setup.reference.positions] = setup.reference.at(part, frame)[0]
        yield float(setup.solution.time[frame]), pose


def _replayed_poses(motion: Replay) -> Iterator[tuple[float, FloatArray]]:
    """Time and (nq,) position along the replay, until it breaks down."""
    for at in np.unique(np.linspace(0, len(motion.path) - 1, _LOOKED_AT).astype(int)):
        if not np.all(np.isfinite(motion.path[at])):
            return
        yield float(motion.time[at]), motion.path[at]


def _first_touches(
    setup: Setup, model: mujoco.MjModel, poses: Iterator[tuple[float, FloatArray]]
) -> dict[tuple[int, int], float]:
    """Pairs of geoms that touch as a tied joint moves them, and the time in s of the first pose in which they do."""
    import mujoco

    data = mujoco.MjData(model)
    first: dict[tuple[int, int], float] = {}
    for time, pose in poses:
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        for number, contact in enumerate(data.contact):
            if contact.exclude or contact.dist > contact.includemargin - _TOUCHES or min(contact.geom) < 0:
                continue
            if contact_jacobian(model, data, number)[0][:, setup.reference.velocities].any():
                first.setdefault((int(contact.geom[0]), int(contact.geom[1])), time)
    return first


def _sentences(model: mujoco.MjModel, touches: dict[tuple[int, int], float], what: str) -> list[str]:
    found = [
        f"geoms {_title(model, a)} and {_title(model, b)} {what} at t = {time:.4g} s, which no `contact` line mentions"
        for (a, b), time in touches.items()
    ]
    if len(found) > _NAMED:
        found = [
            *found[:_NAMED],
            f"{len(found) - _NAMED} more pairs of geoms {what} where no line mentions it",
        ]
    return found


def _title(model: mujoco.MjModel, geom: int) -> str:
    """A geom's name, or the body that it is of."""
    import mujoco

    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    if name:
        return str(name)
    body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, int(model.geom_bodyid[geom]))
    return f"{geom} (of {body})" if body else str(geom)
