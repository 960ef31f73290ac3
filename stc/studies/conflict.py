"""A minimal set of statements that contradict each other.

The deletion filter (J. W. Chinneck, Feasibility and Infeasibility in Optimization, 2008) removes one statement after
the other, permanently if the rest is still infeasible.  The remaining set is irreducible: without any one of its
statements the others can hold.  The multipliers of the violation's minimum show beforehand which statements have no
influence, so that few must be tried.  For nonlinear statements "infeasible" means that the solver finds no point from
its starts.

Finally, the result is tested: by how much must each statement be relaxed for the others to hold?  If this finds a point
that satisfies all of them, there is no conflict, and the search continues from that point.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.solver import Options, Start, Status, minimize
from stc.solver.residuals import assess
from stc.studies.feasibility import ElasticProblem, FeasibilityProblem
from stc.studies.relaxation import Relaxation, needed_relaxation
from stc.transcription.bind import BoundProgram
from stc.transcription.ownership import Ownership, limits_of

FloatArray = NDArray[np.float64]

__all__ = ["Conflict", "find_conflict"]

NEGLIGIBLE = 1e-5
CLOSE = 1e-4
QUICK_ITERATIONS, ITERATIONS = 100, 500
REVISIONS = 4
"""Number of sets of statements without a conflict after which the search ends."""
TESTING, SHARES = 1.0, 2
"""Share of the time limit that is added for testing the result; in a set that may not be minimal a statement's test
takes at most one part in ``SHARES`` of what is left.
"""


@dataclass(frozen=True, slots=True)
class Conflict:
    """Statements that contradict each other.

    Attributes:
        relations: indices into ``Problem.relations``, the most influential first; empty if all statements can hold
            together after all.
        minimal: whether each is certainly needed; False if time ran out or a test was inconclusive.
        x: (N,) the point of least violation that the solver found; or a point that satisfies all.
        weights: (M,) multipliers of the rows there.
        solves: number of feasibility problems solved.
        lacks: for each of the relations, its violation if the others hold; None if that was not found.
    """

    relations: tuple[int, ...]
    minimal: bool
    x: FloatArray
    weights: FloatArray
    solves: int
    lacks: tuple[Relaxation | None, ...] = ()


@dataclass(frozen=True, slots=True)
class _Least:
    """The point of least violation of some statements (N,), with the multipliers of the rows (M,)."""

    x: FloatArray
    y: FloatArray


class _Filter:
    """Tests whether statements can hold together, and caches their points of least violation."""

    def __init__(
        self, bound: BoundProgram, ownership: Ownership, starts: list[FloatArray], time_limit: float
    ) -> None:
        self.bound, self.ownership, self.starts = bound, ownership, starts
        self.deadline = time.perf_counter() + time_limit
        self.solves = 0
        self.least: dict[frozenset[int], _Least] = {}
        self.last: list[FloatArray] = []
        self.feasible = bound.x0
        self.met: dict[frozenset[int], FloatArray] = {}

    def infeasible(self, kept: set[int]) -> bool | None:
        """Whether statements contradict each other; None if the solver could not decide."""
        problem = FeasibilityProblem(self.bound, self.ownership, kept)
        if len(problem.crossed):
            return True
        found: _Least | None = None
        starts = [*self.last, *self.starts]
        for start in starts:
            inside = np.clip(start, problem.x_lower, problem.x_upper)
            if self._meets(problem, start) or self._holds(problem, inside):
                self.met[frozenset(kept)] = self.feasible
                return False
        for start in starts:
            least = self._relaxed(problem, np.clip(start, problem.x_lower, problem.x_upper))
            if least is None:
                continue
            if self._meets(problem, least.x):
                self.met[frozenset(kept)] = least.x
                return False
            found = least
            break
        if found is None:
            return None
        self.least[frozenset(kept)], self.last = found, [found.x]
        return True

    def hold(self, kept: set[int], x: FloatArray) -> bool:
        """Whether a point satisfies all of these statements."""
        return self._meets(FeasibilityProblem(self.bound, self.ownership, kept), x)

    def _meets(self, problem: FeasibilityProblem, x: FloatArray) -> bool:
        violation = assess(problem, x, np.zeros(problem.m)).violation
        if violation <= Options().feasibility_tolerance:
            self.feasible = x
            return True
        return False

    def _options(self, iterations: int) -> Options | None:
        left = self.deadline - time.perf_counter()
        if left <= 0.0:
            return None
        self.solves += 1
        return Options(max_iterations=iterations, time_limit=left, retries=0)

    def _holds(self, problem: FeasibilityProblem, x: FloatArray) -> bool:
        """Whether a quick solve from ``x`` satisfies all statements."""
        options = self._options(QUICK_ITERATIONS)
        if options is None or not np.isfinite(problem.values(x)[1]).all():
            return False
        return self._meets(problem, minimize(problem, options, start=Start(x)).x)

    def _relaxed(self, problem: FeasibilityProblem, x: FloatArray) -> _Least | None:
        """The solution of the elastic program from ``x``."""
        options = self._options(ITERATIONS)
        if options is None or not np.isfinite(problem.values(x)[1]).all():
            return None
        elastic = ElasticProblem(problem, x)
        result = minimize(elastic, options, start=Start(elastic.x0))
        if result.status is not Status.OPTIMAL:
            return None
        return _Least(result.x[: problem.n], result.row_multipliers)


def find_conflict(
    bound: BoundProgram,
    ownership: Ownership,
    x: FloatArray,
    row_multipliers: FloatArray,
    time_limit: float = 10.0,
) -> Conflict | None:
    """The statements that cause infeasibility.

    Args:
        bound: the infeasible program.
        ownership: its rows and bounds by statement.
        x: (N,) the final point of a solve.
        row_multipliers: (M,) of that solve: the certificate if it ended infeasible.
        time_limit: seconds for all feasibility problems together; as many more for the final test.

    Returns:
        The conflict, or None if there was no result in time.
    """
    with np.errstate(all="ignore"):
        return _find(bound, ownership, x, row_multipliers, time_limit)


def _find(
    bound: BoundProgram, ownership: Ownership, x: FloatArray, y: FloatArray, time_limit: float
) -> Conflict | None:
    starts = [bound.x0]
    for other in (x, np.zeros(bound.n)):  # at rest in the origin much holds that does not near the guess
        if np.isfinite(other).all() and not any(np.array_equal(other, known) for known in starts):
            starts.append(other)
    search = _Filter(bound, ownership, starts, time_limit)
    deadline = search.deadline + TESTING * time_limit
    for _ in range(REVISIONS):
        found = _filtered(search, x, y)
        decided = found is not None
        if found is None:
            # There was no time to test all statements; there may be enough to find one change that suffices.
            weight = _weights(bound, ownership, x, y)
            ranked = sorted(ownership.relations, key=lambda k: (-weight.get(k, 0.0), k))
            found = Conflict(tuple(ranked), False, x, y, search.solves)
        if not found.relations:
            return found
        found = _tested(search, found, deadline)
        if found.lacks:
            return found if decided or any(found.lacks) else None
        # A point meets them all: from there it has to be another set that fails, or none does.
        search.starts.insert(0, search.feasible)
    return None


def _tested(search: _Filter, found: Conflict, deadline: float) -> Conflict:
    """A conflict with the relaxation that each statement needs; without it if a point satisfies all, which is then
    ``search.feasible``.

    In a set that may not be minimal, no statement is known to matter.  There the question is which statement, changed
    alone, lets all others of the spec hold, and it is asked of those that a user can change.
    """
    relations = set(found.relations)
    order, rest = list(found.relations), relations
    if not found.minimal:
        order = [k for k in sorted(order, key=partial(_kind, search)) if _kind(search, k) < _LAW]
        rest = set(search.ownership.relations)
    lacks: dict[int, Relaxation] = {}
    for k, relation in enumerate(order):
        others = rest - {relation}
        starts = [search.met.get(frozenset(others)) if found.minimal else search.bound.x0, found.x]
        tried = [x for x in starts if x is not None]
        for number, x in enumerate(tried):
            shares = len(order) - k if found.minimal else min(len(order) - k, SHARES)
            left = (deadline - time.perf_counter()) / shares / (len(tried) - number)
            lack = needed_relaxation(search.bound, search.ownership, others, relation, x, left)
            if lack is None:
                continue
            if search.hold(relations, lack.x):
                return found
            known = lacks.setdefault(relation, lack)
            if abs(lack.amount) < abs(known.amount):
                lacks[relation] = lack
    return replace(found, lacks=tuple(lacks.get(relation) for relation in found.relations))


_LIMIT, _FRAME, _LAW = range(3)


def _kind(search: _Filter, relation: int) -> int:
    """Whether a statement is an inequality, an equation of one frame, or one that holds over a time."""
    stated = search.ownership.problem.relations[relation]
    return _LIMIT if not stated.is_equality else _FRAME if stated.range.first == stated.range.last else _LAW


def _filtered(search: _Filter, x: FloatArray, y: FloatArray) -> Conflict | None:
    """The result of the deletion filter."""
    bound, ownership = search.bound, search.ownership
    whole = set(ownership.relations)
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
    needed, certain, minimal = set(candidates), set[int](), True
    while needed - certain:
        weight = _weights_of(search, needed, weight)
        relation = min(needed - certain, key=lambda k: (weight.get(k, 0.0), -k))
        rest = needed - {relation}
        verdict = search.infeasible(rest)
        if verdict is True:
            needed = _without_idle(search, rest, certain)
            continue
        certain.add(relation)
        minimal &= verdict is False
    x, y = _least_violation(search, needed, x)
    weight = _weights(bound, ownership, x, y)
    ranked = sorted(needed, key=lambda k: (-weight.get(k, 0.0), k))
    return Conflict(tuple(ranked), minimal, x, y, search.solves)


def _without_idle(search: _Filter, needed: set[int], certain: set[int]) -> set[int]:
    """The statements without all those that have no influence at the least violation, if these can be removed
    together.
    """
    weight = _weights_of(search, needed, {})
    if not weight:
        return needed
    largest = max(weight.values())
    pulling = certain | {k for k in needed if weight.get(k, 0.0) > NEGLIGIBLE * largest}
    return pulling if len(pulling) < len(needed) - 1 and search.infeasible(pulling) else needed


def _weights_of(search: _Filter, kept: set[int], otherwise: dict[int, float]) -> dict[int, float]:
    """The influence of statements at their least violation, if it is known."""
    least = search.least.get(frozenset(kept))
    return otherwise if least is None else _weights(search.bound, search.ownership, least.x, least.y)


def _least_violation(search: _Filter, needed: set[int], x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The point of least violation of the conflicting statements alone, and the weights of the rows there."""
    key = frozenset(needed)
    if key not in search.least:
        search.infeasible(needed)
    if key in search.least:
        return search.least[key].x, search.least[key].y
    # Bounds that cross, or no time left.
    problem = FeasibilityProblem(search.bound, search.ownership, needed)
    return np.clip(x, problem.x_lower, problem.x_upper), np.zeros(problem.m)


def _weights(bound: BoundProgram, ownership: Ownership, x: FloatArray, y: FloatArray) -> dict[int, float]:
    """The influence of each statement at the minimum of the violation, from multipliers of rows and bounds."""
    weight: dict[int, float] = {}
    if not np.isfinite(x).all() or not np.isfinite(y).all():
        return weight
    _, jac, _ = bound.derivatives(x, np.zeros(bound.m), 0.0)
    size = np.zeros(bound.m)
    np.maximum.at(size, bound.jac_rows, np.abs(jac))
    pull = np.bincount(bound.jac_cols, weights=jac * y[bound.jac_rows], minlength=bound.n)
    weight.update(ownership.largest_by_relation(np.abs(y) * size))
    for entry in ownership.bounds:
        low, high = limits_of(entry)
        here, force = x[entry.position], pull[entry.position]
        close = CLOSE * np.maximum(1.0, np.abs(here))
        active = ((here <= low + close) & (force > 0.0)) | ((here >= high - close) & (force < 0.0))
        held = float(np.abs(force[active]).max(initial=0.0))
        if held > 0.0:
            weight[entry.relation] = max(weight.get(entry.relation, 0.0), held)
    return weight
