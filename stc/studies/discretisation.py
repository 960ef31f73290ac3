"""How far a discretised motion is from solving its own equations between the frames.

Two estimates, both without another solve:

*Local errors* of every step.  Under the collocation methods the motion between the nodes is a polynomial, and there
the equations of motion hold only approximately.  The estimate is where the equations themselves lead from the
step's left frame, everything else (forces) being what the method's curves say, against where the motion is at its
right frame: Picard iteration on Gauss points, from the method's own curve, which gains an order of the step each
time.  (J. T. Betts, Practical methods for optimal control and estimation using nonlinear programming, 2010, section
4.7.4, bounds the same error by the integral of the defect's absolute value; under hermite-simpson that is an order
too large, since the defect changes its sign at the midpoint.)  Central differences have no polynomial of their own:
there the differences are compared with those that use two more frames, which are two orders more accurate, and the
gap is integrated over the step; where a derivative is asked for at a single frame, its gap counts as it is.

The local errors of a quantity, relative to its size along the motion, are summed over all steps: what they come to
together where the system neither damps nor multiplies them.  (The largest one alone, which is usual, is smaller by
the number of steps; measured against finer solves and replays it promises too much by two orders.)

*Quadrature error* of the objective: its integrals along the curves between the nodes against the method's own
sums, relative to the objective.

Neither sees what a finer motion would do differently: that a control switches within a step shows as far as it
costs, not as far as it moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.phases import phases, resolved, stretches
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.records import dataclass
from stc.solution import Solution
from stc.symbolic.differentiate import jacobian
from stc.symbolic.expr import Expr, evaluate_all, symbols
from stc.transcription.schemes import stencil_reach

__all__ = ["Estimate", "estimate"]

FloatArray = NDArray[np.float64]

POINTS = 6
"""Gauss quadrature in every step, exact to order 12; an even number of places, none of which is a node."""
PICARD = 3
"""Corrections by the equations; the second makes the local error of hermite-simpson exact to leading order."""


def _gauss(points: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places and weights on 0..1, and the integrals of the interpolant from 0 to each place. (points, points)"""
    at, weights = np.polynomial.legendre.leggauss(points)
    at, weights = 0.5 + 0.5 * at, 0.5 * weights
    powers = np.arange(points)
    integrals = at[:, None] ** (powers + 1) / (powers + 1)
    # Columns of the inverse transposed turn values at the places into the polynomial's coefficients.
    return at, weights, np.asarray(np.linalg.solve(at[:, None] ** powers, np.eye(points)).T @ integrals.T)


SHARES, WEIGHTS, INTEGRALS = _gauss(POINTS)

States = dict[tuple[str, int], FloatArray]

CHUNK = 4096
"""Steps that are looked at in one go."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The discretisation error of a solution.

    Attributes:
        states: for every (variable, order of a derivative) that equations of motion determine, the absolute local
            error of each step, (n,), relative to one more than its largest value; infinite where it cannot be told.
        quadrature: (n,) what each step contributes to the objective's error, relative to the objective, signed.
    """

    states: Mapping[tuple[str, int], FloatArray]
    quadrature: FloatArray

    @property
    def local(self) -> FloatArray:
        """The largest local error of each step. (n,)"""
        return np.max([np.zeros(len(self.quadrature)), *self.states.values()], axis=0)

    @property
    def local_error(self) -> float:
        """The largest local error of all."""
        return float(self.local.max(initial=0.0))

    @property
    def accumulated(self) -> float:
        """The largest sum of one quantity's local errors."""
        return max((float(error.sum()) for error in self.states.values()), default=0.0)

    @property
    def quadrature_error(self) -> float:
        """The relative error of the objective."""
        return abs(float(self.quadrature.sum()))

    @property
    def error(self) -> float:
        """The larger one of the last two."""
        return max(self.accumulated, self.quadrature_error)

    @property
    def worst(self) -> str:
        """Name of the quantity whose local errors have the largest sum, empty where all are exact."""
        if self.accumulated == 0.0:
            return ""
        name, order = max(self.states, key=lambda state: float(self.states[state].sum()))
        return name + "'" * order

    def within(self, first: int, last: int) -> float:
        """What the steps from frame ``first`` to frame ``last`` contribute to the error."""
        local = max((float(error[first:last].sum()) for error in self.states.values()), default=0.0)
        return max(local, abs(float(self.quadrature[first:last].sum())))


def estimate(problem: Problem, solution: Solution) -> Estimate:
    """Estimate the discretisation error of an optimal solution.

    Args:
        problem: what was solved, with the solution's numbers.
        solution: of this problem, times increasing.

    Raises:
        SolutionError: the times do not increase.
    """
    solution.require_increasing_times()
    states = (_difference_errors if problem.method == "central" else _local_errors)(problem, solution)
    return Estimate(states, _quadrature_error(problem, solution) if solution.n else np.zeros(0))


# ------------------------------------------------------------------ collocation


def _local_errors(problem: Problem, solution: Solution) -> States:
    found: States = {}
    tops = {
        name: order for name, order in solution.trajectories if order > 0
    }  # orders rise: the last one stays
    for phase in phases(problem):
        bodies = [e.body for e in phase.equations if _readable(e.body, solution)]
        here = {k.name for b in bodies for k in symbols(b) if isinstance(k, VariableRef)}
        flow = _Flow(bodies, {name: order for name, order in tops.items() if name in here})
        if not flow.entries:
            continue
        for begin in range(phase.first, phase.last, CHUNK):
            steps = np.arange(begin, min(begin + CHUNK, phase.last))
            for (name, order), error in flow.errors(solution, steps).items():
                sums = found.setdefault((name, order), np.zeros(solution.n))
                sums[steps] = np.abs(error) / _size(solution, name, order)
    return found


