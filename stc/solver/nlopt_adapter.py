"""NLopt's algorithms on the same nonlinear program.

S. G. Johnson, The NLopt nonlinear-optimization package, http://github.com/stevengj/nlopt.

NLopt sees ``f``, equations ``c(x) = 0`` and inequalities ``d(x) <= 0``: a range becomes two inequalities, fixed
variables are left out.  It reports a point and nothing else, so multipliers are recovered by least squares
(:mod:`stc.solver.dual_estimate`) and the status says whether that point satisfies the optimality conditions, to the
tolerances of the project's own method.  The same test stops the local algorithms as soon as it holds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from stc.errors import UsageError
from stc.solver.dual_estimate import assess_point, stationary_violation
from stc.solver.monitor import Monitor, Stopped
from stc.solver.nlopt_algorithms import Algorithm, Choice, choose, require
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.point_result import point_result
from stc.solver.report import Callback, Result, Start
from stc.solver.rays import falls_without_limit
from stc.solver.scaled_problem import relative_violation
from stc.solver.status import Status

__all__ = ["minimize_with_nlopt"]

X_TOLERANCE = 1e-12
CONSTRAINT_TOLERANCE = 1e-9
SMALL_STEP = 1e-2
SEARCH_SHARE = 0.8
LOCAL_EVALUATIONS = 2000
STATIONARY = 1e-6


def minimize_with_nlopt(
    name: str,
    nlp: NLP,
    options: Options | None = None,
    callback: Callback | None = None,
    start: Start | None = None,
) -> Result:
    """Minimise with ``nlopt:NAME`` or ``nlopt:NAME:LOCAL``; arguments and result as :func:`stc.solver.minimize`.

    An iteration is an evaluation with derivatives, or n + 1 evaluations where an algorithm asks for none.

    Raises:
        UsageError: no such algorithm, one that cannot do what the problem needs, or NLopt is not installed.
    """
    choice = choose(name)
    require(choice, nlp)
    with np.errstate(all="ignore"):
        return _Solve(choice, nlp, options or Options(), callback, start).run()


def _nlopt() -> Any:
    try:
        import nlopt
    except ImportError as error:
        raise UsageError("NLopt is not installed", "pip install nlopt") from error
    return nlopt


class _Functions:
    """The problem in NLopt's form: free variables only, each point evaluated once."""

    def __init__(self, nlp: NLP, x: Floats) -> None:
        self.nlp = nlp
        self.free = np.flatnonzero(nlp.x_lower != nlp.x_upper)
        self.x = x.copy()
        bounded = np.isfinite(nlp.row_lower) | np.isfinite(nlp.row_upper)
        equal = (nlp.row_lower == nlp.row_upper) & bounded
        self.equal = np.flatnonzero(equal)
        self.above = np.flatnonzero(~equal & np.isfinite(nlp.row_upper))
        self.below = np.flatnonzero(~equal & np.isfinite(nlp.row_lower))
        self.f, self.r = 0.0, np.zeros(nlp.m)
        self.gradient, self.jac = np.zeros(nlp.n), np.zeros(len(nlp.jac_rows))
        self._valued = self._derived = b""
        sign = np.concatenate([np.ones(len(self.above)), -np.ones(len(self.below))])
        self._equality_entries = self._entries([self.equal], np.ones(len(self.equal)))
        self._inequality_entries = self._entries([self.above, self.below], sign)

    def _entries(self, parts: list[Any], sign: Floats) -> tuple[Any, Any, Any, Floats]:
        """Where each Jacobian entry goes in a dense matrix of these rows and the free variables."""
        nlp = self.nlp
        column = np.full(nlp.n, -1)
        column[self.free] = np.arange(len(self.free))
        source, line = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        at = 0
        for part in parts:
            place = np.full(nlp.m, -1)
            place[part] = at + np.arange(len(part))
            mine = np.flatnonzero((place[nlp.jac_rows] >= 0) & (column[nlp.jac_cols] >= 0))
            source.append(mine)
            line.append(place[nlp.jac_rows[mine]])
            at += len(part)
        entry, row = np.concatenate(source), np.concatenate(line)
        return entry, row, column[nlp.jac_cols[entry]], sign[row]

    def move(self, z: Floats) -> bool:
        """Go to free variables ``z``; True when the point is a new one."""
        key = z.tobytes()
        if key == self._valued:
            return False
        self.x[self.free] = z
        self.f, r = self.nlp.values(self.x)
        self.r = r.copy()
        self._valued = key
        return True

    def derive(self, z: Floats) -> bool:
        """Derivatives at ``z``; True when they are new."""
        self.move(z)
        key = z.tobytes()
        if key == self._derived:
            return False
        gradient, jac, _ = self.nlp.derivatives(self.x, np.zeros(self.nlp.m), 0.0)
        self.gradient, self.jac = gradient.copy(), jac.copy()
        self._derived = key
        return True

    def equalities(self, out: Floats, matrix: Floats) -> None:
        """Values and dense Jacobian of the equations."""
        out[:] = self.r[self.equal] - self.nlp.row_upper[self.equal]
        if matrix.size:
            entry, row, col, _ = self._equality_entries
            matrix[:] = 0.0
            matrix[row, col] = self.jac[entry]

    def inequalities(self, out: Floats, matrix: Floats) -> None:
        """Values and dense Jacobian of the inequalities, upper bounds first."""
        nlp, high, low = self.nlp, self.above, self.below
        out[: len(high)] = self.r[high] - nlp.row_upper[high]
        out[len(high) :] = nlp.row_lower[low] - self.r[low]
        if matrix.size:
            entry, row, col, sign = self._inequality_entries
            matrix[:] = 0.0
            matrix[row, col] = sign * self.jac[entry]

    def violation(self) -> float:
        """Largest relative violation of a row at the current point."""
        rows = relative_violation(self.r, self.nlp.row_lower, self.nlp.row_upper)
        bounds = relative_violation(self.x, self.nlp.x_lower, self.nlp.x_upper)
        return max(float(rows.max(initial=0.0)), float(bounds.max(initial=0.0)))


