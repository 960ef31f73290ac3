"""Finds the variables and rows that bounds and linear equations determine, and removes them before the solve.

A foot that stands still has coordinates, velocities and accelerations at every frame, and as many equations that join
them: with the first frame and all accelerations given, each equation in turn has one unknown left and says what it is.
Such variables, those that bounds fix, and the rows that have none but these keep a solver busy for nothing
(E. D. Andersen and K. D. Andersen, Presolving in linear programming, Math. Program. 71, 1995: singleton rows).
The multipliers of the equations that were used follow from the solution in the opposite order.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.core.structures import Structure, structure
from stc.records import dataclass, field
from stc.solver.convexity import Bending
from stc.solver.evaluator import Evaluator, Part, PartlyEvaluable, Scaling, python_evaluator
from stc.solver.form_cache import Keeper, once
from stc.solver.kkt.couplings import sort_by_key
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.pairs import Complementary, Pairs
from stc.solver.report import Callback, IterationRecord, Result, Start
from stc.solver.residuals import assess, holds
from stc.solver.scaled_problem import RELAXATION, relative_violation
from stc.solver.status import Status

__all__ = ["Determined", "Reduced", "determined_by", "presolved"]


@dataclass(slots=True)
class Determined:
    """The parts of a program that are known before it is solved.

    Attributes:
        part: what is left, with the values of what is known.
        equations: those that were used (``determined`` in ``presolve.h``).
        keeper: for the program that is left.
        stated: its evaluator, see :class:`stc.solver.evaluator.Stated`.
    """

    part: Part
    equations: Structure
    keeper: Keeper = field(default_factory=Keeper)
    stated: Evaluator | None = None


class Reduced:
    """A program without what is known of it: :class:`stc.solver.nlp.NLP`."""

    def __init__(self, nlp: NLP, known: Determined) -> None:
        self.whole, self.known = nlp, known
        part = known.part
        self.keeper = known.keeper
        cols, rows = part.cols, part.rows
        self.n, self.m = cols.size, rows.size
        self.x0 = np.asarray(nlp.x0, float)[cols]
        self.x_lower, self.x_upper = nlp.x_lower[cols], nlp.x_upper[cols]
        self.row_lower, self.row_upper = nlp.row_lower[rows], nlp.row_upper[rows]
        self.jac_rows, self.jac_cols = part.jac_rows, part.jac_cols
        self.hess_rows, self.hess_cols = part.hess_rows, part.hess_cols
        self.var_stage, self.row_stage = nlp.var_stage[cols], nlp.row_stage[rows]
        self.row_linear, self.objective_degree = nlp.row_linear[rows], nlp.objective_degree
        self.fixed_curvature = nlp.fixed_curvature[cols]
        self.pairs = _pairs_left(nlp, part)
        self._x, self._y = part.x.copy(), np.zeros(nlp.m)

    def all_variables(self, x: Floats) -> Floats:
        """The whole program's variables, (n,), in an array that the next call overwrites."""
        self._x[self.known.part.cols] = x
        return self._x

    def all_multipliers(self, y: Floats) -> Floats:
        """The multipliers of all rows of the program, (m,), 0 for removed ones, in an array that the next call
        overwrites."""
        self._y[self.known.part.rows] = y
        return self._y

    def values(self, x: Floats) -> tuple[float, Floats]:
        """See :class:`NLP`."""
        f, r = self.whole.values(self.all_variables(x))
        return f, r[self.known.part.rows]

    def derivatives(
        self, x: Floats, multipliers: Floats, objective_factor: float
    ) -> tuple[Floats, Floats, Floats]:
        """See :class:`NLP`."""
        part = self.known.part
        gradient, jac, hess = self.whole.derivatives(
            self.all_variables(x), self.all_multipliers(multipliers), objective_factor
        )
        return gradient[part.cols], jac[part.jac], hess[part.hess]

    def row_bends(self) -> NDArray[np.int8]:
        """See :class:`stc.solver.convexity.Bending`; a function of fewer variables bends no other way."""
        if not isinstance(self.whole, Bending):
            return np.zeros(self.m, np.int8)
        return self.whole.row_bends()[self.known.part.rows]

    def evaluator(self, scaling: Scaling) -> Evaluator:
        """See :class:`stc.solver.evaluator.Evaluable`."""
        if isinstance(self.whole, PartlyEvaluable):
            return self.whole.part_evaluator(scaling, self.known.part)
        return python_evaluator(self, scaling)

    def as_stated(self) -> Evaluator:
        """See :class:`stc.solver.evaluator.Stated`."""
        if self.known.stated is None:
            self.known.stated = self.evaluator(Scaling.none(self.n, self.m))
        return self.known.stated

    def start(self, start: Start) -> Start:
        """A start of the whole program, as it concerns this one."""
        part, x = self.known.part, np.asarray(start.x, float)
        y, z = start.row_multipliers, start.bound_multipliers
        return Start(x[part.cols], y if y is None else y[part.rows], z if z is None else z[part.cols])

    def callback(self, callback: Callback | None) -> Callback | None:
        """A callback for this program that passes the iterates of the whole program to ``callback``."""
        if callback is None:
            return None
        its = callback

        def told(record: IterationRecord) -> bool | None:
            x = None if record.x is None else self.all_variables(record.x)
            return its(replace(record, x=x))

        return told

    def restored(self, result: Result, options: Options) -> Result | None:
        """A result of this program extended to the whole program and assessed there.

        None if an optimal result is not optimal for the whole program.
        """
        weight = 0.0 if result.status is Status.INFEASIBLE else 1.0
        x, y = self._whole_point(result, weight)
        judged = assess(self.whole, x, y)
        if result.status is Status.OPTIMAL and not holds(self.whole, x, judged, options):
            return None
        return replace(
            result,
            x=x,
            row_multipliers=y,
            bound_multipliers=judged.bound_multipliers,
            objective=judged.objective,
            violation=judged.violation,
            optimality=judged.optimality,
        )

    def _whole_point(self, result: Result, weight: float) -> tuple[Floats, Floats]:
        """Variables (n,) and row multipliers (m,) of the whole program, for a result of this one.

        Args:
            weight: of the objective in what the multipliers balance: 0 where they show that nothing is feasible.
        """
        whole = self.whole
        x, y = self.all_variables(result.x).copy(), self.all_multipliers(result.row_multipliers).copy()
        gradient, jac, _ = whole.derivatives(x, y, 0.0)
        self.known.equations.set(jac=np.ascontiguousarray(jac))
        function("presolve_balance")(self.known.equations, weight, np.ascontiguousarray(gradient), y)
        return x, y