def _size(solution: Solution, name: str, order: int) -> float:
    channel = solution.trajectories[name, order]
    return 1.0 + float(np.abs(np.concatenate([channel.before, channel.after])).max())


class _Flow:
    """Equations of motion as they lead from the left end of a step to the right.

    Args:
        bodies: what must be zero.
        tops: highest derivative of every variable in them.
    """

    def __init__(self, bodies: list[Expr], tops: dict[str, int]) -> None:
        self.bodies, self.tops = bodies, tops
        keys = [VariableRef(name, order) for name, order in tops.items()]
        self.entries = jacobian(bodies, keys) if keys else {}

    def errors(self, solution: Solution, steps: NDArray[np.int_]) -> dict[tuple[str, int], FloatArray]:
        """Where each step ought to end less where it does, for every derivative below the highest. (steps,)"""
        values, shape = _between(solution, steps)
        lengths = np.diff(solution.time)[steps][:, None]
        starts = solution.at_frame(steps, "after")
        ends = solution.at_frame(steps + 1, "before")
        found: dict[tuple[str, int], FloatArray] = {}
        for _ in range(PICARD):
            change = self._change(values, shape)
            for column, (name, top) in enumerate(self.tops.items()):
                rate = np.asarray(values[VariableRef(name, top)]) + change[..., column]
                values[VariableRef(name, top)] = rate
                for order in range(top - 1, -1, -1):
                    left = np.asarray(starts[name + "'" * order])
                    found[name, order] = left + lengths[:, 0] * (rate @ WEIGHTS) - ends[name + "'" * order]
                    rate = left[:, None] + lengths * (rate @ INTEGRALS)
                    values[VariableRef(name, order)] = rate
        return found

    def _change(self, values: dict[object, Any], shape: tuple[int, int]) -> FloatArray:
        """What the highest derivatives lack to solve the equations, one Newton step. (steps, places, variables)"""
        places = sorted(self.entries)
        numbers = evaluate_all([*self.bodies, *(self.entries[place] for place in places)], values)
        numbers = [np.broadcast_to(np.asarray(v, float), shape).reshape(-1) for v in numbers]
        residual = np.array(numbers[: len(self.bodies)])
        matrix = np.zeros((residual.shape[1], len(self.bodies), len(self.tops)))
        for (row, column), number in zip(places, numbers[len(self.bodies) :], strict=True):
            matrix[:, row, column] = number
        good = np.isfinite(residual).all(axis=0) & np.isfinite(matrix).all(axis=(1, 2))
        change = np.full((residual.shape[1], len(self.tops)), np.inf)
        inverse = np.linalg.pinv(matrix[good], rcond=1e-10)
        change[good] = -np.einsum("pcr,rp->pc", inverse, residual[:, good])
        return change.reshape(*shape, len(self.tops))


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


def _difference_errors(problem: Problem, solution: Solution) -> States:
    """Wider stencils against the method's own, at the frames where a derivative stands in some statement."""
    n, time = solution.n, solution.time
    lengths = np.diff(time)
    found: States = {}
    for (name, order), (wide, single) in _frames_of_use(problem).items():
        width = 2 * stencil_reach(order) + 1
        if width + 2 > n + 1:
            found[name, order - 1] = np.full(n, np.inf)
            continue
        x = solution[name]
        better = _derivative(time, x, order, width + 2)
        gap = np.abs(_derivative(time, x, order, width) - better)
        # A condition at one frame is missed by the gap itself, by the step beside it.
        at = np.flatnonzero(single & ~wide)
        if len(at):
            missed = found.setdefault((name, order), np.zeros(n))
            np.add.at(missed, np.minimum(at, n - 1), gap[at] / (1.0 + float(np.abs(better).max())))
        if order > 1:
            # Where the stencil does not fit no statement holds; the nearest frame where it does speaks for the step.
            reach = stencil_reach(order)
            gap[:reach], gap[n + 1 - reach :] = gap[reach], gap[n - reach]
            wide[:reach], wide[n + 1 - reach :] = wide[reach], wide[n - reach]
        gap[~wide] = 0.0
        below = x if order == 1 else _derivative(time, x, order - 1, 2 * stencil_reach(order - 1) + 1)
        error = 0.5 * lengths * (gap[:-1] + gap[1:]) / (1.0 + float(np.abs(below).max()))
        found[name, order - 1] = found.get((name, order - 1), 0.0) + error
    return found


def _frames_of_use(
    problem: Problem,
) -> dict[tuple[str, int], tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """The frames at which each derivative stands in statements on several frames, and on one, (n+1,) each."""
    n = problem.n
    found: dict[tuple[str, int], tuple[NDArray[np.bool_], NDArray[np.bool_]]] = {}
    ranges = [(r.body, r.range) for r in problem.relations] + [(o.body, o.range) for o in problem.objective]
    for first, last in [*stretches(problem, ()), (n, n)]:
        for body, frames in ranges:
            a, b = max(first, frames.first), min(max(last - 1, first), frames.last)
            if a > b:
                continue
            for key in symbols(resolved(problem, body, a)):
                if isinstance(key, VariableRef) and key.order:
                    here = float(key.scale) * np.arange(a, b + 1) + float(key.shift)
                    at = np.clip(np.rint(here).astype(int), 0, n)
                    none = np.zeros(n + 1, bool), np.zeros(n + 1, bool)
                    several, one = found.setdefault((key.name, key.order), none)
                    (several if frames.first < frames.last and key.scale else one)[at] = True
    return found


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
