"""From a transcription to the solver's result: directly, or through the same motion on fewer frames."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from stc.deadline import left
from stc.optimizers import DEFAULT, Minimizer, SizeWarning, caution, optimizer_of
from stc.problem import Problem
from stc.records import dataclass, field
from stc.solution import Solution
from stc.solver import Options, Result, Start, Status
from stc.solver.status import advice, sentence
from stc.solving import in_progress
from stc.solving.collect import collect
from stc.solving.complementarity import brought_down
from stc.solving.fewer_frames import FINE, FewerFrames, Fineness, Nested
from stc.solving.free_end import by_free_end
from stc.transcription import Transcription
from stc.transcription.bind import BoundProgram

__all__ = ["ColdSolve", "contradictions_of", "solve"]

#: Bounds that exclude each other are told up to this number.
MOST_CONTRADICTIONS = 5

Callback = Callable[[Any], bool | None]


class Motions(Protocol):
    """The motion of a spec on other numbers of frames; implemented by :class:`stc.pipeline.Model`."""

    def on_fewer_frames(
        self, problem: Problem, given: Mapping[str, float], fineness: Fineness
    ) -> FewerFrames | None:
        """Constants for the same motion on fewer frames."""

    def compiled(self, method: str | None, given: Mapping[str, float]) -> tuple[Problem, Transcription]:
        """The problem for some constants, ready to be solved."""

    def follow(
        self,
        earlier: Solution,
        transcription: Transcription,
        problem: Problem,
        before: Problem | None = None,
    ) -> tuple[Start, BoundProgram | None]:
        """The start from a solution (of the problem ``before``), and the program that was bound for it."""


def solve(
    transcription: Transcription,
    constants: Mapping[str, float] | None = None,
    options: Options | None = None,
    start: Start | None = None,
    callback: Callback | None = None,
    optimizer: str = DEFAULT,
    minimizer: Minimizer | None = None,
    bound: BoundProgram | None = None,
) -> tuple[BoundProgram, Result]:
    """Bind constants, compile if necessary, and minimise.

    Products that should be zero are reduced in several solves (see :mod:`stc.solving.complementarity`).

    Args:
        transcription: of the problem.
        constants: values of all constants, default those of the problem.
        options: of the solver.
        start: decision vector (and multipliers) to start from instead of the guess.
        callback: called after every iteration; returning True stops.
        optimizer: its name, see :mod:`stc.optimizers`.
        minimizer: called in its stead, say to measure it.
        bound: the transcription with these constants, if it is at hand.

    Raises:
        SpecError, EvaluationError: the starting point is not valid.
        UsageError: no such optimizer, or one that cannot handle the problem.
    """
    options, name = options or Options(), transcription.problem.relaxation
    if not name:
        return _once(transcription, constants, options, start, callback, optimizer, minimizer, bound)
    numbers = transcription.problem.constants if constants is None else constants

    def relaxed(value: float, options: Options, start: Start | None) -> Result:
        nonlocal bound
        given = {**numbers, name: value}
        bound, result = _once(transcription, given, options, start, callback, optimizer, minimizer, None)
        return result

    result = brought_down(relaxed, numbers[name], options, start)
    assert bound is not None
    return bound, result


def _once(
    transcription: Transcription,
    constants: Mapping[str, float] | None,
    options: Options,
    start: Start | None,
    callback: Callback | None,
    optimizer: str,
    minimizer: Minimizer | None,
    bound: BoundProgram | None,
) -> tuple[BoundProgram, Result]:
    """As :func:`solve`, with fixed constants."""
    minimizer = minimizer or optimizer_of(optimizer)
    if bound is None:
        bound = transcription.bind(constants, None if start is None else start.x)
        if start is not None:
            start = replace(start, x=bound.x0)
    under_way = in_progress.current
    if under_way is not None and under_way.transcription is transcription:
        under_way.start = bound.x0
    if bound.contradictions:
        return bound, _contradicted(transcription, bound)
    if left() <= 0.0:
        return bound, _unmoved(bound, Status.TIME_LIMIT)
    if remark := caution(optimizer, bound):
        warnings.warn(remark, SizeWarning, stacklevel=2)
    problem = transcription.problem
    if start is None and optimizer == DEFAULT and problem.n and not problem.jumps:
        result = by_free_end(transcription, bound, options, callback, minimizer)
    else:
        result = minimizer(bound, options, start=start, callback=callback)
    return bound, _forward(transcription, constants, result)


def _forward(transcription: Transcription, constants: Mapping[str, float] | None, result: Result) -> Result:
    """The result; it fails if a step is not positive."""
    if result.status is not Status.OPTIMAL:
        return result
    wrong = transcription.backward_step(result.x, constants)
    if wrong is None:
        return result
    step, length = wrong
    names = " and ".join(f"`{parameter}`" for parameter in transcription.steps.parameters)
    message = (
        f"The step from frame {step} to {step + 1} would take {length:.4g} s. All other conditions hold, but steps "
        f"must be positive. Bound {names} accordingly, or start from a guess with longer steps."
    )
    return replace(result, status=Status.FAILED, message=message)


def contradictions_of(transcription: Transcription, bound: BoundProgram) -> list[str]:
    """The bounds that contradict each other, each with the positions of its statements; at most a few."""
    lines = []
    for contradiction in bound.contradictions[:MOST_CONTRADICTIONS]:
        places = [transcription.problem.relations[k].span.location for k in contradiction.relations if k >= 0]
        lines.append(f"{contradiction.message} ({' and '.join(dict.fromkeys(places))})")
    more = len(bound.contradictions) - len(lines)
    return [*lines, f"and {more} more"] if more > 0 else lines


def _contradicted(transcription: Transcription, bound: BoundProgram) -> Result:
    """The result for bounds that contradict each other, before any step is taken."""
    lines = contradictions_of(transcription, bound)
    worst = max((c.gap for c in bound.contradictions), default=0.0)
    return _unmoved(
        bound, Status.INFEASIBLE, "The bounds contradict each other: " + "; ".join(lines) + ".", worst
    )


def _unmoved(bound: BoundProgram, status: Status, message: str = "", least: float = 0.0) -> Result:
    """The start as the result, if no step is taken; its violation is at least ``least``."""
    objective, rows = bound.values(bound.x0)
    with np.errstate(invalid="ignore"):
        low = np.maximum(bound.x_lower - bound.x0, bound.x0 - bound.x_upper)
        rlow = np.maximum(bound.row_lower - rows, rows - bound.row_upper)
    violation = float(max(np.max(low, initial=0.0), np.max(rlow, initial=0.0), least))
    return Result(
        status=status,
        x=bound.x0,
        row_multipliers=np.zeros(bound.m),
        bound_multipliers=np.zeros(bound.n),
        objective=objective,
        violation=violation,
        optimality=float("nan"),
        iterations=0,
        factorizations=0,
        message=message or f"{sentence(status)} {advice(status)}",
    )


@dataclass(slots=True)
class ColdSolve:
    """A solve from a spec's own guess: through fewer frames if there are many, or with their help if it is hard.

    Attributes:
        seconds: times by stage; deriving and compiling the motion on fewer frames is counted there and not as solving.
    """

    model: Motions
    problem: Problem
    transcription: Transcription
    given: Mapping[str, float]
    options: Options
    callback: Callback | None = None
    minimizer: Minimizer | None = None
    seconds: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("derive", "compile", "solve"), 0.0)
    )
    _reduced: tuple[Problem, Transcription, Mapping[str, float]] | None = None
    _followed: BoundProgram | None = None

    def run(self) -> Result:
        """Solve the problem; each call begins anew and has the same result."""
        # What is quadratic takes few steps anyway, and contacts that come and go want all frames.
        if self.transcription.is_quadratic or self.problem.relaxation:
            return self._fine(self.options, None, self.callback)
        fewer = self._reduce(FINE)
        nested = Nested(self._coarse, self._follow, self._fine, self.options, self.callback)
        if fewer is not None:
            return nested.fewer_first(fewer.ratio)
        return nested.fewer_for_help(lambda fineness: self._reduce(fineness) is not None)

    def _reduce(self, fineness: Fineness) -> FewerFrames | None:
        fewer = self.model.on_fewer_frames(self.problem, self.given, fineness)
        if fewer is None:
            return None
        begin = time.perf_counter()
        given = {**self.given, **fewer.constants}
        self._reduced = *self.model.compiled(self.problem.method, given), given
        reduced = self._reduced[1]
        seconds = self.seconds
        seconds["solve"] -= time.perf_counter() - begin
        seconds["derive"] += reduced.seconds.pop("derive", 0.0)
        seconds["compile"] += reduced.seconds.pop("compile", 0.0)
        return fewer

    def _coarse(self, options: Options, told: Callback | None) -> Solution:
        """The motion on fewer frames, from their own guess."""
        assert self._reduced is not None
        small, reduced, given = self._reduced
        _, result = solve(reduced, small.constants, options, None, told, minimizer=self.minimizer)
        return collect(reduced, result, small.constants, given, {})

    def _follow(self, motion: Solution) -> Start:
        """The start on all frames at a motion that was solved on fewer."""
        before = None if self._reduced is None else self._reduced[0]
        found, self._followed = self.model.follow(motion, self.transcription, self.problem, before)
        return found

    def _fine(self, options: Options, start: Start | None, told: Callback | None) -> Result:
        """Solve with all frames of the motion."""
        bound = None if start is None else self._followed
        numbers, minimizer = self.problem.constants, self.minimizer
        return solve(self.transcription, numbers, options, start, told, minimizer=minimizer, bound=bound)[1]
