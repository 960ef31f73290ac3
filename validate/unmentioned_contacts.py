"""Geoms that touch although the spec has no contact force there: their forces are in the replay and not in the
solution.

This concerns pairs whose bodies have no ``contact`` line, and frames where the force of the lines is zero, as for a
swinging foot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.contact_meter import can_touch, contact_jacobian, touchable

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

#: Of the largest value of a contact line, so much at least is a force.
_ACTS = 1e-3


@dataclass(frozen=True, slots=True)
class Touch:
    """Geoms that touch although they should not.

    Attributes:
        line: a description of the contact and its time.
        advice: the advice.
    """

    line: str
    advice: str


def unmentioned_contacts(setup: Setup, motion: Replay) -> tuple[list[Touch], list[Touch]]:
    """Geoms, moved by tied joints, that touch although the spec has no contact force there.

    Args:
        setup: the motion.
        motion: its replay, which gives the positions of joints that are not tied.

    Returns:
        Those that touch in the solved motion, or come so close that they touch in the replay; and those that touch in
        the replay only.  Empty if a contact line acts on a joint instead of a body, because its geoms are not known.
    """
    if not can_touch(setup.compiled) or any(line.path[0] == "joint" for line in setup.contact.lines):
        return [], []
    model = setup.model()
    solved = _touches(setup, model, _solved_poses(setup, motion))
    near = _touches(setup, touchable(setup.model()), _solved_poses(setup, motion))
    replayed = _touches(setup, model, _replayed_poses(motion))
    only = {pair: times for pair, times in replayed.items() if pair not in solved}
    hit = {pair: times for pair, times in only.items() if pair in near}
    astray = {pair: times for pair, times in only.items() if pair not in near}
    in_replay = "touch in the replay, not in the solution,"
    return (
        [*_told(setup, solved, "touch"), *_told(setup, hit, f"come within 1 mm and {in_replay}")],
        _told(setup, astray, in_replay),
    )


def _acting(setup: Setup) -> dict[int, np.ndarray]:
    """Per body with contact lines, by the first of those that are welded to it: (n+1,) whether their force acts at a
    frame or at one beside it."""
    found: dict[int, np.ndarray] = {}
    for line, place in zip(setup.contact.lines, setup.contact.where.places, strict=True):
        if place is None:
            continue
        sides = [line.value.before, line.value.after]
        if line.value.mid is not None:
            sides += [np.append(line.value.mid, 0.0), np.append(0.0, line.value.mid)]
        size = np.max(np.abs(sides), axis=0)
        acts = np.pad(size > _ACTS * size.max(initial=0.0), 1)
        body = setup.compiled.body_weldid[place.body]
        known = found.setdefault(int(body), np.zeros(len(size), bool))
        known |= acts[:-2] | acts[1:-1] | acts[2:]
    return found


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


def _touches(
    setup: Setup, model: mujoco.MjModel, poses: Iterator[tuple[float, FloatArray]]
) -> dict[tuple[int, int], list[float]]:
    """Pairs of geoms that touch where no contact force acts, as a tied joint moves them, and when, in s."""
    import mujoco

    data, acting, ends = mujoco.MjData(model), _acting(setup), setup.solution.time
    found: dict[tuple[int, int], list[float]] = {}
    for time, pose in poses:
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        frame = int(np.clip(np.searchsorted(ends, time, side="right") - 1, 0, len(ends) - 1))
        meant = {body for body, acts in acting.items() if acts[frame : frame + 2].any()}
        contacts = data.contact
        near = (contacts.exclude == 0) & (contacts.dist <= contacts.includemargin - _TOUCHES)
        for number in np.flatnonzero(near & (contacts.geom >= 0).all(axis=1)).tolist():
            pair = contacts.geom[number]
            if not meant.isdisjoint(model.body_weldid[model.geom_bodyid[pair]].tolist()):
                continue
            if contact_jacobian(model, data, number)[0][:, setup.reference.velocities].any():
                times = found.setdefault((int(pair[0]), int(pair[1])), [])
                if not times or times[-1] != time:
                    times.append(time)
    return found


def _told(setup: Setup, touches: dict[tuple[int, int], list[float]], what: str) -> list[Touch]:
    model, lifted = setup.compiled, {int(body) for body in _acting(setup)}
    found = []
    for (a, b), times in touches.items():
        names = f"geoms {_title(model, a)} and {_title(model, b)}"
        own = next((g for g in (a, b) if int(model.body_weldid[model.geom_bodyid[g]]) in lifted), None)
        if own is None:
            hint = "keep them apart, or state the force between them and give it in `contact` lines under replay:"
            if times[0] == setup.solution.time[0] and model.geom_bodyid[a] and model.geom_bodyid[b]:
                hint = f"where bodies overlap as drawn, write `with excludes` after the model's name; else {hint}"
            found.append(
                Touch(f"{names} {what} at t = {times[0]:.4g} s, which no `contact` line mentions", hint)
            )
            continue
        first, last = _stretch(setup, times)
        frames = f"frames {first} to {last}" if last > first else f"frame {first}"
        body = model.body(int(model.geom_bodyid[own])).name or "without a name"
        found.append(
            Touch(
                f"{names} {what} in {frames}, from t = {times[0]:.4g} s on, where the solved contact force on body "
                f"{body} is zero",
                f"keep them apart there, by more `clearance` in the `contact:` section or by a line such as "
                f"`[{first}, {last}]: z >= 0.01;` on the height z of the lowest point of {_title(model, own)}, or let "
                "the contact act there",
            )
        )
    if len(found) > _NAMED:
        more = f"{len(found) - _NAMED} more pairs of geoms {what} where no contact force acts"
        found = [*found[:_NAMED], Touch(more, "keep them apart as well")]
    return found


def _stretch(setup: Setup, times: list[float]) -> tuple[int, int]:
    """First and last frame of the first stretch of poses that touch, without a frame between them that does not."""
    frames = np.searchsorted(setup.solution.time, np.array(times) + 1e-9, side="right") - 1
    gaps = np.flatnonzero(np.diff(frames) > 1)
    return int(frames[0]), int(frames[gaps[0]] if len(gaps) else frames[-1])


def _title(model: mujoco.MjModel, geom: int) -> str:
    """A geom's name, or the body that it is of."""
    name, body = model.geom(geom).name, model.body(int(model.geom_bodyid[geom])).name
    return str(name) if name else f"{geom} (of {body})" if body else str(geom)
