"""The drift of standing contacts: the displacement of contact points in the solved motion while contact forces act on
them.

A spec may constrain a foot by its acceleration alone; then the errors of the method move it, and an optimiser can
exploit this.  The position and velocity of each contact point come from MuJoCo's kinematics along the solved motion,
at and between the frames.  For a sphere, which may roll, the displacement of the material points that touch is summed.
Contacts that slide with friction, or stand on a moving body, are left out.

In a replay with MuJoCo's contacts a standing contact may slip as well: :func:`slips` finds where it does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.contact_meter import touchable, welded
from stc.validate.metrics import FloatArray, Metric

if TYPE_CHECKING:
    import mujoco

    from stc.validate.contact_forces import ContactForces
    from stc.validate.places import Place
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup

#: Of the largest contact force, so much acts where something stands.
_ACTS = 1e-9

#: Shares of a step at which a motion is looked at, its frames left out.
_BETWEEN = np.array([0.25, 0.5, 0.75])


@dataclass(frozen=True, slots=True)
class Stand:
    """A contact point over some frames on which a force acts.

    Attributes:
        name: name of the point in the replay's lines.
        first, last: first and last frame.
        drift: largest distance from its first position, in m.
        frame: frame of that distance; may be fractional.
    """

    name: str
    first: int
    last: int
    drift: float
    frame: float


@dataclass(frozen=True, slots=True)
class Slip:
    """A contact that stands in the solved motion and slips in a replay.

    Attributes:
        name: name of the point in the replay's lines.
        body: name of its body.
        first, frame: the frame from which it stands, and the first one at which it is farther from its first position
            than :data:`stc.validate.limits.STANDS`.
    """

    name: str
    body: str
    first: int
    frame: int


def contact_drift(setup: Setup, ground: Sequence[ContactForces] = ()) -> list[Stand]:
    """The drift of each contact point while a force acts on it.

    Args:
        setup: the motion.
        ground: the contact forces, which show which bodies slide.
    """
    import mujoco

    if not setup.all_tied or not setup.solution.n:
        return []
    model = touchable(setup.model())
    data = mujoco.MjData(model)
    return [
        Stand(name, first, last, *_moved(setup, model, data, place, first, last))
        for place, name, first, last in _standing(setup, model, data, ground)
    ]


def slips(setup: Setup, motion: Replay, ground: Sequence[ContactForces]) -> list[Slip]:
    """The contacts that slip in a replay with MuJoCo's contacts, the first one first.

    Args:
        setup: the motion.
        motion: the replay.
        ground: the contact forces, which show which bodies slide in the solved motion.
    """
    import mujoco

    if not setup.all_tied or not setup.solution.n:
        return []
    model = touchable(setup.model())
    data = mujoco.MjData(model)
    states = list(zip(motion.positions, motion.velocities, strict=True))

    def put(state: Sequence[FloatArray]) -> None:
        data.qpos, data.qvel = state

    found = []
    for place, name, first, last in _standing(setup, model, data, ground):
        ways = _distances(
            model, data, place, put, states[first : last + 1], setup.solution.time[first : last + 1]
        )
        far = np.flatnonzero(ways > limits.STANDS)  # NaN, after a breakdown, is not
        if len(far):
            body = model.body(place.body).name or str(place.body)
            found.append(Slip(name, body, first, first + int(far[0])))
    return sorted(found, key=lambda slip: slip.frame)


def _standing(
    setup: Setup, model: mujoco.MjModel, data: mujoco.MjData, ground: Sequence[ContactForces]
) -> Iterator[tuple[Place, str, int, int]]:
    """The points of contacts that stand, with their names and their first and last frames."""
    slides = {one.body: one.slides | (one.friction == 0.0) for one in ground}
    for place, (name, lines) in _places(setup).items():
        body = model.body(place.body).name or str(place.body)
        for first, last in _stands(setup, lines):
            if np.any(slides.get(body, np.zeros(1, bool))[first : last + 1]):
                continue
            if not _on_what_moves(setup, model, data, place, first):
                yield place, name, first, last


def drift_metrics(stands: Sequence[Stand]) -> list[Metric]:
    """The largest drift of each contact point."""
    worst: dict[str, Stand] = {}
    for stand in stands:
        if stand.name not in worst or stand.drift > worst[stand.name].drift:
            worst[stand.name] = stand
    return [
        Metric(
            "contact moves while it stands", f"{one.name}, frames {one.first} to {one.last}", one.drift, "m"
        )
        for one in worst.values()
    ]


def drift_notes(stands: Sequence[Stand]) -> list[str]:
    """A note on the contact that moves farthest, if it moves too far."""
    far = [stand for stand in stands if not stand.drift <= limits.STANDS]
    if not far:
        return []
    worst = max(far, key=lambda stand: stand.drift)
    return [
        f"{worst.name} stands on frames {worst.first} to {worst.last} and moves by {worst.drift:.2g} m until "
        f"frame {worst.frame:g}: its acceleration is zero at the nodes, but its place drifts between them; use more "
        "frames, or constrain its place and velocity as well"
    ]


def _places(setup: Setup) -> dict[Place, tuple[str, list[int]]]:
    """The points of the contact lines, each with its name and its lines."""
    found: dict[Place, tuple[str, list[int]]] = {}
    for number, (line, place) in enumerate(zip(setup.contact.lines, setup.contact.where.places, strict=True)):
        if place is not None:
            found.setdefault(place, (".".join(line.path[:-1]), []))[1].append(number)
    return found


def _stands(setup: Setup, lines: Sequence[int]) -> Iterator[tuple[int, int]]:
    """First and last frames of the steps in which a force acts."""
    largest = max(
        [float(np.abs(part).max()) for one in setup.contact.channels for part in (one.before, one.after)],
        default=0.0,
    )
    acting = np.zeros(setup.solution.n, bool)
    for number in lines:
        channel = setup.contact.channels[number]
        inside = [channel.after[:-1], channel.before[1:], *([] if channel.mid is None else [channel.mid])]
        acting |= np.max(np.abs(inside), axis=0) > _ACTS * largest
    first = 0
    for acts, run in groupby(acting):
        last = first + len(list(run))
        if acts:
            yield first, last
        first = last


def _on_what_moves(
    setup: Setup, model: mujoco.MjModel, data: mujoco.MjData, place: Place, frame: int
) -> bool:
    """Whether the body touches a moving body at a frame."""
    import mujoco

    setup.reference.put(data, setup.reference.at("after", frame)[:2])
    mujoco.mj_fwdPosition(model, data)
    own = welded(model, place.body)
    for contact in data.contact:
        bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom if geom >= 0]
        others = [body for body in bodies if body not in own]
        if len(others) < len(bodies) and any(model.body_weldid[body] for body in others):
            return True
    return False


def _moved(
    setup: Setup, model: mujoco.MjModel, data: mujoco.MjData, place: Place, first: int, last: int
) -> tuple[float, float]:
    """The largest distance of a point from its position at a frame, in m, and the frame at which it occurs."""
    times: list[float] = [float(first)]
    states: list[Sequence[FloatArray]] = [setup.reference.at("after", first)[:2]]
    for step in range(first, last):
        positions, velocities = setup.reference.in_step(step, _BETWEEN)[:2]
        states += list(zip(positions, velocities, strict=True))
        states.append(setup.reference.at("before", step + 1)[:2])
        times += [*(step + _BETWEEN).tolist(), step + 1.0]
    at = np.interp(times, np.arange(setup.solution.n + 1), setup.solution.time)
    far = _distances(model, data, place, lambda state: setup.reference.put(data, state), states, at)
    worst = int(np.argmax(far))
    return float(far[worst]), times[worst]


def _distances(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    place: Place,
    put: Callable[[Sequence[FloatArray]], None],
    states: Sequence[Sequence[FloatArray]],
    times: FloatArray,
) -> FloatArray:
    """(k,) how far the points of a place are from their first positions in k states at the given times, in m.

    Args:
        model, data: of the simulator.
        place: the place.
        put: writes a state into ``data``.
        states: of any kind that ``put`` takes.
        times: (k,) in s.
    """
    ways = _ways(model, data, place, put, states)
    if place.radius:
        # From the velocities of the points that touch, by the trapezoid rule.
        steps = 0.5 * np.diff(times)[:, None, None] * (ways[1:] + ways[:-1])
        ways = np.concatenate([np.zeros_like(ways[:1]), np.cumsum(steps, axis=0)])
    return np.asarray(np.linalg.norm(ways - ways[:1], axis=2).max(axis=1))


def _ways(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    place: Place,
    put: Callable[[Sequence[FloatArray]], None],
    states: Sequence[Sequence[FloatArray]],
) -> FloatArray:
    """(k, p, 3) positions of the points of a place in k states; for a sphere, the velocity of the touching point."""
    import mujoco

    found = []
    for state in states:
        put(state)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        at = place.point(model, data)
        if place.radius:
            along = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, along, None, at, place.body)
            found.append([along @ data.qvel])
        else:
            found.append([at + corner for corner in _corners(model, data, place)])
    return np.array(found)


def _corners(model: mujoco.MjModel, data: mujoco.MjData, place: Place) -> list[FloatArray]:
    """The points to follow for a place: the corners of the face of a box, otherwise the place itself."""
    import mujoco

    if place.kind != "geom" or int(model.geom_type[place.index]) != int(mujoco.mjtGeom.mjGEOM_BOX):
        return [np.zeros(3)]
    x, y = data.geom_xmat[place.index].reshape(3, 3).T[:2] * model.geom_size[place.index, :2, None]
    return [sign * x + other * y for sign in (-1.0, 1.0) for other in (-1.0, 1.0)]
