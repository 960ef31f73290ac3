"""Feasibility restoration: leave the objective aside until the rows are nearly met.

The elastic form stays near the point where the search got stuck.  It ends at a point that the
filter accepts, or at a minimum of the violation, which certifies local infeasibility when the violation there
is not zero: ``J^T y + z = 0`` with ``|y| <= 1`` and ``y`` of the sign of each violated row.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stc.records import dataclass
from stc.solver.constants import ACCURATE, LARGEST_MULTIPLIER
from stc.solver.convexity import is_convex
from stc.solver.elastic import ElasticProblem
from stc.solver.form_cache import once
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.nlp import Floats
from stc.solver.outcome import ACCEPTABLE, PROGRESS, End, Outcome
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.starting import least_squares_multipliers
from stc.solver.workspace import Filter, workspace_of

__all__ = ["Acceptance", "barrier_value", "elastic_of", "meet_rows", "returned"]

RHO = 1e3
"""What a unit of violation costs beside nearness to where restoration begins, which that is divided by here."""


def barrier_value(f: float, gap: Floats, mu: float) -> float:
    """``f - mu * sum(log(gap))``."""
    return f - mu * float(np.log(gap).sum()) if gap.size else f


@dataclass(frozen=True, slots=True)
class Acceptance:
    """Decides when restoration may end: the violation fell and the filter accepts the point."""

    elastic: ElasticProblem
    filter: Filter
    theta: float
    mu: float

    def __call__(self, form: Formulation, it: Iterate) -> bool:
        base = self.elastic.base
        own, p, q = self.elastic.split(it.w[: self.elastic.n])
        c = it.c + p - q
        if base.any_ignored:
            c[base.ignored] = 0.0
        theta = float(np.abs(c).sum())
        if theta > PROGRESS * self.theta:
            return False
        w = np.concatenate([own, it.w[self.elastic.n :]])
        f, _ = base.values(own)
        gap = base.gap(w)
        if not np.isfinite(f) or (gap.size and gap.min() <= 0.0):
            return False
        return self.filter.accepts(theta, barrier_value(f, gap, self.mu))


def meet_rows(
    form: ScaledProblem, it: Iterate, mu: float, tolerance: float, solve: Callable[..., Outcome]
) -> tuple[End | None, Outcome]:
    """Move the iterate ``it`` to a point that satisfies the rows, or violates them least nearby, without regard to the
    objective.

    Args:
        mu: the barrier parameter, which says how much it counts to stay near ``it``.
        tolerance: the violation that counts as none.
        solve: solves an :class:`ElasticProblem` from an iterate with a barrier parameter.

    Returns:
        Why to stop there, or None; and the elastic problem's own outcome.
    """
    claim: Iterate | None = None
    while True:
        elastic = elastic_of(form)
        elastic.stay_near(it.w[: form.n], float(np.sqrt(max(mu, 1e-8))) / RHO)
        barrier = max(mu, float(np.abs(it.c).max(initial=0.0))) / RHO
        outcome = solve(elastic, elastic.start(it.w, np.zeros(form.m), it.z, barrier), barrier)
        end = returned(form, it, elastic, outcome, tolerance)
        if claim is not None and it.theta > PROGRESS * claim.theta:
            it.become(claim)
            # Where the search from there got lost, nothing has confirmed the claim.
            return End.STATIONARY_VIOLATION if end is End.STATIONARY_VIOLATION else End.STUCK, outcome
        if end is not End.STATIONARY_VIOLATION or not elastic.is_held(it.w[: form.n], ACCURATE * tolerance):
            return end, outcome
        if not once(is_convex, form.nlp):  # of such rows a stationary violation says little anyway
            return end, outcome
        # It stays near where it began, which may be all that keeps it there.
        claim, mu = it.snapshot(), 0.0


def returned(
    form: ScaledProblem, it: Iterate, elastic: ElasticProblem, outcome: Outcome, tolerance: float
) -> End | None:
    """Move ``it``, the form's workspace's, to where an elastic problem ended; why to stop there, or None."""
    there = outcome.iterate
    assert there is not None
    n = form.n
    w, z = np.concatenate([there.w[:n], there.w[elastic.n :]]), there.z[elastic.own_gaps]
    if z.max(initial=0.0) > LARGEST_MULTIPLIER:
        z = np.ones_like(z)
    work, before = workspace_of(form), it.snapshot()
    restored = work.evaluate(w, np.zeros(form.m), z)
    if not np.isfinite(restored.theta + restored.f + restored.dual.sum()):
        work.load(before)
        return End.STUCK
    end: End | None = None
    minimal = outcome.end is End.CONVERGED or outcome.error <= ACCEPTABLE
    if outcome.end is not End.STOPPED and minimal:
        if form.violation(w[:n], restored.r) > tolerance:
            end = End.STATIONARY_VIOLATION
    work.evaluate(w, outcome.y / elastic.price if end else least_squares_multipliers(work), z)
    return end


def elastic_of(base: ScaledProblem) -> ElasticProblem:
    """The elastic form of a problem, for one restoration at a time."""
    return base.keep(ElasticProblem)
