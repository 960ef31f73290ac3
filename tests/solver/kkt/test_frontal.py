"""The structured factorisation: cost that grows with the stages only, and what happens off the plan."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from solver.kkt.backends import assert_alike_with_all_instructions
from solver.kkt.kkt_problems import STRUCTURES, Builder, Pattern, Values, generic, sparse_diagonals

from stc.solver.kkt import DenseKKT, FrontalKKT, frontal, pivots


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
        kkt = FrontalKKT(*pattern.arguments())
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
    first = FrontalKKT(*p.arguments())
    inertia = first.factorize(*values.arguments())
    expected = first.solve(*rhs)
    at_jac, at_hess = rng.permutation(p.jac_rows.size), rng.permutation(p.hess_rows.size)
    other = FrontalKKT(
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
    kkt = FrontalKKT(*pattern.arguments())
    assert kkt.factorize(*values.arguments()) == (pattern.n, pattern.m, 0)
    solution = rng.normal(size=pattern.n + pattern.m)
    rhs = pattern.matrix(values) @ solution
    kkt.solve(rhs[: pattern.n], rhs[pattern.n :])
    assert kkt.last_residual < 1e-12
    assert kkt.nnz_factor < 60 * frames


def test_border_without_curvature_does_not_fill_the_window():
    """Hardly curved variables that couple with one row over everything would all wait for it."""
    frames = 1500
    b = Builder(np.random.default_rng(5))
    x = [b.variables(1, i)[0] for i in range(frames)]
    b.row(frames - 1, x)
    pattern = b.pattern()
    none = np.zeros(0)
    kkt = FrontalKKT(*pattern.arguments())
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
def test_unknowns_that_only_the_last_ones_could_eliminate_do_not_fill_the_window(coupling):
    frames = 400
    pattern, entries = waiting_for_the_last(frames, coupling)
    n, none = 2 * frames + 2, np.zeros(0)
    kkt = FrontalKKT(*pattern)
    rhs = np.random.default_rng(9).normal(size=n)
    for values in (entries, waiting_for_the_last(frames, 1.0)[1]):
        regular = values is not entries or coupling >= 1e-11
        inertia = kkt.factorize(values, none, np.zeros(n), none)
        assert sum(inertia) == n
        assert (inertia == (frames + 1, frames + 1, 0)) == regular
        assert regular or inertia.zero > 0
        kkt.solve(rhs, none)
        assert not regular or kkt.last_residual < 1e-9
        assert not np.tril(kkt._window.reshape(kkt._stride, -1)).any()
    assert kkt._held_slots <= 64


def test_a_matrix_that_was_given_up_is_singular_for_the_dense_factorisation_too():
    pattern, entries = waiting_for_the_last(100, 1e-15)
    n, none = 202, np.zeros(0)
    for system in (DenseKKT(*pattern), FrontalKKT(*pattern)):
        assert system.factorize(entries, none, np.zeros(n), none).zero > 0


def test_matrices_that_leave_the_plan():
    """A plan made for one kind of matrix serves, or makes way, when others come."""
    rng = np.random.default_rng(6)
    pattern = STRUCTURES["stencil"](rng, 15)
    kkt, judge = FrontalKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
    for kind in (generic, sparse_diagonals) * 2 + (sparse_diagonals,) * 10 + (generic,) * 10:
        values = kind(rng, pattern)
        assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())
        kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
        assert kkt.last_residual < 1e-11


@pytest.mark.parametrize("structure", STRUCTURES)
def test_patterns_hold_for_whatever_pivots_are_taken(structure, monkeypatch):
    """Pivots that fail are taken later and in other pairs; the planned lists still find all there is."""
    monkeypatch.setattr(frontal, "PLANNING", 1e30)
    rng = np.random.default_rng(21)
    pattern = STRUCTURES[structure](rng, 12)
    kkt = FrontalKKT(*pattern.arguments())
    kkt.pivot_threshold = 0.45
    strayed = delayed = 0
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
        inertia = kkt.factorize(*values.arguments())
        assert inertia == ((eigenvalues > 0.0).sum(), (eigenvalues < 0.0).sum(), 0)
        assert not np.tril(kkt._window.reshape(kkt._stride, -1)).any()
        rhs = rng.normal(size=pattern.n + pattern.m)
        found = np.concatenate(kkt.solve(rhs[: pattern.n], rhs[pattern.n :]))
        expected = np.linalg.solve(matrix, rhs)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
        assert kkt.last_residual < 1e-12
        strayed += kkt._counts[pivots.STRAYED]
        delayed += kkt._counts[pivots.DELAYED]
    assert kkt._plans_made == 1
    assert strayed > 0
    assert delayed > 0 or structure == "single"


def test_doubtful_solves_raise_the_threshold(monkeypatch):
    rng = np.random.default_rng(7)
    pattern = STRUCTURES["chain"](rng, 40)
    kkt = FrontalKKT(*pattern.arguments())
    kkt.pivot_threshold = 0.01
    values = sparse_diagonals(rng, pattern)
    rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
    kkt.factorize(*values.arguments())
    expected = kkt.solve(*rhs)
    assert kkt.factorizations == 1
    monkeypatch.setattr(frontal, "DOUBTFUL", 0.0)
    found = kkt.solve(*rhs)
    # From 0.01 over 0.1 to the highest, each of them a factorisation that counts.
    assert kkt.factorizations == 3
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8 * np.abs(other).max())
    kkt.solve(*rhs)
    assert kkt.factorizations == 3


def test_all_instruction_sets_give_the_same():
    script = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from solver.kkt.kkt_problems import STRUCTURES, VALUES
from stc.solver.kkt import FrontalKKT
for name in ("chain", "bordered", "single"):
    rng = np.random.default_rng(8)
    pattern = STRUCTURES[name](rng, 5)
    kkt = FrontalKKT(*pattern.arguments())
    for kind in VALUES.values():
        inertia = kkt.factorize(*kind(rng, pattern).arguments())
        dx, dy = kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
        print(*inertia, float(kkt.last_residual < 1e-12), *(f"{v:.12e}" for v in (np.abs(dx).sum(), np.abs(dy).sum())))
"""
    assert_alike_with_all_instructions(script, 3 * 4 * 6)


