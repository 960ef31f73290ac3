"""A start between limits that seem to leave nothing: they are set wide, and narrowed again.

Where rows are not convex, a violation that is stationary says nothing of points elsewhere.  A solution between wider
limits meets all equations, as it must, and may be far from there; limits at half the distance that it lacks of what was
asked for lead to the next one, and so on (continuation: E. L. Allgower and K. Georg, Numerical Continuation Methods,
1990).  The objective goes along, which keeps motions simple.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stc.solver.evaluator import Evaluator, Scaling, evaluator_of
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.report import Callback, IterationRecord, Start
from stc.solver.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from stc.solver.kkt import KKTSystem

__all__ = ["Widened", "narrowed_start"]

NARROWER = 0.5
"""Share of what a solution lacks of the limits that the next ones leave to it."""
CLOSE = 0.005
"""The same, from which on the limits as stated may do."""
ITERATIONS, FIRST_ITERATIONS = 150, 300
"""Of one of the solves, and of the first."""
NARROWEST = 1e-3
"""Limits are widened as if they were at least so far apart."""


class Widened:
    """A program whose limits may be set wider: :class:`stc.solver.nlp.NLP`.  Equations and fixed variables stay."""

    def __init__(self, nlp: NLP) -> None:
        self.nlp = nlp
        self.n, self.m, self.x0 = nlp.n, nlp.m, nlp.x0
        self.jac_rows, self.jac_cols = nlp.jac_rows, nlp.jac_cols
        self.hess_rows, self.hess_cols = nlp.hess_rows, nlp.hess_cols
        self.var_stage, self.row_stage = nlp.var_stage, nlp.row_stage
        self.row_linear, self.objective_degree = nlp.row_linear, nlp.objective_degree
        self.fixed_curvature = nlp.fixed_curvature
        self._x_unit, self._row_unit = _units(nlp.x_lower, nlp.x_upper), _units(nlp.row_lower, nlp.row_upper)
        self.widen(0.0)

    def widen(self, by: float) -> None:
        """Set the limits ``by`` times as far apart as they are farther out on either side."""
        nlp = self.nlp
        self.x_lower, self.x_upper = nlp.x_lower - by * self._x_unit, nlp.x_upper + by * self._x_unit
        self.row_lower, self.row_upper = (
            nlp.row_lower - by * self._row_unit,
            nlp.row_upper + by * self._row_unit,
        )

    def lacking(self, x: Floats) -> float:
        """How much wider the limits have to be for ``x`` (n,), if it meets all equations."""
        nlp = self.nlp
        lacks = (
            np.maximum(lower - value, value - upper)[unit > 0.0] / unit[unit > 0.0]
            for value, lower, upper, unit in (
                (x, nlp.x_lower, nlp.x_upper, self._x_unit),
                (nlp.values(x)[1], nlp.row_lower, nlp.row_upper, self._row_unit),
            )
        )
        return max(float(lack.max(initial=0.0)) for lack in lacks)

    def values(self, x: Floats) -> tuple[float, Floats]:
        """See :class:`NLP`."""
        return self.nlp.values(x)

    def derivatives(
        self, x: Floats, multipliers: Floats, objective_factor: float
    ) -> tuple[Floats, Floats, Floats]:
        """See :class:`NLP`."""
        return self.nlp.derivatives(x, multipliers, objective_factor)

    def evaluator(self, scaling: Scaling) -> Evaluator:
        """See :class:`stc.solver.evaluator.Evaluable`."""
        return evaluator_of(self.nlp, scaling)


def _units(lower: Floats, upper: Floats) -> Floats:
    """What limits are widened in: their distance, or their magnitude where there is one; 0 where they are equal."""
    apart = upper - lower
    magnitudes = np.maximum(*(np.where(np.isfinite(side), np.abs(side), 1.0) for side in (lower, upper)))
    units = np.maximum(np.where(np.isfinite(apart), apart, np.maximum(1.0, magnitudes)), NARROWEST)
    return np.where(lower == upper, 0.0, units)


def narrowed_start(
    nlp: NLP,
    x: Floats,
    widest: float,
    limits: Options,
    new_kkt: Callable[..., KKTSystem],
    callback: Callback | None = None,
) -> tuple[Floats | None, int]:
    """A point that meets all equations and is nearly between the limits.

    Args:
        x: where to start, (n,).
        widest: how much wider the limits are at first, in distances between them.
        limits: has those on iterations and time, and all other settings.
        new_kkt, callback: see :func:`stc.solver.minimize`; iterations are counted on from one solve to the next.

    Returns:
        The point, (n,), or None where the way to it ended; and the iterations it took.

    Raises:
        KeyboardInterrupt: a solve was interrupted, by Ctrl-C or by ``callback``.
    """
    from stc.solver.sqp import minimize

    wide = Widened(nlp)
    spent, most, wider = 0, FIRST_ITERATIONS, widest

    def told(record: IterationRecord) -> bool | None:
        assert callback is not None
        return callback(replace(record, iteration=spent + record.iteration, phase="narrowing"))

    while wider > NARROWER * CLOSE:
        wide.widen(wider)
        options = replace(
            limits,
            max_iterations=min(most, limits.max_iterations - spent),
            retries=0,
            warm_start=False,
            presolve=False,
        )
        result = minimize(wide, options, None if callback is None else told, Start(x), new_kkt)
        spent += result.iterations
        if result.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if result.status is not Status.OPTIMAL:
            return None, spent
        x, most = result.x, ITERATIONS
        wider = NARROWER * min(wider, wide.lacking(x))
    return x, spent
