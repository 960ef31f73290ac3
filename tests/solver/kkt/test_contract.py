"""Every KKT system keeps the contract: against exact arithmetic, LAPACK, and each other."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from solver.kkt.dense import DenseKKT
from solver.kkt.kkt_problems import STRUCTURES, VALUES, Builder, Pattern, Values, exact_inertia, generic

from stc.core.calls import chain
from stc.solver.kkt import Inertia
from stc.solver.kkt.contract import KKTSystem
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.reuse import StructuredKKT

SYSTEMS = [DenseKKT, MultifrontalKKT]


def equilibrated(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """S K S with the largest entry of every row near 1, and the diagonal of S."""
    scale = np.ones(len(matrix))
    for _ in range(12):
        largest = np.abs(matrix * scale[:, None] * scale).max(axis=1)
        scale /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return matrix * scale[:, None] * scale, scale


def check(system: KKTSystem, pattern: Pattern, values: Values, rng: np.random.Generator) -> None:
    """Inertia against LAPACK, solutions against the matrix."""
    matrix, scale = equilibrated(pattern.matrix(values))
    inertia = system.factorize(*values.arguments())
    eigenvalues = np.linalg.eigvalsh(matrix)
    size = len(matrix)
    assert sum(inertia) == size
    condition = np.abs(eigenvalues).max() / np.abs(eigenvalues).min()
    if condition < 1e11:
        assert inertia == Inertia(int((eigenvalues > 0).sum()), int((eigenvalues < 0).sum()), 0)
    expected = rng.normal(size=size)
    rhs = matrix @ expected
    dx, dy = system.solve(rhs[: pattern.n] / scale[: pattern.n], rhs[pattern.n :] / scale[pattern.n :])
    assert dx.shape == (pattern.n,)
    assert dy.shape == (pattern.m,)
    found = np.concatenate([dx, dy]) / scale
    residual = np.abs(matrix @ found - rhs).max() / (np.abs(rhs).max() + np.abs(found).max())
    assert system.last_residual < 1e-10
    assert residual < 1e-10
    if condition < 1e11:
        assert np.abs(found - expected).max() <= 1e-13 * condition * np.abs(expected).max() + 1e-12
    others = matrix @ rng.normal(size=size) * rng.choice([1e-3, 0.0, 1.0]), rhs
    for first, second in (others, others[::-1]):
        system.rhs[:], system.second_rhs[:] = first / scale, second / scale
        system.solve_both_call()
        while system.check_solution():
            system.solve_both_call()
        for given, solution in ((first, system.solution), (second, system.second_solution)):
            residual = np.abs(matrix @ (solution / scale) - given).max()
            assert residual <= 1e-10 * (np.abs(given).max() + np.abs(solution / scale).max())


@pytest.mark.parametrize("values_of", VALUES.values(), ids=VALUES)
@pytest.mark.parametrize("structure", STRUCTURES.values(), ids=STRUCTURES)
@pytest.mark.parametrize("system", SYSTEMS)
def test_random_matrices(system, structure, values_of):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        pattern = structure(rng, int(rng.integers(1, 16)))
        kkt = system(*pattern.arguments())
        for _ in range(3):
            check(kkt, pattern, values_of(rng, pattern), rng)


@pytest.mark.parametrize("structure", STRUCTURES.values(), ids=STRUCTURES)
@pytest.mark.parametrize("system", SYSTEMS)
def test_attempts_tell_a_right_inertia_from_a_wrong_one(system, structure):
    """Hessians with more and more negative curvature, against LAPACK; factors of a right inertia serve to solve."""
    verdicts = set()
    for seed in range(6):
        rng = np.random.default_rng(200 + seed)
        pattern = structure(rng, 12)
        kkt = system(*pattern.arguments())
        kkt.factorize(*generic(rng, pattern).arguments())
        for shift in (0.0, 0.3, 1.0, 3.0, 10.0, 30.0):
            values = generic(rng, pattern)
            values.primal[:] = shift
            matrix, _ = equilibrated(pattern.matrix(values))
            eigenvalues = np.linalg.eigvalsh(matrix)
            if np.abs(eigenvalues).min() < 1e-9 * np.abs(eigenvalues).max():
                continue
            for own, given in zip((kkt.hess, kkt.jac, kkt.primal, kkt.dual), values.arguments(), strict=True):
                own[:] = given
            attempt = kkt.attempt_call
            if attempt is None:
                inertia = kkt.refactor()
            elif ended := attempt():
                inertia = kkt.resume(ended)
            else:
                inertia = Inertia(*kkt.inertia)
            right = bool((eigenvalues < 0.0).sum() == pattern.m)
            verdicts.add(right)
            excess = inertia.negative - pattern.m
            assert (inertia == (pattern.n, pattern.m, 0)) == right
            assert right or excess * ((eigenvalues < 0.0).sum() - pattern.m) > 0
            if right:
                kkt.rhs[:] = rng.normal(size=kkt.rhs.size)
                kkt.solve_call()
                kkt.check_solution()
                residual = np.abs(pattern.matrix(values) @ kkt.solution - kkt.rhs).max()
                assert residual < 1e-9 * (1.0 + np.abs(kkt.solution).max()) * np.abs(matrix).max() * 10.0
    assert True in verdicts


@pytest.mark.parametrize("structure", STRUCTURES.values(), ids=STRUCTURES)
@pytest.mark.parametrize("system", SYSTEMS)
def test_inertia_against_fractions(system, structure):
    for seed in range(4):
        rng = np.random.default_rng(100 + seed)
        pattern = structure(rng, 3)
        # Small whole numbers: often singular, and then exactly so.
        values = Values(
            rng.integers(-2, 3, pattern.hess_rows.size).astype(float),
            rng.integers(-2, 3, pattern.jac_rows.size).astype(float),
            rng.integers(0, 2, pattern.n).astype(float),
            rng.integers(0, 2, pattern.m).astype(float),
        )
        kkt = system(*pattern.arguments())
        assert kkt.factorize(*values.arguments()) == exact_inertia(pattern.matrix(values))


def test_dense_inertia_against_bunch_kaufman():
    rng = np.random.default_rng(5)
    pattern = STRUCTURES["single"](rng, 8)
    values = generic(rng, pattern)
    _, d, _ = scipy.linalg.ldl(pattern.matrix(values))
    pivots = np.linalg.eigvalsh(d)
    inertia = DenseKKT(*pattern.arguments()).factorize(*values.arguments())
    assert inertia == ((pivots > 0).sum(), (pivots < 0).sum(), 0)


@pytest.mark.parametrize("system", SYSTEMS)
def test_changing_values_on_one_pattern(system):
    """One object sees all kinds of matrices in turn, diagonals that vanish and come back among them."""
    rng = np.random.default_rng(9)
    pattern = STRUCTURES["chain"](rng, 12)
    kkt = system(*pattern.arguments())
    for count in range(1, 25):
        kind = rng.choice(list(VALUES))
        check(kkt, pattern, VALUES[kind](rng, pattern), rng)
        assert kkt.factorizations == count


@pytest.mark.parametrize("system", SYSTEMS)
def test_same_values_same_answer(system):
    rng = np.random.default_rng(10)
    pattern = STRUCTURES["bordered"](rng, 10)
    kkt = system(*pattern.arguments())
    values, others = generic(rng, pattern), VALUES["sparse_diagonals"](rng, pattern)
    rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
    kkt.factorize(*values.arguments())
    dx, dy = kkt.solve(*rhs)
    kept = dx.copy(), dy.copy()
    kkt.factorize(*others.arguments())
    kkt.solve(*rhs)
    np.testing.assert_array_equal(dx, kept[0], err_msg="results are the caller's own")
    kkt.factorize(*values.arguments())
    again = kkt.solve(*rhs)
    np.testing.assert_allclose(again[0], dx, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(again[1], dy, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("copies", [1, 3])
def test_repeated_rows_are_zero_pivots(system, copies):
    rng = np.random.default_rng(11)
    base = STRUCTURES["chain"](rng, 10)
    repeated = rng.choice(base.m, size=copies, replace=False)
    rows, cols = [base.jac_rows], [base.jac_cols]
    for k, row in enumerate(repeated):
        own = base.jac_cols[base.jac_rows == row]
        rows.append(np.full(own.size, base.m + k, dtype=np.int32))
        cols.append(own)
    pattern = Pattern(
        base.n,
        base.m + copies,
        np.concatenate(rows),
        np.concatenate(cols),
        base.hess_rows,
        base.hess_cols,
        base.var_stage,
        np.concatenate([base.row_stage, base.row_stage[repeated]]),
    )
    values = generic(rng, base)
    jac = np.concatenate([values.jac, *(-1.7 * values.jac[base.jac_rows == row] for row in repeated)])
    dual = np.concatenate([values.dual, np.zeros(copies)])
    dual[repeated] = 0.0
    full = Values(values.hess, jac, values.primal, dual)
    kkt = system(*pattern.arguments())
    inertia = kkt.factorize(*full.arguments())
    eigenvalues = np.sort(np.abs(np.linalg.eigvalsh(pattern.matrix(full))))
    assert eigenvalues[copies] > 1e-8
    assert inertia.zero == copies
    # In the range of K the answer is as good as ever.
    matrix = pattern.matrix(full)
    rhs = matrix @ rng.normal(size=len(matrix))
    found = np.concatenate(kkt.solve(rhs[: pattern.n], rhs[pattern.n :]))
    assert np.abs(matrix @ found - rhs).max() < 1e-8 * np.abs(rhs).max()
    # Outside it the answer is finite, and the residual says that it is none.
    outside = np.concatenate(kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m)))
    assert np.isfinite(outside).all()
    assert kkt.last_residual > 1e-9


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("growth", [0.7, 1.3])
def test_a_row_that_follows_from_all_others(system, growth):
    """States driven from a pinned start leave nothing for a row at the end to say; errors grow on the way."""
    rng = np.random.default_rng(15)
    frames, width = 30, 4
    b = Builder(rng)
    x = [b.variables(width, i) for i in range(frames)]
    entries: list[float] = []
    for k in range(width):
        b.row(0, [x[0][k]])
        entries.append(1.0)
    for i in range(frames - 1):
        step = growth * np.linalg.qr(rng.normal(size=(width, width)))[0]
        for k in range(width):
            b.row(i, [x[i + 1][k], *x[i]])
            entries.extend([1.0, *-step[k]])
    b.row(frames - 1, x[-1])
    entries.extend(rng.normal(size=width))
    pairs = list(b.jac)
    stages = np.array(b.var_stage, dtype=np.int32), np.array(b.row_stage, dtype=np.int32)
    index = np.array(pairs, dtype=np.int32)
    none = np.zeros(0, dtype=np.int32)
    rows, cols = index[:, 0].copy(), index[:, 1].copy()
    n, m = frames * width, frames * width + 1
    kkt = system(n, m, rows, cols, none, none, *stages)
    for _ in range(3):
        primal = 10.0 ** rng.uniform(-3, 3, n)
        inertia = kkt.factorize(np.zeros(0), np.array(entries), primal, np.zeros(m))
        assert inertia == (n, m - 1, 1)
        # Any softening of the rows makes it regular.
        assert kkt.factorize(np.zeros(0), np.array(entries), primal, np.full(m, 1e-6)) == (n, m, 0)


@pytest.mark.parametrize("system", SYSTEMS)
def test_nothing_but_zeros(system):
    pattern = STRUCTURES["chain"](np.random.default_rng(12), 4)
    kkt = system(*pattern.arguments())
    values = Values(
        np.zeros(pattern.hess_rows.size),
        np.zeros(pattern.jac_rows.size),
        np.zeros(pattern.n),
        np.zeros(pattern.m),
    )
    assert kkt.factorize(*values.arguments()) == (0, 0, pattern.n + pattern.m)
    dx, dy = kkt.solve(np.ones(pattern.n), np.ones(pattern.m))
    assert np.isfinite(dx).all() and np.isfinite(dy).all()


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(("n", "m"), [(0, 0), (3, 0), (0, 2), (1, 1)])
def test_small_sizes(system, n, m):
    none = np.zeros(0, dtype=np.int32)
    kkt = system(n, m, none, none, none, none, np.zeros(n, dtype=np.int32), np.zeros(m, dtype=np.int32))
    assert kkt.factorize(np.zeros(0), np.zeros(0), np.full(n, 2.0), np.full(m, 4.0)) == (n, m, 0)
    dx, dy = kkt.solve(np.ones(n), np.ones(m))
    np.testing.assert_allclose(dx, np.full(n, 0.5))
    np.testing.assert_allclose(dy, np.full(m, -0.25))
    assert kkt.last_residual < 1e-14


@pytest.mark.parametrize("system", SYSTEMS)
def test_zero_right_hand_side(system):
    rng = np.random.default_rng(13)
    pattern = STRUCTURES["chain"](rng, 3)
    kkt = system(*pattern.arguments())
    kkt.factorize(*generic(rng, pattern).arguments())
    dx, dy = kkt.solve(np.zeros(pattern.n), np.zeros(pattern.m))
    assert not dx.any() and not dy.any()
    assert kkt.last_residual == 0.0


@pytest.mark.parametrize("system", SYSTEMS)
def test_refusals(system):
    rng = np.random.default_rng(14)
    pattern = STRUCTURES["chain"](rng, 3)
    kkt = system(*pattern.arguments())
    with pytest.raises(ValueError, match="factorize"):
        kkt.solve(np.zeros(pattern.n), np.zeros(pattern.m))
    values = generic(rng, pattern)
    with pytest.raises(ValueError, match="primal_diagonal"):
        kkt.factorize(values.hess, values.jac, values.primal[1:], values.dual)
    for bad in (np.nan, np.inf):
        for array in values.arguments():
            kept = array[0]
            array[0] = bad
            with pytest.raises(ValueError, match="finite"):
                kkt.factorize(*values.arguments())
            array[0] = kept
    kkt.factorize(*values.arguments())
    with pytest.raises(ValueError, match="rhs_y"):
        kkt.solve(np.zeros(pattern.n), np.zeros(pattern.m + 1))


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("seed", [2, 3, 4, 7])
def test_large_shifts_do_not_look_singular(system, seed):
    """Huge and unequal shifts of all variables, unequal rows of full rank: the inertia is (n, m, 0)."""
    rng = np.random.default_rng(seed)
    pattern = STRUCTURES["chain"](rng, 30)
    values = generic(rng, pattern)
    primal = 10.0 ** rng.uniform(33.0, 39.0, pattern.n)
    jac = values.jac * 10.0 ** rng.uniform(-3.0, 3.0, pattern.m)[pattern.jac_rows]
    kkt = system(*pattern.arguments())
    inertia = kkt.factorize(np.zeros(pattern.hess_rows.size), jac, primal, np.zeros(pattern.m))
    assert inertia == (pattern.n, pattern.m, 0)


@pytest.mark.parametrize("system", [*SYSTEMS, StructuredKKT])
def test_attached_arrays(system):
    """Values written into the system's own arrays: the same answers, through a call that can be part of a chain."""
    rng = np.random.default_rng(21)
    pattern = STRUCTURES["bordered"](rng, 9)
    kkt, judge = system(*pattern.arguments()), DenseKKT(*pattern.arguments())
    with pytest.raises(ValueError, match="factorize"):
        _ = kkt.solve_call
    arrays = kkt.hess, kkt.jac, kkt.primal, kkt.dual
    rhs, solution, report = kkt.rhs, kkt.solution, kkt.report
    for kind in VALUES.values():
        values = kind(rng, pattern)
        for own, given in zip(arrays, values.arguments(), strict=True):
            own[:] = given
        assert kkt.refactor() == judge.factorize(*values.arguments())
        rhs[:] = rng.normal(size=rhs.size)
        expected = np.concatenate(judge.solve(rhs[: pattern.n], rhs[pattern.n :]))
        chain([kkt.solve_call])()
        assert kkt.check_solution() is False
        assert report[0] == kkt.last_residual < 1e-10
        np.testing.assert_allclose(solution, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    arrays[0][0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        kkt.refactor()
    with pytest.raises(ValueError, match="factorize"):
        _ = kkt.solve_call
