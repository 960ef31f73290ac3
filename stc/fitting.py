"""A pose in which the equality constraints of a model hold, close to a given one.

A file may draw a model where a loop is open, or where a joint is outside of its range.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.language.model.independence import Point
from stc.language.model.scope import ModelScope
from stc.mechanism.equalities import held
from stc.problem import ConstantRef, VariableRef
from stc.symbolic.expr import Expr, evaluate_all

Matrix = NDArray[np.float64]

#: Constraints that are violated by less, in m or rad, hold.
HOLDS = 1e-8
#: The share of its range by which a joint that is moved stays away from both ends.
_ROOM = 0.02
#: The step of differences, and the largest of a joint in a round, in m or rad.
_STEP, _FAR, _ROUNDS, _DAMPING, _ASIDE = 1e-7, 0.2, 100, 1e-10, 1e-3


#: A pose is nearly singular where the least singular value of its welds is below this share of the largest; then the
#: best of so many poses around it is taken, whose hinges differ by so much, in rad.
_SINGULAR, _DRAWN, _SPREAD = 0.03, 16, 0.3


class Fit:
    """The constraints of a model as functions of its pose, without welds to mocap bodies, which hold things anywhere.

    Parameters
    ----------
    scope
        The model.
    """

    def __init__(self, scope: ModelScope) -> None:
        self.scope = scope
        self._keys = [VariableRef(name) for one in scope.coordinates for name in one.pose]
        self._constants: dict[object, object] = {
            ConstantRef(name): value for name, value in scope.constants.items()
        }
        welds = filter(scope.mechanism.welded_to_mocap, scope.mechanism.equalities)
        self._welded = [rate for each in welds for rate in held(scope.dynamics, each).rates]
        self._rows: list[Expr] = [
            row
            for each in scope.mechanism.equalities
            if each.active and not scope.mechanism.welded_to_mocap(each)
            for row in held(scope.dynamics, each).places
        ]

    def off(self, q: Matrix) -> Matrix:
        """(rows, k) what is 0 where the constraints hold, in k poses, (nq, k)."""
        known = self._constants | dict(zip(self._keys, q, strict=True))
        return np.array(
            [np.broadcast_to(np.asarray(e, float), q.shape[1:]) for e in evaluate_all(self._rows, known)]
        ).reshape(len(self._rows), *q.shape[1:])

    def holds(self, q: Matrix) -> bool:
        """Whether all constraints hold in a pose, (nq,)."""
        return bool(np.abs(self.off(q[:, None])).max(initial=0.0) < HOLDS)

    def pose(self, q: Matrix) -> Matrix | None:
        """A pose in which the constraints hold, (nq,), by moving hinges and slides within their ranges; None if none is
        found near a given one.

        Source: damped least squares (Wampler 1986); a joint that comes to an end of its range stays there for a round.
        """
        joints = [joint for joint in self.scope.mechanism.joints if joint.kind in ("hinge", "slide")]
        moving = np.array([joint.qpos for joint in joints], int)
        ends = [joint.bounds if joint.limited else (-np.inf, np.inf) for joint in joints]
        room = [_ROOM * (high - low) if joint.limited else 0.0 for joint, (low, high) in zip(joints, ends)]
        low, high = np.array(ends).reshape(-1, 2).T + np.array([room, np.negative(room)])
        low, high = np.minimum(low, q[moving]), np.maximum(high, q[moving])
        pose = q.copy()
        for _ in range(_ROUNDS):
            columns = np.repeat(pose[:, None], len(moving) + 1, axis=1)
            columns[moving, np.arange(1, len(moving) + 1)] += _STEP
            off = self.off(columns)
            if np.abs(off[:, 0]).max(initial=0.0) < HOLDS:
                return pose
            if not np.isfinite(off).all():  # a weld that is half a turn open has no axis to turn about
                pose[moving] = np.clip(pose[moving] + _ASIDE, low, high)
                continue
            slopes, free = (off[:, 1:] - off[:, :1]) / _STEP, np.ones(len(moving), bool)
            for _ in range(len(moving)):
                some = slopes * free
                step = -some.T @ np.linalg.solve(some @ some.T + _DAMPING * np.eye(len(some)), off[:, 0])
                step *= min(1.0, _FAR / max(1e-300, np.abs(step).max(initial=0.0)))
                stopped = free & ((pose[moving] + step < low) | (pose[moving] + step > high))
                if not stopped.any():
                    break
                pose[moving[stopped]] = np.where(step < 0.0, low, high)[stopped]
                free &= ~stopped
            pose[moving] += step * free
        return None

    def regular(self, q: Matrix) -> Matrix:
        """A pose, (nq,), whose welds to mocap bodies do not depend on each other, as they do where an arm is straight.

        Hinges are turned at random, within their ranges, if they depend on each other in the given pose.
        """

        def conditioned(pose: Matrix) -> float:
            values = {key.name: value for key, value in zip(self._keys, pose.tolist(), strict=True)}
            sizes = np.linalg.svd(Point(self.scope, values, self.scope.constants).jacobian(self._welded))[1]
            return float(sizes[-1] / sizes[0]) if len(sizes) and sizes[0] else 1.0

        if conditioned(q) > _SINGULAR:
            return q
        rng, poses = np.random.default_rng(1), []
        for _ in range(_DRAWN):
            poses.append(q.copy())
            for joint in self.scope.mechanism.joints:
                if joint.kind == "hinge":
                    low, high = joint.bounds if joint.limited else (-np.inf, np.inf)
                    room = 0.1 * (high - low) if joint.limited else 0.0
                    turned = q[joint.qpos] + rng.normal(scale=_SPREAD)
                    poses[-1][joint.qpos] = np.clip(turned, low + room, high - room)
        return max(poses, key=conditioned)
