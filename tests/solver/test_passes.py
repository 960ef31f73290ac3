"""The passes of an iteration against the formulas written out in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scaled_program import dense, errors_of, evaluate, inside, scaled
from solver.kkt.dense import DenseKKT
from symbolic_program import INF, SymbolicProgram

from stc.core.functions import function
from stc.core.structures import structure
from stc.solver import Options
from stc.solver.curvature import largest_step
from stc.solver.newton_system import NewtonSystem
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import Workspace


def at_work(seed: int) -> tuple[ScaledProblem, Workspace]:
    """A workspace at a random interior point, measured, with a random step in it."""
    form = scaled()
    work = Workspace(form)
    work.load(inside(form, seed))
    work.run("progress_measure")
    rng = np.random.default_rng(seed + 1)
    step = work.step
    step.dw[:] = 0.3 * rng.standard_normal(form.size) * form.moving
    step.dy[:], step.dz[:] = rng.standard_normal(form.m), rng.standard_normal(form.gaps)
    return form, work


@given(st.integers(0, 1000), st.sampled_from([0.0, 1e-3, 0.5]))
def test_errors_are_those_of_the_definition(seed: int, mu: float) -> None:
    form, work = at_work(seed)
    s = work.s
    x, r = work.it.w[: form.n], work.it.r
    assert (s.stated, s.violation) == pytest.approx(
        (form.user_objective(work.it.f), form.violation(x, r)), rel=1e-12
    )
    work.run("point_measure", mu)
    wanted = errors_of(form, work.it, mu)
    assert (s.dual_error, s.primal, s.gap_error) == pytest.approx(wanted, rel=1e-12)
    assert s.error == max(s.dual_error, s.primal, s.gap_error)
    assert s.products == pytest.approx(float(work.it.gap @ work.it.z), rel=1e-12)


@pytest.mark.parametrize("name", ["w", "y", "z", "c", "dual"])
def test_an_error_that_is_no_number_shows(name: str) -> None:
    _, work = at_work(0)
    getattr(work.it, name)[0] = np.nan
    work.step.dw[0] = np.nan
    work.run("step_lengths")
    assert not np.isfinite(work.s.finite)
    if name in ("c", "dual", "z"):
        work.run("point_measure", 0.0)
        assert not np.isfinite(work.s.error)


@given(st.integers(0, 1000), st.floats(0.5, 1.0))
def test_steps_end_before_the_bounds(seed: int, tau: float) -> None:
    form, work = at_work(seed)
    it, step = work.it, work.step
    work.s.tau = tau
    work.run("step_lengths")
    gap_step = form.sign * step.dw[form.index]
    s = work.s
    assert s.primal_step == pytest.approx(largest_step(it.gap, gap_step, tau), rel=1e-12)
    assert s.dual_step == pytest.approx(largest_step(it.z, step.dz, tau), rel=1e-12)
    assert s.slope == pytest.approx(float(it.gradient @ step.dw[: form.n]), rel=1e-10, abs=1e-12)
    assert s.log_slope == pytest.approx(float((gap_step / it.gap).sum()), rel=1e-10, abs=1e-12)
    assert s.length == pytest.approx(float(np.linalg.norm(step.dw[: form.n])), rel=1e-12)
    alpha = s.primal_step
    work.run("point_try_step", alpha)
    trial, tried = evaluate(form, it.w + alpha * step.dw, it.y, it.z), work.trial
    assert tried.theta == pytest.approx(trial.theta, rel=1e-12)
    assert tried.f == pytest.approx(trial.f, rel=1e-12)
    assert tried.structure.logarithms == pytest.approx(np.log(trial.gap).sum(), rel=1e-12)
    assert tried.structure.smallest_gap == pytest.approx(trial.gap.min(), rel=1e-12)


@given(st.integers(0, 1000), st.booleans())
def test_rows_multipliers_move_as_far_as_suits_the_lagrangian(seed: int, shifted: bool) -> None:
    """No other fraction of their step leaves a smaller gradient, to first order."""
    form, work = at_work(seed)
    it, step, n = work.it, work.step, form.n
    work.step.dw *= 0.2
    work.s.tau = 0.9
    work.run("step_lengths")
    work.shifts[:] = np.random.default_rng(seed).uniform(0.0, 1.0, n) * form.free
    shifts = shifted * work.shifts
    before = it.snapshot()
    residual, alpha, dual = work.residual.copy(), work.s.primal_step, work.s.dual_step
    work.run("point_try_step", alpha)
    work.s.mu, work.s.shift = 0.1, float(shifted)
    assert work.run("point_move")
    moved = it.y - before.y
    whole = np.flatnonzero(np.abs(step.dy) > 1e-9)
    fraction = float(moved[whole[0]] / step.dy[whole[0]])
    np.testing.assert_allclose(moved, fraction * step.dy, atol=1e-12)
    jac = dense(form.jac_rows, form.jac_cols, before.jac, (form.m, n))

    def left(share: float) -> float:
        g = (1 - alpha) * residual + (alpha - dual) * form.scatter(step.dz)
        g[:n] -= alpha * shifts * step.dw[:n]
        turn = np.concatenate([jac.T @ step.dy, -step.dy]) * form.moving
        return float(np.linalg.norm(g + (share - alpha) * turn))

    if alpha == dual and not shifted:
        assert fraction == pytest.approx(alpha)
    else:
        least = min(left(share) for share in np.linspace(0.0, 1.0, 101))
        assert left(fraction) <= least + 1e-9
    wanted = evaluate(form, it.w, it.y, it.z)
    for name in ("f", "theta", "r", "gap", "c", "gradient", "jac", "hess", "dual"):
        np.testing.assert_allclose(getattr(it, name), getattr(wanted, name), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_centring_with_the_least_predicted_error_is_found(seed: int) -> None:
    form, work = at_work(seed)
    it, s = work.it, work.s
    system = NewtonSystem(work)
    system.factorize(0.1)
    work.run("step_predict")
    average = s.products / form.gaps
    grid = [1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.06, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0, 5.0, 20.0, 100.0]
    errors = []
    for sigma in grid:
        dw = work.affine.dw + sigma * work.centring.dw
        gap_step, z_step = form.sign * dw[form.index], work.affine.dz + sigma * work.centring.dz
        tau = max(0.99, 1.0 - sigma * average)
        a, b = largest_step(it.gap, gap_step, tau), largest_step(it.z, z_step, tau)
        products = (it.gap + a * gap_step) * (it.z + b * z_step)
        dual = float(work.residual @ work.residual) / form.moving.sum()
        primal = float(it.c @ it.c) / form.m
        errors.append(np.mean(products**2) + (1 - b) ** 2 * dual + (1 - a) ** 2 * primal)
    assert s.centring_parameter == grid[int(np.argmin(errors))]


@given(st.lists(st.floats(1e-300, 1e300), max_size=30))
def test_logarithms_of_products_are_sums_of_logarithms(values: list[float]) -> None:
    found = function("point_log_sum")(len(values), np.array(values))
    assert found == pytest.approx(sum(np.log(v) for v in values), rel=1e-12, abs=1e-10)


def test_a_logarithm_of_nothing_is_no_number() -> None:
    assert np.isnan(function("point_log_sum")(2, np.array([1.0, 0.0])))
    assert np.isnan(function("point_log_sum")(2, np.array([-1.0, -1.0])))


def test_the_slack_of_a_row_without_entries_makes_up_for_its_residual() -> None:
    """The row is a number: only its slack can meet it."""
    nlp = SymbolicProgram([1.0], lambda x: x[0] ** 2, lambda x: [(0.0 * x[0] + 2.0, -INF, 9.0)])
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    assert form.jac_rows.size == 0
    work = Workspace(form)
    work.load(evaluate(form, np.array([1.0, 5.0]), np.zeros(1), np.full(1, 0.25)))
    work.run("point_measure", 0.0)
    work.s.mu = 0.5
    NewtonSystem(work).factorize(0.5)
    work.run("step_newton")
    gap = 9.0 - 5.0 + 9e-9
    assert work.step.dw.tolist() == pytest.approx([-1.0, 2.0 - 5.0])
    assert work.step.dz.tolist() == pytest.approx([0.5 / gap - 0.25 / gap * 3.0 - 0.25])


@pytest.mark.parametrize("gaps", [1, 7, 512, 3 * 512 + 5])
@pytest.mark.parametrize("far", [1.0, 30.0])
def test_the_centring_parameter_leaves_the_smallest_error(gaps, far):
    """Against every one of them tried; where bounds are in the way of all of them, products stay."""
    rng = np.random.default_rng(gaps)
    index = rng.integers(0, gaps + 3, gaps)
    sign = rng.choice([-1.0, 1.0], gaps)
    gap, z = rng.uniform(0.1, 2.0, gaps), rng.uniform(0.1, 2.0, gaps)
    affine, centring = 0.3 * far * rng.normal(size=gaps + 3), 0.1 * rng.normal(size=gaps + 3)
    affine_z, centring_z = -z + 0.1 * rng.normal(size=gaps), 0.5 * rng.uniform(size=gaps)
    step = structure("step")
    s = structure("iteration")(
        form=structure("formulation")(gaps=gaps, m=7, moving_entries=11, many_gaps=True, index=index, sign=sign),
        now=structure("iterate")(gap=gap, z=z), affine=step(dw=affine, dz=affine_z),
        centring=step(dw=centring, dz=centring_z), scratch=np.zeros(2 * gaps), products=float(gap @ z),
        dual_squared=0.3, primal_squared=0.2,
    )  # fmt: skip
    function("step_choose_centring")(s)
    grid = [1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.06, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0, 5.0, 20.0, 100.0]
    errors, reaches = [], []
    for sigma in grid:
        change = sign * (affine + sigma * centring)[index]
        change_z = affine_z + sigma * centring_z
        tau = max(0.99, 1.0 - sigma * (gap @ z) / gaps)
        a = min(1.0, tau / max(1e-300, np.max(-change / gap)))
        b = min(1.0, tau / max(1e-300, np.max(-change_z / z)))
        products = (gap + a * change) * (z + b * change_z)
        errors.append((1 - b) ** 2 * 0.3 / 11.0 + (1 - a) ** 2 * 0.2 / 7.0 + products @ products / gaps)
        reaches.append(a)
    best = int(np.argmin(errors))
    expected = grid[best] if reaches[best] >= 0.2 else max(grid[best], 1.0)
    assert s.centring_parameter == expected
