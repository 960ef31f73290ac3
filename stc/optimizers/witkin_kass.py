"""The method of "Spacetime constraints": a Newton step on the objective, then one that projects onto the constraints.

A. Witkin and M. Kass, Spacetime constraints, SIGGRAPH 1988; M. Ahrens and B. Levin, 2001, section 2.5.  With
g and H the gradient and Hessian of the objective alone, C the equations and J their Jacobian, each iteration solves
two sparse linear systems in sequence, both by conjugate gradients:

    H S^ = -g                       a Newton step on the objective, whatever the equations
    J (S~ + S^) = -C                a step that meets their linearisation, as short as possible

and goes to ``S + S^ + S~``.  As it was printed, "short" is the Euclidean length.  The iteration then comes to rest
where ``J^T`` reaches ``H^-1 g`` instead of ``g``: at a solution only if H is a multiple of the identity on its range,
as it is for a plain sum of squared unknowns.  ``witkin-kass:printed`` is that.  ``witkin-kass`` measures length by
the curvature of the objective, ``s . (H + sigma I) s``: then the point of rest satisfies the optimality conditions, for
any sigma > 0, and the multipliers come out of the second system,

    J (H + sigma I)^-1 J^T y = C + J S^,        S~ = -(H + sigma I)^-1 J^T y.

sigma makes H positive definite, grows when a step does not lessen the l1 merit function, and shrinks when it does.

Limits: equations only; the curvature of the equations is not used, so that convergence is linear, at best, where they
are curved; conjugate gradients take many products where the scheme couples long chains of frames.  It is here for
teaching and for comparison.
"""

from __future__ import annotations

import numpy as np

from stc.deadline import within
from stc.errors import UsageError
from stc.optimizers.conjugate_gradients import conjugate_gradients
from stc.optimizers.dual_estimate import stationary_violation
from stc.optimizers.point_result import Judgement, judge, point_result
from stc.optimizers.rays import falls_without_limit
from stc.records import dataclass
from stc.solver.monitor import Monitor, Stopped
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.products import inner
from stc.solver.report import Callback, Result, Start
from stc.solver.status import Status

__all__ = ["PRINTED", "minimize_witkin_kass"]

PRINTED = "printed"

FIRST_SIGMA = 1e-4
SMALLEST_SIGMA = 1e-13
LARGEST_SIGMA = 1e10
SHRINK, GROW = 0.1, 10.0
NOTICEABLE = 1e-3
GOOD, POOR = 0.75, 0.25
NEGLIGIBLE = 1e-12
INNER, OUTER = 1e-13, 1e-11
ACCURATE = 1e-6
EARLY = 1e-2
ARMIJO = 1e-4
SHORTEST = 1e-4
REST = 1e-9
PATIENCE = 3
STATIONARY = 1e-6
LOW = -1e15
PROBES, NEARBY = 20, 1e-3


def minimize_witkin_kass(
    nlp: NLP,
    options: Options | None = None,
    callback: Callback | None = None,
    start: Start | None = None,
    variant: str = "",
) -> Result:
    """Minimise with equations as the only constraints; arguments and result as :func:`stc.solver.minimize`.

    Args:
        variant: "" or :data:`PRINTED`.

    Raises:
        UsageError: the problem has inequalities, or bounds on unknowns that do not fix them.
    """
    open_rows = nlp.row_lower != nlp.row_upper
    inequalities = int((open_rows & (np.isfinite(nlp.row_lower) | np.isfinite(nlp.row_upper))).sum())
    free = nlp.x_lower != nlp.x_upper
    bounded = int((free & (np.isfinite(nlp.x_lower) | np.isfinite(nlp.x_upper))).sum())
    if inequalities or bounded:
        raise UsageError(
            f"witkin-kass takes equations only, and this problem has {inequalities} inequalities in several "
            f"unknowns and {bounded} unknowns with bounds",
            "sqp and nlopt:slsqp take inequalities",
        )
    options = options or Options()
    with np.errstate(all="ignore"), within(options.time_limit):
        return _Solve(nlp, options, callback, start, variant == PRINTED).run()


@dataclass(slots=True)
class _Point:
    """A point with its functions: x (n,), objective, residual of the equations (m,), derivatives."""

    x: Floats
    f: float
    c: Floats
    gradient: Floats
    jac: Floats
    hess: Floats


class _Failed(ArithmeticError):
    """No step was found."""


