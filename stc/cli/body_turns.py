"""The number of turns of bodies in a motion, which poses alone do not show."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.solution import Solution
from stc.transcription.turns import CONJUGATE, turns_between

FloatArray = NDArray[np.float64]

#: What turns less than this from its first pose to its last, in rad, needs not be told: the poses tell it.
LEAST = math.pi

#: A component of an axis that is smaller than this is not shown.
_NO_PART = 0.02


@dataclass(frozen=True, slots=True)
class Turn:
    """The total rotation of a free or ball joint.

    Attributes:
        joint: its path, ``joint.root``.
        angle: rad, beyond pi and below -pi as well.
        axis: unit vector, in the world for a free joint, in the parent's axes for a ball.
    """

    joint: str
    angle: float
    axis: tuple[float, float, float]

    def __str__(self) -> str:
        return f"{self.angle / (2.0 * math.pi):.3g} about {self._about()}"

    def _about(self) -> str:
        parts = [(part, name) for part, name in zip(self.axis, "xyz", strict=True) if abs(part) > _NO_PART]
        if len(parts) == 1:
            return parts[0][1]
        return f"({', '.join(f'{part:.2g}' for part in self.axis)})"


def turns(solution: Solution) -> list[Turn]:
    """The joints that turn by more than half a turn: the sum of all their turns from node to node."""
    found = []
    for name in solution.variables:
        if name.endswith(".qw"):
            joint = name.removesuffix(".qw")
            total = _sum(_quaternions(solution, joint))
            angle = float(np.linalg.norm(total))
            if angle > LEAST:
                axis = total / angle
                if axis[int(np.argmax(np.abs(axis)))] < 0.0:
                    angle, axis = -angle, -axis
                x, y, z = axis.tolist()
                found.append(Turn(joint, angle, (x, y, z)))
    return found


def _quaternions(solution: Solution, joint: str) -> FloatArray:
    """A joint's orientation at all nodes, in order of time. (k, 4)"""
    parts = []
    for component in "wxyz":
        channel = solution.trajectories[f"{joint}.q{component}", 0]
        values = channel.before
        if channel.mid is not None:
            values = np.append(np.stack([values[:-1], channel.mid], axis=1).reshape(-1), values[-1])
        parts.append(values)
    return np.stack(parts, axis=1)


def _sum(q: FloatArray) -> FloatArray:
    """The sum of the rotation vectors from each orientation to the next one, along the axes that q turns in. (3,)"""
    back = (
        q.T * CONJUGATE
    )  # seen from there, the turn has the components that it has in the axes that q turns in
    return np.asarray(turns_between(back[:, 1:], back[:, :-1]).sum(axis=1))


__all__ = ["Turn", "turns"]
