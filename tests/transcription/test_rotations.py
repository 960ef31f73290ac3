"""Unit quaternions keep the order of each transcription, and their norm.

The truth is a box that tumbles about its unstable intermediate axis, integrated by SciPy with an error below 1e-12.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stc.errors import Source
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.problem import Rotation
from stc.solver import minimize
from stc.transcription import transcribe

INERTIA = (1.0, 2.0, 3.0)
START = (0.3, 3.0, 0.2)
T = 2.0

SPEC = """
constants: n = {n}, T = 2, h = T/n;
variables: qw, qx, qy, qz, wx, wy, wz;
method: {method};
guess: qw = 1;
constraints:
  [0, n]: wx' = {x}*wy*wz; wy' = {y}*wz*wx; wz' = {z}*wx*wy;
  [0]: {start}
"""


def motion(method: str, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Orientation and angular velocity at the last frame, and all norms less 1."""
    a, b, c = INERTIA
    pinned = "qw = 1; qx; qy; qz; " + " ".join(f"w{k} = {v};" for k, v in zip("xyz", START))
    text = SPEC.format(n=n, method=method, x=(b - c) / a, y=(c - a) / b, z=(a - b) / c, start=pinned)
    problem = elaborate(parse(Source("tumbling", text)))
    rotation = Rotation(("qw", "qx", "qy", "qz"), ("wx", "wy", "wz"))
    # The start is pinned as a whole, so that the norm there is no further row.
    transcription = transcribe(replace(problem, rotations=[rotation]))
    guess = truth(np.linspace(0, T, n + 1))
    program = transcription.bind(problem.constants)
    x = program.x0.copy()
    for name, values in zip(("qw", "qx", "qy", "qz", "wx", "wy", "wz"), guess):
        for slot, order, before, after, middle in transcription.layout.slots():
            if slot == name and order == 0:
                x[before] = x[after] = values
                if len(middle):
                    x[middle] = 0.5 * (values[1:] + values[:-1])
    result = minimize(transcription.bind(problem.constants, start=x))
    assert result.violation < 1e-8
    recovery = transcription.recovery(result.x)
    known = recovery.trajectories()
    frames = np.array([known[name, 0].before for name in ("qw", "qx", "qy", "qz", "wx", "wy", "wz")])
    norms = (frames[:4] ** 2).sum(axis=0) - 1.0
    return frames[:, -1], norms


def rates(_: float, state: np.ndarray) -> np.ndarray:
    a, b, c = INERTIA
    w, x, y, z, p, q, r = state
    turned = 0.5 * np.array(
        [-x * p - y * q - z * r, w * p + y * r - z * q, w * q - x * r + z * p, w * r + x * q - y * p]
    )
    return np.concatenate([turned, [(b - c) / a * q * r, (c - a) / b * r * p, (a - b) / c * p * q]])


def truth(times: np.ndarray) -> np.ndarray:
    """(7, times) of the integration."""
    start = np.array([1.0, 0.0, 0.0, 0.0, *START])
    return solve_ivp(rates, (0.0, T), start, "DOP853", times, rtol=1e-13, atol=1e-14).y


@lru_cache
def errors(method: str, n: int) -> tuple[float, float]:
    """Of the orientation, in radians of rotation, and of the norm."""
    found, norms = motion(method, n)
    right = truth(np.array([T]))[:, -1]
    along = abs(found[:4] @ right[:4])
    across = np.linalg.norm(found[:4] - np.sign(found[:4] @ right[:4]) * right[:4])
    return 2.0 * 2.0 * np.arcsin(min(1.0, 0.5 * across)) if along > 0.5 else 2.0 * np.arccos(along), float(
        np.abs(norms).max()
    )


@pytest.mark.parametrize(("method", "order"), [("central", 2), ("trapezoidal", 2), ("hermite-simpson", 4)])
def test_orientation_converges_with_the_order_of_the_method(method: str, order: int) -> None:
    coarse, fine = errors(method, 60)[0], errors(method, 120)[0]
    assert order - 0.4 < np.log2(coarse / fine) < order + 0.6


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_quaternions_stay_unit(method: str) -> None:
    assert errors(method, 60)[1] < 1e-9
