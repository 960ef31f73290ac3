"""Turns between orientations as numbers, beside MuJoCo's functions for quaternions."""

from __future__ import annotations

import mujoco
import numpy as np

from stc.transcription.turns import turned, turns_between


def orientations(rng: np.random.Generator, count: int) -> np.ndarray:
    q = rng.normal(size=(4, count))
    return q / np.linalg.norm(q, axis=0)


def test_a_turn_between_orientations_is_that_of_mujoco() -> None:
    a, b = (orientations(np.random.default_rng(seed), 50) for seed in (1, 2))
    found = turns_between(a, b)
    for k in range(50):
        expected = np.zeros(3)
        mujoco.mju_subQuat(expected, b[:, k], a[:, k])
        np.testing.assert_allclose(found[:, k], expected, atol=1e-12)


def test_turned_orientations_are_those_of_mujoco() -> None:
    rng = np.random.default_rng(3)
    q, vector = orientations(rng, 50), rng.normal(size=(3, 50))
    found = turned(q, vector)
    for k in range(50):
        expected = q[:, k].copy()
        mujoco.mju_quatIntegrate(expected, vector[:, k], 1.0)
        np.testing.assert_allclose(found[:, k], expected, atol=1e-12)


def test_no_turn_at_all() -> None:
    q = orientations(np.random.default_rng(4), 3)
    np.testing.assert_allclose(turns_between(q, q), 0.0, atol=1e-15)
    np.testing.assert_allclose(turned(q, np.zeros((3, 3))), q, atol=1e-15)
