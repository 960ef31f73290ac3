"""When a recorded motion stands on the floor, and on what: by how high places are and how fast they move.

A place stands where it is low and slow, and has left where it is higher by several times: the two thresholds differ
(hysteresis, as in a Schmitt trigger), so that what trembles about one of them does not come and go.  When it came and
when it left, its height tells, which changes there at once.
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
#: So much higher than where it rests, in m, it has left.
FINEST = 1e-3
#: Instants per frame at which a motion is looked at.
FINE = 4
#: Frames that a stance and a flight last at least.
SHORTEST = 3
#: Motions that come no nearer to the floor than this, in m, are in the air.
FAR = 0.05
#: Rounds, and the step of differences, by which a pose is put on the floor.
_ROUNDS, _STEP = 20, 1e-6


@dataclass(slots=True)
class Contact:
    """What touches the floor, and when.

    Attributes
    ----------
    name
        How the spec calls it.
    spot
        Where it is.
    ranges
        First and last frame of each stance.
    times
        The same in seconds, as they were found.
    """

    name: str
    spot: Spot
    ranges: list[tuple[int, int]]
    times: list[tuple[float, float]]


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
    if "contact" in mechanism.options.disabled:
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
    if ground - _floor(stance) > FAR:
        return []
    rates = np.gradient(places, times, axis=2)
    speeds = np.linalg.norm(rates, axis=0)
    found: dict[str, Contact] = {}
    for spot, height, speed in zip(stance.spots, heights - ground, speeds, strict=True):
        low = max(LOW, LOW_SHARE * float(np.ptp(height)))
        slow = max(SLOW, SLOW_SHARE * float(speed.max()))
        stands = _held((height < low) & (speed < slow), height < HIGHER * low, height)
        stretches = _stretches(stands, SHORTEST * FINE)
        if stretches and spot.written not in found:
            spans = [(float(times[first]), float(times[last])) for first, last in stretches]
            frames = [
                (round(a / recording.duration * n), round(b / recording.duration * n)) for a, b in spans
            ]
            found[spot.written] = Contact(_name(spot, len(found) + 1), spot, frames, spans)
    return _unlike(list(found.values()))


def _held(rests: NDArray[np.bool_], near: NDArray[np.bool_], height: FloatArray) -> NDArray[np.bool_]:
    """True where a place stands: about the instants at which it rests, as long as it is no higher than there.

    Parameters
    ----------
    rests
        (k,) where it is low and slow.
    near
        (k,) where it is not yet high: rests within one such stretch are one stance.
    height
        (k,) in m.
    """
    found = np.zeros(len(rests), bool)
    for first, end in stretches_of(near):
        inside = first + np.flatnonzero(rests[first:end])
        if inside.size:
            level = float(np.median(height[inside]))
            spread = float(np.median(np.abs(height[inside] - level)))
            # What lands is fast until it touches, and what leaves is slow at first: its height tells when.
            low = height < level + max(FINEST, 4.0 * spread)
            begin, last = int(inside[0]), int(inside[-1])
            while begin > first and low[begin - 1]:
                begin -= 1
            while begin < last and not low[begin]:
                begin += 1
            while last + 1 < end and low[last + 1]:
                last += 1
            while last > begin and not low[last]:
                last -= 1
            found[begin : last + 1] = True
    return found


def _stretches(stands: NDArray[np.bool_], shortest: int) -> list[tuple[int, int]]:
    """First and last instant of each stance, without gaps that are too short to be flights, and short touches."""
    joined: list[tuple[int, int]] = []
    for first, end in stretches_of(stands):
        if joined and first - joined[-1][1] < shortest:
            joined[-1] = joined[-1][0], end - 1
        else:
            joined.append((first, end - 1))
    return [(first, last) for first, last in joined if last - first >= shortest]


def _name(spot: Spot, number: int) -> str:
    """A name for a contact: that of its geom, where it has a plain one."""
    inner = spot.written.partition("(geom.")[2].rstrip(")")
    return inner if inner.isidentifier() else f"contact{number}"


def _unlike(found: list[Contact]) -> list[Contact]:
    """Of the points of one body that stand at the same time the first three: what a fourth one bears nothing tells."""
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
