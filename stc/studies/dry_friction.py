"""Dry friction in a spec's equations of motion and in its model's: its direction, and differences between the two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.phases import Phase
from stc.records import dataclass
from stc.solution import Solution
from stc.studies.terms import STATIC, TOGETHER, Difference
from stc.trajectory import Channel
from stc.validate.dry_friction import AT_REST
from stc.validate.model_equations import ModelEquations

FloatArray = NDArray[np.float64]

#: What differs less than this share of the friction from position to position is the same at all of them.
_SAME = 1e-8

#: What slides slower than this share of its fastest may be at rest: the solver leaves as much.
_SLOW = 1e-6

#: The dry friction of a sliding direction, 0 for none, in words.
_WAYS = {1.0: "that of sliding forwards", -1.0: "that of sliding backwards", 0.0: "left out"}


def way_in_words(way: float) -> str:
    """The dry friction of a sliding direction; 0 for none, nan for whichever the velocity has."""
    return _WAYS.get(float(way), "against the velocity")


@dataclass(frozen=True, slots=True)
class Slid:
    """The sliding direction of a joint or tendon with dry friction on a phase of a motion.

    Attributes:
        forwards: first and last of the frames at which it slides forwards; None if it does not.
        backwards: the same of sliding backwards.
    """

    forwards: tuple[float, float] | None
    backwards: tuple[float, float] | None

    @property
    def way(self) -> float:
        """1 or -1 if it slides in one direction only; 0 if in both, or if it rests."""
        return float(self.forwards is not None) - float(self.backwards is not None)

    def otherwise(self, way: float) -> str:
        """The frames at which it slides in another direction than the given one, in words; "" if it does not, or any
        is right (nan).
        """
        if np.isnan(way):
            return ""
        found = {1.0: ("forwards", self.forwards), -1.0: ("backwards", self.backwards)}
        return " and ".join(
            f"{words} between frames {frames[0]:g} and {frames[1]:g}"
            for sign, (words, frames) in found.items()
            if frames is not None and sign != way
        )


def slid(motion: Solution, phase: Phase, mechanics: ModelEquations) -> list[Slid]:
    """The sliding direction of each joint and tendon with dry friction at the nodes of a phase; empty without
    velocities.
    """
    lines = {channel.name: channel for channel in motion.replay if channel.kind == "joint"}
    channels = [(lines[name].value, lines[name].rate) for name in mechanics.joints if name in lines]
    if len(channels) < len(mechanics.joints) or any(rate is None for _, rate in channels):
        return []
    start, stop = motion.force_frames or (0, motion.n)
    first, last = max(phase.first, start), min(phase.last, stop)
    if last <= first:
        return []
    frames = np.arange(first, last + 1.0)
    places = np.concatenate([frames[:-1], frames[1:], frames[:-1] + 0.5])

    def nodes(channel: Channel) -> FloatArray:
        """A channel's values at the beginnings of the steps, then at their ends, then at their midpoints."""
        mid = channel.mid[first:last] if channel.mid is not None else channel.after[:0]
        return np.concatenate([channel.after[first:last], channel.before[first + 1 : last + 1], mid])

    q = np.stack([nodes(value) for value, _ in channels], axis=1)
    v = np.stack([nodes(rate) for _, rate in channels if rate is not None], axis=1)
    rates = np.array([mechanics.slides(at) @ speed for at, speed in zip(q, v)])
    found = []
    for rate in rates.reshape(len(q), len(mechanics.dry)).T:
        slow = max(AT_REST, _SLOW * float(np.abs(rate).max(initial=0.0)))
        ends = []
        for one in (rate > slow, rate < -slow):
            where = places[: len(rate)][one]
            ends.append((float(where.min()), float(where.max())) if len(where) else None)
        found.append(Slid(*ends))
    return found


def dry_friction_named(
    found: Sequence[Difference], spec: FloatArray, model: FloatArray, mechanics: ModelEquations
) -> list[Difference]:
    """Differences, with those of static forces called dry friction if they are the same at all positions.

    Args:
        found: differences of all terms.
        spec: (S, k) static forces at S positions according to the spec, with dry friction as it states that.
        model: (S, k) according to the model, with dry friction as it is sliding.
        mechanics: the model.
    """
    start, named = np.zeros(len(mechanics.joints)), []
    ways = [np.abs(mechanics.friction(start, one)) for one in np.eye(len(mechanics.dry))]
    for one in found:
        row = mechanics.joints.index(one.joint)
        gap = spec[:, row] - model[:, row]
        most = float(sum(way[row] for way in ways))
        if one.kind in (STATIC, TOGETHER) and most > 0.0 and float(np.ptp(gap)) <= _SAME * most:
            slides = float(mechanics.friction(start, mechanics.sliding)[row])
            stated = float(gap.mean()) + slides
            given = slides or most * float(np.sign(stated))
            one = replace(one, term="dry friction", spec=stated, model=given)
        named.append(one)
    return named
