"""The multifrontal factorisation: cost that grows with the stages only, and pivots that have to wait."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from solver.kkt.backends import assert_alike_with_all_instructions
from solver.kkt.dense import DenseKKT
from solver.kkt.kkt_problems import STRUCTURES, Builder, Pattern, Values, generic, sparse_diagonals

from stc.solver.kkt import MultifrontalKKT, multifrontal


def regular(rng: np.random.Generator, frames: int, kind: str) -> Pattern:
    """A motion with the same couplings at every frame, and one complication."""
    b = Builder(rng)
    x = [b.variables(3, i) for i in range(frames)]
    border = b.variables(2, frames - 1) if kind == "parameters" else []
    for i in range(frames):
        b.curvature(x[i][:2], 1.0)
        absolute = x[0][:1] if kind == "absolute" else []
        b.row(i, [*x[i][:2], *border, *absolute])
        if i + 1 < frames:
            b.row(i, [x[i][0], x[i][1], x[i + 1][0]])
            b.row(i, [x[i][1], x[i][2], x[i + 1][1]])
        if kind == "five points" and 2 <= i < frames - 2:
            b.row(i, [x[i + d][2] for d in (-2, -1, 0, 1, 2)])
        if kind == "mirrored":
            b.row(i, [x[i][2], x[frames - 1 - i][0]])
    if kind == "periodic":
        b.row(frames - 1, [x[0][0], x[-1][0]])
    if kind == "total":
        b.row(frames - 1, [v[2] for v in x])
    return b.pattern()


KINDS = ["plain", "parameters", "absolute", "five points", "mirrored", "periodic", "total"]


@pytest.mark.parametrize("kind", KINDS)
def test_factor_grows_linearly(kind):
    rng = np.random.default_rng(1)
    sizes = []
    for frames in (100, 200, 400):
        pattern = regular(rng, frames, kind)
        kkt = MultifrontalKKT(*pattern.arguments())
        values = generic(rng, pattern)
        kkt.factorize(*values.arguments())
        rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
        kkt.solve(*rhs)
        assert kkt.last_residual < 1e-12
        sizes.append(kkt.nnz_factor)
    assert sizes[2] - sizes[1] < 2.3 * (sizes[1] - sizes[0])
    assert sizes[2] < 120 * 400


@pytest.mark.parametrize("kind", KINDS)
def test_order_of_entries_and_stage_numbers_do_not_matter(kind):
    rng = np.random.default_rng(2)
    p = regular(rng, 20, kind)
    values = generic(rng, p)
    rhs = rng.normal(size=p.n), rng.normal(size=p.m)
    first = MultifrontalKKT(*p.arguments())
    inertia = first.factorize(*values.arguments())
    expected = first.solve(*rhs)
    at_jac, at_hess = rng.permutation(p.jac_rows.size), rng.permutation(p.hess_rows.size)
    other = MultifrontalKKT(
        p.n,
        p.m,
        p.jac_rows[at_jac],
        p.jac_cols[at_jac],
        p.hess_rows[at_hess],
        p.hess_cols[at_hess],
        7 * p.var_stage - 40,
        7 * p.row_stage - 40,
    )
    assert other.factorize(values.hess[at_hess], values.jac[at_jac], values.primal, values.dual) == inertia
    for found, wanted in zip(other.solve(*rhs), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-8 * np.abs(wanted).max())


def test_unknowns_that_must_wait():
    """Curvature at the last frame only: nothing can be eliminated alone, and rows outnumber variables early."""
    frames = 60
    b = Builder(np.random.default_rng(3))
    x = [b.variables(2, i) for i in range(frames)]
    b.curvature(x[-1], 1.0)
    b.row(0, x[0][:1])
    b.row(0, x[0][1:])
    for i in range(frames - 1):
        b.row(i, [x[i][0], x[i][1], x[i + 1][0]])
        b.row(i, [x[i][1], x[i + 1][1]])
    pattern = b.pattern()
    rng = np.random.default_rng(4)
    values = Values(
        np.ones(pattern.hess_rows.size),
        rng.uniform(0.5, 1.5, pattern.jac_rows.size),
        np.zeros(pattern.n),
        np.zeros(pattern.m),
    )
    kkt = MultifrontalKKT(*pattern.arguments())
    assert kkt.factorize(*values.arguments()) == (pattern.n, pattern.m, 0)
    solution = rng.normal(size=pattern.n + pattern.m)
    rhs = pattern.matrix(values) @ solution
    kkt.solve(rhs[: pattern.n], rhs[pattern.n :])
    assert kkt.last_residual < 1e-12
    assert kkt.nnz_factor < 60 * frames


def test_border_without_curvature_fills_nothing():
    """Hardly curved variables that couple with one row over everything would all wait for it."""
    frames = 1500
    b = Builder(np.random.default_rng(5))
    x = [b.variables(1, i)[0] for i in range(frames)]
    b.row(frames - 1, x)
    pattern = b.pattern()
    none = np.zeros(0)
    kkt = MultifrontalKKT(*pattern.arguments())
    inertia = kkt.factorize(none, np.ones(frames), np.full(frames, 1e-5), np.zeros(1))
    assert inertia == (frames, 1, 0)
    dx, dy = kkt.solve(np.zeros(frames), np.ones(1))
    np.testing.assert_allclose(dx, np.full(frames, 1.0 / frames), rtol=1e-9)
    np.testing.assert_allclose(dy, [-1e-5 / frames], rtol=1e-6)
    assert kkt.nnz_factor < 200 * frames


def waiting_for_the_last(frames: int, coupling: float) -> tuple[list[object], NDArray[np.float64]]:
    """Unknowns that couple with one of two border variables and, weakly, with each other in pairs; and the entries."""
    rng = np.random.default_rng(8)
    u, v = 2 * np.arange(frames), 2 * np.arange(frames) + 1
    border = np.array([2 * frames, 2 * frames + 1])
    rows = np.concatenate([v, np.full(frames, border[0]), np.full(frames, border[1]), border])
    cols = np.concatenate([u, u, v, border])
    entries = np.concatenate(
        [coupling * rng.uniform(0.5, 2.0, frames), rng.uniform(0.5, 2.0, 2 * frames), np.ones(2)]
    )
    stage = np.append(np.repeat(np.arange(frames), 2), [frames - 1, frames - 1])
    none = np.zeros(0, dtype=np.int64)
    return [2 * frames + 2, 0, none, none, rows, cols, stage, none], entries


@pytest.mark.parametrize("coupling", [1.0, 1e-11, 1e-13, 3e-15, 0.0])
def test_unknowns_that_only_the_last_ones_could_eliminate(coupling):
    frames = 400
    pattern, entries = waiting_for_the_last(frames, coupling)
    n, none = 2 * frames + 2, np.zeros(0)
    kkt = MultifrontalKKT(*pattern)
    rhs = np.random.default_rng(9).normal(size=n)
    for values in (entries, waiting_for_the_last(frames, 1.0)[1]):
        regular = values is not entries or coupling >= 1e-11
        inertia = kkt.factorize(values, none, np.zeros(n), none)
        assert sum(inertia) == n
        assert (inertia == (frames + 1, frames + 1, 0)) == regular
        assert regular or inertia.zero > 0
        kkt.solve(rhs, none)
        assert not regular or kkt.last_residual < 1e-9
    assert kkt.nnz_factor < 200 * frames


def test_a_matrix_that_is_singular_to_working_precision_is_so_for_the_dense_factorisation_too():
    pattern, entries = waiting_for_the_last(100, 1e-15)
    n, none = 202, np.zeros(0)
    for system in (DenseKKT(*pattern), MultifrontalKKT(*pattern)):
        assert system.factorize(entries, none, np.zeros(n), none).zero > 0


def test_matrices_that_leave_the_plan():
    """A plan made for one kind of matrix serves, or makes way, when others come."""
    rng = np.random.default_rng(6)
    pattern = STRUCTURES["stencil"](rng, 15)
    kkt, judge = MultifrontalKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
    for kind in (generic, sparse_diagonals) * 2 + (sparse_diagonals,) * 10 + (generic,) * 10:
        values = kind(rng, pattern)
        assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())
        kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
        assert kkt.last_residual < 1e-11


@pytest.mark.parametrize("structure", STRUCTURES)
def test_pivots_that_fail_are_taken_in_a_later_front(structure):
    rng = np.random.default_rng(21)
    pattern = STRUCTURES[structure](rng, 12)
    kkt = MultifrontalKKT(*pattern.arguments())
    delayed = 0
    for _ in range(30):
        values = generic(rng, pattern)
        values.hess *= 10.0 ** rng.uniform(-8, 0, values.hess.size)
        values.jac *= 10.0 ** rng.uniform(-2, 0, values.jac.size)
        values.primal *= rng.random(pattern.n) < 0.5
        values.dual *= rng.random(pattern.m) < 0.5
        matrix = pattern.matrix(values)
        eigenvalues = np.linalg.eigvalsh(matrix)
        if np.abs(eigenvalues).min() < 1e-7:
            continue
        kkt._system.threshold = 0.45
        inertia = kkt.factorize(*values.arguments())
        assert inertia == ((eigenvalues > 0.0).sum(), (eigenvalues < 0.0).sum(), 0)
        rhs = rng.normal(size=pattern.n + pattern.m)
        found = np.concatenate(kkt.solve(rhs[: pattern.n], rhs[pattern.n :]))
        expected = np.linalg.solve(matrix, rhs)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
        assert kkt.last_residual < 1e-12
        delayed += kkt._system.delayed
    assert delayed > 0 or structure in ("single", "awkward")


def test_doubtful_solves_raise_the_threshold(monkeypatch):
    rng = np.random.default_rng(7)
    pattern = STRUCTURES["chain"](rng, 40)
    kkt = MultifrontalKKT(*pattern.arguments())
    values = sparse_diagonals(rng, pattern)
    rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
    kkt.factorize(*values.arguments())
    expected = kkt.solve(*rhs)
    assert kkt.factorizations == 1
    monkeypatch.setattr(multifrontal, "DOUBTFUL", -1.0)
    found = kkt.solve(*rhs)
    assert kkt.factorizations > 1  # each larger threshold is a factorisation that counts
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8 * np.abs(other).max())


def test_all_instruction_sets_give_the_same():
    script = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from solver.kkt.kkt_problems import STRUCTURES, VALUES
from stc.solver.kkt import MultifrontalKKT
for name in ("chain", "bordered", "single"):
    rng = np.random.default_rng(8)
    pattern = STRUCTURES[name](rng, 5)
    kkt = MultifrontalKKT(*pattern.arguments())
    for kind in VALUES.values():
        inertia = kkt.factorize(*kind(rng, pattern).arguments())
        dx, dy = kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
        print(*inertia, float(kkt.last_residual < 1e-12), *(f"{v:.12e}" for v in (np.abs(dx).sum(), np.abs(dy).sum())))
"""
    assert_alike_with_all_instructions(script, 3 * 4 * 6)