def test_operations_and_memory_of_a_full_matrix():
    """One dense positive definite block: n^3 / 3 operations, n (n - 1) / 2 entries."""
    size = 40
    rows, columns = np.tril_indices(size)
    none = np.zeros(0, dtype=np.int32)
    kkt = FrontalKKT(size, 0, none, none, rows, columns, np.zeros(size, dtype=np.int32), none)
    rng = np.random.default_rng(12)
    kkt.factorize(rng.uniform(-1.0, 1.0, rows.size), np.zeros(0), np.full(size, 100.0), np.zeros(0))
    assert kkt.nnz_factor == size * (size - 1) // 2
    assert kkt.operations == sum(k * (k + 1) for k in range(size))
    # Indices are shared by the pivots of a panel.
    assert 8 * kkt.nnz_factor < kkt.factor_bytes - 40 * size < 9 * kkt.nnz_factor


@pytest.mark.parametrize("structure", ["chain", "bordered", "stencil", "absolute", "variable_major"])
def test_entries_that_are_always_zero_are_left_out(structure, monkeypatch):
    """Whichever entries are zero, and when they no longer are: as the dense one finds."""
    monkeypatch.setattr(frontal, "PLANNING", -(10**9))  # a plan for each matrix
    rng = np.random.default_rng(13)
    pattern = STRUCTURES[structure](rng, 12)
    kkt, judge = FrontalKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
    hess_zero = rng.random(pattern.hess_rows.size) < 0.3
    jac_zero = rng.random(pattern.jac_rows.size) < 0.1
    for share in (0.0, 1.0, 1.0, 0.9, 0.5, 0.2, 0.0, 1.0):
        values = generic(rng, pattern)
        values.hess[hess_zero & (rng.random(hess_zero.size) < share)] = 0.0
        values.jac[jac_zero & (rng.random(jac_zero.size) < share)] = 0.0
        values.primal += 1.0
        values.dual += 1e-3
        inertia = kkt.factorize(*values.arguments())
        assert inertia == judge.factorize(*values.arguments())
        rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
        for one, other in zip(kkt.solve(*rhs), judge.solve(*rhs), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-7 * np.abs(other).max())
    assert kkt.last_residual < 1e-12


def test_left_out_entries_come_back(monkeypatch):
    monkeypatch.setattr(frontal, "PLANNING", -(10**9))
    rng = np.random.default_rng(14)
    pattern = regular(rng, 60, "plain")
    kkt, judge = FrontalKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
    values = generic(rng, pattern)
    kkt.factorize(*values.arguments())
    full = kkt.nnz_factor
    values.jac[2::5] = 0.0
    trimmed = Values(values.hess * 0.0, values.jac, values.primal + 1.0, values.dual + 1.0)
    for _ in range(2):
        assert kkt.factorize(*trimmed.arguments()) == judge.factorize(*trimmed.arguments())
    few = kkt.nnz_factor
    assert few < 0.9 * full
    monkeypatch.setattr(frontal, "PLANNING", 10**12)  # no plan but for what comes back
    for entry in (2, 7, 12, 17, 22):  # one more each time: in the end all are kept
        trimmed.jac[entry] = 1.0
        assert kkt.factorize(*trimmed.arguments()) == judge.factorize(*trimmed.arguments())
        kkt.solve(np.ones(pattern.n), np.ones(pattern.m))
        assert kkt.last_residual < 1e-12
    assert kkt.nnz_factor > few


def test_a_matrix_without_any_entries(monkeypatch):
    """But for its diagonal."""
    monkeypatch.setattr(frontal, "PLANNING", -(10**9))
    rng = np.random.default_rng(15)
    pattern = regular(rng, 10, "plain")
    kkt = FrontalKKT(*pattern.arguments())
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
    kkt = FrontalKKT(*pattern.pattern().arguments())
    paired = kkt.factorize(np.zeros(1), np.ones(1), np.zeros(1), np.zeros(1))
    assert (paired.positive, paired.negative) == (1, 1)
    kkt.factorize(np.ones(1), np.full(1, coupling), np.zeros(1), np.ones(1))
    x, y = kkt.solve(np.ones(1), np.ones(1))
    np.testing.assert_array_equal((x[0], y[0]), (1.0, -1.0))


def test_what_overflows_counts_as_zero_and_leaves_nothing_behind(monkeypatch):
    rng = np.random.default_rng(3)
    p = regular(rng, 6, "plain")
    values = generic(rng, p)
    kkt = FrontalKKT(*p.arguments())
    expected = kkt.factorize(*values.arguments())
    equilibrate = kkt._equilibrate

    def overflow() -> None:
        equilibrate()
        kkt._values[: p.n + p.m : 5] = np.nan

    monkeypatch.setattr(kkt, "_equilibrate", overflow)
    assert kkt.factorize(*values.arguments()).zero > 0
    monkeypatch.setattr(kkt, "_equilibrate", equilibrate)
    assert kkt.factorize(*values.arguments()) == expected
    rhs = rng.normal(size=p.n), rng.normal(size=p.m)
    kkt.solve(*rhs)
    assert kkt.last_residual < 1e-12
