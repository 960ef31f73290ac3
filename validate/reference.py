"""The solved motion of the tied joints as a function of time, by the transcription's own polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.solution import Solution
from stc.trajectory import Channel, curves, horner
from stc.validate.metrics import FloatArray
from stc.validate.model import Tie
from stc.validate.signals import node_value

if TYPE_CHECKING:
    import mujoco


class Reference:
    """Positions, velocities and accelerations of the tied joints.

    Attributes:
        has_acceleration: whether the solution knows them all.
        positions: (k,) indices of the tied joints in ``qpos``.
        velocities: (k,) indices in ``qvel``.
    """

    def __init__(self, solution: Solution, ties: Sequence[Tie]) -> None:
        self.ties = list(ties)
        self.has_acceleration = all(tie.line.acceleration is not None for tie in ties)
        self.positions = np.array([tie.position for tie in ties], dtype=np.intp)
        self.velocities = np.array([tie.velocity for tie in ties], dtype=np.intp)
        n = solution.n
        steps, lengths = np.arange(n), np.diff(solution.time)
        found: list[list[list[FloatArray]]] = []
        for tie in ties:
            orders: dict[int, Channel] = {}
            for order, channel in enumerate((tie.line.value, tie.line.rate, tie.line.acceleration)):
                if channel is not None:
                    orders[order] = channel
            by_order = curves(solution.method, orders, steps, lengths) if n else {}
            found.append([by_order[k] for k in sorted(by_order)])
        count = 3 if self.has_acceleration else 2
        #: Per order and power of s an array (n, k) of coefficients.
        self._coefficients = [_by_power([f[k] for f in found], n) for k in range(count)] if n else []

    def in_step(self, step: int, shares: FloatArray) -> list[FloatArray]:
        """Positions, velocities and, where known, accelerations at shares of a step: (len(shares), k) each."""
        return [horner([c[step] for c in powers], shares[:, None]) for powers in self._coefficients]

    def at(self, part: str, index: int) -> list[FloatArray]:
        """The same at a node, (k,) each: ``before`` or ``after`` a frame, or ``mid`` of a step."""
        found = []
        for field in ("value", "rate", "acceleration")[: 3 if self.has_acceleration else 2]:
            channels = [getattr(tie.line, field) for tie in self.ties]
            found.append(np.array([node_value(channel, part, index) for channel in channels]))
        return found

    @property
    def extent(self) -> float:
        """The longest way of a tied joint, in m or rad: the distance between two of its places at the frames."""
        return max(float(np.ptp([tie.line.value.before, tie.line.value.after])) for tie in self.ties)

    def put(self, data: mujoco.MjData, state: Sequence[FloatArray]) -> None:
        """Write positions, velocities and, if given, accelerations (k,) into a simulation."""
        data.qpos[self.positions] = state[0]
        data.qvel[self.velocities] = state[1]
        if len(state) > 2:
            data.qacc[self.velocities] = state[2]


def _by_power(joints: Sequence[Sequence[FloatArray]], n: int) -> list[FloatArray]:
    """Coefficient arrays (n, k) per power, from one list of (n,) coefficients per joint."""
    degree = max(len(curve) for curve in joints)
    found = [np.zeros((n, len(joints))) for _ in range(degree)]
    for column, curve in enumerate(joints):
        for power, coefficient in enumerate(curve):
            found[power][:, column] = coefficient
    return found
