"""Stages other than frames, for bodies that couple with few others: narrower, and the same solutions."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.kkt_problems import Builder, Pattern, generic
from solver.kkt.motions import structure
from solver.kkt.test_contract import check

from stc.solver.kkt.levels import narrower_stages
from stc.solver.kkt.reuse import StructuredKKT, forget
from stc.solver.kkt.segments import number_stages


def bodies(
    rng: np.random.Generator, count: int, frames: int, *, reach: int, states: int = 1, parameter: bool = False
) -> Pattern:
    """Bodies whose next state depends on their own and on those of ``reach`` neighbours on either side."""
    b = Builder(rng)
    shared = b.variables(1, frames) if parameter else []
    x = [[b.variables(states + 1, i) for _ in range(count)] for i in range(frames)]
    for i in range(frames):
        for j in range(count):
            b.curvature(x[i][j], 1.0)
            near = x[i][max(j - reach, 0) : j + reach + 1]
            for k in range(states if i + 1 < frames else 0):
                b.row(i, [*(v for body in near for v in body), x[i + 1][j][k], *shared])
    return b.pattern()


def new_stages(pattern: Pattern) -> np.ndarray | None:
    couplings, stage = structure(pattern)
    numbered = number_stages(couplings, stage)
    assert numbered is not None
    return narrower_stages(couplings, numbered)


@pytest.mark.parametrize("parameter", [False, True])
@pytest.mark.parametrize(
    ("count", "frames", "reach", "states"), [(20, 18, 0, 1), (8, 17, 0, 4), (40, 16, 1, 1)]
)
def test_stages_along_the_bodies_are_narrower_than_frames(
    count: int, frames: int, reach: int, states: int, parameter: bool
) -> None:
    rng = np.random.default_rng(count)
    pattern = bodies(rng, count, frames, reach=reach, states=states, parameter=parameter)
    values = generic(rng, pattern)
    values.dual[:] = 0.0  # equations have nothing on the diagonal, and need variables beside them
    forget()
    system = StructuredKKT(*pattern.arguments())
    check(system, pattern, values, rng)
    stages = new_stages(pattern)
    assert stages is not None
    widths = np.bincount(np.unique(stages, return_inverse=True)[1])
    assert np.median(widths) <= (2 * states + 1) * (1 if reach == 0 else frames)


@pytest.mark.parametrize("parameter", [False, True])
def test_unknowns_couple_in_a_stage_and_with_the_next_one(parameter: bool) -> None:
    pattern = bodies(np.random.default_rng(3), 60, 16, reach=1, parameter=parameter)
    stages = new_stages(pattern)
    assert stages is not None
    couplings, _ = structure(pattern)
    inner = np.ones(couplings.size, dtype=bool)
    inner[: int(parameter)] = False
    kept = inner[couplings.first] & inner[couplings.second]
    stage = np.unique(stages, return_inverse=True)[1]
    assert np.abs(stage[couplings.first[kept]] - stage[couplings.second[kept]]).max() == 1
    # Along the bodies a stage has about an unknown of each frame and body, or two: not 60 bodies.
    assert np.median(np.bincount(stage)) <= 60


def test_frames_remain_where_others_are_no_narrower() -> None:
    long = bodies(np.random.default_rng(4), 30, 60, reach=1)
    assert new_stages(long) is None


def test_frames_remain_where_they_are_narrow_or_dense() -> None:
    assert new_stages(bodies(np.random.default_rng(5), 5, 20, reach=0)) is None
    assert new_stages(bodies(np.random.default_rng(6), 20, 20, reach=10)) is None
