"""The controls of a solution as functions of time, the way its transcription means its forces.

- ``central``: given at the frames, straight lines between them.  Where clipped stencils left the equations
  of motion out (normally frames 0 and n) no force was determined, and the nearest frame's is held.
- ``trapezoidal``: straight lines between the frames.
- ``hermite-simpson``: in every step the parabola through frame, midpoint and frame.

At a jump the step to the left uses the value before it and the step to the right the value after it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.solution import Solution
from stc.trajectory import Channel, horner, parabola
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError, find_object, lines_of

if TYPE_CHECKING:
    import mujoco


class Controls:
    """Control signals of a replay.

    Attributes:
        addresses: (k,) index in MuJoCo's ``ctrl`` of each driven actuator.
        names: the driven actuators.
        channels: their node values, held at the ends where the method asks for it.
    """

    def __init__(self, model: mujoco.MjModel, solution: Solution) -> None:
        """Tie the spec's ``actuator`` lines to the model.

        Raises:
            ModelError: an unknown actuator, or one that takes several controls.
        """
        lines = lines_of(solution, "actuator")
        self.names = [line.name for line in lines]
        self.actuators = [
            find_object(model, "actuator", line.name, f"actuator {line.name}") for line in lines
        ]
        for name, index in zip(self.names, self.actuators):
            if model.actuator_ctrlnum[index] != 1:
                raise ModelError(f"actuator {name} takes {model.actuator_ctrlnum[index]} controls, not one")
        self.addresses = np.array([model.actuator_ctrladr[index] for index in self.actuators], dtype=np.intp)
        first, last = solution.force_frames or (0, solution.n)
        self.channels = [line.value.held_outside(first, last) for line in lines]
        self._coefficients = self._polynomials(solution.n)

    def _polynomials(self, n: int) -> list[FloatArray]:
        """Per power of s (0, 1, 2) an array (n, k) of coefficients of every step and actuator."""
        found = [np.zeros((n, len(self.channels))) for _ in range(3)]
        for column, channel in enumerate(self.channels):
            left, right = channel.after[:-1], channel.before[1:]
            curve = [left, right - left] if channel.mid is None else parabola(left, channel.mid, right)
            for power, coefficient in enumerate(curve):
                found[power][:, column] = coefficient
        return found

    def in_step(self, step: int, shares: FloatArray) -> FloatArray:
        """Controls in one step at the given shares of it: (len(shares), k)."""
        return horner([c[step] for c in self._coefficients], shares[:, None])

    def at_frame(self, frame: int, side: str) -> FloatArray:
        """Controls at a frame as the step on one side sees them: (k,)."""
        return np.array([_side(channel, side)[frame] for channel in self.channels])

    def beyond_range(self, model: mujoco.MjModel) -> list[str]:
        """Names of the actuators whose control leaves the range that the model clamps it to."""
        found = []
        for name, index, channel in zip(self.names, self.actuators, self.channels):
            if model.actuator_ctrllimited[index]:
                lower, upper = model.actuator_ctrlrange[index]
                values = np.concatenate([channel.before, channel.after])
                slack = 1e-9 * max(1.0, abs(lower), abs(upper))
                if values.min() < lower - slack or values.max() > upper + slack:
                    found.append(name)
        return found


def _side(channel: Channel, side: str) -> FloatArray:
    return channel.before if side == "before" else channel.after
