"""Programs with complementary pairs, solved by an exact penalty whose weight grows.

Each pass solves the program with the products ``a*b`` in the objective (:mod:`stc.solver.penalised`).  Where they
are not nothing at the solution, the weight was too small, and the next pass begins there with a larger one (S. Leyffer,
G. Lopez-Calva and J. Nocedal, 2006, algorithm 1 with the subproblems solved).  A solution is one of the program as
stated, with the weight as the products' multiplier: such points are strongly stationary (R. Fletcher and S. Leyffer,
Solving mathematical programs with complementarity constraints as nonlinear programs, Optim. Methods Softw. 19, 2004).
Where a pass is not solved, the products are rows instead, which allow less and less (S. Scholtes, Convergence
properties of a regularization scheme, SIAM J. Optim. 11, 2001).  Where multipliers grow without limit, no weight is
large enough; there the smaller side of each pair is held at nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from stc.arrays import scattered
from stc.records import dataclass, field
from stc.solver.active_set import NEAR
from stc.solver.convexity import is_convex
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.outcome import ACCEPTABLE, BUDGET
from stc.solver.pairs import Pairs
from stc.solver.penalised import Penalised
from stc.solver.products import between
from stc.solver.report import Callback, IterationRecord, Result, Start
from stc.solver.residuals import assess
from stc.solver.scaled_problem import NEARBY
from stc.solver.status import UNPAIRED, Status

__all__ = ["by_penalty"]

FIRST_WEIGHT, GROWTH = 100.0, 10.0
"""The penalty's gradient, as a multiple of the objective's near the start, and how the weight grows."""

Solve = Callable[[NLP, Options, Callback | None, Start], Result]


def by_penalty(
    nlp: NLP, pairs: Pairs, options: Options, callback: Callback | None, start: Start, solve: Solve
) -> Result:
    """Solve a program with complementary pairs.

    Args:
        solve: solves a program without.
    """
    solves = _PenaltySolves(nlp, pairs, options, callback, solve)
    weight = _first_weight(nlp, pairs, start)
    convex = is_convex(Penalised(nlp, pairs, 1.0))
    best: Result | None = None
    rounds = [
        (_weighted(solves, weight, start), convex),
        (_weighted(solves, FIRST_WEIGHT * weight, start), convex),
    ]
    if options.retries:
        rounds.insert(1, (_relaxed(solves, start), False))
    for results, proves in rounds:
        for result in results:
            best = result if best is None or solves.is_better(result, best) else best
            if solves.ends(result) or (result.status is Status.INFEASIBLE and proves):
                return solves.of_all(result)  # infeasible whatever the products
        assert best is not None
        if max(solves.missing(best), best.violation) <= NEAR:
            held = solves.held(best)
            if solves.ends(held):
                return solves.of_all(held)
    assert best is not None
    if best.success:
        message = UNPAIRED.format(solves.missing(best))
        best = replace(best, status=Status.FAILED, message=message)
    return solves.of_all(best)


def _weighted(solves: _PenaltySolves, weight: float, start: Start) -> Iterator[Result]:
    """The results of solves with growing weights, each from the result of the one before."""
    last = weight / ACCEPTABLE
    while weight <= last:
        result = solves.penalised(weight, start)
        yield result
        if not result.success:
            return  # it is not for want of weight
        start = Start(result.x)
        weight *= GROWTH


def _relaxed(solves: _PenaltySolves, start: Start) -> Iterator[Result]:
    """The results of solves whose products may be as large as a constant that goes down, each from the one before."""
    room = 1.0
    while room >= ACCEPTABLE:
        result = solves.penalised(0.0, start, room)
        yield result
        if result.success or result.status is Status.ITERATION_LIMIT:
            start = Start(result.x)
        room /= GROWTH


@dataclass(slots=True)
class _PenaltySolves:
    """Data that all solves share, and the sums of their iterations and times."""

    nlp: NLP
    pairs: Pairs
    options: Options
    callback: Callback | None
    solve: Solve
    iterations: int = 0
    factorizations: int = 0
    history: list[IterationRecord] = field(default_factory=list)

    def penalised(self, weight: float, start: Start, room: float | None = None) -> Result:
        """One pass, with a weight or with rows that allow so much."""
        program = Penalised(self.nlp, self.pairs, weight, room)
        passed = self._solved(program, program.start(start))
        return self._as_of(passed, program.all_multipliers(passed.row_multipliers))

    def held(self, result: Result) -> Result:
        """Solve from a point where pairs are nearly complementary, with the smaller side of each pair fixed at zero."""
        nlp, pairs = self.nlp, self.pairs
        spare = pairs.spare(nlp, result.x, nlp.values(result.x)[1])
        which = spare.argmin(axis=1)
        every = np.arange(len(pairs))
        place, sign = pairs.side[every, which], np.where(pairs.lower[every, which], 1.0, -1.0)
        program = Penalised(nlp, pairs, 0.0)
        program.hold(place, pairs.limits(nlp)[every, which])
        passed = self._solved(program, Start(result.x))
        y = program.all_multipliers(passed.row_multipliers)
        # What holds a side may push either way; where it pulls, the product's multiplier has to.
        other = pairs.spare(nlp, passed.x, nlp.values(passed.x)[1])[every, 1 - which]
        pull = sign * np.concatenate([passed.bound_multipliers, y])[place]
        y[pairs.product] = np.maximum(0.0, pull) / np.maximum(other, ACCEPTABLE)
        of_rows = place >= nlp.n
        rows = place[of_rows] - nlp.n
        np.subtract.at(y, rows, (sign * y[pairs.product] * other)[of_rows])
        return self._as_of(passed, y)

    def ends(self, result: Result) -> bool:
        """Whether a result says all there is to say, or nothing more may be tried."""
        if result.status in (Status.TIME_LIMIT, Status.INTERRUPTED):
            return True
        if self.iterations >= self.options.max_iterations:
            return True
        return result.success and self.missing(result) <= ACCEPTABLE

    def is_better(self, one: Result, other: Result) -> bool:
        """Whether a result is nearer to a solution."""
        return (one.violation, self.missing(one)) < (other.violation, self.missing(other))

    def missing(self, result: Result) -> float:
        """The largest of the smaller sides, relative to ``max(1, larger side)``."""
        return self.pairs.residual(self.nlp, result.x)

    def of_all(self, result: Result) -> Result:
        """A result with what all solves have taken."""
        return replace(
            result, iterations=self.iterations, factorizations=self.factorizations, history=self.history
        )

    def _solved(self, program: Penalised, start: Start) -> Result:
        options, before = self.options, self.iterations
        left = min(BUDGET, options.max_iterations - before)
        warm = options.warm_start and start.row_multipliers is not None
        limits = replace(options, max_iterations=left, retries=0, warm_start=warm)
        passed = self.solve(program, limits, _told(self.callback, before), start)
        self.history += [replace(record, iteration=record.iteration + before) for record in passed.history]
        self.iterations += passed.iterations
        self.factorizations += passed.factorizations
        return passed

    def _as_of(self, passed: Result, y: Floats) -> Result:
        """A result of a penalised program as one of the program itself, with multipliers ``y`` (m,) of its rows."""
        judged = assess(self.nlp, passed.x, y)
        return replace(
            passed,
            row_multipliers=y,
            bound_multipliers=judged.bound_multipliers,
            objective=judged.objective,
            violation=judged.violation,
            optimality=judged.optimality,
        )


def _first_weight(nlp: NLP, pairs: Pairs, start: Start) -> float:
    """The first weight of the penalty.

    That is the largest multiplier of a product in an earlier solution. Without one, it is the weight for which the
    gradients of penalty and objective are equally large a little way off the start, where neither is flat by chance.
    """
    if start.row_multipliers is not None:
        known = float(np.abs(start.row_multipliers[pairs.product]).max(initial=0.0))
        if known > 0.0:
            return known
    size = np.maximum(1.0, np.abs(start.x))
    x = between(start.x + NEARBY * size * scattered(nlp.n), nlp.x_lower, nlp.x_upper)
    gradient, jac, _ = nlp.derivatives(x, np.zeros(nlp.m), 0.0)
    free = nlp.x_lower < nlp.x_upper
    of_product = np.zeros(nlp.m, bool)
    of_product[pairs.product] = True
    entries = of_product[nlp.jac_rows] & free[nlp.jac_cols]
    slope = float(np.abs(gradient[free] * size[free]).max(initial=0.0))
    products = float(np.abs(jac[entries] * size[nlp.jac_cols[entries]]).max(initial=0.0))
    weight = FIRST_WEIGHT * slope / products if slope > 0.0 and products > 0.0 else 1.0
    return weight if np.isfinite(weight) else 1.0


def _told(callback: Callback | None, before: int) -> Callback | None:
    """A callback that counts the iterations of earlier solves."""
    if callback is None:
        return None
    its = callback
    return lambda record: its(replace(record, iteration=record.iteration + before))
