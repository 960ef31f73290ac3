"""NLopt's algorithms on the same nonlinear program.

S. G. Johnson, The NLopt nonlinear-optimization package, http://github.com/stevengj/nlopt.

NLopt sees ``f``, equations ``c(x) = 0`` and inequalities ``d(x) <= 0``: a range becomes two inequalities, fixed
variables are left out.  It reports a point and nothing else, so multipliers are recovered by least squares
(:mod:`stc.optimizers.dual_estimate`) and the status says whether that point satisfies the optimality conditions, to the
tolerances of the project's own method.  The same test stops the local algorithms as soon as it holds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from stc.errors import UsageError
from stc.optimizers.dual_estimate import stationary_violation
from stc.optimizers.in_child import minimize_in_child
from stc.optimizers.nlopt_algorithms import Algorithm, Choice, choose, require
from stc.optimizers.nlopt_functions import Functions
from stc.optimizers.point_result import GAIN, Judgement, judge, point_result
from stc.optimizers.rays import falls_without_limit
from stc.solver.monitor import Monitor, Stopped
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.report import Callback, Result, Start
from stc.solver.scaled_problem import relative_violation
from stc.solver.status import Status

__all__ = ["minimize_with_nlopt"]

X_TOLERANCE = 1e-12
GRADIENT_TOLERANCE = 1e-13
SMALL_STEP = 1e-2
SEARCH_SHARE = 0.8
LOCAL_EVALUATIONS = 2000
STATIONARY = 1e-6
NEARBY, FARTHER = 1e-3, 0.3
CLEARLY = 0.99
EARLY = 1e-2


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
        UsageError: the algorithm does not exist or cannot solve this kind of problem, or NLopt is not installed.
    """
    choice = choose(name)
    require(choice, nlp)
    _nlopt()
    settings = options or Options()

    def minimize(told: Callback | None) -> Result:
        with np.errstate(all="ignore"):
            return _Solve(choice, nlp, settings, told, start).run()

    return minimize_in_child(minimize, nlp, settings, callback)


def _nlopt() -> Any:
    try:
        import nlopt
    except ImportError as error:
        raise UsageError("NLopt is not installed", "pip install nlopt") from error
    return nlopt


class _Log(Monitor):
    """A monitor that also records points between iterations."""

    def note(self, x: Floats, objective: float, violation: float) -> None:
        """Keep a point if it is the best so far."""
        if self._is_better(objective, violation):
            self.best = (violation, objective, x.copy(), np.zeros(0))


