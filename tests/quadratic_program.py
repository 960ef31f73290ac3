"""A linear or quadratic program, stated by its matrices."""

from __future__ import annotations

import numpy as np


class Quadratic:
    """``gradient . x + 1/2 x . H x`` over ``lower <= A x <= upper`` and bounds, dense."""

    def __init__(self, gradient, curvature, matrix, rows, bounds) -> None:
        self.gradient, self.curvature, self.matrix = gradient, curvature, matrix
        self.m, self.n = matrix.shape
        self.row_lower, self.row_upper = rows
        self.x_lower, self.x_upper = bounds
        self.x0 = np.zeros(self.n)
        self.jac_rows, self.jac_cols = (k.ravel().astype(np.int32) for k in np.indices(matrix.shape))
        self.hess_rows, self.hess_cols = (k.astype(np.int32) for k in np.tril_indices(self.n))
        self.var_stage, self.row_stage = np.zeros(self.n, np.int32), np.zeros(self.m, np.int32)
        self.row_linear = np.ones(self.m, bool)
        self.objective_degree = 2 if curvature.any() else 1
        self.fixed_curvature = np.ones(self.n, bool)

    def values(self, x):
        return float((self.gradient + 0.5 * self.curvature @ x) @ x), self.matrix @ x

    def derivatives(self, x, multipliers, objective_factor):
        hess = objective_factor * self.curvature[self.hess_rows, self.hess_cols]
        return self.gradient + self.curvature @ x, self.matrix.ravel().copy(), hess
