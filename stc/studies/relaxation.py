"""The relaxation that one statement needs for others to hold, in its own units.

    minimise s >= 0   subject to   lower - s <= body <= upper + s   at all frames of the statement,
                                   the others as they are

There is one additional unknown, s, which belongs to no frame; the statement's rows and bounds become rows that contain
it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.solver import Options, Start, Status, minimize
from stc.studies.feasibility import FeasibilityProblem
from stc.transcription.bind import BoundProgram
from stc.transcription.ownership import Ownership, Place, place_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

__all__ = ["Relaxation", "RelaxedProblem", "needed_relaxation"]

ITERATIONS = 300


@dataclass(frozen=True, slots=True)
class Relaxation:
    """The relaxation that a statement needs if others hold.

    Attributes:
        amount: the least s, signed: positive where the statement is above its upper bound, negative below a lower one.
        place: the place that determines it.
        x: (N,) a point that attains it.
    """

    amount: float
    place: Place
    x: FloatArray


class RelaxedProblem:
    """The program above: :class:`stc.solver.nlp.NLP` in (x, s)."""

    def __init__(
        self, bound: BoundProgram, ownership: Ownership, others: set[int], relation: int, x: FloatArray
    ) -> None:
        base = self.base = FeasibilityProblem(bound, ownership, others)
        self._bound = bound
        rows = np.flatnonzero(ownership.rows_of(relation) & ~ownership.rows_kept(others))
        above = rows[np.isfinite(bound.row_upper[rows])]
        below = rows[np.isfinite(bound.row_lower[rows])]
        self._source = np.concatenate([above, below])
        self.row_sign = np.concatenate([np.ones(len(above)), -np.ones(len(below))])
        limits = [np.concatenate([bound.row_upper[above], -bound.row_lower[below]])]
        self.places = [ownership.place(int(row)) for row in self._source]
        position, slope = [np.zeros(0, np.int64)], [np.zeros(0)]
        for entry in ownership.bounds:
            if entry.relation != relation:
                continue
            for sign, ends in ((1.0, entry.upper), (-1.0, entry.lower)):
                k = np.flatnonzero(np.isfinite(ends))
                position.append(entry.position[k])
                slope.append(sign * entry.slope[k])
                limits.append(sign * ends[k])
                self.row_sign = np.concatenate([self.row_sign, np.full(len(k), sign)])
                self.places += [place_of(int(entry.nodes.position[j]), int(entry.nodes.side[j])) for j in k]
        self._position, self._slope = np.concatenate(position), np.concatenate(slope)
        self._limit = np.concatenate(limits)
        extra = len(self._limit)
        self.n, self.m = base.n + 1, base.m + extra
        self.x_lower, self.x_upper = np.append(base.x_lower, 0.0), np.append(base.x_upper, np.inf)
        self.row_lower = np.concatenate([base.row_lower, np.full(extra, -np.inf)])
        self.row_upper = np.concatenate([base.row_upper, self._limit])
        self._structure(bound)
        start = np.clip(x, base.x_lower, base.x_upper)
        lack = self.values(np.append(start, 0.0))[1][base.m :] - self._limit
        lack = lack[np.isfinite(lack)]
        self.x0 = np.append(start, max(float(lack.max(initial=0.0)), 0.0) + 1e-3)
        self.objective_degree = 1
        self.fixed_curvature = np.zeros(self.n, bool)

    def _structure(self, bound: BoundProgram) -> None:
        base, count = self.base, len(self._source)
        order = np.argsort(bound.jac_rows, kind="stable")
        begin = np.searchsorted(bound.jac_rows[order], np.arange(base.m + 1))
        lengths = begin[self._source + 1] - begin[self._source]
        parts = [np.zeros(0, np.int64), *(order[begin[row] : begin[row + 1]] for row in self._source)]
        self._copied = np.concatenate(parts)
        self._copied_sign = np.repeat(self.row_sign[:count], lengths)
        extra = base.m + np.arange(len(self._limit))
        rows: list[NDArray[np.integer]] = [
            bound.jac_rows,
            np.repeat(extra[:count], lengths),
            extra[count:],
            extra,
        ]
        cols: list[NDArray[np.integer]] = [
            bound.jac_cols,
            bound.jac_cols[self._copied],
            self._position,
            np.full(len(extra), base.n),
        ]
        self.jac_rows = np.concatenate(rows).astype(np.int32)
        self.jac_cols = np.concatenate(cols).astype(np.int32)
        self.hess_rows, self.hess_cols = bound.hess_rows, bound.hess_cols
        last = 1 + max(int(bound.var_stage.max(initial=0)), int(bound.row_stage.max(initial=0)))
        self.var_stage = np.append(bound.var_stage, last).astype(np.int32)
        stages = [bound.row_stage, bound.row_stage[self._source], bound.var_stage[self._position]]
        self.row_stage = np.concatenate(stages).astype(np.int32)
        linear = [bound.row_linear, bound.row_linear[self._source], np.ones(len(self._position), bool)]
        self.row_linear = np.concatenate(linear)

    def values(self, x: FloatArray) -> tuple[float, FloatArray]:
        """The objective, which is s, and the rows of the relaxed program."""
        own, s = x[:-1], float(x[-1])
        _, rows = self._bound.values(own)
        bodies = self.row_sign[: len(self._source)] * rows[self._source]
        rows[self.base.left_out] = 0.0
        return s, np.concatenate([rows, bodies - s, self._slope * own[self._position] - s])

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray, objective_factor: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The derivatives of :meth:`values`: gradient, Jacobian and Hessian entries."""
        base, count = self.base, len(self._source)
        y = multipliers[: base.m].copy()
        y[base.left_out] = 0.0
        np.add.at(y, self._source, self.row_sign[:count] * multipliers[base.m : base.m + count])
        _, jac, hess = self._bound.derivatives(x[:-1], y, 0.0)
        copied = self._copied_sign * jac[self._copied]
        kept = base.masked(jac)
        gradient = np.zeros(self.n)
        gradient[-1] = 1.0
        return gradient, np.concatenate([kept, copied, self._slope, -np.ones(len(self._limit))]), hess


def needed_relaxation(
    bound: BoundProgram,
    ownership: Ownership,
    others: set[int],
    relation: int,
    x: FloatArray,
    time_limit: float,
) -> Relaxation | None:
    """The least relaxation of ``relation`` while ``others`` hold, as far as the solver finds.

    Args:
        x: (N,) where to start.
        time_limit: in seconds.

    Returns:
        None where no answer was found.
    """
    if time_limit <= 0.0:
        return None
    problem = RelaxedProblem(bound, ownership, others, relation, x)
    if not len(problem.places) or len(problem.base.crossed):
        return None
    _, rows = problem.values(problem.x0)
    if not np.isfinite(rows).all():
        return None
    options = Options(max_iterations=ITERATIONS, time_limit=time_limit, retries=1)
    result = minimize(problem, options, start=Start(problem.x0))
    if result.status is not Status.OPTIMAL:
        return None
    pull = np.abs(result.row_multipliers[problem.base.m :])
    where = int(np.argmax(pull))
    return Relaxation(float(result.x[-1] * problem.row_sign[where]), problem.places[where], result.x[:-1])
