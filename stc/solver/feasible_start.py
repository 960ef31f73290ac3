"""Feasible points to begin with: the objective is left aside until the rows are met."""

from __future__ import annotations

import numpy as np

from stc.solver.constants import SMALL_VIOLATION
from stc.solver.interior import optimise
from stc.solver.monitor import Monitor
from stc.solver.nlp import Floats
from stc.solver.options import Options
from stc.solver.outcome import BUDGET, End, Outcome, Tactics
from stc.solver.restoration import elastic_of, returned
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.starting import cold_iterate

__all__ = ["least_violation"]


def least_violation(
    form: ScaledProblem, x: Floats, options: Options, monitor: Monitor
) -> tuple[End | None, Outcome]:
    """Minimise the sum of the violations from ``x`` (n,), without a limit of the distance.

    A restoration keeps near where it begins and close to the bounds that hold there; this begins far inside of them.

    Returns:
        None where the rows are met, at least nearly, else why to stop there; and the outcome, in terms of ``form``.

    Raises:
        Stopped: at a limit or on the user's request.
    """
    it = cold_iterate(form, x / form.x_scale, by_gaps=False)
    elastic = elastic_of(form)
    elastic.stay_near(it.w[: form.n], 0.0)
    mu = max(options.initial_barrier, float(np.abs(it.c).max(initial=0.0)))
    start = elastic.start(it.w, np.zeros(form.m), it.z, mu)
    outcome = optimise(elastic, start, mu, options, monitor, tactics=Tactics(budget=BUDGET))
    end = returned(form, it, elastic, outcome, options.feasibility_tolerance)
    own = it.w[: form.n].copy()
    if (
        end is None and form.violation(own, it.r) > SMALL_VIOLATION
    ):  # which a search with the objective does not meet
        end = End.STUCK
    return end, Outcome(end or End.CONVERGED, form, own, it.y.copy(), outcome.error, it)
