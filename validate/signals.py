"""Values at the nodes of a solution as functions of time, interpolated as its transcription interpolates forces.

- ``central``: given at the frames, straight lines between them.  At frames where clipped stencils
  leave out the equations of motion (normally frames 0 and n) no force is determined; the nearest frame's is used.
- ``trapezoidal``: straight lines between the frames.
- ``hermite-simpson``: in every step the parabola through frame, midpoint and frame.
- ``stepping``: in every step the value of the frame that ends it.

At a jump the step to the left uses the value before it and the step to the right the value after it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel, horner, interpolant
from stc.validate.metrics import FloatArray


class Signals:
    """Several replay lines as functions of time.

    Attributes:
        lines: the replay lines.
        channels: their node values, held at the ends where the method asks for it.
    """

    def __init__(self, solution: Solution, lines: Sequence[ReplayChannel]) -> None:
        first, last = solution.force_frames or (0, solution.n)
        self.lines = list(lines)
        self.channels = [line.value.held_outside(first, last) for line in lines]
        self._coefficients = _polynomials(self.channels, solution)
        self._time = solution.time

    def __len__(self) -> int:
        return len(self.lines)

    def in_step(self, step: int, shares: FloatArray) -> FloatArray:
        """Values in one step at the given shares of it: (len(shares), k)."""
        return horner([c[step] for c in self._coefficients], shares[:, None])

    def at(self, part: str, index: int) -> FloatArray:
        """Values at a node, (k,): ``before`` or ``after`` frame ``index``, or ``mid`` of step ``index``."""
        return np.array([node_value(channel, part, index) for channel in self.channels])

    def at_times(self, times: FloatArray) -> FloatArray:
        """Values at times within the motion, in seconds (m,): (m, k); at a jump, those after it."""
        if len(self._time) == 1:
            return np.tile(self.at("after", 0), (len(times), 1))
        steps, shares = steps_at(self._time, times)
        return horner([c[steps] for c in self._coefficients], shares[:, None])


def steps_at(frames: FloatArray, times: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """The steps that contain some times, (m,), and the shares of these steps, (m,).

    Args:
        frames: (n+1,) times of the frames, in seconds; two at least.
        times: (m,) times within them.
    """
    steps = np.clip(np.searchsorted(frames, times, side="right") - 1, 0, len(frames) - 2)
    return steps, np.clip((times - frames[steps]) / np.diff(frames)[steps], 0.0, 1.0)


def node_value(channel: Channel, part: str, index: int) -> float:
    """The value of a channel at a node: ``before`` or ``after`` frame ``index``, ``mid`` of step ``index``."""
    values = {"before": channel.before, "after": channel.after, "mid": channel.mid}[part]
    assert values is not None
    return float(values[index])


def _polynomials(channels: Sequence[Channel], solution: Solution) -> list[FloatArray]:
    """Per power of s (0, 1, 2) an array (n, k) of coefficients of every step and channel."""
    steps = np.arange(solution.n)
    found = [np.zeros((solution.n, len(channels))) for _ in range(3)]
    for column, channel in enumerate(channels):
        for power, coefficient in enumerate(interpolant(solution.method, channel, steps)):
            found[power][:, column] = coefficient
    return found
