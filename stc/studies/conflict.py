"""A minimal set of statements that cannot hold together.

The deletion filter (J. W. Chinneck, Feasibility and Infeasibility in Optimization, 2008): leave one statement
after the other out, for good if the rest is infeasible still.  What remains is irreducible: without any one of
its statements the others can hold.  The multipliers of the violation's minimum tell beforehand which statements
take no part, so that few have to be tried.  For nonlinear statements "infeasible" is what the solver finds
from the starts that it is given, here as everywhere.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stc.solver import NLP, Options, Result, Start, Status, minimize
from stc.transcription.bind import BoundProgram
from stc.transcription.ownership import Ownership

FloatArray = NDArray[np.float64]

__all__ = ["Conflict", "FeasibilityProblem", "find_conflict"]

NEGLIGIBLE = 1e-5
ITERATIONS = 300


class FeasibilityProblem:
    """A nonlinear program without its objective, of the statements kept alone: :class:`stc.solver.nlp.NLP`.

    Rows of statements left out stay in the sparsity, without bounds.
    """

    def __init__(self, bound: BoundProgram, ownership: Ownership, kept: Iterable[int]) -> None:
        self._bound = bound
        kept = set(kept)
        rows = ownership.rows_kept(kept)
        self.left_out = np.flatnonzero(~rows)
        self._entry_left_out = ~rows[bound.jac_rows]
        self.n, self.m = bound.n, bound.m
        self.row_lower = np.where(rows, bound.row_lower, -np.inf)
        self.row_upper = np.where(rows, bound.row_upper, np.inf)
        lower, upper = ownership.bounds_kept(kept, bound.n)
        self.crossed = np.flatnonzero(lower > upper + 1e-9 * np.maximum(1.0, np.abs(lower)))
        self.x_lower, self.x_upper = lower, np.maximum(lower, upper)
        self.x0 = np.clip(bound.x0, self.x_lower, self.x_upper)
        self.jac_rows, self.jac_cols = bound.jac_rows, bound.jac_cols
        self.hess_rows, self.hess_cols = bound.hess_rows, bound.hess_cols
        self.var_stage, self.row_stage = bound.var_stage, bound.row_stage
        self.row_linear = bound.row_linear
        self.objective_degree = 0

    def values(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Zero, and the rows; 0 for those left out, which may have no value here."""
        _, rows = self._bound.values(x)
        rows[self.left_out] = 0.0
        return 0.0, rows

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray, objective_factor: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of the rows kept."""
        y = multipliers.copy()
        y[self.left_out] = 0.0
        _, jac, hess = self._bound.derivatives(x, y, 0.0)
        self.masked(jac)
        if len(self.left_out):
            np.nan_to_num(hess, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
        return np.zeros(self.n), jac, hess

    def masked(self, jac: FloatArray) -> FloatArray:
        """The Jacobian's entries, 0 in rows left out; in place."""
        jac[self._entry_left_out] = 0.0
        return jac


@dataclass(frozen=True, slots=True)
class Conflict:
    """Statements that cannot hold together.

    Attributes:
        relations: indices into ``Problem.relations``; none where all statements can hold together after all.
        minimal: whether it is certain that each is needed; False when time ran out or a test said nothing.
        x: (N,) where they are violated least, as far as the solver can tell; or a point that meets all.
        weights: (M,) multipliers of the rows there: which of them pull, and which way.
        solves: feasibility problems that were solved.
    """

    relations: tuple[int, ...]
    minimal: bool
    x: FloatArray
    weights: FloatArray
    solves: int


