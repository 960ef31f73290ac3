"""When a recorded motion stands on the floor, and on what: by how high places are and how fast they move.

A place stands where it is low and slow, and has left where it is higher by several times: the two thresholds differ
(hysteresis, as in a Schmitt trigger), so that what trembles about one of them does not come and go.  When it came and
when it left is told by how far it is from where it stands.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import stretches_of
from stc.explaining.recording import Recording
from stc.records import dataclass
from stc.stance import Spot, Stance

__all__ = ["Contact", "contacts", "put_on_floor"]

FloatArray = NDArray[np.float64]

#: A place may rest below this height, in m and as a share of how high it gets, and flies above so many times that.
LOW, LOW_SHARE, HIGHER = 4e-3, 0.04, 2.5
#: It rests below this speed, in m/s and as a share of its largest one.
SLOW, SLOW_SHARE = 0.1, 0.08
#: So far from where it rests, in m, it has certainly left; and how many times farther it is looked at again.
FINEST, APART = 1e-3, 3.0
#: Instants per frame at which a motion is looked at.
FINE = 4
#: Frames that a stance and a flight last at least.
SHORTEST = 3
#: Motions whose lowest place is farther than this from the floor, in m, do not stand on it.
FAR = 0.05
#: Rounds, and the step of differences, by which a pose is put on the floor.
_ROUNDS, _STEP = 20, 1e-6


@dataclass(slots=True)
class Contact:
    """A point that touches the floor, and the frames on which it does.

    Attributes
    ----------
    name
        How the spec calls it.
    spot
        Where it is.
    ranges
        First and last frame of each stance.
    """

    name: str
    spot: Spot
    ranges: list[tuple[int, int]]


def contacts(recording: Recording, n: int) -> list[Contact]:
    """The places of a model that stand on the floor during a motion.

    Parameters
    ----------
    recording
        The motion.
    n
        Its last frame.
    """
    mechanism = recording.mechanism
    floors = any(geom.kind == "plane" for geom in mechanism.geoms)
    if "contact" in mechanism.options.disabled or not floors:
        return []
    # Which places a geom has depends on how it lies: the model's own pose has soles level, to the last digit.
    poses = [keyframe.qpos for keyframe in mechanism.keyframes if keyframe.name]
    stance = Stance(mechanism, [*poses, mechanism.start][0])
    times = np.linspace(0.0, recording.duration, FINE * n + 1)
    if not stance.spots:
        return []
    places, _ = stance.seen(recording.at(times).T, stance.spots)
    heights = np.einsum("i,isk->sk", stance.up, places)
    # Recordings have the floor a little higher or lower than the model.
    ground = float(heights.min())
    if abs(ground - _floor(stance)) > FAR:
        return []
    rates = np.gradient(places, times, axis=2)
    speeds = np.linalg.norm(rates, axis=0)
    found: dict[str, Contact] = {}
    for index, spot in enumerate(stance.spots):
        height, speed = heights[index] - ground, speeds[index]
        # The lowest place of what rolls goes along the floor while it stands: its height alone tells.
        path = height[None] if spot.radius else places[:, index]
        low = max(LOW, LOW_SHARE * float(np.ptp(height)))
        slow = max(SLOW, SLOW_SHARE * float(speed.max()))
        near = height < HIGHER * low
        rests = near & (height < low) & (speed < slow)
        spans = _joined(_spans(times, path, rests, near), recording.duration / n, recording.duration)
        if spans and spot.written not in found:
            frames = [
                (round(a / recording.duration * n), round(b / recording.duration * n)) for a, b in spans
            ]
            found[spot.written] = Contact(_name(spot, len(found) + 1), spot, frames)
    return _unlike(list(found.values()))


def _spans(
    times: FloatArray, path: FloatArray, rests: NDArray[np.bool_], near: NDArray[np.bool_]
) -> list[tuple[float, float]]:
    """The first and last times of each stance of a point: around the instants of rest, until it leaves.

    Parameters
    ----------
    times
        (k,) s.
    path
        (3, k) where the place is, in m; or (1, k) its height.
    rests
        (k,) where it is low and slow.
    near
        (k,) where it is not yet high: rests within one such stretch are one stance.
    """
    found = []
    for first, end in stretches_of(near):
        inside = first + np.flatnonzero(rests[first:end])
        if inside.size:
            gone = np.linalg.norm(path - np.median(path[:, inside], axis=1)[:, None], axis=0)
            unsure = max(FINEST, 4.0 * float(np.median(gone[inside])))
            middle = int(inside[len(inside) // 2])
            begin = _left(times[::-1], gone[::-1], len(times) - 1 - middle, unsure)
            last = _left(times, gone, middle, unsure)
            found.append((begin, last))
    return found


def _left(times: FloatArray, gone: FloatArray, rests: int, unsure: float) -> float:
    """When a place leaves from where it rests at an instant; the times may run backwards.

    Parameters
    ----------
    times
        (k,) s.
    gone
        (k,) how far it is from there, in m.
    rests
        The instant.
    unsure
        The distance from which on it is certain to have left.

    It leaves slowly at first, or at once: by some power of the time since.  Of any such power the times at which it is
    away by certain distances, each several times the last one, are a geometric progression, whose limit is wanted.
    """
    at = []
    for power in range(3):
        beyond = np.flatnonzero(gone[rests:] > unsure * APART**power)
        if not beyond.size:
            break
        k = rests + int(beyond[0])
        share = (unsure * APART**power - gone[k - 1]) / (gone[k] - gone[k - 1])
        at.append(float(times[k - 1] + share * (times[k] - times[k - 1])))
    if not at:
        return float(times[-1])
    bend = at[0] + at[-1] - 2.0 * at[1] if len(at) == 3 else 0.0
    limit = (at[0] * at[2] - at[1] ** 2) / bend if bend else at[0]
    if len(at) < 3:
        return at[0]
    ends = sorted((2.0 * at[0] - at[1], at[0]))
    return min(max(limit, ends[0]), ends[1])


def _joined(spans: list[tuple[float, float]], step: float, whole: float) -> list[tuple[float, float]]:
    """Stances without gaps that are too short to be flights, and without touches that are too short to be stances."""
    joined: list[tuple[float, float]] = []
    for begin, end in spans:
        if joined and begin - joined[-1][1] < SHORTEST * step:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((begin, end))
    # At both ends of a motion noise is worst, and nothing tells of so short a flight.
    joined = [
        (0.0 if a < SHORTEST * step else a, whole if whole - b < SHORTEST * step else b) for a, b in joined
    ]
    return [(begin, end) for begin, end in joined if end - begin >= SHORTEST * step]


def _name(spot: Spot, number: int) -> str:
    """A name for a contact: that of its geom, where it has a plain one."""
    inner = spot.written.partition("(geom.")[2].rstrip(")")
    return inner if inner.isidentifier() else f"contact{number}"


def _unlike(found: list[Contact]) -> list[Contact]:
    """At most three points of a body that stand at the same time: the force on a fourth one is not determined."""
    kept: list[Contact] = []
    for contact in found:
        alike = [one for one in kept if one.spot.body == contact.spot.body and one.ranges == contact.ranges]
        if len(alike) < 3:
            kept.append(contact)
    return kept


def put_on_floor(stance: Stance, q: FloatArray, standing: list[Contact]) -> FloatArray:
    """The pose (nq,) nearest to one in which all that stands touches the floor: damped least squares."""
    spots = [contact.spot for contact in standing]
    moving = [j.qpos for j in stance.mechanism.joints if j.kind in ("hinge", "slide")]
    moving += [j.qpos + k for j in stance.mechanism.joints if j.kind == "free" for k in range(3)]
    q = q.copy()
    for _ in range(_ROUNDS if spots else 0):
        columns = np.repeat(q[:, None], len(moving) + 1, axis=1)
        columns[moving, np.arange(1, len(moving) + 1)] += _STEP
        heights = np.einsum("i,isk->sk", stance.up, stance.seen(columns, spots)[0]) - _floor(stance)
        slopes = (heights[:, 1:] - heights[:, :1]) / _STEP
        square = slopes @ slopes.T + 1e-9 * np.eye(len(spots))
        q[moving] -= slopes.T @ np.linalg.solve(square, heights[:, 0])
        if np.abs(heights[:, 0]).max() < 1e-9:
            break
    return q


def _floor(stance: Stance) -> float:
    """How high the model's floor is along its normal, in m."""
    return float(stance.up @ np.array(stance.floor.origin))