class _Solve:
    """One solve: the algorithm, what follows when it ends, and the result."""

    def __init__(
        self, choice: Choice, nlp: NLP, options: Options, callback: Callback | None, start: Start | None
    ) -> None:
        self.choice, self.nlp, self.options = choice, nlp, options
        x0 = np.asarray(nlp.x0 if start is None else start.x, dtype=float)
        self.x0 = np.clip(x0, nlp.x_lower, np.maximum(nlp.x_lower, nlp.x_upper))
        self.monitor = Monitor(options, callback)
        self.deadline = time.perf_counter() + options.time_limit
        self.functions = _Functions(nlp, self.x0)
        self.lower, self.upper = nlp.x_lower[self.functions.free], nlp.x_upper[self.functions.free]
        self.ended: Status | None = None
        self.optimal_at: Floats | None = None
        self.word = ""

    def run(self) -> Result:
        nlp = self.nlp
        if np.any(nlp.x_lower > nlp.x_upper) or np.any(nlp.row_lower > nlp.row_upper):
            return self._result(Status.INFEASIBLE, self.x0, "Two bounds contradict each other.")
        f, r = nlp.values(self.x0)
        if not (np.isfinite(f) and np.all(np.isfinite(r))):
            return self._result(Status.FAILED, self.x0, "A function is undefined at the starting point.")
        if not len(self.functions.free):
            feasible = self._violation(self.x0) <= self.options.feasibility_tolerance
            return self._result(Status.OPTIMAL if feasible else Status.INFEASIBLE, self.x0)
        x = self._searched() if self.choice.algorithm.search else self._optimised(self.choice, self.x0, 1.0)
        if self.ended is Status.INTERRUPTED:
            return self._result(Status.INTERRUPTED, self._best(x))
        return self._concluded(x)

    def _searched(self) -> Floats:
        """The best of the box, then finished locally: a search alone stops near an optimum and not at it."""
        self._optimised(self.choice, self.x0, SEARCH_SHARE)
        best = self._best(self.x0)
        if self.ended in (Status.INTERRUPTED, Status.TIME_LIMIT):
            return best
        self.ended = None
        return self._optimised(choose("nlopt:slsqp"), best, 1.0)

    def _concluded(self, x: Floats) -> Result:
        """The result for where the algorithm ended."""
        options = self.options
        candidates = [x, self._best(x)]
        if self.optimal_at is not None:
            candidates.insert(0, self.optimal_at)
        judged = [assess_point(self.nlp, one, options.unscaled_tolerance)[1] for one in candidates]
        errors = [max(j.violation / options.feasibility_tolerance, j.optimality / options.unscaled_tolerance, 1.0)
                  for j in judged]  # fmt: skip
        x = candidates[int(np.argmin(errors))]
        violation = judged[int(np.argmin(errors))].violation
        if min(errors) <= 1.0:
            return self._result(Status.OPTIMAL, x)
        if violation <= options.feasibility_tolerance:
            if falls_without_limit(self.nlp, x, self.x0, options.feasibility_tolerance):
                return self._result(Status.UNBOUNDED, x)
        elif self.ended is not Status.TIME_LIMIT:
            nearest, stationary = self._least_violation(x)
            if self.ended is Status.INTERRUPTED:
                return self._result(Status.INTERRUPTED, self._best(x))
            if stationary:
                return self._result(Status.INFEASIBLE, nearest)
        status = self.ended or Status.FAILED
        return self._result(status, x, self._failure(x) if status is Status.FAILED else "")

    def _failure(self, x: Floats) -> str:
        _, judged = assess_point(self.nlp, x)
        return (
            f"{self.choice.name} {self.word} with a violation of {judged.violation:.1e} and an optimality error "
            f"of {judged.optimality:.1e}, where {self.options.feasibility_tolerance:.0e} and "
            f"{self.options.unscaled_tolerance:.0e} count as solved. Try another optimizer: sqp is the default."
        )

    # -- running NLopt -----------------------------------------------------------------------------------------

    def _optimised(self, choice: Choice, x0: Floats, share: float) -> Floats:
        """Run one algorithm from ``x0`` (n,) with a share of the iterations allowed; where it ended."""
        functions = self.functions
        size = len(functions.free)
        allowed = int(share * self.options.max_iterations)
        opt = self._configured(choice.algorithm, size, (allowed + 1) * (size + 1 if not choice.gradient else 30))
        if choice.local is not None:
            inner = self._configured(choice.local, size, LOCAL_EVALUATIONS)
            inner.set_xtol_rel(1e-9)
            inner.set_ftol_rel(1e-12)
            opt.set_local_optimizer(inner)
        watch = _Watch(self, choice, opt, allowed)
        opt.set_min_objective(watch.objective)
        nlp = self.nlp
        if len(functions.equal):
            size_of = np.maximum(1.0, np.abs(nlp.row_upper[functions.equal]))
            opt.add_equality_mconstraint(watch.guarded(functions.equalities), CONSTRAINT_TOLERANCE * size_of)
        if len(functions.above) + len(functions.below):
            bounds = np.concatenate([nlp.row_upper[functions.above], nlp.row_lower[functions.below]])
            tolerance = CONSTRAINT_TOLERANCE * np.maximum(1.0, np.abs(bounds))
            opt.add_inequality_mconstraint(watch.guarded(functions.inequalities), tolerance)
        z = opt.optimize(np.clip(x0[functions.free], self.lower, self.upper))
        outcome = opt.last_optimize_result()
        if outcome == -2 or outcome == -3:
            reason = opt.get_errmsg() or ("out of memory" if outcome == -3 else "it does not say why")
            raise UsageError(f"{choice.name} does not take this problem: {reason}")
        self.word = _WORDS.get(outcome, "stopped")
        if watch.error is not None:
            raise watch.error
        x = x0.copy()
        x[functions.free] = np.clip(z, self.lower, self.upper)
        return x if np.isfinite(x).all() else x0

    def _configured(self, algorithm: Algorithm, size: int, evaluations: int) -> Any:
        nlopt = _nlopt()
        nlopt.srand(self.options.seed + 1)
        opt = nlopt.opt(getattr(nlopt, algorithm.constant), size)
        opt.set_exceptions_enabled(False)
        opt.set_lower_bounds(self.lower)
        opt.set_upper_bounds(self.upper)
        opt.set_xtol_rel(X_TOLERANCE)
        opt.set_maxeval(evaluations)
        left = self.deadline - time.perf_counter()
        if np.isfinite(left):
            opt.set_maxtime(max(left, 1e-3))
        return opt

    def _least_violation(self, x: Floats) -> tuple[Floats, bool]:
        """Follow the sum of squared violations down from ``x``; where that ends, and whether it is stationary there.

        NLopt cannot tell an infeasible problem from one that it failed on; this can.
        """
        nlp, functions = self.nlp, self.functions
        opt = self._configured(choose("nlopt:lbfgs").algorithm, len(functions.free), LOCAL_EVALUATIONS)
        watch = _Watch(self, self.choice, opt, self.options.max_iterations)

        def squares(z: Floats, slope: Floats) -> float:
            functions.derive(z)
            over = np.maximum(functions.r - nlp.row_upper, 0.0) - np.maximum(nlp.row_lower - functions.r, 0.0)
            if slope.size:
                terms = functions.jac * over[nlp.jac_rows]
                slope[:] = np.bincount(nlp.jac_cols, weights=terms, minlength=nlp.n)[functions.free]
            return 0.5 * float(over @ over)

        opt.set_min_objective(watch.quiet(squares))
        z = opt.optimize(np.clip(x[functions.free], self.lower, self.upper))
        nearest = x.copy()
        nearest[functions.free] = np.clip(z, self.lower, self.upper)
        error, _ = stationary_violation(nlp, nearest)
        violated = self._violation(nearest) > self.options.feasibility_tolerance
        return nearest, violated and error <= STATIONARY

    # -- results -----------------------------------------------------------------------------------------------

    def _violation(self, x: Floats) -> float:
        _, r = self.nlp.values(x)
        return float(relative_violation(r, self.nlp.row_lower, self.nlp.row_upper).max(initial=0.0))

    def _best(self, x: Floats) -> Floats:
        return x if self.monitor.best is None else self.monitor.best[2]

    def _result(self, status: Status, x: Floats, message: str = "") -> Result:
        return point_result(self.nlp, x, status, self.options, self.monitor, message=message)