class _Solve:
    """One solve: the algorithm, what follows when it ends, and the result."""

    def __init__(
        self, choice: Choice, nlp: NLP, options: Options, callback: Callback | None, start: Start | None
    ) -> None:
        self.choice, self.nlp, self.options = choice, nlp, options
        x0 = np.asarray(nlp.x0 if start is None else start.x, dtype=float)
        self.x0 = np.clip(x0, nlp.x_lower, np.maximum(nlp.x_lower, nlp.x_upper))
        self.monitor = _Log(options, callback)
        self.functions = Functions(nlp, self.x0, options.scaling)
        self.ended: Status | None = None
        self.optimal_at: Floats | None = None
        self.word = ""
        self.restarted = False

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
        """The best point in the box, refined locally, since a search alone only comes close to an optimum."""
        self._optimised(self.choice, self.x0, SEARCH_SHARE)
        best = self._best(self.x0)
        if self.ended in (Status.INTERRUPTED, Status.TIME_LIMIT):
            return best
        self.ended = None
        return self._optimised(self._local_choice(), best, 1.0)

    def _local_choice(self) -> Choice:
        """The local algorithm for refinement or restarts: the algorithm itself, or SLSQP after a search."""
        return choose("nlopt:slsqp") if self.choice.algorithm.search else self.choice

    def _concluded(self, x: Floats) -> Result:
        """The result for the final point of the algorithm."""
        # To judge a large problem's point takes long: after the time limit there is one.
        candidates = [self._best(x)] if self.ended is Status.TIME_LIMIT else [x, self._best(x)]
        if self.optimal_at is not None:
            candidates.insert(0, self.optimal_at)
        judged = min((judge(self.nlp, one, self.options) for one in candidates), key=lambda j: j.error)
        x, feasibility = judged.x, self.options.feasibility_tolerance
        if judged.optimal:
            return point_result(self.nlp, judged, Status.OPTIMAL, self.monitor)
        if judged.conditions.violation <= feasibility:
            if falls_without_limit(self.nlp, x, self.x0, feasibility):
                return self._result(Status.UNBOUNDED, x)
        elif self.ended is not Status.TIME_LIMIT:
            nearest, verdict = self._least_violation(x)
            if self.ended is Status.INTERRUPTED:
                return self._result(Status.INTERRUPTED, self._best(x))
            if verdict == "feasible" and not self.restarted and self.ended is None:
                self.restarted = True
                return self._concluded(self._optimised(self._local_choice(), nearest, 1.0))
            if verdict == "stationary":
                return self._result(Status.INFEASIBLE, nearest)
        if self.ended is None and not self.restarted:
            self.restarted = True
            return self._concluded(self._optimised(self._local_choice(), x, 1.0))
        status = self.ended or Status.FAILED
        message = self._failure(judged) if status is Status.FAILED else ""
        return point_result(self.nlp, judged, status, self.monitor, message)

    def _failure(self, judged: Judgement) -> str:
        found, options = judged.conditions, self.options
        if found.violation > options.feasibility_tolerance or found.optimality > options.unscaled_tolerance:
            figures = (
                f"a violation of {found.violation:.1e} and an optimality error of {found.optimality:.1e}, where "
                f"{options.feasibility_tolerance:.0e} and {options.unscaled_tolerance:.0e} count as solved"
            )
        else:
            figures = (
                "multipliers so large that small residuals prove nothing: the objective may still be off by "
                f"{judged.error * GAIN * options.unscaled_tolerance:.1e} of its size"
            )
        return f"{self.choice.name} {self.word} with {figures}. Try another optimizer: sqp is the default."

    # -- running NLopt -----------------------------------------------------------------------------------------

    def _optimised(self, choice: Choice, x0: Floats, share: float) -> Floats:
        """Run one algorithm from ``x0`` (n,) with a share of the iterations; returns its final point."""
        functions = self.functions
        size = len(functions.free)
        allowed = int(share * self.options.max_iterations)
        opt = self._configured(
            choice.algorithm, size, (allowed + 1) * (size + 1 if not choice.gradient else 30)
        )
        if choice.local is not None:
            inner = self._configured(choice.local, size, LOCAL_EVALUATIONS)
            inner.set_xtol_rel(1e-9)
            inner.set_ftol_rel(1e-12)
            opt.set_local_optimizer(inner)
        watch = _Watch(self, choice, opt, allowed)
        opt.set_min_objective(watch.objective)
        nlp = self.nlp
        if len(functions.equal):
            tolerance = functions.tolerances(nlp.row_upper, functions.equal)
            opt.add_equality_mconstraint(watch.guarded(functions.equalities), tolerance)
        if len(functions.above) + len(functions.below):
            above = functions.tolerances(nlp.row_upper, functions.above)
            tolerance = np.concatenate([above, functions.tolerances(nlp.row_lower, functions.below)])
            if choice.algorithm.row_by_row:
                for k, allowance in enumerate(tolerance):
                    opt.add_inequality_constraint(watch.row(k), allowance)
            else:
                opt.add_inequality_mconstraint(watch.guarded(functions.inequalities), tolerance)
        z = opt.optimize(functions.inside(x0))
        outcome = opt.last_optimize_result()
        if outcome == -2 or outcome == -3:
            reason = opt.get_errmsg() or ("out of memory" if outcome == -3 else "it does not say why")
            raise UsageError(f"{choice.name} cannot solve this problem: {reason}")
        self.word = _WORDS.get(outcome, "stopped")
        self.ended = self.ended or _LIMITS.get(outcome)
        if watch.error is not None:
            raise watch.error
        return functions.outside(z) if np.isfinite(z).all() else x0

    def _configured(self, algorithm: Algorithm, size: int, evaluations: int) -> Any:
        nlopt = _nlopt()
        nlopt.srand(self.options.seed + 1)
        opt = nlopt.opt(getattr(nlopt, algorithm.constant), size)
        opt.set_exceptions_enabled(False)
        opt.set_lower_bounds(self.functions.lower)
        opt.set_upper_bounds(self.functions.upper)
        opt.set_xtol_rel(X_TOLERANCE)
        opt.set_maxeval(evaluations)
        opt.set_param("tolg", GRADIENT_TOLERANCE)
        left = self.monitor.time_left
        if np.isfinite(left):
            opt.set_maxtime(max(left, 1e-3))
        return opt

    def _least_violation(self, x: Floats) -> tuple[Floats, str]:
        """Minimise the sum of squared violations from ``x``, the start and points near them.

        NLopt cannot distinguish an infeasible problem from a failure; this can.

        Returns:
            The point of least violation and ``feasible``, ``stationary`` or ``""``: what it proves.
        """
        rng = np.random.default_rng(self.options.seed)
        size = np.maximum(1.0, np.abs(x))
        starts = [x, x + NEARBY * rng.uniform(-1.0, 1.0, len(x)) * size, self.x0]
        starts += [one + FARTHER * rng.uniform(-1.0, 1.0, len(x)) * size for one in (x, self.x0)]
        best, least = x, np.inf
        for one in starts:
            nearest = self._descended(np.clip(one, self.nlp.x_lower, self.nlp.x_upper))
            if self.ended in (Status.INTERRUPTED, Status.TIME_LIMIT):
                return best, ""
            squares = self.functions.squares()
            if squares < CLEARLY * least:
                best, least = nearest, squares
            if self._violation(best) <= self.options.feasibility_tolerance:
                return best, "feasible"
        error, _ = stationary_violation(self.nlp, best, self.functions.row_scale)
        return best, "stationary" if error <= STATIONARY else ""

    def _descended(self, x: Floats) -> Floats:
        """The minimum of the sum of squared violations reached from ``x`` (n,)."""
        functions = self.functions
        opt = self._configured(choose("nlopt:lbfgs").algorithm, len(functions.free), LOCAL_EVALUATIONS)
        watch = _Watch(self, self.choice, opt, self.options.max_iterations)

        def squares(z: Floats, slope: Floats) -> float:
            functions.derive(z)
            if slope.size:
                slope[:] = functions.squares_slope()
            return functions.squares()

        opt.set_min_objective(watch.quiet(squares))
        z = opt.optimize(functions.inside(x))
        functions.derive(z if np.isfinite(z).all() else functions.inside(x))
        return functions.outside(functions.inside(functions.x))

    # -- results -----------------------------------------------------------------------------------------------

    def _violation(self, x: Floats) -> float:
        _, r = self.nlp.values(x)
        return float(relative_violation(r, self.nlp.row_lower, self.nlp.row_upper).max(initial=0.0))

    def _best(self, x: Floats) -> Floats:
        return x if self.monitor.best is None else self.monitor.best[2]

    def _result(self, status: Status, x: Floats, message: str = "") -> Result:
        return point_result(self.nlp, judge(self.nlp, x, self.options), status, self.monitor, message)


