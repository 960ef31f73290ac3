"""Orientations as numbers: rotations between them as vectors, and orientations rotated by these."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.symbolic.expr import evaluate_all, sym
from stc.time_derivatives import quaternion_product

FloatArray = NDArray[np.float64]

#: The product of two quaternions, whose components are symbols with the keys 0 to 7.
_PRODUCT = quaternion_product([sym(k) for k in range(4)], [sym(k) for k in range(4, 8)])
#: Times a quaternion, the opposite turn.
CONJUGATE = np.array([[1.0], [-1.0], [-1.0], [-1.0]])


def turns_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """The shortest rotations from orientations to others, relative to the first.

    Args:
        a, b: quaternions, real part first. (4, k)

    Returns:
        Angles times axes. (3, k)
    """
    real, *vector = _product(a * CONJUGATE, b)
    sine = np.linalg.norm(vector, axis=0)
    angle = 2.0 * np.arctan2(sine, np.abs(real))
    scale = np.divide(angle, sine, out=np.full(len(sine), 2.0), where=sine > 0.0)
    return np.where(real < 0.0, -1.0, 1.0) * scale * np.array(vector)


def turned(q: FloatArray, vector: FloatArray) -> FloatArray:
    """Orientations (4, k) rotated by angles times axes (3, k), in their own frames; of unit length."""
    half = 0.5 * np.linalg.norm(vector, axis=0)
    real, share = np.cos(half), 0.5 * np.sinc(half / np.pi)
    found = _product(q, np.array([real, *(share * vector)]))
    return found / np.linalg.norm(found, axis=0)


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.array(evaluate_all(_PRODUCT, dict(enumerate([*a, *b]))))
