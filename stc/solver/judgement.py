"""Holds what an attempt has led to against the problem as stated: unscaled, and bounds not relaxed."""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.constants import ACCURATE, EXACT
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.outcome import ACCEPTABLE, End, Outcome
from stc.solver.products import ROUGHLY, ROUNDED, between, term_sums
from stc.solver.residuals import Assessment, assess, holds, is_met_but_for_rounding
from stc.solver.scaled_problem import ORDINARY, ScaledProblem

__all__ = ["Judgement", "Point", "possible_gain", "slopes_left"]


@dataclass(frozen=True, slots=True)
class Point:
    """Variables (n,) and row multipliers (m,) of the problem as stated."""

    x: Floats
    y: Floats


class Judgement:
    """The judgement of one solve's points; the last ones are not evaluated again."""

    def __init__(self, nlp: NLP, options: Options) -> None:
        self.nlp, self.options = nlp, options
        self._assessed: tuple[Point, Assessment] | None = None
        self._last_stated: tuple[Outcome, Floats, Point] | None = None

    def assess(self, point: Point) -> Assessment:
        """The conditions at a point of the problem as stated, of the last one without evaluating them again."""
        known = self._assessed
        if known is None or known[0] is not point:
            known = self._assessed = point, assess(self.nlp, point.x, point.y)
        return known[1]

    def stated(self, outcome: Outcome) -> Point:
        """The outcome's point and row multipliers for the problem as stated.

        The variables are moved onto the bounds that they overstep by a hair, unless the rows would suffer more.
        """
        known = self._last_stated
        if known is not None and known[0] is outcome and known[1] is outcome.y:
            return known[2]
        point = self._point_of(outcome)
        self._last_stated = outcome, outcome.y, point
        return point

    def _point_of(self, outcome: Outcome) -> Point:
        form = outcome.form
        assert isinstance(form, ScaledProblem)
        as_found, y = form.as_stated(outcome.x, outcome.y)
        point = between(as_found, self.nlp.x_lower, self.nlp.x_upper)
        if (point == as_found).all():
            return Point(point, y)
        moved, unmoved = (assess(self.nlp, x, y).violation for x in (point, as_found))
        return Point(point if moved <= max(unmoved, ROUGHLY) else as_found, y)

    def confirms(self, point: Point) -> bool:
        """Whether the problem as stated confirms a point."""
        return holds(self.nlp, point.x, self.assess(point), self.options)

    def stalled_short(self, outcome: Outcome, point: Point, again: bool = False) -> bool:
        """Whether the iteration stalled where the objective may still gain, or ended where a lighter one does not tell.

        A barrier that holds a point off many bounds leaves each of them a product too small to count: together they do.
        So do slopes that are too small to count where variables are large, which those of quadratic programs may be, or
        have become so, and all errors where the objective was divided by much, as one that is steep at a far start.
        A point that was gone on to for such a reason is asked ``again``: a small error does not tell what relaxed
        bounds owe.
        """
        form = outcome.form
        assert isinstance(form, ScaledProblem)
        doubtful = again or outcome.end is End.STUCK or form.objective_factor < 1.0
        if not doubtful:
            size = np.abs(outcome.x)
            far = float(size.sum(where=form.quadratic_program or size > ORDINARY[1]))
            doubtful = outcome.error * max(1.0, far) > ACCEPTABLE * form.objective_scale * max(
                1.0, abs(self.assess(point).objective)
            )
        return doubtful and self.may_gain(point)

    def may_gain(self, point: Point) -> bool:
        """Whether the objective may gain there what counts, of all products together."""
        return self.gain(point) > ACCEPTABLE

    def share_of_error(self, point: Point) -> float:
        """The factor by which an error must shrink for the conditions as stated to hold, and for a negligible gain."""
        most = self.options.unscaled_tolerance
        left = (
            most / max(most, self.assess(point).optimality),
            ACCEPTABLE / max(ACCEPTABLE, self.gain(point)),
        )
        return max(ACCURATE * min(left), EXACT) if min(left) < 1.0 else 1.0

    def gain(self, point: Point) -> float:
        """The gain that is possible to first order, relative to the objective, or to 1 where that is less."""
        return possible_gain(self.nlp, point.x, point.y, self.assess(point).bound_multipliers)

    def is_met(self, x: Floats, violation: float) -> bool:
        """Whether ``x`` (n,), of that violation, is feasible."""
        tolerance = self.options.feasibility_tolerance
        return violation <= tolerance or is_met_but_for_rounding(self.nlp, x, tolerance)


def possible_gain(nlp: NLP, x: Floats, y: Floats, z: Floats) -> float:
    """First-order estimate of the change of the objective from ``x`` (n,) to the solution, relative to ``max(1, |f|)``.

    Sums the error of every condition times the way to where it would hold: multipliers times the distances to
    their bounds, and slopes times the sizes of the variables, but for what rounding leaves of a slope's terms.
    Unlike a residual it does not depend on units, and it sees when large multipliers make a residual look small.
    """
    f, r = nlp.values(x)
    away_r = np.where(y > 0.0, nlp.row_upper - r, r - nlp.row_lower)
    away_x = np.where(z > 0.0, nlp.x_upper - x, x - nlp.x_lower)
    # A multiplier without a bound on its side is an error of the slope, which counts below.
    gain = float(np.abs(y * np.where(np.isfinite(away_r), away_r, 0.0)).sum())
    gain += float(np.abs(z * np.where(np.isfinite(away_x), away_x, 0.0)).sum())
    gain += float(slopes_left(nlp, x, y, z) @ np.abs(x))
    return gain / max(1.0, abs(f))


def slopes_left(nlp: NLP, x: Floats, y: Floats, z: Floats) -> Floats:
    """The sizes of the Lagrangian's slopes at ``x`` (n,), (n,), but for what rounding may leave of their terms."""
    gradient, jac, hess = nlp.derivatives(x, y, 1.0)
    slopes = np.abs(gradient + np.bincount(nlp.jac_cols, weights=jac * y[nlp.jac_rows], minlength=nlp.n) + z)
    # A gradient that varies has terms of the size of H x, for all we know: differences over short steps cancel.
    terms = term_sums(nlp.jac_cols, nlp.jac_rows, jac, y, nlp.n) + np.abs(z)
    terms += term_sums(nlp.hess_rows, nlp.hess_cols, hess, x, nlp.n)
    across = np.where(nlp.hess_rows != nlp.hess_cols, hess, 0.0)
    terms += term_sums(nlp.hess_cols, nlp.hess_rows, across, x, nlp.n)
    return np.maximum(slopes - ROUNDED / 4.0 * terms, 0.0)
