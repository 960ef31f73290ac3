"""Stages in a row, whatever their width and the values: against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.backends import assert_alike_with_all_instructions
from solver.kkt.kkt_problems import Builder, Pattern, generic
from solver.kkt.motions import chain_of, holding, motion, structure
from solver.kkt.test_contract import check

import stc
from stc.codegen import threads
from stc.solver.kkt import chain, choice, folding
from stc.solver.kkt.chain import ChainKKT, find_chain
from stc.solver.kkt.chain_elimination import FACTORS, FIELDS
from stc.solver.kkt.choice import leaves_much, suits_chain
from stc.solver.kkt.reuse import StructuredKKT
from stc.solver.kkt.segments import find_segments, number_stages


def wide(rng: np.random.Generator, frames: int, states: int) -> Pattern:
    """Accelerations that all depend on one another, and trapezoidal defects, as of a chain of rods."""
    b = Builder(rng)
    x = [b.variables(4 * states, i) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i][: 3 * states], 1.0)
        b.curvature(x[i][3 * states :], 1.0)
        for k in range(states):
            b.row(i, [*x[i][: 3 * states], x[i][3 * states + k]])
            for q in (k, states + k) if i + 1 < frames else ():
                b.row(i + 1, [x[i][q], x[i + 1][q], x[i][q + states], x[i + 1][q + states]])
    return b.pattern()


FOLDED = pytest.mark.parametrize("folded", [False, True], ids=["from one end", "from both"])


@FOLDED
@pytest.mark.parametrize("states", [1, 2, 3, 4, 5, 7, 9])
def test_stages_of_any_width(states, folded):
    """Panels of one, two and four, in blocks that begin anywhere."""
    rng = np.random.default_rng(states)
    pattern = wide(rng, 16, states)
    kkt = chain_of(pattern, folded=folded)
    for _ in range(2):
        check(kkt, pattern, generic(rng, pattern), rng)
        assert kkt._by_plan


@FOLDED
@pytest.mark.parametrize("parameters", [1, 2, 5, 9])
def test_unknowns_that_couple_with_every_stage(parameters, folded):
    """They come last, in an order of their own."""
    rng = np.random.default_rng(parameters)
    pattern = motion(rng, 24, parameters=parameters, waypoint=folded)
    kkt = chain_of(pattern, folded=folded)
    for _ in range(2):
        check(kkt, pattern, generic(rng, pattern), rng)
        assert kkt._by_plan


@FOLDED
@pytest.mark.parametrize("parameters", [0, 3])
def test_solutions_are_refined(parameters, folded):
    """With factors that are a little wrong, of one vector or of two."""
    rng = np.random.default_rng(parameters)
    pattern = motion(rng, 24, parameters=parameters)
    kkt = chain_of(pattern, folded=folded)
    kkt.factorize(*generic(rng, pattern).arguments())
    kkt._factors *= 1.0 + 1e-5 * rng.uniform(-1.0, 1.0, kkt._factors.size)
    one, other = rng.normal(size=(2, kkt.rhs.size))
    kkt.rhs[:] = one
    kkt.solve_call()
    assert kkt.report[0] < 1e-12
    assert kkt.report[1] >= 2
    alone = kkt.solution.copy()
    kkt.second_rhs[:] = other
    kkt.solve_both_call()
    assert kkt.report[0] < 1e-12
    np.testing.assert_allclose(kkt.solution, alone, rtol=1e-9, atol=1e-9 * np.abs(alone).max())
    kkt.rhs[:], both = other, kkt.second_solution.copy()
    kkt.solve_call()
    np.testing.assert_allclose(kkt.solution, both, rtol=1e-9, atol=1e-9 * np.abs(both).max())
    kkt.rhs[:] = 0.0
    kkt.solve_both_call()
    np.testing.assert_allclose(kkt.second_solution, both, rtol=1e-9, atol=1e-9 * np.abs(both).max())


def test_stages_have_nothing_in_common_but_what_they_leave():
    """The first frame's fixed state leaves nothing: what the others pivot on is not there yet."""
    rng = np.random.default_rng(5)
    pattern = wide(rng, 24, 4)
    values = generic(rng, pattern)
    first = pattern.var_stage == 0
    first &= np.arange(pattern.n) < 8  # positions and velocities
    values.jac[first[pattern.jac_cols]] = 0.0
    values.hess[first[pattern.hess_rows] | first[pattern.hess_cols]] = 0.0
    values.primal[:] = 0.0
    values.primal[first] = 1.0
    values.dual[:] = 0.0
    kkt = chain_of(pattern, first)
    check(kkt, pattern, values, rng)
    assert kkt._by_plan
    table = kkt._plan_in_use().tables[1].reshape(-1, FIELDS)
    assert 4 <= np.unique(table[:, 0]).size < 10
    assert (np.diff(table[:, FACTORS]) > 0).all()