_WORDS = {
    -1: "failed",
    -4: "stopped at rounding errors",
    -5: "was stopped",
    1: "ended",
    3: "ended",
    4: "made no further progress",
    5: "ran out of evaluations",
    6: "ran out of time",
}


class _Watch:
    """Between NLopt and the problem: counts, logs, and stops NLopt without letting an exception through it."""

    def __init__(self, solve: _Solve, choice: Choice, opt: Any, allowed: int) -> None:
        self.solve, self.choice, self.opt, self.allowed = solve, choice, opt, allowed
        self.error: Exception | None = None
        self._evaluations = 0
        self._stopped = False
        self._last = solve.functions.x.copy()

    def objective(self, z: Floats, slope: Floats) -> float:
        """NLopt's objective: a value, and its gradient into ``slope`` where that is wanted."""
        functions = self.solve.functions

        def evaluate() -> float:
            new = functions.derive(z) if slope.size else functions.move(z)
            self._evaluations += 1
            if new and (slope.size or not self.choice.gradient):
                self._count(bool(slope.size))
            if slope.size:
                slope[:] = functions.gradient[functions.free]
            return functions.f if np.isfinite(functions.f) else np.inf

        return self._safely(evaluate, slope, np.inf)

    def guarded(self, fill: Callable[[Floats, Floats], None]) -> Callable[[Floats, Floats, Floats], None]:
        """Rows for NLopt: it calls with where the values go, the point, and where the Jacobian goes."""
        functions = self.solve.functions

        def rows(out: Floats, z: Floats, matrix: Floats) -> None:
            def evaluate() -> float:
                if matrix.size:
                    functions.derive(z)
                else:
                    functions.move(z)
                fill(out, matrix)
                return 0.0

            self._safely(evaluate, matrix, 0.0)

        return rows

    def quiet(self, function: Callable[[Floats, Floats], float]) -> Callable[[Floats, Floats], float]:
        """Another objective, which is watched for limits and not logged."""

        def evaluate(z: Floats, slope: Floats) -> float:
            def inner() -> float:
                self.solve.monitor.check()
                value = function(z, slope)
                return value if np.isfinite(value) else np.inf

            return self._safely(inner, slope, np.inf)

        return evaluate

    def _safely(self, evaluate: Callable[[], float], slope: Floats, otherwise: float) -> float:
        """An evaluation; after a stop there are no more, for some algorithms go on for a while."""
        if not self._stopped:
            try:
                return evaluate()
            except Stopped as stopped:
                self._stop(stopped.status)
            except KeyboardInterrupt:
                self._stop(Status.INTERRUPTED)
            except Exception as error:  # handed on once NLopt has returned
                self.error = error
                self._stop(Status.FAILED)
        if slope.size:
            slope[:] = 0.0
        return otherwise

    def _stop(self, status: Status | None) -> None:
        self.solve.ended = status
        self._stopped = True
        self.opt.force_stop()

    def _count(self, derived: bool) -> None:
        """Log a new point as an iteration, and stop where it is optimal already."""
        solve = self.solve
        functions, monitor = solve.functions, solve.monitor
        whole = derived or self._evaluations % (len(functions.free) + 1) == 0
        size = np.maximum(1.0, np.abs(functions.x))
        step = float((np.abs(functions.x - self._last) / size).max(initial=0.0))
        violation = functions.violation() if np.isfinite(functions.f) else np.inf
        optimality = float("nan")
        if whole and step <= SMALL_STEP and violation <= solve.options.feasibility_tolerance:
            if not self.choice.algorithm.search:
                goal = 0.1 * solve.options.unscaled_tolerance
                optimality = assess_point(solve.nlp, functions.x, goal)[1].optimality
                if optimality <= goal and violation <= 0.1 * solve.options.feasibility_tolerance:
                    solve.optimal_at = functions.x.copy()
        self._last = functions.x.copy()
        x, f = functions.x, functions.f
        if not whole:
            monitor.note(x, f, violation)
            return
        monitor.record(x, None, f, violation, optimality, step, 1.0, 0.0, 0.0, "nlopt")
        if solve.optimal_at is not None:
            self._stop(None)
            return
        if monitor.iterations >= self.allowed:
            raise Stopped(Status.ITERATION_LIMIT)
        monitor.count()
