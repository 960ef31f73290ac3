"""The discretisation error of a motion: how well it satisfies its own equations between the frames.

Two estimates, both without another solve:

*Local errors* of every step.  Under the collocation methods the motion between the nodes is a polynomial, and there
the equations of motion hold only approximately.  The estimate integrates the equations from the step's
left frame, with forces on the method's curves, and compares the result with the motion at the right frame.  The
integration is Picard iteration on Gauss points, starting from the method's own curve; each iteration gains an order of
the step.  (J. T. Betts, Practical methods for optimal control and estimation using nonlinear programming, 2010, section
4.7.4, bounds the same error by the integral of the defect's absolute value; under hermite-simpson that is an order
too large, since the defect changes its sign at the midpoint.)  Central differences have no polynomial of their own:
there the differences are compared with those that use two more frames, which are two orders more accurate, and the
gap is integrated over the step; for a derivative at a single frame, the gap itself counts.

The local errors of a quantity, relative to its size along the motion, are summed over all steps, which is their total
effect if the system neither damps nor amplifies them.  (The largest one alone, which is usual, is smaller by a factor
of the number of steps; compared with finer solves and replays it is too small by two orders of magnitude.)

*Quadrature error* of the objective: its integrals along the curves between the nodes against the method's own
sums, relative to the objective.

Neither estimate accounts for changes of the optimum itself: the switch of a control within a step shows in its effect
on the objective, but not in its effect on the motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.phases import phases, resolved, stretches
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, Rotation, TimeRef, VariableRef
from stc.records import dataclass
from stc.solution import Solution
from stc.symbol_values import fixed_values, values_at
from stc.symbolic.expr import Expr, evaluate_all, neg, sym, symbols
from stc.time_derivatives import quaternion_product
from stc.transcription.schemes import stencil_reach

__all__ = ["Estimate", "estimate"]

FloatArray = NDArray[np.float64]

POINTS = 6
"""Points of Gauss quadrature in every step, exact to order 12. Their number is even, so that none is a node."""
PICARD = 3
"""Corrections by the equations; the second makes the local error of hermite-simpson exact to leading order, the third
shows whether they converge."""
STEP = 1e-5
"""Step of difference quotients of the equations."""
DIVERGES = 0.5
"""The step is too long if a correction changes the local error by more than this share of the previous change."""


def _gauss(points: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places and weights on 0..1, and the integrals of the interpolant from 0 to each place. (points, points)"""
    # The roots of a Legendre polynomial are the eigenvalues of a tridiagonal matrix (Golub & Welsch 1969): NumPy's own
    # function for them would take longer to import than all of this takes.
    order = np.arange(1, points)
    beside = order / np.sqrt(4.0 * order**2 - 1.0)
    roots, vectors = np.linalg.eigh(np.diag(beside, 1) + np.diag(beside, -1))
    at, weights = 0.5 + 0.5 * roots, vectors[0] ** 2
    powers = np.arange(points)
    integrals = at[:, None] ** (powers + 1) / (powers + 1)
    # Columns of the inverse transposed turn values at the places into the polynomial's coefficients.
    return at, weights, np.asarray(np.linalg.solve(at[:, None] ** powers, np.eye(points)).T @ integrals.T)


SHARES, WEIGHTS, INTEGRALS = _gauss(POINTS)

States = dict[tuple[str, int], FloatArray]

