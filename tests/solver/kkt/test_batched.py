"""Segments eliminated side by side and the rest between them: against dense algebra, whatever the values."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.backends import assert_alike_with_all_instructions
from solver.kkt.dense import DenseKKT
from solver.kkt.kkt_problems import STRUCTURES, Builder, generic
from solver.kkt.motions import holding, motion, parts, structure, system_of
from solver.kkt.test_contract import check

import stc
from stc.solver.kkt import reuse
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.reuse import StructuredKKT
from stc.solver.kkt.seams import Sewn, kind_of, sew
from stc.solver.kkt.segments import Segmentation, find_segments, number_stages


def sewn_of(couplings: Couplings, found: Segmentation) -> Sewn:
    return sew(couplings, found, [kind_of(found, k, couplings.n) for k in range(len(found.example))])


@pytest.mark.parametrize(
    "structure", ["chain", "bordered", "stencil", "absolute", "variable_major", "five_points"]
)
def test_irregular_structures(structure):
    """Random couplings leave next to no runs; whoever is chosen has to be right."""
    rng = np.random.default_rng(3)
    pattern = STRUCTURES[structure](rng, 24)
    kkt, judge = StructuredKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
    values = generic(rng, pattern)
    assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())


def test_inequalities_that_become_active():
    """Each frame's inequality is far from active, or as good as an equation: one order of pivots serves neither."""
    rng = np.random.default_rng(4)
    pattern = motion(rng, 30)
    kkt, judge = system_of(pattern), DenseKKT(*pattern.arguments())
    for share in (0.0, 0.1, 0.5, 1.0):
        values = generic(rng, pattern)
        values.hess = np.abs(values.hess) * (pattern.hess_rows == pattern.hess_cols)
        values.primal[:] = 1e-6
        values.dual[:] = 0.0
        inequality = np.arange(pattern.m)[1:-2:5]
        values.dual[inequality] = np.where(rng.random(inequality.size) < share, 1e-9, 1e4)
        assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())
        kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
        assert kkt.last_residual < 1e-11


@pytest.mark.parametrize("frame", [0, 7, 15, 29])
def test_dependent_rows_are_found(frame):
    """Two rows of one frame are the same: one eigenvalue is zero, wherever the frame is."""
    rng = np.random.default_rng(5)
    frames = 30
    b = Builder(rng)
    x = [b.variables(4, i) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i], 1.0)
        b.row(i, x[i][:3])
        b.row(i, x[i][:3])
        if i + 1 < frames:
            b.row(i, [x[i][0], x[i + 1][0], x[i][3]])
    pattern = b.pattern()
    kkt, judge = system_of(pattern), DenseKKT(*pattern.arguments())
    values = generic(rng, pattern)
    values.dual[:] = 0.0
    assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())
    twice = np.flatnonzero(pattern.row_stage == frame)[:2]
    for v in x[frame][:3]:
        one, two = (np.flatnonzero((pattern.jac_rows == r) & (pattern.jac_cols == v)) for r in twice)
        values.jac[two] = values.jac[one]
    inertia = kkt.factorize(*values.arguments())
    assert inertia == judge.factorize(*values.arguments())
    assert inertia.zero == 1
    # Any softening of the rows makes it regular.
    values.dual[:] = 1e-7
    assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())


def test_segments_do_not_touch_each_other():
    """What is eliminated in one segment couples with no other, and all lanes of a group look alike."""
    rng = np.random.default_rng(6)
    pattern = motion(rng, 60, parameters=1, waypoint=True)
    couplings, _, found = parts(pattern)
    assert found is not None
    assert found.interior.sum() > 30
    segment = np.full(found.interior.size, -1)
    number = 0
    for group in found.groups:
        for lane in range(group.segments):
            assert (segment[group.stages[:, lane]] == -1).all()
            segment[group.stages[:, lane]] = number
            number += 1
    assert np.array_equal(segment >= 0, found.interior)
    sewn = sewn_of(couplings, found)
    own = np.concatenate([segment[found.stages.stage], np.full(sewn.added, -1)])
    first, second = own[sewn.couplings.first], own[sewn.couplings.second]
    assert not np.any((first >= 0) & (second >= 0) & (first != second))
    for group, before, after in zip(found.groups, sewn.before, sewn.after, strict=True):
        assert before.shape == after.shape == (before.shape[0], group.stages.shape[1])
        assert (own[before] == -1).all()
        assert (own[after] == -1).all()