@FOLDED
def test_frames_that_hold_a_variable_are_part_of_it(folded):
    rng = np.random.default_rng(19)
    pattern = motion(rng, 60)
    kkt, free = (chain_of(pattern, held, folded=folded) for held in (holding(pattern, 20, 40), None))
    assert len(kkt._chain.kinds) == len(free._chain.kinds)
    assert np.unique(kkt._chain.kind).size == np.unique(free._chain.kind).size
    check(kkt, pattern, generic(rng, pattern), rng)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_what_is_gone_through_from_both_ends(share):
    """Every stage once, by parts of about the same cost that meet in a stage which couples with both."""
    rng = np.random.default_rng(3)
    frames = 40
    b = Builder(rng)
    x = [b.variables(6 if i < share * frames else 3, i) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i], 1.0)
        b.row(i, x[i][:2])
        if i + 1 < frames:
            b.row(i + 1, [x[i][0], x[i + 1][0], x[i][1], x[i + 1][1]])
    pattern = b.pattern()
    found = chain_of(pattern, folded=True)._chain
    first, second = found.parts
    stages = found.kind.size
    assert first + second == stages - 1
    work = np.diff(found.base).astype(float) ** 2
    assert 0.7 < work[:first].sum() / work[first:-1].sum() < 1.4
    assert np.array_equal(np.sort(found.order), np.arange(pattern.n + pattern.m))
    expected = np.arange(1, stages + 1)
    expected[[first - 1, stages - 2, stages - 1]] = stages - 1
    assert np.array_equal(found.after, expected)


def test_which_chains_are_gone_through_from_both_ends(monkeypatch):
    rng = np.random.default_rng(4)
    pattern = wide(rng, 24, 3)
    couplings, stage = structure(pattern)
    numbered = number_stages(couplings, stage)
    for folded, parts in ((1e3, 2), (1e9, 0)):
        monkeypatch.setattr(chain, "FOLDED", folded)
        assert len(find_chain(couplings, stage, numbered, None).parts) == parts
    monkeypatch.setattr(chain, "FOLDED", 0.0)
    monkeypatch.setattr(folding, "SHORTEST", 13)
    assert find_chain(couplings, stage, numbered, None).parts == ()


def test_the_same_bits_on_one_thread(two_threads):
    """Whether a second thread comes from the other end is seen in no digit."""
    rng = np.random.default_rng(31)
    pattern = wide(rng, 20, 5)
    values = [generic(rng, pattern) for _ in range(5)]
    rhs = rng.normal(size=(5, 2, pattern.n + pattern.m))
    seen = []
    for limit in (2, 1):
        threads.limit(limit)
        kkt = chain_of(pattern, folded=True)
        results = []
        for own, (one, other) in zip(values, rhs, strict=True):
            inertia = kkt.factorize(*own.arguments())
            kkt.rhs[:], kkt.second_rhs[:] = one, other
            kkt.solve_both_call()
            both = kkt.solution.tobytes(), kkt.second_solution.tobytes()
            kkt.solve_call()
            results.append((inertia, kkt._by_plan, *both, kkt.solution.tobytes()))
        seen.append(results)
    assert seen[0] == seen[1]
    assert any(by_plan for _, by_plan, *_ in seen[0])