CHUNK = 4096
"""Number of steps that are evaluated together."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The discretisation error of a solution.

    Attributes:
        states: for every (variable, order of a derivative) that equations of motion determine, the absolute local
            error of each step, (n,), relative to one more than its largest value; infinite if it is not known.
        quadrature: (n,) contribution of each step to the objective's error, relative to the objective, signed.
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
        """The larger one of ``accumulated`` and ``quadrature_error``."""
        return max(self.accumulated, self.quadrature_error)

    @property
    def worst(self) -> str:
        """Name of the quantity whose local errors have the largest sum, empty where all are exact."""
        if self.accumulated == 0.0:
            return ""
        name, order = max(self.states, key=lambda state: float(self.states[state].sum()))
        return name + "'" * order

    def within(self, first: int, last: int) -> float:
        """The contribution of the steps from frame ``first`` to frame ``last`` to the error."""
        local = max((float(error[first:last].sum()) for error in self.states.values()), default=0.0)
        return max(local, abs(float(self.quadrature[first:last].sum())))


def estimate(problem: Problem, solution: Solution) -> Estimate:
    """Estimate the discretisation error of an optimal solution.

    Args:
        problem: the problem with the solution's constants.
        solution: a solution of this problem with increasing times.

    Raises:
        SolutionError: the times do not increase.
    """
    solution.require_increasing_times()
    if problem.method == "central":
        states = _difference_errors(problem, solution)
    else:
        missed = local_errors(problem, solution)
        states = {key: np.abs(error) / _size(solution, *key) for key, error in missed.items()}
    quadrature = quadrature_errors(problem, solution) / (1.0 + abs(solution.objective))
    return Estimate(states, quadrature)


# ------------------------------------------------------------------ collocation


def local_errors(problem: Problem, solution: Solution) -> States:
    """The local error of each step: the state reached by the equations from its left frame, minus the state at its
    right frame.

    Args:
        problem: the problem.
        solution: its solution by one of the collocation methods.

    Returns:
        For every (variable, order of a derivative below its highest) a signed error of each step, (n,), in its units;
        infinite if it is not known.
    """
    found: States = {}
    tops = {
        name: order for name, order in solution.trajectories if order > 0
    }  # orders rise: the last one stays
    turning = [body for rotation in problem.rotations for body in _turning(rotation)]
    for phase in phases(problem):
        bodies = [e.body for e in phase.equations if _readable(e.body, solution)]
        flow = _Flow([*bodies, *turning], tops)
        for begin in range(phase.first, phase.last, CHUNK):
            steps = np.arange(begin, min(begin + CHUNK, phase.last))
            for key, error in flow.errors(solution, steps).items():
                found.setdefault(key, np.zeros(solution.n))[steps] = error
    return found


def _turning(rotation: Rotation) -> list[Expr]:
    """Residuals of the kinematics of a unit quaternion with its angular velocity, along the unit sphere and normal to
    it.
    """
    places = [sym(VariableRef(name)) for name in rotation.quaternion]
    rates = [sym(VariableRef(name, 1)) for name in rotation.quaternion]
    along = quaternion_product([places[0], *(neg(c) for c in places[1:])], rates)
    turns = [
        rate * 2.0 - sym(VariableRef(name)) for rate, name in zip(along[1:], rotation.velocity, strict=True)
    ]
    return [*turns, along[0]]


def _size(solution: Solution, name: str, order: int) -> float:
    channel = solution.trajectories[name, order]
    return 1.0 + float(np.abs(np.concatenate([channel.before, channel.after])).max())


class _Flow:
    """Integration of the equations of motion from the left end of a step to the right.

    Args:
        bodies: the expressions that must be zero.
        tops: highest derivative of every variable of the motion.
    """

    def __init__(self, bodies: list[Expr], tops: dict[str, int]) -> None:
        used = {key for body in bodies for key in symbols(body)}
        every = [VariableRef(name, order) for name, order in tops.items()]
        self.highest = [key for key in every if key in used]
        self.bodies = [body for body in bodies if not set(symbols(body)).isdisjoint(self.highest)]
        self.tops = tops

    def errors(self, solution: Solution, steps: NDArray[np.int_]) -> States:
        """The integrated state at the end of each step minus that of the motion, for every derivative below the
        highest. (steps,)

        Corrections that diverge, as where a step is long for a stiff system, are summed as the alternating geometric
        series that they begin.
        """
        values = values_at(solution, index := steps[:, None] + SHARES)
        shape = index.shape
        inverse = self._inverse(values, shape) if self.bodies else np.zeros((shape[0], 0, 0))
        lengths = np.diff(solution.time)[steps][:, None]
        found: States = {}
        several: list[States] = []
        for _ in range(PICARD):
            found = {}
            if self.bodies:
                change = self._change(values, shape, inverse)
                for column, key in enumerate(self.highest):
                    values[key] = np.asarray(values[key]) + change[..., column]
            for name, top in self.tops.items():
                rate = np.asarray(values[VariableRef(name, top)])
                for order in range(top - 1, -1, -1):
                    channel = solution.trajectories[name, order]
                    left, right = channel.after[steps], channel.before[steps + 1]
                    found[name, order] = left + lengths[:, 0] * (rate @ WEIGHTS) - right
                    rate = left[:, None] + lengths * (rate @ INTEGRALS)
                    values[VariableRef(name, order)] = rate
            several.append(found)
        return {key: _summed([one[key] for one in several]) for key in found}

    def _inverse(self, values: Mapping[object, Any], shape: tuple[int, int]) -> FloatArray:
        """The matrix that maps residuals to changes of the highest derivatives, (steps, derivatives, bodies).

        By differences of the equations, which are linear in them but for rare ones, and at one place in each step:
        successive corrections replace the others.
        """
        place = POINTS // 2
        here: dict[object, Any] = {
            key: value[:, place] if np.shape(value) == shape else value for key, value in values.items()
        }
        base = [np.broadcast_to(np.asarray(here[key], float), shape[:1]) for key in self.highest]
        steps = [STEP * (1.0 + np.abs(one).max(initial=0.0)) for one in base]
        for row, (key, one, step) in enumerate(zip(self.highest, base, steps, strict=True)):
            here[key] = np.repeat(one[None], len(steps) + 1, axis=0)
            here[key][row + 1] += step
        matrix = np.empty((shape[0], len(self.bodies), len(steps)))
        for row, number in enumerate(evaluate_all(self.bodies, here)):
            all_of_it = np.broadcast_to(np.asarray(number, float), (len(steps) + 1, shape[0]))
            matrix[:, row] = ((all_of_it[1:] - all_of_it[0]) / np.array(steps)[:, None]).T
        good = np.isfinite(matrix).all(axis=(1, 2))
        inverse = np.full((shape[0], len(steps), len(self.bodies)), np.inf)
        inverse[good] = np.linalg.pinv(matrix[good], rcond=1e-9)
        return inverse

    def _change(
        self, values: Mapping[object, Any], shape: tuple[int, int], inverse: FloatArray
    ) -> FloatArray:
        """The Newton correction of the highest derivatives. (steps, points, derivatives)"""
        numbers = evaluate_all(self.bodies, values)
        residual = np.array([np.broadcast_to(np.asarray(v, float), shape) for v in numbers])
        change = -np.einsum("scr,rsp->spc", inverse, residual)
        return np.where(np.isfinite(change), change, np.inf)


def _summed(errors: list[FloatArray]) -> FloatArray:
    """The limit of a sequence of estimates: its last, or the sum of a geometric series if changes do not decrease.
    (steps,)
    """
    if len(errors) < 3:
        return errors[-1]
    first, second, last = errors[0], errors[1], errors[-1]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        diverges = ~(np.abs(errors[2] - second) <= DIVERGES * np.abs(second - first)) & (second != first)
        ratio = np.abs(second - first) / np.abs(first)
        series = np.where(np.isfinite(ratio), first / (1.0 + ratio), 0.0)
    return np.where(diverges, series, last)


def _readable(body: Expr, solution: Solution) -> bool:
    """Whether an expression is defined between the nodes of the solution."""
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


# ------------------------------------------------------------------ central differences


def _difference_errors(problem: Problem, solution: Solution) -> States:
    """Wider stencils compared with the method's own, at the frames where a derivative is used."""
    n, time = solution.n, solution.time
    lengths = np.diff(time)
    found: States = {}
    for (name, order), (wide, single) in _frames_of_use(problem).items():
        width = 2 * stencil_reach(order) + 1
        if width + 2 > n + 1:
            found[name, order - 1] = np.full(n, np.inf)
            continue
        x = solution[name]
        better = derivative_at_frames(time, x, order, width + 2)
        gap = np.abs(derivative_at_frames(time, x, order, width) - better)
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
        below = (
            x if order == 1 else derivative_at_frames(time, x, order - 1, 2 * stencil_reach(order - 1) + 1)
        )
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


