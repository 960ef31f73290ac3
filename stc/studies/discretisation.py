"""How far a discretised motion is from solving its own equations between the frames.

Two estimates, both without another solve:

*Local error* of every step.  Under the collocation methods the motion between the nodes is a polynomial, and there
the equations of motion hold only approximately.  The change of the highest derivatives that would make them hold,
integrated over a step, is the error that the step adds to the derivative below, relative to its size along the
motion (J. T. Betts, Practical methods for optimal control and estimation using nonlinear programming, 2010,
section 4.7.4; M. Kelly, An introduction to trajectory optimization, SIAM Review 59, 2017, section 5.4).  Central
differences have no polynomial of their own: there the differences are compared with those that use two more
frames, which are two orders more accurate, and the gap is integrated in the same way.

*Quadrature error* of the objective: its integrals along the curves between the nodes against the method's own
sums, relative to the objective.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.phases import phases, resolved, stretches
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.solution import Solution
from stc.symbolic.differentiate import jacobian
from stc.symbolic.expr import Expr, evaluate_all, symbols
from stc.transcription.schemes import stencil_reach

__all__ = ["Estimate", "estimate"]

FloatArray = NDArray[np.float64]

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
SHARES: FloatArray = np.concatenate([0.25 + 0.25 * _POINTS, 0.75 + 0.25 * _POINTS])
WEIGHTS: FloatArray = np.concatenate([0.25 * _WEIGHTS, 0.25 * _WEIGHTS])
"""Gauss quadrature on either half of a step; its places are never nodes."""

CHUNK = 4096
"""Steps that are looked at in one go."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The discretisation error of a solution.

    Attributes:
        local: (n,) relative local error of every step; infinite where it cannot be told.
        quadrature: (n,) what each step contributes to the objective's error, relative to the objective, signed.
        worst: name of the derivative with the largest local error, empty where all are exact.
    """

    local: FloatArray
    quadrature: FloatArray
    worst: str

    @property
    def local_error(self) -> float:
        """The largest local error."""
        return float(self.local.max(initial=0.0))

    @property
    def quadrature_error(self) -> float:
        """The relative error of the objective."""
        return abs(float(self.quadrature.sum()))

    @property
    def error(self) -> float:
        """The larger of both."""
        return max(self.local_error, self.quadrature_error)


def estimate(problem: Problem, solution: Solution) -> Estimate:
    """Estimate the discretisation error of an optimal solution.

    Args:
        problem: what was solved, with the solution's numbers.
        solution: of this problem, times increasing.

    Raises:
        SolutionError: the times do not increase.
    """
    solution.require_increasing_times()
    n = solution.n
    if problem.method == "central":
        local, worst = _difference_error(problem, solution)
    else:
        local, worst = _defects(problem, solution)
    return Estimate(local, _quadrature_error(problem, solution) if n else np.zeros(0), worst)


# ------------------------------------------------------------------ collocation


def _defects(problem: Problem, solution: Solution) -> tuple[FloatArray, str]:
    local, worst, largest = np.zeros(solution.n), "", 0.0
    tops = {
        name: order for name, order in solution.trajectories if order > 0
    }  # orders rise: the last one stays
    size = {
        name: 1.0 + max(_largest(solution, name, order - 1), _largest(solution, name, order))
        for name, order in tops.items()
    }
    for phase in phases(problem):
        bodies = [e.body for e in phase.equations if _readable(e.body, solution)]
        found = {k.name for b in bodies for k in symbols(b) if isinstance(k, VariableRef)}
        names = [name for name in tops if name in found]
        keys = [VariableRef(name, tops[name]) for name in names]
        entries = jacobian(bodies, keys) if names else {}
        if not entries:
            continue
        places = sorted(entries)
        for begin in range(phase.first, phase.last, CHUNK):
            steps = np.arange(begin, min(begin + CHUNK, phase.last))
            values, shape = _between(solution, steps)
            numbers = evaluate_all([*bodies, *(entries[place] for place in places)], values)
            numbers = [np.broadcast_to(np.asarray(v, float), shape).reshape(-1) for v in numbers]
            residual = np.array(numbers[: len(bodies)])
            matrix = np.zeros((residual.shape[1], len(bodies), len(names)))
            for (row, column), number in zip(places, numbers[len(bodies) :], strict=True):
                matrix[:, row, column] = number
            good = np.isfinite(residual).all(axis=0) & np.isfinite(matrix).all(axis=(1, 2))
            change = np.full((residual.shape[1], len(names)), np.inf)
            change[good] = np.einsum(
                "pcr,rp->pc", np.linalg.pinv(matrix[good], rcond=1e-10), residual[:, good]
            )
            lengths = np.diff(solution.time)[steps]
            mean = np.einsum("sqc,q->sc", np.abs(change).reshape(*shape, len(names)), WEIGHTS)
            error = mean * lengths[:, None] / np.array([size[name] for name in names])
            local[steps] = error.max(axis=1)
            column = int(error.max(axis=0).argmax())
            if error.max() > largest:
                largest, worst = float(error.max()), names[column] + "'" * (tops[names[column]] - 1)
    return local, worst


def _readable(body: Expr, solution: Solution) -> bool:
    """Whether an expression has a value between the nodes of the solution."""
    for key in symbols(body):
        if isinstance(key, VariableRef):
            if (key.scale, key.shift, key.side) != (1, 0, "") or (
                key.name,
                key.order,
            ) not in solution.trajectories:
                return False
        elif not isinstance(key, ConstantRef | ParameterRef | TimeRef | IndexRef):
            return False
    return True


def _largest(solution: Solution, name: str, order: int) -> float:
    channel = solution.trajectories[name, order]
    return float(np.abs(np.concatenate([channel.before, channel.after])).max())


def _fixed(solution: Solution) -> dict[object, Any]:
    values: dict[object, Any] = {ConstantRef(k): v for k, v in solution.constants.items()}
    values.update({ParameterRef(k): v for k, v in solution.parameters.items()})
    return values


def _between(solution: Solution, steps: NDArray[np.int_]) -> tuple[dict[object, Any], tuple[int, int]]:
    """What every symbol is worth at the quadrature's places in some steps, and the shape (steps, places)."""
    index = steps[:, None] + SHARES
    motion = solution.at_frame(index)
    values = _fixed(solution)
    for name, order in solution.trajectories:
        values[VariableRef(name, order)] = motion[name + "'" * order]
    lengths = np.diff(solution.time)
    values[TimeRef()] = solution.time[steps][:, None] + SHARES * lengths[steps][:, None]
    values[IndexRef()] = index
    return values, index.shape