@pytest.mark.parametrize("frame", [2, 11, 21])
def test_a_pivot_that_either_part_or_the_middle_refuses(two_threads, frame):
    """The matrix is factorised another way then, and by the plan again when that serves."""
    rng = np.random.default_rng(33)
    pattern = wide(rng, 24, 4)
    kkt = chain_of(pattern, folded=True)
    values = generic(rng, pattern)
    check(kkt, pattern, values, rng)
    assert kkt._by_plan
    jac, dual = values.jac.copy(), values.dual.copy()
    rows = np.flatnonzero(pattern.row_stage == frame)[:2]
    values.jac[np.isin(pattern.jac_rows, rows)] = 0.0  # rows of nothing
    values.dual[rows] = 0.0
    assert kkt.factorize(*values.arguments()).zero == 2
    values.jac[:], values.dual[:] = jac, dual
    check(kkt, pattern, values, rng)
    assert kkt._by_plan


def test_who_is_chosen(monkeypatch):
    rng = np.random.default_rng(2)
    assert not isinstance(StructuredKKT(*motion(rng, 40).arguments()).system, ChainKKT)
    narrow = number_stages(*structure(wide(rng, 20, 6)))
    assert narrow is not None
    assert not suits_chain(structure(wide(rng, 20, 6))[0], narrow)
    system = StructuredKKT(*wide(rng, 20, 9).arguments()).system
    assert isinstance(system, ChainKKT)
    couplings, stage = system._couplings, system._stage
    numbered = number_stages(couplings, stage)
    assert numbered is not None
    assert find_chain(couplings, stage, numbered, None) is not None
    monkeypatch.setattr(chain, "KINDS", 2)
    assert find_chain(couplings, stage, numbered, None) is None


def test_sparse_stages_are_a_chain_where_segments_leave_much(monkeypatch):
    couplings, stage = structure(motion(np.random.default_rng(2), 60))
    numbered = number_stages(couplings, stage)
    assert numbered is not None
    found = find_segments(numbered)
    assert found is not None
    assert not leaves_much(numbered, None)  # too narrow
    monkeypatch.setattr(choice, "WIDE", 5)
    assert leaves_much(numbered, None)
    assert not leaves_much(numbered, found)
    monkeypatch.setattr(choice, "SHORT", 1000)
    assert not leaves_much(numbered, None)


def test_a_short_jump_is_a_chain_from_one_end(monkeypatch):
    """From the last frame on, at which joints stand still, there would be more rows than variables."""
    chains = []
    prepare = ChainKKT.__init__

    def noted(kkt, couplings, stage, chain):
        chains.append(chain)
        prepare(kkt, couplings, stage, chain)

    monkeypatch.setattr(ChainKKT, "__init__", noted)
    monkeypatch.setattr(chain, "FOLDED", 0.0)
    solved = stc.load("luxo_jump", k=1).solve(max_iterations=10)
    assert solved.iterations == 10
    assert [found.parts for found in chains] == [()]


def test_the_next_solve_takes_over():
    rng = np.random.default_rng(10)
    pattern = wide(rng, 20, 6)
    first = StructuredKKT(*pattern.arguments())
    system = first.system
    values = generic(rng, pattern)
    inertia = first.factorize(*values.arguments())
    assert 0 < 8 * first.nnz_factor <= first.factor_bytes < system.nbytes
    assert first.operations > 0
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


@FOLDED
def test_the_next_solve_repeats_the_last_one(folded):
    """To the last bit: what a solve starts from is looked for among what is known."""
    rng = np.random.default_rng(11)
    pattern = wide(rng, 20, 4)
    kkt = chain_of(pattern, folded=folded)
    values = [generic(rng, pattern) for _ in range(6)]
    rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
    found = []
    for _ in range(3):
        for each in values:
            assert sum(kkt.factorize(*each.arguments())) == pattern.n + pattern.m
            found.append(np.concatenate(kkt.solve(*rhs)).tobytes())
        kkt.restart()
    assert found[6:12] == found[12:]


def test_all_instruction_sets_give_the_same():
    script = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from solver.kkt.kkt_problems import generic
from solver.kkt.motions import chain_of, motion
rng = np.random.default_rng(11)
pattern = motion(rng, 16, parameters=1, waypoint=True)
kkt = chain_of(pattern)
for _ in range(3):
    print(*kkt.factorize(*generic(rng, pattern).arguments()))
    for part in kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m)):
        print(*(f"{number:.12e}" for number in part))
"""
    assert_alike_with_all_instructions(script, 3 * (3 + 160))
