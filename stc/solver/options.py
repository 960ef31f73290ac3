"""Settings of the solver."""

from __future__ import annotations

from stc.records import dataclass

__all__ = ["Options"]


@dataclass(frozen=True, slots=True)
class Options:
    """Settings of :func:`stc.solver.minimize`; the defaults suit well-posed problems of any size.

    Attributes:
        tolerance: largest KKT error of the scaled problem that counts as solved.
        feasibility_tolerance: largest violation of a row or bound, in the user's own units and relative to
            ``max(1, |bound|)``, that counts as satisfied.
        unscaled_tolerance: largest relative KKT error of the problem as stated that counts as solved.
        max_iterations: limit on the iterations of all phases together.
        time_limit: limit in seconds of wall-clock time.
        scaling: scale objective, rows and badly scaled variables automatically.
        presolve: leave out what bounds and linear equations determine.
        warm_start: start from the primal-dual start and its active set.
        trusting: no effort is spared to keep to the active set of a warm start; otherwise, as from another number of
            frames, only its variables are started from where the active set does not lead to a solution at once.
        initial_barrier: barrier parameter of a cold start.
        retries: how many other ways (feasibility first, limits that are wide at first, a cautious barrier, starts
            nearby and elsewhere) are tried before a failure or local infeasibility is reported.
        seed: seed of the random directions used to leave saddle points and stationary infeasible points.
    """

    tolerance: float = 1e-8
    feasibility_tolerance: float = 1e-6
    unscaled_tolerance: float = 1e-6
    max_iterations: int = 3000
    time_limit: float = float("inf")
    scaling: bool = True
    presolve: bool = True
    warm_start: bool = False
    trusting: bool = True
    initial_barrier: float = 0.1
    retries: int = 5
    seed: int = 0