class _Filter:
    """The deletion filter with its limits."""

    def __init__(
        self, bound: BoundProgram, ownership: Ownership, starts: list[FloatArray], time_limit: float
    ) -> None:
        self.bound, self.ownership, self.starts = bound, ownership, starts
        self.deadline = time.perf_counter() + time_limit
        self.solves = 0
        self.least: dict[frozenset[int], Result] = {}
        self.feasible = bound.x0

    def infeasible(self, kept: set[int]) -> bool | None:
        """Whether statements cannot hold together; None where the solver could not tell."""
        problem = FeasibilityProblem(self.bound, self.ownership, kept)
        if len(problem.crossed):
            return True
        found: Result | None = None
        for start in self.starts:
            left = self.deadline - time.perf_counter()
            if left <= 0.0:
                return None
            result = self._solved(problem, np.clip(start, problem.x_lower, problem.x_upper), left)
            if result is None:
                continue
            if result.violation <= Options().feasibility_tolerance:
                self.feasible = result.x
                return False
            if result.status is Status.INFEASIBLE and (found is None or result.violation < found.violation):
                found = result
        if found is None:
            return None
        self.least[frozenset(kept)] = found
        return True

    def _solved(self, problem: NLP, start: FloatArray, left: float) -> Result | None:
        self.solves += 1
        _, rows = problem.values(start)
        if not np.isfinite(rows).all():
            return None
        options = Options(max_iterations=ITERATIONS, time_limit=left)
        return minimize(problem, options, start=Start(start))


def find_conflict(
    bound: BoundProgram,
    ownership: Ownership,
    x: FloatArray,
    row_multipliers: FloatArray,
    time_limit: float = 10.0,
) -> Conflict | None:
    """The statements to blame for infeasibility.

    Args:
        bound: the infeasible program.
        ownership: its rows and bounds by statement.
        x: (N,) where a solve ended.
        row_multipliers: (M,) of that solve: the certificate if it ended infeasible.
        time_limit: seconds for all feasibility problems together.

    Returns:
        The conflict, or None where nothing could be told in time.
    """
    with np.errstate(all="ignore"):
        return _find(bound, ownership, x, row_multipliers, time_limit)


def _find(
    bound: BoundProgram, ownership: Ownership, x: FloatArray, y: FloatArray, time_limit: float
) -> Conflict | None:
    whole = set(ownership.relations)
    starts = [bound.x0, x] if np.isfinite(x).all() else [bound.x0]
    search = _Filter(bound, ownership, starts, time_limit)
    weight = _weights(bound, ownership, x, y)
    heavy = {k for k in whole if weight.get(k, 0.0) > NEGLIGIBLE * max(weight.values(), default=0.0) > 0.0}
    candidates = whole
    if heavy and heavy != whole and search.infeasible(heavy):
        candidates = heavy
    else:
        verdict = search.infeasible(whole)
        if verdict is None:
            return None
        if not verdict:
            return Conflict((), True, search.feasible, np.zeros(bound.m), search.solves)
    minimal = True
    needed = set(candidates)
    for relation in sorted(candidates, key=lambda k: (weight.get(k, 0.0), -k)):
        rest = needed - {relation}
        verdict = search.infeasible(rest)
        if verdict is True:
            needed = rest
        elif verdict is None:
            minimal = False
    x, y = _least_violation(search, needed, x)
    return Conflict(tuple(sorted(needed)), minimal, x, y, search.solves)


def _least_violation(search: _Filter, needed: set[int], x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the conflicting statements alone are violated least, and what the rows weigh there."""
    key = frozenset(needed)
    if key not in search.least:
        search.infeasible(needed)
    if key in search.least:
        return search.least[key].x, search.least[key].row_multipliers
    # Bounds that cross, or no time left.
    problem = FeasibilityProblem(search.bound, search.ownership, needed)
    return np.clip(x, problem.x_lower, problem.x_upper), np.zeros(problem.m)


def _weights(bound: BoundProgram, ownership: Ownership, x: FloatArray, y: FloatArray) -> dict[int, float]:
    """How hard each statement pulls at the minimum of the violation; rows by multiplier, bounds by what they hold."""
    weight: dict[int, float] = {}
    if not np.isfinite(x).all() or not np.isfinite(y).all():
        return weight
    _, jac, _ = bound.derivatives(x, np.zeros(bound.m), 0.0)
    size = np.zeros(bound.m)
    np.maximum.at(size, bound.jac_rows, np.abs(jac))
    pull = np.bincount(bound.jac_cols, weights=jac * y[bound.jac_rows], minlength=bound.n)
    weight.update(ownership.largest_by_relation(np.abs(y) * size))
    for entry in ownership.bounds:
        held = float(np.abs(pull[entry.position]).max(initial=0.0))
        if held > 0.0:
            weight[entry.relation] = max(weight.get(entry.relation, 0.0), held)
    return weight