class _Solve:
    """One minimisation, from its start to its result."""

    def __init__(
        self, nlp: NLP, options: Options, callback: Callback | None, start: Start | None, printed: bool
    ) -> None:
        self.nlp, self.options, self.printed = nlp, options, printed
        self.monitor = Monitor(options, callback)
        self.free = nlp.x_lower != nlp.x_upper
        x0 = np.asarray(nlp.x0 if start is None else start.x, dtype=float)
        self.x0 = np.where(self.free, x0, nlp.x_lower)
        self.rows = np.isfinite(nlp.row_upper)
        self.target = np.where(self.rows, nlp.row_upper, 0.0)
        self.below = np.flatnonzero(nlp.hess_rows != nlp.hess_cols)
        self.sigma = FIRST_SIGMA
        self.penalty = self.merit = 0.0
        self.flat = False
        self.y = np.zeros(nlp.m)

    def run(self) -> Result:
        nlp = self.nlp
        if np.any(nlp.x_lower > nlp.x_upper) or np.any(nlp.row_lower > nlp.row_upper):
            return self._result(self.x0, Status.INFEASIBLE, "Two bounds contradict each other.")
        point = self._at(self.x0)
        if point is None:
            return self._result(self.x0, Status.FAILED, "A function is undefined at the starting point.")
        self.best = point.x
        try:
            return self._iterate(point)
        except Stopped as stopped:
            return self._result(self.best, stopped.status)
        except KeyboardInterrupt:
            return self._result(self.best, Status.INTERRUPTED)

    def _iterate(self, point: _Point) -> Result:
        rest, step, length = 0, np.inf, 1.0
        while True:
            judged = self._judged(point)
            self._record(point, judged, step, length)
            if judged.error <= EARLY or (self.flat and judged.optimal):
                return point_result(self.nlp, judged, Status.OPTIMAL, self.monitor)
            if rest >= PATIENCE or point.f < LOW:
                return self._stuck(point, judged)
            try:
                after, length = self._full_step(point) if self.printed else self._accepted_step(point)
            except _Failed:
                return self._stuck(point, judged)
            step = float((np.abs(after.x - point.x) / (1.0 + np.abs(point.x))).max(initial=0.0))
            rest = rest + 1 if step <= REST else 0
            point = after
            self.best = point.x
            self.monitor.count()

    def _record(self, point: _Point, judged: Judgement, step: float, length: float) -> None:
        found = judged.conditions
        size = step if np.isfinite(step) else 0.0
        self.monitor.record(
            "witkin-kass",
            lambda: (point.x, judged.y),
            point.f,
            found.violation,
            found.optimality,
            size,
            length,
            0.0,
            0.0 if self.printed else self.sigma * self._scale(point),
        )

    def _judged(self, point: _Point) -> Judgement:
        """The result with the multipliers of the second system; for the printed method with those that fit best."""
        if self.printed:
            answer = conjugate_gradients(
                lambda v: self._rows(point, self._columns(point, v)),
                -self._rows(point, point.gradient),
                OUTER,
                check=self.monitor.check,
            )
            self.y = answer.x
        return judge(self.nlp, point.x, self.options, self.y)

    # -- steps -------------------------------------------------------------------------------------------------

    def _full_step(self, point: _Point) -> tuple[_Point, float]:
        """The method as printed: shortest solutions of both systems, with full steps wherever functions are defined."""
        newton = conjugate_gradients(
            lambda v: self._hessian(point, v), -point.gradient, OUTER, check=self.monitor.check
        )
        missing = point.c + self._rows(point, newton.x)
        answer = conjugate_gradients(
            lambda v: self._rows(point, self._columns(point, v)), missing, OUTER, check=self.monitor.check
        )
        whole = newton.x - self._columns(point, answer.x)
        length = 1.0
        while length >= SHORTEST:
            after = self._at(point.x + length * whole)
            if after is not None:
                return after, length
            length *= 0.5
        raise _Failed

    def _accepted_step(self, point: _Point) -> tuple[_Point, float]:
        """A step that decreases the merit function; sigma grows until there is one."""
        while self.sigma <= LARGEST_SIGMA:
            self.monitor.check()
            found = self._pair(point)
            if found is not None:
                step, y = found
                accepted = self._search(point, step, y)
                if accepted is not None:
                    after, length = accepted
                    self.y = y
                    self._adapt(self._promise(point, step, length), self._merit(point) - self._merit(after))
                    return after, length
            self.sigma = max(GROW * self.sigma, NOTICEABLE)
        raise _Failed

    def _promise(self, point: _Point, step: Floats, length: float) -> float:
        """The decrease that the objective's quadratic model and the linearised equations predict for a step."""
        along, bent = inner(point.gradient, step), inner(step, self._hessian(point, step))
        return length * (self.penalty * float(np.abs(point.c).sum()) - along) - 0.5 * length**2 * bent

    def _adapt(self, promised: float, gained: float) -> None:
        """Reduce sigma if the decrease is as predicted, and increase it if it is not."""
        self.flat = promised <= NEGLIGIBLE * max(1.0, abs(self.merit))
        if self.flat:  # gains drown in rounding errors
            return
        if gained > GOOD * promised:
            self.sigma = max(SMALLEST_SIGMA, SHRINK * self.sigma)
        elif gained < POOR * promised:
            self.sigma = max(GROW * self.sigma, NOTICEABLE)

    def _pair(self, point: _Point) -> tuple[Floats, Floats] | None:
        """The two systems: step (n,) and multipliers (m,); None where sigma is too small for either."""
        newton = self._metric_solve(point, -point.gradient)
        if newton is None:
            return None
        projected = self._project(point, point.c + self._rows(point, newton))
        if projected is None:
            return None
        back, y = projected
        return newton + back, y

    def _project(self, point: _Point, missing: Floats) -> tuple[Floats, Floats] | None:
        """The step of least length in the metric that changes the linearised rows by ``-missing`` (m,)."""
        diagonal = self._metric_diagonal(point)
        weights = point.jac**2 / diagonal[self.nlp.jac_cols]
        rows = np.bincount(self.nlp.jac_rows, weights=weights, minlength=self.nlp.m)
        failed = False

        def product(v: Floats) -> Floats:
            nonlocal failed
            inner = self._metric_solve(point, self._columns(point, v))
            if inner is None:
                failed = True
                return np.zeros_like(v)
            return self._rows(point, inner)

        answer = conjugate_gradients(
            product, missing, OUTER, np.where(rows > 0.0, rows, 1.0), check=self.monitor.check
        )
        if failed or answer.indefinite or answer.residual > ACCURATE:
            return None
        inner = self._metric_solve(point, self._columns(point, answer.x))
        return None if inner is None else (-inner, answer.x)

    def _search(self, point: _Point, step: Floats, y: Floats) -> tuple[_Point, float] | None:
        """The longest of the halved steps that lessens the l1 merit function enough."""
        self.penalty = max(self.penalty, 2.0 * float(np.abs(y).max(initial=0.0)))
        slope = inner(point.gradient, step) - self.penalty * float(np.abs(point.c).sum())
        small = float(np.abs(step / (1.0 + np.abs(point.x))).max(initial=0.0)) <= 1e-9
        if not slope < 0.0 and not small:
            return None
        before = self.merit = self._merit(point)
        noise = 1e-13 * max(1.0, abs(point.f), abs(before))
        length = 1.0
        while length >= SHORTEST:
            after = self._at(point.x + length * step)
            if after is not None and self._merit(after) <= before + ARMIJO * length * slope + noise:
                return after, length
            if after is not None and length == 1.0:  # the equations' curvature may be to blame: project again
                again = self._project(point, after.c)
                bent = None if again is None else self._at(point.x + step + again[0])
                if bent is not None and self._merit(bent) <= before + ARMIJO * slope + noise:
                    return bent, 1.0
            length *= 0.5
        return None

    def _merit(self, point: _Point) -> float:
        return point.f + self.penalty * float(np.abs(point.c).sum())

    # -- products ----------------------------------------------------------------------------------------------

    def _at(self, x: Floats) -> _Point | None:
        """The functions at ``x`` (n,), or None where one has no value."""
        nlp = self.nlp
        f, r = nlp.values(x)
        c = np.where(self.rows, r - self.target, 0.0)
        gradient, jac, hess = nlp.derivatives(x, np.zeros(nlp.m), 1.0)
        live = self.rows[nlp.jac_rows] & self.free[nlp.jac_cols]
        curved = self.free[nlp.hess_rows] & self.free[nlp.hess_cols]
        point = _Point(
            x,
            float(f),
            c,
            np.where(self.free, gradient, 0.0),
            np.where(live, jac, 0.0),
            np.where(curved, hess, 0.0),
        )
        whole = np.isfinite(f) and all(
            np.isfinite(part).all() for part in (c, point.gradient, point.jac, point.hess)
        )
        return point if whole else None

    def _rows(self, point: _Point, v: Floats) -> Floats:
        """``J v``, (m,)."""
        terms: Floats = point.jac * v[self.nlp.jac_cols]
        return np.asarray(np.bincount(self.nlp.jac_rows, weights=terms, minlength=self.nlp.m), dtype=float)

    def _columns(self, point: _Point, v: Floats) -> Floats:
        """``J^T v``, (n,)."""
        terms: Floats = point.jac * v[self.nlp.jac_rows]
        return np.asarray(np.bincount(self.nlp.jac_cols, weights=terms, minlength=self.nlp.n), dtype=float)

    def _hessian(self, point: _Point, v: Floats) -> Floats:
        """``H v``, (n,), of the objective."""
        nlp, below = self.nlp, self.below
        product = np.bincount(nlp.hess_rows, weights=point.hess * v[nlp.hess_cols], minlength=nlp.n)
        mirrored = point.hess[below] * v[nlp.hess_rows[below]]
        return np.asarray(product + np.bincount(nlp.hess_cols[below], weights=mirrored, minlength=nlp.n))

    def _diagonal(self, point: _Point) -> Floats:
        nlp = self.nlp
        on = nlp.hess_rows == nlp.hess_cols
        return np.asarray(np.bincount(nlp.hess_rows[on], weights=point.hess[on], minlength=nlp.n), float)

    def _scale(self, point: _Point) -> float:
        """The scale of sigma: the largest curvature, or 1 if there is none."""
        return float(np.abs(point.hess).max(initial=0.0)) or 1.0

    def _metric_diagonal(self, point: _Point) -> Floats:
        sigma = self.sigma * self._scale(point)
        return np.maximum(self._diagonal(point), 0.0) + sigma

    def _metric_solve(self, point: _Point, rhs: Floats) -> Floats | None:
        """``(H + sigma I)^-1 rhs``, (n,); None where that matrix is not positive definite."""
        sigma = self.sigma * self._scale(point)
        answer = conjugate_gradients(
            lambda v: self._hessian(point, v) + sigma * v,
            rhs,
            INNER,
            self._metric_diagonal(point),
            self.monitor.check,
        )
        return None if answer.indefinite or answer.residual > ACCURATE else answer.x

    # -- results -----------------------------------------------------------------------------------------------

    def _stuck(self, point: _Point, judged: Judgement) -> Result:
        """The result if no step is left."""
        nlp, options = self.nlp, self.options
        if not judged.optimal:
            judged = min(judged, judge(nlp, point.x, options), key=lambda one: one.error)
        if judged.optimal:
            return point_result(nlp, judged, Status.OPTIMAL, self.monitor)
        if judged.conditions.violation > options.feasibility_tolerance:
            error, off = stationary_violation(nlp, point.x, np.ones(nlp.m))
            if error <= STATIONARY and self._least_nearby(point.x, inner(off, off)):
                return self._result(point.x, Status.INFEASIBLE)
        elif falls_without_limit(nlp, point.x, self.x0, options.feasibility_tolerance):
            return self._result(point.x, Status.UNBOUNDED)
        found = judged.conditions
        message = (
            f"The iteration stopped with a violation of {found.violation:.1e} and an optimality error of "
            f"{found.optimality:.1e}."
        )
        if self.printed:
            message += (
                " As printed, the method stops at a solution only if the objective is a plain sum of squares; "
                "witkin-kass without `:printed` continues."
            )
        return point_result(nlp, judged, Status.FAILED, self.monitor, message)

    def _least_nearby(self, x: Floats, squares: float) -> bool:
        """Whether no point tried near ``x`` (n,) violates less: a saddle of the violation proves nothing."""
        rng = np.random.default_rng(self.options.seed)
        for _ in range(PROBES):
            nearby = x + np.where(self.free, NEARBY * rng.uniform(-1.0, 1.0, len(x)) * (1.0 + np.abs(x)), 0.0)
            _, off = stationary_violation(self.nlp, nearby, np.ones(self.nlp.m))
            if inner(off, off) < (1.0 - NEARBY**3) * squares:
                return False
        return True

    def _result(self, x: Floats, status: Status, message: str = "") -> Result:
        return point_result(self.nlp, judge(self.nlp, x, self.options), status, self.monitor, message)
