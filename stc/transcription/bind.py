"""The nonlinear program with its numbers, as the solver uses it.

Binding evaluates constants into kernel inputs, node data, bounds and the starting point.  A new value of a
constant that is not structural only requires a new binding, without differentiating or compiling.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.codegen.kernel import KernelSet
from stc.errors import EvaluationError
from stc.problem import Problem, Relation
from stc.records import dataclass
from stc.solver.evaluator import Evaluator, Part, Scaling
from stc.solver.form_cache import Keeper
from stc.solver.pairs import Pairs
from stc.symbolic.expr import ZERO, Expr, symbols
from stc.symbolic.tables import TableRef
from stc.transcription.assemble import Program, data_of
from stc.transcription.bending import row_bends
from stc.transcription.evaluation import Evaluation, evaluator
from stc.transcription.grid import Nodes
from stc.transcription.layout import Layout
from stc.transcription.numbers import Numbers
from stc.transcription.statements import LINK, Statements
from stc.transcription.statements import Bound as BoundStatement

FloatArray = NDArray[np.float64]
Values = np.float64 | FloatArray

INFINITE = np.float64(np.inf)


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Bounds that contradict each other, found before solving.

    ``relations`` index ``Problem.relations``; ``gap`` is the distance between the bounds.
    """

    relations: tuple[int, ...]
    name: str
    frame: float
    gap: float
    message: str


@dataclass(slots=True)
class Bounds:
    """Bounds of decision variables and the relation that each came from (-1: none). All (size,)."""

    lower: FloatArray
    upper: FloatArray
    lower_from: NDArray[np.int64]
    upper_from: NDArray[np.int64]
    contradictions: list[Contradiction]


def evaluate_bounds(problem: Problem, statements: Statements, layout: Layout, numbers: Numbers) -> Bounds:
    """Intersects all bounds on each decision variable and lists those that contradict each other.

    Parameters that steps depend on are bounded so that steps are positive.

    Raises:
        EvaluationError: a bound, or the bounded expression, has no value.
    """
    size = layout.size
    result = Bounds(np.full(size, -np.inf), np.full(size, np.inf), np.full(size, -1), np.full(size, -1), [])
    numbers.evaluate(
        e
        for bound in statements.bounds
        for e in (bound.rest, bound.lower, bound.upper, bound.coefficient)
        if e is not None
    )
    for bound in statements.bounds:
        _apply(problem, bound, layout, numbers, result)
    for at, low, high in step_limits(layout, numbers):
        if low > result.lower[at]:
            result.lower[at], result.lower_from[at] = low, -1
        if high < result.upper[at]:
            result.upper[at], result.upper_from[at] = high, -1
    crossed = np.flatnonzero(result.lower > result.upper)
    for position in crossed:
        low, high = result.lower[position], result.upper[position]
        if low - high <= 1e-12 * max(1.0, abs(low), abs(high)):  # rounding of one and the same number
            result.lower[position] = result.upper[position] = 0.5 * (low + high)
            continue
        name, order, frame, _ = layout.describe(int(position))
        text = name + "'" * order
        where = f" at frame {frame:g}" if frame >= 0 else ""
        owners = (int(result.lower_from[position]), int(result.upper_from[position]))
        result.contradictions.append(
            Contradiction(
                owners,
                text,
                frame,
                float(low - high),
                f"{text}{where} must be at least {low:.10g} and at most {high:.10g}",
            )
        )
    return result


def step_limits(layout: Layout, numbers: Numbers) -> list[tuple[int, float, float]]:
    """Positions of parameters, and the bounds on them that make steps positive."""
    ranges = numbers.steps.implied(numbers.coefficients, numbers.constants)
    return [(layout.parameters[name], low, high) for name, (low, high) in ranges.items()]


