"""Settings of the solver."""

from __future__ import annotations

from typing import Any

from stc.arguments import number, whole
from stc.errors import UsageError
from stc.records import dataclass

__all__ = ["Options", "check_tolerance", "given_options"]

#: Rounding alone leaves larger errors in all but the smallest problems: nothing below can be told from zero.
SMALLEST_TOLERANCE = 1e-14


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
        retries: how many other ways (feasibility first, the least violation from here and there, starts nearby and
            elsewhere, limits that are wide at first, a cautious barrier) are tried before a failure or local
            infeasibility is reported.
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
    retries: int = 9
    seed: int = 0


def check_tolerance(tolerance: float, name: str = "the tolerance") -> None:
    """Refuse a tolerance that no solve can keep, or that every point does.

    Args:
        tolerance: of the optimality conditions.
        name: what the message calls it.

    Raises:
        UsageError: it is not between 1e-14 and 1.
    """
    if not SMALLEST_TOLERANCE <= tolerance < 1:
        hint = "numbers have 16 digits: smaller errors are those of rounding" if 0 < tolerance < 1 else ""
        raise UsageError(f"{name} must lie between {SMALLEST_TOLERANCE:g} and 1, not {tolerance:g}", hint)


def given_options(
    tolerance: float | None = None, max_iterations: int | None = None, time_limit: float | None = None
) -> Options:
    """The options with what is given, the defaults elsewhere.

    Args:
        tolerance, max_iterations, time_limit: as in :class:`Options`; None is not given.

    Raises:
        UsageError: a value that cannot be meant.
    """
    given: dict[str, Any] = {}
    if tolerance is not None:
        given["tolerance"] = number(tolerance, "the tolerance")
        check_tolerance(given["tolerance"])
    if max_iterations is not None:
        given["max_iterations"] = most = whole(max_iterations, "max_iterations")
        if most < 0:
            raise UsageError(f"max_iterations must be at least 0, not {max_iterations}")
    if time_limit is not None:
        given["time_limit"] = number(time_limit, "the time limit")
        if not given["time_limit"] > 0:
            raise UsageError(f"the time limit must be a positive number of seconds, not {time_limit:g}")
    return Options(**given)
