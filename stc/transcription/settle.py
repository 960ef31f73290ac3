"""Inverse kinematics for the guess of a model's motion: standing feet and other held constraints.

Interpolation between poses moves the whole robot, including its feet.  At every frame and midpoint, the least motion
of the joints is computed that moves the held constraints to their places (inverse kinematics by damped least squares,
Wampler 1986).  The correction of a coordinate without constraints changes gradually from one correction to the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.problem import ConstantRef, Fixture, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import Expr, evaluate_all, symbols
from stc.transcription.turns import turned, turns_between

FloatArray = NDArray[np.float64]

#: How far the root moves for what joints do: feet come down under a robot, not the robot onto its feet.
ROOT = 0.05
#: What keeps steps small where no joint moves what is held.
DAMPING = 1e-3
#: Farther than this nothing is brought in one step, in m or rad.
FARTHEST = 0.1
STEPS = 8
#: What is not nearer than this after the last step, in m or rad, was out of reach: the correction of others is taken.
REACHED = 1e-6


@dataclass(slots=True)
class _Freedom:
    """One velocity component: a variable, or an axis of an orientation."""

    rate: VariableRef
    quaternion: tuple[str, ...] = ()
    axis: int = 0


class Settling:
    """The paths of all coordinates, and their corrections.

    Args:
        problem: the problem with the fixtures.
        paths: values by variable at ``at``; they are changed.
        at: frames and midpoints. (k,)
        known: values of constants and parameters, and the time at each place.
    """

    def __init__(
        self, problem: Problem, paths: dict[str, FloatArray], at: FloatArray, known: Mapping[object, object]
    ) -> None:
        self.paths, self.at = paths, at
        self.known = {**known, IndexRef(): at}
        keys = dict.fromkeys(key for one in problem.fixtures for rate in one.rates for key in symbols(rate))
        self.freedoms = [
            _Freedom(key) for key in keys if isinstance(key, VariableRef) and key == VariableRef(key.name, 1)
        ]
        for rotation in problem.rotations:
            self.freedoms += [
                _Freedom(VariableRef(name), rotation.quaternion, axis)
                for axis, name in enumerate(rotation.velocity)
            ]
        names = [one.rate.name for one in self.freedoms]
        self.ease = np.array([ROOT if name in problem.root else 1.0 for name in names])
        self.fixtures = [one for one in problem.fixtures if self._is_known(one)]

    @property
    def moved(self) -> list[str]:
        """The variables whose paths may have changed."""
        names = [one.quaternion or (one.rate.name,) for one in self.freedoms]
        return list(dict.fromkeys(name for some in names for name in some))

    def _is_known(self, fixture: Fixture) -> bool:
        """Whether its places are functions of the configuration and of numbers that are known."""
        kinds = (VariableRef, ConstantRef, ParameterRef, IndexRef, TimeRef)
        return all(isinstance(key, kinds) for e in (*fixture.places, *fixture.rates) for key in symbols(e))

    def run(self) -> None:
        """Apply the corrections to the paths."""
        before = dict(self.paths)
        for _ in range(STEPS):
            off, rates = self._held()
            if np.abs(off).max(initial=0.0) < REACHED:
                break
            self._move(self._step(np.clip(off, -FARTHEST, FARTHEST), rates))
        off, rates = self._held()
        reached = (np.abs(off) < REACHED).all(axis=0)
        held = np.asarray((np.abs(rates) > DAMPING**2).any(axis=0) & reached)
        corrections = np.zeros((len(self.freedoms), len(self.at)))
        for row, (freedom, there) in enumerate(zip(self.freedoms, held, strict=True)):
            if there.any():
                corrections[row] = np.interp(self.at, self.at[there], self._moved(freedom, before)[there])
        self.paths.update(before)
        self._move(corrections)

    def _held(self) -> tuple[FloatArray, FloatArray]:
        """The residuals of held constraints, (m, k), and their derivatives by each freedom, (m, f, k)."""
        size, count = len(self.at), len(self.freedoms)
        moving: dict[object, object] = {
            one.rate: np.eye(count)[row][:, None] for row, one in enumerate(self.freedoms)
        }
        offs, rates = [np.zeros((0, size))], [np.zeros((0, count, size))]
        for fixture in self.fixtures:
            where = (self.at >= fixture.range.first) & (self.at <= fixture.range.last)
            place = int(np.flatnonzero(self.at == fixture.reference)[0])
            offs.append(where * self._values(fixture.places, (size,), place, {}))
            rates.append(where * self._values(fixture.rates, (count, size), place, moving))
        return np.concatenate(offs), np.concatenate(rates)

    def _values(
        self, bodies: Sequence[Expr], shape: tuple[int, ...], reference: int, moving: Mapping[object, object]
    ) -> FloatArray:
        """Functions of the configuration there, and of that at the reference: what refers to a frame further on."""
        values = {**self.known, **moving}
        keys = {key for body in bodies for key in symbols(body)} - set(values)
        compares = any(key.shift for key in keys)
        for key in keys:
            path = self.paths[key.name]
            values[key] = path[reference] if compares and key.shift == 0 else path
        found = evaluate_all(list(bodies), values)
        return np.array([np.broadcast_to(np.asarray(e, float), shape) for e in found])

    def _step(self, off: FloatArray, rates: FloatArray) -> FloatArray:
        """The least correction of the residuals to first order, with weights of the freedoms. (f, k)"""
        jacobian = (rates * self.ease[:, None]).transpose(2, 0, 1)  # (k, m, f)
        square = jacobian @ jacobian.transpose(0, 2, 1) + DAMPING**2 * np.eye(len(off))
        pulls = np.linalg.solve(square, off.T[:, :, None])  # (k, m, 1)
        return -self.ease[:, None] * (jacobian.transpose(0, 2, 1) @ pulls)[:, :, 0].T

    def _moved(self, freedom: _Freedom, before: Mapping[str, FloatArray]) -> FloatArray:
        """The correction of a freedom so far. (k,)"""
        if not freedom.quaternion:
            return self.paths[freedom.rate.name] - before[freedom.rate.name]
        old, new = (np.array([paths[name] for name in freedom.quaternion]) for paths in (before, self.paths))
        return turns_between(old, new)[freedom.axis]

    def _move(self, by: FloatArray) -> None:
        """Move all paths. ``by``: (f, k)."""
        turns: dict[tuple[str, ...], FloatArray] = {}
        for freedom, step in zip(self.freedoms, by, strict=True):
            if freedom.quaternion:
                turns.setdefault(freedom.quaternion, np.zeros((3, len(self.at))))[freedom.axis] = step
            else:
                self.paths[freedom.rate.name] = self.paths[freedom.rate.name] + step
        for names, vector in turns.items():
            new = turned(np.array([self.paths[name] for name in names]), vector)
            self.paths.update(zip(names, new, strict=True))