def _apply(problem: Problem, bound: BoundStatement, layout: Layout, numbers: Numbers, into: Bounds) -> None:
    """Tighten the bounds on a variable at the nodes of a statement; most have one number for all of them."""
    relation, nodes = problem.relations[bound.relation], bound.nodes
    rest = numbers.value(bound.rest, nodes)
    low = -INFINITE if bound.lower is None else numbers.value(bound.lower, nodes) - rest
    high = INFINITE if bound.upper is None else numbers.value(bound.upper, nodes) - rest
    sound = bound.lower is None or np.isfinite(low).all()
    if not (sound and (bound.upper is None or np.isfinite(high).all())):
        _check_value(relation, bound.rest, rest, nodes, numbers)
        _check_limits(relation, bound.lower, bound.upper, nodes, numbers)
    slope: Values = np.float64(0.0)
    if bound.unknown is not None:
        slope = numbers.value(bound.coefficient, nodes)
        _check_value(relation, bound.coefficient, slope, nodes, numbers)
    dead = slope == 0.0
    if dead.any():
        tolerance = 1e-9 * np.maximum(1.0, np.abs(rest))
        wrong = dead & ((low > tolerance) | (high < -tolerance) | np.isnan(low) | np.isnan(high))
        if wrong.any():
            every = np.broadcast_arrays(wrong, low, high, nodes.position)
            k = int(np.flatnonzero(every[0])[0])
            frame = float(nodes.position[k]) / 2
            into.contradictions.append(
                Contradiction(
                    (bound.relation,),
                    "",
                    frame,
                    float(max(every[1][k], -every[2][k])),
                    f"`{relation.text}` is false at frame {frame:g} whatever the unknowns are",
                )
            )
    if bound.unknown is None or dead.all():
        return
    if bound.positions is None:  # they are the same for all constants
        bound.positions = layout.position(bound.unknown, nodes)
    position = bound.positions
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        one, other = low / slope, high / slope
    beyond = ~dead & (np.isfinite(low) & np.isinf(one) | np.isfinite(high) & np.isinf(other))
    if beyond.any():
        raise _no_value(relation, bound.coefficient, nodes, beyond, numbers)
    rising = slope > 0.0
    ends = np.where(rising, one, other), np.where(rising, other, one)
    if dead.any():
        live, shape = ~dead, position.shape
        position, ends = position[live], tuple(np.broadcast_to(end, shape)[live] for end in ends)
    _tighten(np.fmax, into.lower, into.lower_from, position, ends[0], bound.relation)
    _tighten(np.fmin, into.upper, into.upper_from, position, ends[1], bound.relation)


def _check_limits(
    relation: Relation, lower: Expr | None, upper: Expr | None, nodes: Nodes, numbers: Numbers
) -> None:
    """Refuse bounds that are not numbers, or that no number satisfies; infinite ones are allowed if a constant is
    infinite.

    Raises:
        EvaluationError: with the statement, the frame and the constants.
    """
    for limit, impossible in ((lower, np.inf), (upper, -np.inf)):
        if limit is None:
            continue
        value = numbers.at(limit, nodes)
        if np.isfinite(value).all():
            continue
        endless = any(np.isinf(numbers.constants.get(key, 0.0)) for key in symbols(limit))
        wrong = np.isnan(value) | (value == impossible) if endless else ~np.isfinite(value)
        if wrong.any():
            raise _no_value(relation, limit, nodes, wrong, numbers)


def _check_value(relation: Relation, e: Expr, value: Values, nodes: Nodes, numbers: Numbers) -> None:
    """Refuse values that are not finite at some node.

    Raises:
        EvaluationError: with the statement, the frame and the constants.
    """
    wrong = ~np.isfinite(value)
    if wrong.any():
        raise _no_value(relation, e, nodes, wrong, numbers)


def _no_value(
    relation: Relation, e: Expr, nodes: Nodes, wrong: np.bool_ | NDArray[np.bool_], numbers: Numbers
) -> EvaluationError:
    from stc.transcription.undefined import constant_fault

    hint, values = constant_fault(e, numbers.constants)
    return EvaluationError(
        "this has no value",
        expression=relation.text,
        frame=float(nodes.position[np.broadcast_to(wrong, nodes.position.shape)][0]) / 2,
        values=values,
        span=relation.span,
        hint=hint or "what it is made of is too large, or is divided by zero there",
    )


def _tighten(
    tighter: np.ufunc, limits: FloatArray, owners: NDArray[np.int64], at: NDArray[np.int64], to: FloatArray, owner: int
) -> None:  # fmt: skip
    """Tighten limits by the bounds ``to``, one for all or (k,); ``at`` (k,) may contain positions several times."""
    before = limits[at]
    if to.ndim == 0:
        limits[at] = tighter(before, to)
    else:
        tighter.at(limits, at, to)
    owners[at[limits[at] != before]] = owner