# ------------------------------------------------------------------ central differences


def _difference_error(problem: Problem, solution: Solution) -> tuple[FloatArray, str]:
    used: dict[str, set[int]] = {}
    pieces = [piece.body for several in problem.definitions.values() for piece in several]
    for body in [*(r.body for r in problem.relations), *(o.body for o in problem.objective), *pieces]:
        for key in symbols(body):
            if isinstance(key, VariableRef) and key.order:
                used.setdefault(key.name, set()).add(key.order)
    n, time = solution.n, solution.time
    local, worst, largest = np.zeros(n), "", 0.0
    lengths = np.diff(time)
    for name, orders in used.items():
        x = solution[name]
        below = float(np.abs(x).max())
        for order in range(1, max(orders) + 1):
            narrow = 2 * stencil_reach(order) + 1
            if narrow + 2 > n + 1:
                if order in orders:
                    return np.full(n, np.inf), name + "'" * (order - 1)
                break
            coarse, fine = _derivative(time, x, order, narrow), _derivative(time, x, order, narrow + 2)
            reach = stencil_reach(order)
            gap = np.abs(coarse - fine)
            # Where the stencil does not fit, the nearest frame where it does speaks for the motion.
            gap[:reach], gap[n + 1 - reach :] = gap[reach], gap[n - reach]
            here = float(np.abs(fine[reach : n + 1 - reach]).max())
            if order in orders:
                error = 0.5 * lengths * (gap[:-1] + gap[1:]) / (1.0 + max(below, here))
                local = np.maximum(local, error)
                if error.max() > largest:
                    largest, worst = float(error.max()), name + "'" * (order - 1)
            below = here
    return local, worst


def _derivative(time: FloatArray, x: FloatArray, order: int, width: int) -> FloatArray:
    """A derivative at every frame, of the polynomial through the ``width`` nearest frames. (n+1,)"""
    n = len(time) - 1
    first = np.clip(np.arange(n + 1) - width // 2, 0, n + 1 - width)
    window = first[:, None] + np.arange(width)
    offsets = time[window] - time[:, None]
    scale = np.abs(offsets).max(axis=1)
    powers = (offsets / scale[:, None])[:, None, :] ** np.arange(width)[:, None]  # (n+1, power, point)
    target = np.zeros((n + 1, width, 1))
    target[:, order, 0] = float(np.prod(np.arange(1, order + 1)))
    weights = np.linalg.solve(powers, target)[:, :, 0] / scale[:, None] ** order
    return np.asarray((weights * x[window]).sum(axis=1))


# ------------------------------------------------------------------ objective


def _quadrature_error(problem: Problem, solution: Solution) -> FloatArray:
    error = np.zeros(solution.n)
    terms = [t for t in problem.objective if t.integral and t.range.first < t.range.last]
    for first, last in stretches(problem, ()):
        for term in terms:
            a, b = max(first, term.range.first), min(last, term.range.last)
            body = resolved(problem, term.body, first)
            if a >= b or not _readable(body, solution):
                continue
            for begin in range(a, b, CHUNK):
                steps = np.arange(begin, min(begin + CHUNK, b))
                error[steps] += _integral_gap(solution, body, steps)
    scale = 1.0 + abs(solution.objective)
    return np.where(np.isfinite(error), error, 0.0) / scale


def _integral_gap(solution: Solution, body: Expr, steps: NDArray[np.int_]) -> FloatArray:
    """The integral over each step along the curves, less the method's own. (steps,)"""
    lengths = np.diff(solution.time)[steps]
    values, shape = _between(solution, steps)
    inside = np.broadcast_to(np.asarray(evaluate_all([body], values)[0], float), shape)
    left = _at_nodes(solution, body, steps, "after")
    right = _at_nodes(solution, body, steps + 1, "before")
    if solution.method == "hermite-simpson":
        middle = _at_nodes(solution, body, steps + 0.5, "after")
        own = (left + 4.0 * middle + right) / 6.0
    else:
        own = 0.5 * (left + right)
    return lengths * (inside @ WEIGHTS - own)


def _at_nodes(solution: Solution, body: Expr, index: NDArray[Any], side: Any) -> FloatArray:
    motion = solution.at_frame(index, side)
    values = _fixed(solution)
    for name, order in solution.trajectories:
        values[VariableRef(name, order)] = motion[name + "'" * order]
    values[TimeRef()] = np.interp(index, np.arange(solution.n + 1), solution.time)
    values[IndexRef()] = np.asarray(index, float)
    return np.broadcast_to(np.asarray(evaluate_all([body], values)[0], float), np.shape(index))
