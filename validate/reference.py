"""The solved motion of the tied joints as a function of time, by the transcription's own polynomials.

Quaternions are interpolated component by component and normalised, angular velocities by curves of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stc.solution import Solution
from stc.trajectory import curves, horner
from stc.validate.metrics import FloatArray
from stc.validate.rotations import normalised, rotation_between, turned
from stc.validate.signals import node_value, steps_at
from stc.validate.ties import Orientation, Source, Tie

if TYPE_CHECKING:
    import mujoco


class Reference:
    """Positions, velocities and accelerations of the tied joints: p positions and v velocities, not always as many.

    Attributes:
        ties: the tied parts of joints.
        has_acceleration: whether the solution contains all accelerations.
        positions: (p,) indices of the tied joints in ``qpos``.
        velocities: (v,) indices in ``qvel``.
        dofs: names of the v degrees of freedom.
        columns: of each tie, which of the p positions are its own.
    """

    def __init__(self, solution: Solution, ties: Sequence[Tie]) -> None:
        self.ties = list(ties)
        self.has_acceleration = all(tie.knows_acceleration for tie in ties)
        self.positions = np.array([k for tie in ties for k in tie.positions], dtype=np.intp)
        self.velocities = np.array([k for tie in ties for k in tie.velocities], dtype=np.intp)
        self.dofs = [name for tie in ties for name in tie.dofs]
        self.columns = _slices([len(tie.positions) for tie in ties])
        #: Of each orientation, which positions and velocities are its own; and all other positions and velocities.
        rates = _slices([len(tie.velocities) for tie in ties])
        self._turning = [
            (place, rate)
            for tie, place, rate in zip(ties, self.columns, rates)
            if isinstance(tie, Orientation)
        ]
        kept = [
            (place, rate) for place, rate in zip(self.columns, rates) if (place, rate) not in self._turning
        ]
        self._straight = tuple(
            np.array([k for pair in kept for k in range(pair[i].start, pair[i].stop)], dtype=np.intp)
            for i in (0, 1)
        )
        #: Per order the curve of each entry.
        self._sources = [
            [source for tie in ties for source in tie.sources[part]]
            for part in range(3 if self.has_acceleration else 2)
        ]
        #: Per order and power of s an array (n, k) of coefficients.
        self._coefficients = _by_power(self._sources, solution) if solution.n else []
        self._time = solution.time

    def in_step(self, step: int, shares: FloatArray) -> list[FloatArray]:
        """Positions (s, p), velocities and, where known, accelerations (s, v) at s shares of a step."""
        found = [horner([c[step] for c in powers], shares[:, None]) for powers in self._coefficients]
        return [self._on_sphere(found[0]), *found[1:]]

    def at(self, part: str, index: int) -> list[FloatArray]:
        """Positions (p,), velocities and, where known, accelerations (v,) at a node.

        The node is ``before`` or ``after`` a frame, or ``mid`` of a step.
        """
        found = [
            np.array([node_value(orders[order], part, index) for orders, order in sources])
            for sources in self._sources
        ]
        return [self._on_sphere(found[0]), *found[1:]]

    def at_times(self, times: FloatArray) -> list[FloatArray]:
        """Positions (m, p), velocities and, where known, accelerations (m, v) at times within the motion (m,), s.

        At a jump they are the values after it.
        """
        if len(self._time) == 1:
            return [np.tile(values, (len(times), 1)) for values in self.at("after", 0)]
        steps, shares = steps_at(self._time, times)
        found = [horner([c[steps] for c in powers], shares[:, None]) for powers in self._coefficients]
        return [self._on_sphere(found[0]), *found[1:]]

    @property
    def extent(self) -> float:
        """The largest travel of a tied joint, in m or rad: the distance between two of its places at the frames."""
        return max(tie.extent for tie in self.ties)

    def put(self, data: mujoco.MjData, state: Sequence[FloatArray]) -> None:
        """Write positions (p,), velocities and, if given, accelerations (v,) into a simulation."""
        data.qpos[self.positions] = state[0]
        data.qvel[self.velocities] = state[1]
        if len(state) > 2:
            data.qacc[self.velocities] = state[2]

    def deviation(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """(..., v) the difference of two poses (..., p): differences, and rotations about the body's own axes.

        For all of a model's joints this is what ``mj_differentiatePos`` gives.
        """
        found = np.zeros((*np.broadcast_shapes(start.shape, end.shape)[:-1], len(self.velocities)))
        places, rates = self._straight
        found[..., rates] = end[..., places] - start[..., places]
        for place, rate in self._turning:
            found[..., rate] = rotation_between(start[..., place], end[..., place])
        return found

    def moved(self, pose: FloatArray, way: FloatArray) -> FloatArray:
        """(..., p) the pose at the end of a displacement (..., v): the inverse of :meth:`deviation`."""
        found = np.array(np.broadcast_to(pose, (*way.shape[:-1], pose.shape[-1])))
        places, rates = self._straight
        found[..., places] += way[..., rates]
        for place, rate in self._turning:
            found[..., place] = turned(found[..., place], way[..., rate])
        return found

    def _on_sphere(self, positions: FloatArray) -> FloatArray:
        """Scale the quaternions among positions (..., p) to length one, in place."""
        for place, _ in self._turning:
            positions[..., place] = normalised(positions[..., place])
        return positions


def _slices(lengths: Sequence[int]) -> list[slice]:
    ends = np.cumsum([0, *lengths])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def _by_power(parts: Sequence[Sequence[Source]], solution: Solution) -> list[list[FloatArray]]:
    """For each part, coefficient arrays (n, k) per power of its k curves."""
    n = solution.n
    steps, lengths = np.arange(n), np.diff(solution.time)
    every = {id(orders): orders for sources in parts for orders, _ in sources}
    made = {key: curves(solution.method, orders, steps, lengths) for key, orders in every.items()}
    found = []
    for sources in parts:
        own = [made[id(orders)][order] for orders, order in sources]
        powers = [np.zeros((n, len(own))) for _ in range(max(len(curve) for curve in own))]
        for column, curve in enumerate(own):
            for power, coefficient in enumerate(curve):
                powers[power][:, column] = coefficient
        found.append(powers)
    return found