class BoundProgram(Evaluation):
    """A nonlinear program for the solver: :class:`stc.solver.nlp.NLP`.

    Attributes follow that protocol; if there are ``contradictions``, solving is useless; ``evaluations`` and
    ``derivative_evaluations`` count the calls.
    """

    def __init__(
        self,
        program: Program,
        layout: Layout,
        numbers: Numbers,
        bounds: Bounds,
        x0: FloatArray,
        kernels: KernelSet,
        constants: Mapping[str, float],
        relations: Sequence[Relation],
        pairs: Pairs,
    ) -> None:
        self.keeper = Keeper()
        self.bounds = bounds
        self.numbers = numbers
        self._idle = np.ones(program.size, bool)
        for group in program.groups:
            self._idle[group.positions] = False
        self._any_idle = bool(self._idle.any())
        # Programs with other starts share them, and are told apart by them.
        bounds.lower.flags.writeable = bounds.upper.flags.writeable = False
        self._start_at(x0)
        self.row_lower, self.row_upper = _row_bounds(program, numbers, relations)
        self.jac_rows, self.jac_cols = program.jacobian.rows, program.jacobian.cols
        self.hess_rows, self.hess_cols = program.hessian.rows, program.hessian.cols
        self.var_stage, self.row_stage = layout.stage, program.row_stage
        self.row_linear = program.row_linear
        self.objective_degree = program.objective_degree
        self.fixed_curvature = program.fixed_curvature
        #: Complementary rows, see :class:`stc.solver.pairs.Complementary`.
        self.pairs = pairs
        self.contradictions = bounds.contradictions
        workspace = np.zeros(program.workspace_size)
        for group, start in zip(program.groups, program.data_start, strict=True):
            data = data_of(workspace, group, start)
            for k, ref in enumerate(group.data):
                data[k] = numbers.data(ref, group.nodes)
        super().__init__(program, kernels, workspace, uniform_inputs(program, constants))
        self._as_stated: Evaluator | None = None

    def _start_at(self, x0: FloatArray) -> None:
        self.x0 = x0
        self.x_lower, self.x_upper = self.bounds.lower, self.bounds.upper
        if self._any_idle:  # what nothing determines keeps its guess: the solver sees it as fixed
            self.x_lower = np.where(self._idle, x0, self.x_lower)
            self.x_upper = np.where(self._idle, x0, self.x_upper)

    def started(self, x0: FloatArray) -> BoundProgram:
        """This program with another start, (n,); the two must not be evaluated at the same time."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._start_at(x0)
        return other

    def row_bends(self) -> NDArray[np.int8]:
        """See :class:`stc.solver.convexity.Bending`."""
        return row_bends(self.program, self.numbers)

    def evaluator(self, scaling: Scaling) -> Evaluator:
        """Arrays for one scaling, and the calls that fill them."""
        return evaluator(self, scaling)

    def part_evaluator(self, scaling: Scaling, part: Part) -> Evaluator:
        """An evaluator for a part of the variables and rows."""
        return evaluator(self, scaling, part)

    def as_stated(self) -> Evaluator:
        """See :class:`stc.solver.evaluator.Stated`."""
        if self._as_stated is None:
            self._as_stated = self.evaluator(Scaling.none(self.n, self.m))
        return self._as_stated

    def values(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Objective and rows at ``x``; the rows' array is reused by the next call."""
        stated = self._as_stated or self.as_stated()
        stated.x[:] = x
        stated.values_call()
        return float(stated.f[0]), stated.r

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray, objective_factor: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Objective gradient, Jacobian values and Hessian values of the Lagrangian; arrays are reused and read-only."""
        stated = self._as_stated or self.as_stated()
        stated.x[:] = x
        stated.y[:] = multipliers
        stated.weight[0] = objective_factor
        stated.derivatives_call()
        # Nobody else may write to them: constants among them are not written again.
        return _read_only(stated.gradient), _read_only(stated.jac), _read_only(stated.hess)


def uniform_inputs(program: Program, constants: Mapping[str, float]) -> FloatArray:
    """The values of the inputs that all nodes share: constants, the start of each table, the objective's factor, and
    the numbers of the tables.
    """
    values: list[float] = []
    numbers: list[FloatArray] = []
    end = len(program.uniform)
    for key in program.uniform:
        if isinstance(key, TableRef):
            numbers.append(key.table.storage())
            values.append(float(end))
            end += len(numbers[-1])
        else:
            values.append(constants.get(getattr(key, "name", ""), 0.0))
    return np.concatenate([values, *numbers])


def _read_only(array: FloatArray) -> FloatArray:
    view = array.view()
    view.flags.writeable = False
    return view


def _row_bounds(
    program: Program, numbers: Numbers, relations: Sequence[Relation]
) -> tuple[FloatArray, FloatArray]:
    lower, upper = np.full(program.row_count, -np.inf), np.full(program.row_count, np.inf)
    for group in program.groups:
        for r, row in enumerate(group.rows):
            if row.lower is ZERO and row.upper is ZERO:
                lower[group.row_ids[r]] = upper[group.row_ids[r]] = 0.0
                continue
            for end, into in ((row.lower, lower), (row.upper, upper)):
                if end is None:
                    continue
                values = into[group.row_ids[r]] = numbers.at(end, row.nodes)
                if not np.isfinite(values).all() and row.relation[0] != LINK:
                    _check_limits(relations[row.relation[0]], row.lower, row.upper, row.nodes, numbers)
    return lower, upper
