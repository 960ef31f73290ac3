"""Newton's system on an active set against the one that dense matrices give."""

from __future__ import annotations

from functools import partial
from typing import Any, cast

import numpy as np
import pytest
from scaled_program import dense, scaled

from stc.core.functions import function
from stc.core.structures import structure
from stc.solver.kkt.contract import Inertia
from stc.solver.products import NOTHING
from stc.solver.projection import Projection, factorize_restricted

diagonals = function("conditions_restricted_diagonals")


@pytest.mark.parametrize("active", ["none", "some", "all rows"])
@pytest.mark.parametrize("seed", range(4))
def test_the_system_on_an_active_set(active: str, seed: int) -> None:
    form = scaled()
    rng = np.random.default_rng(seed)
    point = Projection(form)
    point.x[:], point.y[:] = rng.uniform(0.5, 1.5, form.n), rng.standard_normal(form.m)
    assert point.evaluate()
    share_x, share_rows = {"none": (0.0, 0.0), "some": (0.4, 0.5), "all rows": (0.0, 1.0)}[active]
    point.active_x[:] = rng.random(form.n) < share_x
    point.active_rows[:] = rng.random(form.m) < share_rows
    point.x_target[:], point.row_target[:] = rng.standard_normal(form.n), rng.standard_normal(form.m)
    point._restrict()

    n, m = form.n, form.m
    free, met = point.active_x == 0.0, point.active_rows != 0.0
    hess = dense(form.hess_rows, form.hess_cols, point.hess, (n, n))
    hess = hess + np.tril(hess, -1).T
    jac = dense(form.jac_rows, form.jac_cols, point.jac, (m, n))
    dx = np.where(free, 0.0, point.x_target - point.x)
    dy = np.where(met, 0.0, -point.y)
    kkt = form.attached_kkt
    np.testing.assert_array_equal(kkt.hess, point.hess)
    np.testing.assert_array_equal(kkt.jac, point.jac)
    right = np.where(free, -point.lagrangian - hess @ dx - jac.T @ dy, 0.0)
    rows = np.where(met, point.row_target - point.r - jac @ dx, 0.0)
    np.testing.assert_allclose(kkt.rhs, np.concatenate([right, rows]), rtol=1e-12, atol=1e-12)
    assert point.s.largest_curvature == np.abs(hess).max(initial=0.0)

    # What is held and left out nearly moves hardly, and the others as if it did not at all.
    firm = max(1.0, point.s.largest_curvature) / NOTHING**2
    diagonals(point.s, 0.0, 0.0, firm)
    assert np.all(kkt.dual == np.where(met, np.where(form.equality, 0.0, NOTHING), 1.0 / NOTHING**2))
    diagonals(point.s, 1e-3, 1e-3, firm)
    assert np.all(kkt.primal == np.where(free, 1e-3, np.where(form.held, 1.0, firm)))
    matrix = np.block([[hess + np.diag(kkt.primal), jac.T], [jac, -np.diag(kkt.dual)]])
    kept = np.concatenate([free, met])
    exact = np.block([[hess + 1e-3 * np.eye(n), jac.T], [jac, -1e-3 * np.eye(m)]])[np.ix_(kept, kept)]
    step = np.linalg.solve(matrix, kkt.rhs)
    size = np.abs(step).max()
    np.testing.assert_allclose(step[kept], np.linalg.solve(exact, kkt.rhs[kept]), atol=1e-5 * size)
    assert np.abs(step[~kept]).max(initial=0.0) <= 1e-10 * size


class _Dense:
    """What stands in for the linear algebra: a matrix in full, and its eigenvalues."""

    def __init__(self, hess: list[list[float]], jac: list[list[float]]) -> None:
        self.hess, self.jac = np.array(hess), np.array(jac)
        n, m = len(hess), len(jac)
        self.primal, self.dual = np.zeros(n), np.zeros(m)
        self.point = structure("primal_dual")(
            nlp=structure("program")(n=n, m=m, held=np.zeros(n), equality=np.ones(m)),
            kkt=structure("linear_system")(primal=self.primal, dual=self.dual), active_x=np.zeros(n),
            active_rows=np.ones(m),
        )  # fmt: skip
        self.tried, self.largest = 0, float(np.abs(self.hess).max())

    def refactor(self) -> Inertia:
        self.tried += 1
        n, m = len(self.hess), len(self.jac)
        matrix = np.block([[self.hess + np.diag(self.primal), self.jac.T], [self.jac, -np.diag(self.dual)]])
        values = np.linalg.eigvalsh(matrix)
        counts = [int((values > 1e-14).sum()), int((values < -1e-14).sum())]
        return Inertia(*counts, n + m - sum(counts))


@pytest.mark.parametrize(
    ("hess", "jac", "reached", "positive", "tried"),
    [
        ([[1.0, 0.0], [0.0, 1.0]], [[1.0, 1.0]], 0, True, 1),
        ([[1.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]], 1, True, 2),  # rows that depend on each other
        ([[0.0, 0.0], [0.0, 0.0]], [[1.0, 1.0]], 2, True, 3),  # flat
        ([[-1e-10, 0.0], [0.0, -1e-10]], [[1.0, 1.0]], 2, True, 2),  # bent the wrong way by rounding errors
        ([[-1.0, 0.0], [0.0, -1.0]], [[1.0, 1.0]], 2, False, 2),
    ],
)
def test_shifts_that_cannot_help_are_not_tried(
    hess: list[list[float]], jac: list[list[float]], reached: int, positive: bool, tried: int
) -> None:
    given = _Dense(hess, jac)
    assert factorize_restricted(partial(diagonals, given.point), given.largest, cast(Any, given)) == (
        reached,
        positive,
    )
    assert given.tried == tried