_LIMITS = {5: Status.ITERATION_LIMIT, 6: Status.TIME_LIMIT}

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
    """The interface between NLopt and the problem: it counts, logs, and stops NLopt without raising exceptions through
    it.
    """

    def __init__(self, solve: _Solve, choice: Choice, opt: Any, allowed: int) -> None:
        self.solve, self.choice, self.opt, self.allowed = solve, choice, opt, allowed
        self.error: Exception | None = None
        self._evaluations = 0
        self._stopped = False
        self._last = solve.functions.x.copy()

    def objective(self, z: Floats, slope: Floats) -> float:
        """NLopt's objective: the objective's value; writes its gradient into ``slope`` if its size is not zero."""
        functions = self.solve.functions

        def evaluate() -> float:
            new = functions.derive(z) if slope.size else functions.move(z)
            self._evaluations += 1
            if new and (slope.size or self.choice.algorithm.search or not self.choice.gradient):
                self._count(bool(slope.size))
            if slope.size:
                slope[:] = functions.slope()
            return functions.objective_scale * functions.f if np.isfinite(functions.f) else np.inf

        return self._safely(evaluate, slope, np.inf)

    def guarded(self, fill: Callable[[Floats, Floats], None]) -> Callable[[Floats, Floats, Floats], None]:
        """Rows for NLopt, in its calling convention."""
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

    def row(self, k: int) -> Callable[[Floats, Floats], float]:
        """One inequality for NLopt, without derivatives."""
        functions = self.solve.functions
        values = np.zeros(len(functions.above) + len(functions.below))

        def one(z: Floats, slope: Floats) -> float:
            def evaluate() -> float:
                functions.move(z)
                functions.inequalities(values, np.zeros(0))
                return float(values[k])

            return self._safely(evaluate, slope, 0.0)

        return one

    def quiet(self, function: Callable[[Floats, Floats], float]) -> Callable[[Floats, Floats], float]:
        """Another objective, which is watched for limits and not logged."""

        def evaluate(z: Floats, slope: Floats) -> float:
            def inner() -> float:
                self.solve.monitor.check_time()
                value = function(z, slope)
                return value if np.isfinite(value) else np.inf

            return self._safely(inner, slope, np.inf)

        return evaluate

    def _safely(self, evaluate: Callable[[], float], slope: Floats, otherwise: float) -> float:
        """An evaluation; after a stop there are none, since some algorithms continue for a while."""
        if not self._stopped:
            try:
                self.solve.monitor.check_time()  # Ctrl-C counts at every evaluation, not at iterations alone
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
        """Log a new point as an iteration, and stop if it is already optimal."""
        solve = self.solve
        functions, monitor = solve.functions, solve.monitor
        whole = derived or self._evaluations % (len(functions.free) + 1) == 0
        size = np.maximum(1.0, np.abs(functions.x))
        step = float((np.abs(functions.x - self._last) / size).max(initial=0.0))
        violation = functions.violation() if np.isfinite(functions.f) else np.inf
        optimality = float("nan")
        if whole and step <= SMALL_STEP and violation <= solve.options.feasibility_tolerance:
            if not self.choice.algorithm.search:
                judged = judge(solve.nlp, functions.x.copy(), solve.options)
                optimality = judged.conditions.optimality
                if judged.error <= EARLY:
                    solve.optimal_at = judged.x
        self._last = functions.x.copy()
        x, f = functions.x, functions.f
        if not whole:
            monitor.note(x, f, violation)
            return
        monitor.record("nlopt", lambda: (x.copy(), np.zeros(0)), f, violation, optimality, step)
        if solve.optimal_at is not None:
            self._stop(None)
            return
        if monitor.iterations >= self.allowed:
            raise Stopped(Status.ITERATION_LIMIT)
        monitor.count()