def derivative_at_frames(time: FloatArray, x: FloatArray, order: int, width: int) -> FloatArray:
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


def quadrature_errors(problem: Problem, solution: Solution) -> FloatArray:
    """The contribution of each step to the objective's integrals along the curves, minus the method's own sums. (n,)"""
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
    return np.where(np.isfinite(error), error, 0.0)


def _integral_gap(solution: Solution, body: Expr, steps: NDArray[np.int_]) -> FloatArray:
    """The integral over each step along the curves, minus the method's own. (steps,)"""
    lengths = np.diff(solution.time)[steps]
    values = values_at(solution, index := steps[:, None] + SHARES)
    inside = np.broadcast_to(np.asarray(evaluate_all([body], values)[0], float), index.shape)
    channels = solution.trajectories.items()
    left = _at_nodes(solution, body, steps, {key: c.after[steps] for key, c in channels})
    right = _at_nodes(solution, body, steps + 1, {key: c.before[steps + 1] for key, c in channels})
    if solution.method == "hermite-simpson":
        at_mid = {key: c.mid[steps] for key, c in channels if c.mid is not None}
        middle = _at_nodes(solution, body, steps + 0.5, at_mid)
        own = (left + 4.0 * middle + right) / 6.0
    else:
        own = 0.5 * (left + right)
    return lengths * (inside @ WEIGHTS - own)


def _at_nodes(
    solution: Solution, body: Expr, index: NDArray[Any], motion: Mapping[tuple[str, int], FloatArray]
) -> FloatArray:
    """An expression at some nodes, given by their frame index and the known values there. (k,)"""
    values = fixed_values(solution)
    values.update({VariableRef(name, order): numbers for (name, order), numbers in motion.items()})
    values[TimeRef()] = np.interp(index, np.arange(solution.n + 1), solution.time)
    values[IndexRef()] = np.asarray(index, float)
    return np.broadcast_to(np.asarray(evaluate_all([body], values)[0], float), np.shape(index))
