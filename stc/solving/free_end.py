"""A solve that reaches for the end of the motion: what the last frame fixes is first only wished for.

From straight lines between the first and the last pose no motion may be found that weak motors can drive, as that of a
pendulum that has to swing several times before it stands.  If the last frame is free, there is one right away, to let
it hang; and the next steps lead the end of the motion towards its place, by motions that are possible:

    minimise  share * f(x) + 1/2 sum of w_k (x_k - e_k)^2    subject to the same rows and other bounds

with the values e_k that the last frame fixes.  From there the problem as stated is solved.  Optimal control by
shooting does the same with its costs of the last state (Tassa, Mansard & Todorov 2014).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.optimizers import Minimizer
from stc.records import dataclass
from stc.solver import Options, Result, Start, Status
from stc.solver.convexity import is_convex
from stc.solver.nlp import NLP
from stc.solver.status import advice, sentence
from stc.transcription import Transcription
from stc.transcription.bind import BoundProgram

__all__ = ["by_free_end"]

FloatArray = NDArray[np.float64]

#: Weights of values and of their rates (1 rad/s counts as 0.3 rad); what the objective counted where no motion was
#: found, or counts at the start if that is more, is worth this much of their squares.
_WEIGHTS, _SHARE = (1.0, 0.1), 1e-3
#: Of each of the two solves.
_ITERATIONS = 300
#: The error at which the first one ends.
_TOLERANCE = 1e-4
_TINY = float(np.finfo(float).tiny)
_ENDED = (Status.INTERRUPTED, Status.TIME_LIMIT)


@dataclass(frozen=True, slots=True)
class _End:
    """What the last frame fixes.

    Attributes:
        at: positions of values and rates, (k,).
        weights: of their squares, (k,).
        start: the guess, (n,), in which these variables stay as they are from the frame that fixes them before.
    """

    at: NDArray[np.int64]
    weights: FloatArray
    start: FloatArray


class _FreeEnd:
    """``bound`` with a free end: :class:`stc.solver.nlp.NLP`."""

    def __init__(self, bound: BoundProgram, end: _End, share: float) -> None:
        self._bound, self._share, ends = bound, share, end.at
        self._ends, self._weights, self._values = ends, end.weights, bound.x_lower[ends]
        self.n, self.m, self.x0 = bound.n, bound.m, end.start
        self.x_lower, self.x_upper = bound.x_lower.copy(), bound.x_upper.copy()
        self.x_lower[ends], self.x_upper[ends] = -np.inf, np.inf
        self.row_lower, self.row_upper = bound.row_lower, bound.row_upper
        self.jac_rows, self.jac_cols = bound.jac_rows, bound.jac_cols
        diagonal = np.full(bound.n, -1)
        own = np.flatnonzero(bound.hess_rows == bound.hess_cols)
        diagonal[bound.hess_rows[own]] = own
        new = ends[diagonal[ends] < 0]
        diagonal[new] = len(bound.hess_rows) + np.arange(len(new))
        self._diagonal, self._new = diagonal[ends], np.zeros(len(new))
        self.hess_rows = np.concatenate([bound.hess_rows, new]).astype(np.int32)
        self.hess_cols = np.concatenate([bound.hess_cols, new]).astype(np.int32)
        self.var_stage, self.row_stage = bound.var_stage, bound.row_stage
        self.row_linear, self.objective_degree = bound.row_linear, max(2, bound.objective_degree)
        self.fixed_curvature = bound.fixed_curvature

    def values(self, x: FloatArray) -> tuple[float, FloatArray]:
        """A little of the objective and how far the end is from its place, and the rows."""
        f, rows = self._bound.values(x)
        off = x[self._ends] - self._values
        return self._share * f + 0.5 * float(self._weights @ off**2), rows

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray, objective_factor: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The derivatives of :meth:`values`: gradient, Jacobian and Hessian entries."""
        gradient, jac, hess = self._bound.derivatives(x, multipliers, self._share * objective_factor)
        gradient, hess = self._share * gradient, np.concatenate([hess, self._new])
        gradient[self._ends] += self._weights * (x[self._ends] - self._values)
        hess[self._diagonal] += objective_factor * self._weights
        return gradient, jac, hess


def by_free_end(
    transcription: Transcription,
    bound: BoundProgram,
    options: Options,
    callback: Callable[[Any], bool | None] | None,
    minimizer: Minimizer,
) -> Result:
    """Solve from the guess of a spec; if that finds no motion, by a free end, and if that does not, by all means.

    Args:
        transcription: of the problem.
        bound: the problem.
        options: of the solver.
        callback: called after every iteration.
        minimizer: solves a program.
    """
    end = _end(transcription, bound)
    if not len(end.at) or not options.retries:
        return minimizer(bound, options, start=None, callback=callback)
    spent = [first := minimizer(bound, replace(options, retries=0), start=None, callback=callback)]
    unsolved = first.status in (Status.INFEASIBLE, Status.FAILED) and first.iterations > 0
    if not unsolved and not _is_rough(first, options):
        return first
    if not unsolved or is_convex(bound):  # which has nothing else to be found elsewhere
        return minimizer(bound, options, start=None, callback=callback)

    def left() -> int:
        return options.max_iterations - sum(one.iterations for one in spent)

    def solved(program: NLP, start: Start | None, **settings: Any) -> None:
        if left() > 0 and spent[-1].status not in _ENDED:
            some = replace(options, **{"max_iterations": min(left(), _ITERATIONS), "retries": 0, **settings})
            spent.append(minimizer(program, some, start=start, callback=callback))

    sizes = [abs(first.objective), abs(bound.values(end.start)[0]), _TINY]
    free = _FreeEnd(bound, end, _SHARE / max(size for size in sizes if np.isfinite(size)))
    solved(free, None, tolerance=_TOLERANCE, unscaled_tolerance=_TOLERANCE)
    reached = len(spent)
    solved(bound, Start(spent[-1].x))
    found = spent[-1]
    if len(spent) == reached:  # a limit has left nothing for the problem as stated
        status = found.status if found.status in _ENDED else Status.ITERATION_LIMIT
        found = replace(first, status=status, message=f"{sentence(status)} {advice(status)}")
    elif found.status is Status.OPTIMAL and not _is_rough(found, options):
        found = replace(found, strategy="free end")
    else:
        solved(bound, None, max_iterations=left(), retries=options.retries)
        found = spent[-1]
    return replace(
        found,
        iterations=sum(one.iterations for one in spent),
        factorizations=sum(one.factorizations for one in spent),
    )


def _is_rough(found: Result, options: Options) -> bool:
    """Whether a solution would be looked for by other means, if any were allowed, since its errors are too large."""
    rough = found.violation > options.feasibility_tolerance or found.optimality > options.tolerance
    return found.status is Status.OPTIMAL and rough


def _end(transcription: Transcription, bound: BoundProgram) -> _End:
    at: list[int] = []
    weights: list[float] = []
    held: dict[str, int] = {}
    fixed, start = bound.x_lower == bound.x_upper, bound.x0.copy()
    for name, order, before, after, middle in transcription.layout.slots():
        if order < len(_WEIGHTS) and fixed[after[-1]]:
            at.append(int(after[-1]))
            weights.append(_WEIGHTS[order])
        if not order and fixed[after[-1]]:
            held[name] = int(np.flatnonzero(fixed[before[:-1]]).max(initial=0))
        if name in held:
            since = held[name]
            value = 0.0 if order else start[after[since]]
            start[before[since + 1 :]] = start[after[since + 1 :]] = start[middle[since:]] = value
    return _End(np.array(at, np.int64), np.array(weights), start)