def test_operations_and_memory_of_a_full_matrix():
    """One dense positive definite block: n^3 / 3 operations, n (n + 1) / 2 entries."""
    size = 40
    rows, columns = np.tril_indices(size)
    none = np.zeros(0, dtype=np.int32)
    kkt = MultifrontalKKT(size, 0, none, none, rows, columns, np.zeros(size, dtype=np.int32), none)
    rng = np.random.default_rng(12)
    kkt.factorize(rng.uniform(-1.0, 1.0, rows.size), np.zeros(0), np.full(size, 100.0), np.zeros(0))
    assert kkt.nnz_factor == size * (size + 1) // 2
    assert kkt.operations == sum(k * (k + 1) for k in range(size))
    assert kkt.factor_bytes >= 8 * kkt.nnz_factor


def test_a_matrix_without_any_entries():
    """But for its diagonal."""
    rng = np.random.default_rng(15)
    pattern = regular(rng, 10, "plain")
    kkt = MultifrontalKKT(*pattern.arguments())
    kkt.factorize(*generic(rng, pattern).arguments())
    nothing = np.zeros(pattern.hess_rows.size), np.zeros(pattern.jac_rows.size)
    assert kkt.factorize(*nothing, np.ones(pattern.n), np.ones(pattern.m)) == (pattern.n, pattern.m, 0)
    dx, dy = kkt.solve(np.ones(pattern.n), np.ones(pattern.m))
    np.testing.assert_allclose(dx, 1.0)
    np.testing.assert_allclose(dy, -1.0)
    values = generic(rng, pattern)
    assert kkt.factorize(*values.arguments()) == DenseKKT(*pattern.arguments()).factorize(*values.arguments())


@pytest.mark.parametrize("coupling", [1e-200, 1e-300, 5e-324])
def test_a_planned_pair_whose_coupling_vanishes(coupling):
    pattern = Builder(np.random.default_rng(0))
    x = pattern.variables(1, 0)
    pattern.curvature(x, 1.0)
    pattern.row(0, x)
    kkt = MultifrontalKKT(*pattern.pattern().arguments())
    paired = kkt.factorize(np.zeros(1), np.ones(1), np.zeros(1), np.zeros(1))
    assert (paired.positive, paired.negative) == (1, 1)
    kkt.factorize(np.ones(1), np.full(1, coupling), np.zeros(1), np.ones(1))
    x, y = kkt.solve(np.ones(1), np.ones(1))
    np.testing.assert_array_equal((x[0], y[0]), (1.0, -1.0))
