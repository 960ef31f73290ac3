"""Patterns of motions with random values, and the systems for their segments."""

from __future__ import annotations

from unittest import mock

import numpy as np
from solver.kkt.kkt_problems import Builder, Pattern

from stc.solver.kkt import segments
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.segments import Segmentation, find_segments, number_stages


def motion(rng: np.random.Generator, frames: int, *, parameters: int = 0, waypoint: bool = False) -> Pattern:
    """Two positions, two velocities and a force per frame; trapezoidal defects, an equation and an inequality each."""
    b = Builder(rng)
    x = [b.variables(5, i) for i in range(frames)]
    border = b.variables(parameters, frames - 1)
    for i in range(frames):
        b.curvature([x[i][0], x[i][2], x[i][4]], 1.0)
        b.row(i, [x[i][1], x[i][3], x[i][4], *border])
        b.row(i, x[i][:2])
        if i + 1 < frames:
            b.row(i, [x[i][0], x[i][2], x[i + 1][0], x[i + 1][2]])
            b.row(i, [x[i][1], x[i][3], x[i + 1][1], x[i + 1][3]])
            b.row(i, [x[i][2], x[i][4], x[i + 1][2], x[i + 1][4]])
    b.row(0, x[0][:1])
    if waypoint:
        b.row(frames // 2, x[frames // 2][1:3])
    return b.pattern()


def structure(pattern: Pattern) -> tuple[Couplings, np.ndarray]:
    couplings = Couplings.of(*pattern.arguments()[:6])
    stage = np.concatenate([pattern.var_stage, pattern.row_stage]).astype(np.int64)
    return couplings, stage


def holding(pattern: Pattern, *frames: int) -> np.ndarray:
    """Hold the first variable of these frames."""
    held = np.zeros(pattern.n, dtype=bool)
    for frame in frames:
        held[np.flatnonzero(pattern.var_stage == frame)[0]] = True
    return held


def parts(pattern: Pattern, *, shared: bool = False) -> tuple[Couplings, np.ndarray, Segmentation | None]:
    """Its segments, ``shared`` out to two threads where that can be."""
    couplings, stage = structure(pattern)
    sharing = {"EVENING": 2.0, "SHARED": 0.0} if shared else {}
    with mock.patch.multiple(segments, WORTH=2.0, SHORTEST=2, **sharing):  # however short the horizon is
        numbered = number_stages(couplings, stage)
        return couplings, stage, None if numbered is None else find_segments(numbered)


def system_of(pattern: Pattern, *, shared: bool = False) -> MultifrontalKKT:
    couplings, stage, found = parts(pattern, shared=shared)
    assert found is not None
    return MultifrontalKKT.of_couplings(couplings, stage, found)