@pytest.mark.parametrize("backwards", [False, True])
def test_seams_change_nothing(backwards):
    """Without their unknowns, the matrix is what it was, and each has one positive and one negative eigenvalue."""
    rng = np.random.default_rng(15)
    pattern = motion(rng, 30, parameters=1, waypoint=True)
    if backwards:
        for stage in (pattern.var_stage, pattern.row_stage):
            stage[:] = np.where(stage < 30, 29 - stage, stage)
    couplings, stage, found = parts(pattern)
    assert found is not None
    assert len(found.groups) > 0
    sewn = sewn_of(couplings, found)
    size, values = couplings.size, rng.normal(size=couplings.first.size)
    expected, extended = np.zeros((size, size)), np.zeros((size + sewn.added, size + sewn.added))
    diagonal = rng.normal(size=size)
    for matrix, pairs, own in (
        (expected, couplings, values),
        (extended, sewn.couplings, np.concatenate([values, np.full(sewn.added // 2, -1.0)])),
    ):
        np.add.at(matrix, (pairs.first, pairs.second), own)
        np.add.at(matrix, (pairs.second, pairs.first), own)
        matrix[np.arange(size), np.arange(size)] = diagonal
    kinds = [kind_of(found, k, couplings.n) for k in range(len(found.example))]
    for group, before in zip(found.groups, sewn.before, strict=True):
        begin = found.stages.pointers[group.stages[0, : group.segments]]
        held = found.stages.order[begin + kinds[group.kind].following[:, None]]
        extended[before[:, : group.segments], held] = extended[held, before[:, : group.segments]] = 1.0
    inner = np.linalg.inv(extended[size:, size:])
    left = extended[:size, :size] - extended[:size, size:] @ inner @ extended[size:, :size]
    np.testing.assert_allclose(left, expected, atol=1e-12)
    assert (np.linalg.eigvalsh(inner) > 0.0).sum() == sewn.added // 2


def test_what_a_stage_passes_on_is_little():
    """Whichever way the stages are numbered, segments begin at the end that has fewer unknowns there."""
    rng = np.random.default_rng(16)
    pattern = motion(rng, 30)
    widths = []
    for _ in range(2):
        couplings, stage, found = parts(pattern)
        assert found is not None
        widths.append([kind_of(found, k, couplings.n).following.size for k in range(len(found.example))])
        check(MultifrontalKKT.of_couplings(couplings, stage, found), pattern, generic(rng, pattern), rng)
        pattern.var_stage[:], pattern.row_stage[:] = 29 - pattern.var_stage, 29 - pattern.row_stage
    assert widths[0] == widths[1]


def test_unknowns_that_couple_both_ways_stay_where_they_are():
    """A control whose rate costs something couples with those before and after; the rows still change their stage."""
    rng = np.random.default_rng(18)
    b = Builder(rng)
    frames = 30
    x = [b.variables(3, i) for i in range(frames)]
    for i in range(frames):
        b.curvature([x[i][2]], 1.0)
        if i:
            b.row(i - 1, [x[i - 1][0], x[i - 1][1], x[i][0], x[i][1]])
            b.row(i - 1, [x[i - 1][1], x[i - 1][2], x[i][1], x[i][2]])
            b.curvature([x[i - 1][2], x[i][2]], 1.0)
    pattern = b.pattern()
    couplings, stage, found = parts(pattern)
    assert found is not None
    assert [kind_of(found, k, couplings.n).following.size for k in range(len(found.example))] == [3]
    check(MultifrontalKKT.of_couplings(couplings, stage, found), pattern, generic(rng, pattern), rng)


def test_frames_that_hold_a_variable_are_left_out():
    rng = np.random.default_rng(19)
    pattern = motion(rng, 60)
    couplings, stage = structure(pattern)
    held = holding(pattern, 20, 40)
    free, found = (find_segments(number_stages(couplings, stage, mask)) for mask in (None, held))
    assert free is not None
    assert found is not None
    assert free.interior[[20, 40]].all()
    assert not found.interior[[20, 40]].any()
    one, other = (StructuredKKT(*pattern.arguments(), held=mask).system for mask in (None, held))
    assert other is not one


@pytest.mark.nightly
def test_runs_of_unequal_length_have_segments_of_their_own():
    """Eight segments in either, and next to nothing left: of equal length, they would leave a whole segment."""
    rng = np.random.default_rng(21)
    pattern = motion(rng, 300)
    couplings, stage = structure(pattern)
    found = find_segments(number_stages(couplings, stage, holding(pattern, 70)))
    assert found is not None
    assert sorted(len(group.stages) for group in found.groups) == [8, 28]
    assert np.count_nonzero(~found.interior) < 15
    assert len(found.example) == 1
    check(MultifrontalKKT.of_couplings(couplings, stage, found), pattern, generic(rng, pattern), rng)


def test_entries_that_vanish_somewhere_are_no_pivots():
    """An angle passes a right angle at one frame of a long horizon: its cosine is no pivot there."""
    rng = np.random.default_rng(20)
    pattern = motion(rng, 200)
    values = generic(rng, pattern)
    # The only entry of the first position in an equation of its frame, next to that of the first velocity.
    column = np.flatnonzero(pattern.var_stage == 100)[0]
    rows = pattern.jac_rows[pattern.jac_cols == column]
    counts = np.bincount(pattern.jac_rows, minlength=pattern.m)
    row = next(r for r in rows if counts[r] == 2)
    values.jac[(pattern.jac_rows == row) & (pattern.jac_cols == column)] = 1e-17
    kkt = system_of(pattern)
    check(kkt, pattern, values, rng)


def test_a_lamp_in_flight_has_pivots(monkeypatch):
    """At the start of a segment nothing holds its state, and what is left of the stage cancels in many orders."""
    made = []

    class Kept(MultifrontalKKT):
        def _prepare(self, *args):
            super()._prepare(*args)
            made.append(self)

    monkeypatch.setattr(reuse, "MultifrontalKKT", Kept)
    solved = stc.load("luxo_jump", k=4).solve(max_iterations=20)
    assert solved.factorizations > 15
    assert sum(kkt.segments for kkt in made) > 0
    assert sum(kkt.refused for kkt in made) <= 2


def test_storage_grows_with_the_frames_only():
    rng = np.random.default_rng(7)
    sizes = []
    for frames in (400, 800, 1600):
        pattern = motion(rng, frames, parameters=1)
        kkt = system_of(pattern)
        kkt.factorize(*generic(rng, pattern).arguments())
        kkt.solve(np.ones(pattern.n), np.ones(pattern.m))
        assert kkt.last_residual < 1e-12
        sizes.append(kkt.nnz_factor)
        assert 8 * kkt.nnz_factor <= kkt.factor_bytes
        assert 0 < kkt.operations < 10_000 * frames
    assert sizes[2] - sizes[1] < 2.3 * (sizes[1] - sizes[0])


def test_the_next_solve_takes_over():
    rng = np.random.default_rng(10)
    pattern = motion(rng, 80)
    first = StructuredKKT(*pattern.arguments())
    system = first.system
    assert system.segments > 0
    values = generic(rng, pattern)
    inertia = first.factorize(*values.arguments())
    del first
    second = StructuredKKT(*pattern.arguments())
    assert second.system is system
    assert second.factorizations == 0
    with pytest.raises(ValueError, match="factorize before"):
        _ = second.solve_call
    assert second.factorize(*values.arguments()) == inertia
    values.hess[0] = np.inf
    with pytest.raises(ValueError, match="finite"):
        second.factorize(*values.arguments())


def test_all_instruction_sets_give_the_same():
    script = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from solver.kkt.kkt_problems import VALUES
from solver.kkt.test_batched import motion, system_of
rng = np.random.default_rng(11)
pattern = motion(rng, 17, parameters=1)
kkt = system_of(pattern)
for kind in VALUES.values():
    inertia = kkt.factorize(*kind(rng, pattern).arguments())
    dx, dy = kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
    print(*inertia, float(kkt.last_residual < 1e-12), *(f"{v:.12e}" for v in (np.abs(dx).sum(), np.abs(dy).sum())))
"""
    assert_alike_with_all_instructions(script, 4 * 6)
