"""Recognises objectives that decrease without limit."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.nlp import Floats
from stc.solver.outcome import ACCEPTABLE, SHORT_BUDGET
from stc.solver.products import ROUGHLY, term_sums
from stc.solver.report import IterationRecord
from stc.solver.scaled_problem import WEAK, ScaledProblem

__all__ = ["LOW", "falling_to", "is_unbounded"]

FAR = 1e7
TOO_FAR = 1e20
LOW = -TOO_FAR
"""An objective below any sensible value."""
RAY = 10.0
"""How many times farther a point is tried, and farther again."""


def is_unbounded(form: Formulation, it: Iterate, farthest: float) -> bool:
    """True when the objective is below any sensible value, or keeps falling along the ray through a far iterate.

    Both the iterate and the points tried on the ray have to be feasible, relative to the size of the terms in
    each row.

    Args:
        farthest: the size of the largest variable or row.
    """
    if not isinstance(form, ScaledProblem):
        return False
    if it.f > -1.0 or not (farthest > FAR or it.f < LOW):
        return False
    x = it.w[: form.n]
    size = float(np.abs(x).max(initial=0.0))
    if not (size > FAR or it.f < LOW):  # a row alone is large that has no limit on that side
        return False
    if not _feasible(form, x, it.r):
        return False
    # Small variables may have to stay; or they may belong to what grows, as the first frames of a motion do.
    large = np.where(np.abs(x) > WEAK * size, x, 0.0)
    return _falls(form, it, large) or _falls(form, it, x.copy())


def _falls(form: ScaledProblem, it: Iterate, direction: Floats) -> bool:
    """Whether the objective keeps falling along a ray of feasible points from a far iterate."""
    x, last = it.w[: form.n], it.f
    for factor in (RAY, RAY**2, RAY**3):
        beyond = x + (factor - 1.0) * direction
        f, r = form.values(beyond)
        if not np.isfinite(f) or f > last - 0.5 * abs(last) or not _feasible(form, beyond, r):
            return False
        last = f
    return True


def _feasible(form: ScaledProblem, x: Floats, r: Floats) -> bool:
    _, jac, _ = form.derivatives(x, np.zeros(form.m))
    size = term_sums(form.jac_rows, form.jac_cols, jac, x, form.m)
    lower, upper = form.true_rows
    off = np.maximum(np.maximum(lower - r, r - upper), 0.0)
    x_lower, x_upper = form.true_x
    off_x = np.maximum(np.maximum(x_lower - x, x - x_upper), 0.0)
    return bool(
        np.all(off <= ACCEPTABLE + ROUGHLY * size) and np.all(off_x <= ACCEPTABLE + ROUGHLY * np.abs(x))
    )


def falling_to(history: Sequence[IterationRecord]) -> float | None:
    """The last objective of an attempt in which it went on falling; None if there was no such attempt.

    This does not prove that the program is unbounded, but it helps to explain a solve that reached a limit.
    """
    starts = [k for k, record in enumerate(history) if record.step_length == 0.0 and record.step == 0.0]
    lowest: float | None = None
    for begin, end in itertools.pairwise([*starts, len(history)]):
        if end - begin < SHORT_BUDGET or history[begin].phase != "barrier":
            continue
        f = [history[k].objective for k in np.linspace(begin, end - 1, 5).astype(int)]
        fall = f[0] - f[-1]
        steadily = all(later < before for before, later in itertools.pairwise(f))
        if fall > RAY * max(1.0, abs(f[0])) and steadily:
            lowest = f[-1] if lowest is None else min(lowest, f[-1])
    return lowest
