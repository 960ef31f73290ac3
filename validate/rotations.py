"""Orientations as unit quaternions (w, x, y, z), arrays of them at a time: q and -q are the same orientation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    import mujoco

#: Below this sine of half an angle the angle is the sine to rounding.
_TINY = 1e-12

_NEXT, _AFTER_NEXT = np.array([1, 2, 0]), np.array([2, 0, 1])


def normalised(quaternion: FloatArray) -> FloatArray:
    """(..., 4) scaled to length one; a quaternion of length zero is not changed."""
    length = np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return np.asarray(quaternion / np.where(length > 0.0, length, 1.0))


def cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """(..., 3) the vector product, as :func:`numpy.cross`, but ten times faster for few vectors."""
    return np.asarray(
        first[..., _NEXT] * second[..., _AFTER_NEXT] - first[..., _AFTER_NEXT] * second[..., _NEXT]
    )


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """(..., 4) the quaternion product."""
    w, v = first[..., :1], first[..., 1:]
    other, u = second[..., :1], second[..., 1:]
    scalar = w * other - np.sum(v * u, axis=-1, keepdims=True)
    return np.concatenate([scalar, w * u + other * v + cross(v, u)], axis=-1)


def rotation_between(start: FloatArray, end: FloatArray) -> FloatArray:
    """(..., 3) the shortest rotation that takes one orientation to the other, in rad about the first one's own axes.

    MuJoCo's ``mju_subQuat`` gives the same.

    Args:
        start: (..., 4).
        end: (..., 4).
    """
    between = product(normalised(start) * np.array([1.0, -1.0, -1.0, -1.0]), normalised(end))
    between = np.where(between[..., :1] < 0.0, -between, between)
    sine = np.linalg.norm(between[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, between[..., :1])
    return np.asarray(between[..., 1:] * np.where(sine > _TINY, angle / np.maximum(sine, _TINY), 2.0))


def angle_between(start: FloatArray, end: FloatArray) -> FloatArray:
    """(...) the angle of that rotation, 0 to pi, in rad."""
    return np.asarray(np.linalg.norm(rotation_between(start, end), axis=-1))


def turned(quaternion: FloatArray, rotation: FloatArray) -> FloatArray:
    """(..., 4) an orientation turned further by rotations (..., 3), in rad about its own axes."""
    angle = np.linalg.norm(rotation, axis=-1, keepdims=True)
    # np.sinc is sin(pi x)/(pi x).
    change = np.concatenate([np.cos(0.5 * angle), 0.5 * rotation * np.sinc(angle / (2.0 * np.pi))], axis=-1)
    return normalised(product(quaternion, change))


def turning_dofs(model: mujoco.MjModel) -> np.ndarray:
    """(k, 3) the degrees of freedom of each orientation of a model: those of its ball joints and free joints."""
    import mujoco

    free, ball = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
    first = [
        int(dof) + (3 if kind == free else 0)
        for kind, dof in zip(model.jnt_type, model.jnt_dofadr)
        if kind in (free, ball)
    ]
    return np.array(first, dtype=np.intp).reshape(-1, 1) + np.arange(3)


def rate_of_way(way: FloatArray, velocity: FloatArray, turning: np.ndarray) -> FloatArray:
    """(nv,) the rate of a displacement along which ``mj_integratePos`` moves a pose, for a velocity in the resulting
    pose.

    Rotations do not commute: a Runge-Kutta method that sums the stages' angular velocities is of second order.  For
    full order the rotation vector's own differential equation is integrated (Munthe-Kaas, Numerische Mathematik 87,
    1999), with its series up to the terms that the fourth order needs.

    Args:
        way: (nv,) displacement from the pose at the start of the step.
        velocity: (nv,) in the pose at the end of the displacement.
        turning: (k, 3) from :func:`turning_dofs`.
    """
    found = velocity.copy()
    for dofs in turning:  # numbers, since arrays of three take five times as long
        u, w = way[dofs].tolist(), velocity[dofs].tolist()
        once = _cross(u, w)
        found[dofs] = [a + 0.5 * b + c / 12.0 for a, b, c in zip(w, once, _cross(u, once))]
    return found


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
