"""A small scaled program with one of everything, and points inside it."""

from __future__ import annotations

import numpy as np
from solver.kkt.dense import DenseKKT
from symbolic_program import INF, SymbolicProgram

from stc.solver import Options
from stc.solver.iterate import Iterate
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.starting import cold_iterate
from stc.symbolic.expr import call


def program() -> SymbolicProgram:
    """One of everything: an equality, one- and two-sided rows, a row without bounds, a fixed variable."""
    return SymbolicProgram(
        [1.5, 0.7, 2.0, 0.3],
        lambda x: call("exp", x[0]) + x[0] * x[1] + x[2] ** 2 + 3 * x[3] ** 2,
        lambda x: [
            (x[0] * x[1] + x[3], 1.0, 1.0),
            (x[0] ** 2 + x[2], -INF, 9.0),
            (x[1] + x[3], -1.0, 2.0),
            (x[0] * x[3], -INF, INF),
            (x[1] * x[2] - x[0], -3.0, INF),
        ],
        lower=[0.0, -INF, 2.0, -1.0],
        upper=[4.0, 5.0, 2.0, INF],
    )


def scaled(scaling: bool = True) -> ScaledProblem:
    nlp = program()
    return ScaledProblem(nlp, nlp.x0, Options(scaling=scaling), DenseKKT)


def evaluate(form: ScaledProblem, w: np.ndarray, y: np.ndarray, z: np.ndarray) -> Iterate:
    """Every quantity at ``(w, y, z)``, in NumPy."""
    f, r = form.values(w[: form.n])
    c = form.residual(r, w)
    gradient, jac, hess = form.derivatives(w[: form.n], y)
    dual = (
        np.concatenate([gradient + np.bincount(form.jac_cols, jac * y[form.jac_rows], form.n), -y])
        * form.moving
    )
    return Iterate(w, y, z, f, r, form.gap(w), c, float(np.abs(c).sum()), gradient, jac, hess, dual)


def inside(form: ScaledProblem, seed: int) -> Iterate:
    """A random primal-dual point strictly inside the bounds."""
    rng = np.random.default_rng(seed)
    it = cold_iterate(form, program().x0 / form.x_scale)
    w = it.w + 0.2 * rng.uniform(-1, 1, form.size) * form.moving
    w = np.clip(w, form.lower + 0.05, form.upper - 0.05)
    y = np.where(form.ignored, 0.0, rng.standard_normal(form.m))
    return evaluate(form, w, y, rng.uniform(0.1, 2.0, form.gaps))


def errors_of(form: ScaledProblem, it: Iterate, mu: float) -> tuple[float, float, float]:
    """Dual, primal and complementarity error of the barrier problem (Waechter and Biegler 2006, equation 5)."""
    z_sum = float(it.z.sum())

    def scale(total: float, count: int) -> float:
        return min(max(total / max(count, 1) / 100.0, 1.0), 1000.0)

    return (
        float(np.abs(it.dual - form.scatter(it.z)).max(initial=0.0))
        / scale(float(np.abs(it.y).sum()) + z_sum, form.m + form.gaps),
        float(np.abs(it.c).max(initial=0.0)),
        float(np.abs(it.gap * it.z - mu).max(initial=0.0)) / scale(z_sum, form.gaps),
    )


def dense(rows: np.ndarray, cols: np.ndarray, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    matrix = np.zeros(shape)
    matrix[rows, cols] = values
    return matrix
