"""A transcribed problem: its structure is computed once, its numbers for each set of constants."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stc.codegen.kernel import Backend, KernelSet, compile_tapes
from stc.codegen.tape import Tape
from stc.deadline import look
from stc.errors import Diagnostic, EvaluationError, Span, SpecError
from stc.memory import without_collection
from stc.problem import ConstantRef, Problem, VariableRef
from stc.records import dataclass, field
from stc.solver.pairs import Pairs
from stc.symbolic.expr import Expr, symbols
from stc.transcription.assemble import Program, assemble
from stc.transcription.bind import BoundProgram, Bounds, evaluate_bounds
from stc.transcription.derive import Group
from stc.transcription.guess import starting_point
from stc.transcription.numbers import Numbers
from stc.transcription.pairs import find_pairs
from stc.transcription.stated import Stated, state
from stc.transcription.statements import LINK

if TYPE_CHECKING:
    from stc.guesses.values import GivenValues

FloatArray = NDArray[np.float64]


LARGEST_KEPT = 3_000_000
"""Largest number of variables and rows of a program that is kept to be bound to other numbers."""


@dataclass(frozen=True, slots=True)
class _Known:
    """The last bound program.

    Attributes:
        key: thread and constants.
        x0: where it starts, (n,).
        usable: whether that is the spec's own guess, and every function is defined there.
    """

    key: tuple[int, tuple[tuple[str, float], ...]]
    program: BoundProgram
    x0: FloatArray
    usable: bool


@dataclass(slots=True)
class Transcription(Stated):
    """A stated problem with its derivatives: everything derived from its text and structural constants.

    ``kernels`` holds the compiled values kernels, then the derivatives kernels, one of each per group;
    ``seconds`` has ``derive`` and ``compile``.
    """

    program: Program
    tapes: list[Tape]
    kernels: KernelSet | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    _bound: _Known | None = None

    @property
    def groups(self) -> list[Group]:
        """The rows of the program and the summands of its objective, grouped by the pattern of nodes that they read."""
        return self.program.groups

    def compile(self, backend: Backend = "auto", cache: bool = True, at_once: bool = True) -> None:
        """Compile the kernels, or load them from the object cache.

        Args:
            at_once: whether to compile now; otherwise they are interpreted until compiling would have paid off.
        """
        look()
        begin = time.perf_counter()
        sizes = None if at_once else [group.size for group in self.program.groups] * 2
        self.kernels = compile_tapes(self.tapes, self.program.runs, backend, cache, sizes)
        self.seconds["compile"] = time.perf_counter() - begin
        self._bound = None

    def provide_kernels(self, at_once: bool) -> None:
        """Compile the kernels if that has not been done; also interpreted ones if ``at_once``."""
        if self.kernels is None:
            self.compile(at_once=at_once)
        elif at_once:
            self.kernels.compile()

    def bind(
        self,
        constants: Mapping[str, float] | None = None,
        start: FloatArray | None = None,
        guess: GivenValues | None = None,
        check: bool = True,
    ) -> BoundProgram:
        """The nonlinear program for these constants (default: the problem's own).

        Programs bound one after the other for the same constants share all but their start.

        Args:
            constants: values for all constants; none of the structural ones may differ from the problem's.
            start: (layout.size,) decision vector to start from instead of the guess; moved inside the bounds.
            guess: values given by the caller that replace the guess.
            check: whether every function must be defined at the starting point.

        Raises:
            SpecError: a step is not positive at the starting point.
            EvaluationError: a bound has no value; a function has none at the starting point, if that is to be checked.
        """
        look()
        if self.kernels is None:
            self.compile()
        assert self.kernels is not None
        self.kernels.compile_when_due()
        constants = self.problem.constants if constants is None else constants
        key = threading.get_ident(), tuple(constants.items())
        known = self._bound if self._bound is not None and self._bound.key == key else None
        own = start is None and guess is None
        if known is not None and own and known.usable:
            return known.program.started(known.x0)
        if known is None:
            self._bound = None  # before the next one takes its place in memory
            numbers, bounds = self._numbers(constants)
            self._check_steps(bounds)
        else:
            numbers, bounds = known.program.numbers, known.program.bounds
        if start is None:
            x0 = self._guessed(numbers, bounds, constants, guess)
        else:
            x0 = np.clip(start, bounds.lower, np.maximum(bounds.lower, bounds.upper))
        if known is None:
            bound = BoundProgram(
                self.program,
                self.layout,
                numbers,
                bounds,
                x0,
                self.kernels,
                constants,
                self.problem.relations,
                self._pairs(numbers, bounds),
            )
        else:
            bound = known.program.started(x0)
        if check and not bound.contradictions:
            self._check_start(bound)
        if bound.n + bound.m <= LARGEST_KEPT and (known is None or (own and check)):
            self._bound = _Known(key, bound, x0, own and check)
        return bound

    def _numbers(self, constants: Mapping[str, float]) -> tuple[Numbers, Bounds]:
        numbers = Numbers(self.statements, self.steps, self.steps.coefficients(constants), constants)
        return numbers, evaluate_bounds(self.problem, self.statements, self.layout, numbers)

    def _pairs(self, numbers: Numbers, bounds: Bounds) -> Pairs:
        limits = bounds.lower, bounds.upper
        return find_pairs(
            self.problem.relations, self.statements, self.program.groups, self.layout, numbers.at, limits
        )

    def _guessed(
        self, numbers: Numbers, bounds: Bounds, constants: Mapping[str, float], guess: GivenValues | None
    ) -> FloatArray:
        return starting_point(
            self.problem,
            self.grid,
            self.layout,
            self.steps,
            numbers.coefficients,
            constants,
            bounds.lower,
            np.maximum(bounds.lower, bounds.upper),
            guess,
        )

    def guess(self, constants: Mapping[str, float]) -> FloatArray:
        """The spec's own guess, (layout.size,), for values of all constants; :meth:`bind` need not have been called.

        Raises:
            EvaluationError: a bound has no value.
        """
        return self._guessed(*self._numbers(constants), constants, None)

    @property
    def is_quadratic(self) -> bool:
        """Whether all statements are linear, and the objective at most quadratic."""
        return self.program.objective_degree <= 2 and bool(self.program.row_linear.all())

    def steps_fit(self, constants: Mapping[str, float]) -> bool:
        """Whether every step that no parameter changes is positive for these constants."""
        if self.steps.free or not self.grid.n:
            return True
        values: dict[object, float] = {ConstantRef(name): value for name, value in constants.items()}
        lengths = self.steps.lengths(self.steps.coefficients(constants), values)
        return bool(np.all(np.isfinite(lengths) & (lengths > 0.0)))

    def backward_step(
        self, x: FloatArray, constants: Mapping[str, float] | None = None
    ) -> tuple[int, float] | None:
        """The first step that is not positive at a point (layout.size,), and its length; None if all are positive.

        Only steps that depend on parameters are asked for.
        """
        if not self.steps.free:
            return None
        lengths = self.recovery(x, constants).lengths
        wrong = np.flatnonzero(~(lengths > 0.0))
        return (int(wrong[0]), float(lengths[wrong[0]])) if wrong.size else None

    def _check_steps(self, bounds: Bounds) -> None:
        """Refuse statements that no positive steps can satisfy.

        Raises:
            SpecError: with the statement.
        """
        names = [parameter.name for parameter in self.steps.parameters]
        for found in bounds.contradictions:
            stated = [self.problem.relations[k] for k in found.relations if k >= 0]
            if found.name in names and len(stated) < 2:
                message = f"{found.message}: steps are positive"
                raise SpecError(
                    [Diagnostic("error", message, stated[0].span if stated else self.problem.step_span)]
                )

    def _check_start(self, bound: BoundProgram) -> None:
        objective, rows = bound.values(bound.x0)
        bad = np.flatnonzero(~np.isfinite(rows))
        if len(bad):
            row = int(bad[0])
            group = self.program.groups[self.program.row_group[row]]
            statement = group.rows[self.program.row_number[row]]
            instance = int(self.program.row_instance[row])
            number = int(statement.relation[instance])
            text, span = "", None
            if number != LINK:
                text, span = self.problem.relations[number].text, self.problem.relations[number].span
            self._undefined(
                text or statement.label, span, group.nodes.position[instance] / 2, bound, statement.body
            )
        if not np.isfinite(objective):
            for group in self.program.groups:
                for summand in group.summands:
                    term = self.problem.objective[summand.term]
                    if term.rows:
                        values = bound.numbers.of_unknowns(summand.body, summand.nodes, self.layout, bound.x0)
                        wrong = np.flatnonzero(~np.isfinite(values))
                        if len(wrong):
                            frame = float(summand.nodes.position[wrong[0]]) / 2
                            self._undefined(term.text, term.span, frame, bound, term.body)
                        continue
                    recovery = self.recovery(bound.x0)
                    channel = recovery.channel(term.body)
                    values = channel.before[term.range.first : term.range.last + 1]
                    wrong = np.flatnonzero(~np.isfinite(values))
                    if len(wrong):
                        frame = float(term.range.first + wrong[0])
                        self._undefined(term.text, term.span, frame, bound, term.body)
            term = self.problem.objective[0]
            self._undefined(term.text, term.span, 0.0, bound, term.body)

    def _undefined(self, text: str, span: Span | None, frame: float, bound: BoundProgram, body: Expr) -> None:
        values: dict[str, float] = {}
        recovery = self.recovery(bound.x0)
        names = {getattr(k, "name", None): k for k in symbols(body)}
        for name in names:
            if name in recovery.parameters:
                values[name] = recovery.parameters[name]
        for (name, order), channel in recovery.trajectories().items():
            if name in names and isinstance(names[name], VariableRef):
                at = channel.before[int(frame)]
                if frame != int(frame) and channel.mid is not None:
                    at = channel.mid[int(frame)]
                values[name + "'" * order] = float(at)
        from stc.transcription.undefined import constant_fault

        hint, constants = constant_fault(body, bound.numbers.constants)
        if hint:
            values = constants
        raise EvaluationError(
            "this has no value",
            expression=text,
            frame=frame,
            values=values,
            span=span,
            hint=hint or "the solve starts there: give a guess at which every function is defined",
        )


@without_collection()
def transcribe(problem: Problem) -> Transcription:
    """Transcribe a problem into the structure of a nonlinear program.

    Raises:
        SpecError: a statement holds on no frame, or a step's form is not supported.
    """
    begin = time.perf_counter()
    stated = state(problem)
    program = assemble(
        stated.statements, stated.layout, list(problem.constants), with_tables=bool(problem.data)
    )
    programs = [g.programs for g in program.groups]
    tapes = [one.values_tape for one in programs] + [one.derivatives_tape for one in programs]
    result = Transcription(
        problem, stated.grid, stated.layout, stated.steps, stated.lowering, stated.statements, program, tapes
    )
    result.seconds["derive"] = time.perf_counter() - begin
    return result
