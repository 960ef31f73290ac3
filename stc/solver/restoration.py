"""Feasibility restoration: leave the objective aside until the rows are nearly met.

The elastic form with weight 0 stays near the point where the search got stuck.  It ends at a point that the
filter accepts, or at a minimum of the violation, which certifies local infeasibility when the violation there
is not zero: ``J^T y + z = 0`` with ``|y| <= 1`` and ``y`` of the sign of each violated row.
"""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.elastic import ElasticProblem
from stc.solver.formulation import Formulation
from stc.solver.globalization import Filter, barrier_value
from stc.solver.iterate import Iterate
from stc.solver.nlp import Floats
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["PRICE", "Acceptance", "back_from", "elastic_start"]

PRICE = 1.0
BARRIER_FRACTION = 1e-3
PROXIMITY = 1e-3
PROGRESS = 0.9
LARGEST_MULTIPLIER = 1e3


@dataclass(frozen=True, slots=True)
class Acceptance:
    """Tells when restoration may end: the violation fell and the filter accepts the point."""

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


def elastic_start(base: ScaledProblem, it: Iterate, mu: float) -> tuple[ElasticProblem, Iterate, float]:
    """The restoration problem at an iterate, its own first iterate and its barrier parameter."""
    elastic = ElasticProblem(
        base,
        price=PRICE,
        weight=0.0,
        reference=it.w[: base.n].copy(),
        proximity=PROXIMITY * np.sqrt(max(mu, 1e-8)),
    )
    barrier = BARRIER_FRACTION * max(mu, float(np.abs(it.c).max(initial=0.0)))
    return elastic, elastic.start(it.w, np.zeros(base.m), it.z, barrier), barrier


def back_from(elastic: ElasticProblem, it: Iterate) -> tuple[Floats, Floats]:
    """The problem's own point ``w`` and gap multipliers after restoration."""
    n = elastic.base.n
    w = np.concatenate([it.w[:n], it.w[elastic.n :]])
    own = ~((elastic.index >= n) & (elastic.index < elastic.n))
    z = it.z[own]
    if z.max(initial=0.0) > LARGEST_MULTIPLIER:
        z = np.ones_like(z)
    return w, z
