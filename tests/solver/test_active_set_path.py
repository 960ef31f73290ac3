"""The path to the active set of a quadratic program, on dense programs whose optimality conditions are checked."""

import numpy as np
import pytest

from stc.solver.active_set_path import ActiveSetPath


class Dense:
    """Minimise ``g.x + x.H x / 2`` subject to ``low <= A x <= high``: with an active set, as dense equations."""

    def __init__(self, rng, n, c):
        root = rng.normal(size=(n, n))
        self.hess, self.gradient = root @ root.T / n + 0.1 * np.eye(n), 3.0 * rng.normal(size=n)
        self.rows = rng.normal(size=(c, n))
        self.low, self.high = -rng.uniform(0.1, 1.0, c), rng.uniform(0.1, 1.0, c)
        self.low[rng.uniform(size=c) < 0.2] = -np.inf

    def solved(self, signs, gradient, target, own):
        """Values and multipliers with active rows at ``target`` and multipliers ``own`` of the others."""
        active = np.flatnonzero(signs)
        some = self.rows[active]
        matrix = np.block([[self.hess, some.T], [some, np.zeros((len(active),) * 2)]])
        found = np.linalg.solve(matrix, np.concatenate([-gradient - self.rows.T @ own, target[active]]))
        multipliers = own.copy()
        multipliers[active] = found[len(gradient) :]
        return self.rows @ found[: len(gradient)], multipliers

    def path(self, signs, most=100):
        c = len(signs)
        target = np.where(signs < 0, self.low, self.high)
        values, multipliers = self.solved(signs, self.gradient, target, np.zeros(c))
        return ActiveSetPath(
            signs, values, multipliers, self.low, self.high, lambda k: self.unit(signs, k), most
        )

    def unit(self, signs, k):
        one = np.eye(len(signs))[k]
        zero = np.zeros(len(one))
        return self.solved(signs, np.zeros(len(self.gradient)), *((one, zero) if signs[k] else (zero, one)))

    def faults(self, signs):
        """The largest violation, and the largest multiplier that pulls the wrong way."""
        target = np.where(signs < 0, self.low, self.high)
        values, multipliers = self.solved(signs, self.gradient, target, np.zeros(len(signs)))
        return np.maximum(values - self.high, self.low - values).max(), (-signs * multipliers).max()


@pytest.mark.parametrize("seed", range(40))
def test_its_end_meets_the_optimality_conditions(seed):
    rng = np.random.default_rng(seed)
    n, c = int(rng.integers(4, 25)), int(rng.integers(4, 40))
    program = Dense(rng, n, c)
    signs = np.zeros(c)
    some = rng.permutation(c)[: int(rng.integers(0, min(n, c)))]
    signs[some] = np.where(np.isfinite(program.low[some]), rng.choice([-1.0, 1.0], len(some)), 1.0)
    path = program.path(signs)
    assert path.follow()
    violation, wrong = program.faults(path.signs)
    assert violation < 1e-9
    assert wrong < 1e-9


def test_dependent_constraints_give_way_to_one_another():
    program = Dense(np.random.default_rng(1), 2, 3)
    program.hess, program.gradient = np.eye(2), np.array([-2.0, -1.0])
    program.rows = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    program.low, program.high = np.full(3, -np.inf), np.array([1.0, 1.0, 0.5])
    path = program.path(np.array([1.0, 1.0, 0.0]))
    assert path.follow()
    # The point that is nearest to (2, 1) where the sum is at most 0.5: (0.75, -0.25).
    assert np.array_equal(path.signs, [0.0, 0.0, 1.0])


def test_negative_curvature_ends_it():
    program = Dense(np.random.default_rng(2), 2, 2)
    program.hess, program.gradient = np.diag([1.0, -1.0]), np.array([0.0, 2.0])
    program.rows = np.eye(2)
    program.low, program.high = np.full(2, -1.0), np.full(2, 1.0)
    assert not program.path(np.array([0.0, 1.0]), 10).follow()