def _pairs_left(nlp: NLP, part: Part) -> Pairs:
    """The complementary pairs of which nothing is determined; the product of another one is a row like others."""
    if not isinstance(nlp, Complementary):
        return Pairs.none()
    x_index, row_index = np.full(nlp.n, -1), np.full(nlp.m, -1)
    x_index[part.cols], row_index[part.rows] = np.arange(part.cols.size), np.arange(part.rows.size)
    return nlp.pairs.among(x_index, row_index)


def presolved(nlp: NLP) -> Reduced | None:
    """The program that is left when what is determined is left out; None where nothing is, or not without conflict."""
    known = once(determined_by, nlp)
    return None if known is None else Reduced(nlp, known)


def determined_by(nlp: NLP) -> Determined | None:
    """The parts of ``nlp`` that its bounds and linear equations determine.

    None where equations determine no variable or, within rounding errors, cannot hold together with bounds and other
    rows: the solver says more about that. So it does about functions that have no value.
    """
    n, m = nlp.n, nlp.m
    fixed = nlp.x_lower == nlp.x_upper
    usable = nlp.row_linear & (nlp.row_lower == nlp.row_upper)
    rows, cols = (np.ascontiguousarray(index, np.int32) for index in (nlp.jac_rows, nlp.jac_cols))
    unknown = np.flatnonzero(~fixed[cols])
    left = np.bincount(rows[unknown], minlength=m)
    first = np.flatnonzero(usable & (left == 1))
    if not first.size:
        return None
    x = np.where(fixed, nlp.x_lower, nlp.x0)
    f, r = nlp.values(x)
    r = r.copy()
    jac = np.array(nlp.derivatives(x, np.zeros(m), 0.0)[1], float)
    if not np.isfinite(f + r.sum() + jac.sum()):
        return None
    last = np.bincount(rows[unknown], weights=unknown, minlength=m).astype(np.int64)
    largest = np.zeros(m)
    np.maximum.at(largest, rows, np.abs(jac))
    members, starts = sort_by_key(cols, n)
    queue = np.concatenate([first, np.zeros(m, np.int64)]).astype(np.int32)
    found = fixed.astype(np.int32)
    equations = structure("determined")(
        rows=rows, cols=cols, jac=jac, column_start=starts, column_entry=members, row=np.zeros(m, np.int32),
        entry=np.zeros(m, np.int32),
    )  # fmt: skip
    function("presolve_find")(
        equations, first.size, queue, usable.astype(np.int32), left.astype(np.int32), last, largest, found
    )
    for _ in range(2):  # the second time for what rounding has left of the guess
        function("presolve_substitute")(equations, np.where(usable, nlp.row_lower - r, 0.0), x)
        f, r = nlp.values(x)
    gone = found != 0
    settled = np.bincount(rows[~gone[cols]], minlength=m) == 0
    misses = max(
        relative_violation(x, nlp.x_lower, nlp.x_upper)[gone].max(initial=0.0),
        relative_violation(r, nlp.row_lower, nlp.row_upper)[settled].max(initial=0.0),
    )
    if not equations.count or not misses <= RELAXATION:
        return None
    return Determined(Part.of(nlp, x, ~gone, ~settled), equations)
