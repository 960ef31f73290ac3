"""From the text of a spec to a saved solution: one public function per step.

    read_source -> parse -> elaborate -> transcribe -> solve -> Solution.save

:class:`Model` combines the steps and keeps their results: a spec with other values of constants is usually solved again
without parsing, differentiating or compiling.  :mod:`stc.solution_origin` finds the model of a solution, and
:func:`stc.certification.certify` validates one.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stc.arguments import numbers
from stc.bundled import find_spec, is_solution, with_text
from stc.deadline import within
from stc.errors import Diagnostic, EndedError, Source, SpecError, UsageError
from stc.guesses.alignment import Alignment
from stc.in_notebook import in_notebook
from stc.language import read_problem
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.optimizers import DEFAULT, Minimizer
from stc.problem import Problem
from stc.solution import Solution, read
from stc.solver import IterationRecord, Options, Start, Status
from stc.solver.options import given_options
from stc.solving import in_progress
from stc.solving.collect import collect
from stc.solving.fewer_frames import FINE, FewerFrames, Fineness, fewer_frames
from stc.solving.in_progress import Unfinished, motion_at
from stc.solving.kept_transcriptions import KeptTranscriptions
from stc.solving.solve import ColdSolve, solve
from stc.solving.warm_start import aligned, start_from
from stc.trajectory import require_method
from stc.transcription import Transcription, transcribe
from stc.transcription.bind import BoundProgram
from stc.transcription.guess import check_motion, check_names

if TYPE_CHECKING:
    from stc.guesses.values import GivenValues
    from stc.language.syntax import SpecTree

Callback = Callable[[Any], bool | None]
FloatArray = NDArray[np.float64]


#: Characters that a spec may have: far more than anybody writes, few enough to be read in seconds.
MOST_CHARACTERS = 2_000_000


def read_source(spec: str | os.PathLike[str]) -> Source:
    """The text of a spec: a path, a bundled name, or the text itself (anything with a line break or a colon).

    Raises:
        UsageError: no such spec, a file that is not UTF-8 text, or one that holds a solution or table instead; a
            text or file without anything in it, or a file too long to be a spec.
    """
    if not isinstance(spec, str | os.PathLike):
        raise UsageError(f"a spec is a path, a bundled name or its text, not {spec!r}")
    if isinstance(spec, str) and ("\n" in spec or "\r" in spec or (":" in spec and ";" in spec)):
        return with_text(
            Source("<text>", spec.replace("\r\n", "\n").replace("\r", "\n"))
        )  # as files are read
    path = find_spec(spec)
    if is_solution(path):
        from stc.solution_file import refuse_as_spec

        refuse_as_spec(path)
    try:
        with path.open(encoding="utf-8") as stream:
            text = stream.read(MOST_CHARACTERS + 1)  # of what has no end as well
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise UsageError(
            f"{path} is not UTF-8 text: line {line} has the byte {error.object[error.start]:#x}",
            "save it in the encoding UTF-8, which editors offer where they save files",
        ) from error
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from error
    if len(text) > MOST_CHARACTERS:
        raise UsageError(
            f"{path} has more than {MOST_CHARACTERS} characters",
            "a statement under a range header says for many frames what need not be written for each",
        )
    return with_text(Source(str(spec) if Path(spec).is_file() else path.name, text, str(path)))


class Model:
    """A spec that can be solved with different constants, methods and frame counts.

    Attributes
    ----------
    source
        The text and where it came from.
    name
        The spec's name.
    warnings
        The warnings about the last problem that was requested; empty before the first one.
    """

    def __init__(self, source: Source, overrides: Mapping[str, float] | None = None) -> None:
        begin = time.perf_counter()
        self.source = source
        self.name = Path(source.path).stem if source.path else "text"
        self.overrides = numbers(overrides or {})
        self.tree: SpecTree = self._parsed()
        self._parse_seconds = time.perf_counter() - begin
        self.warnings: tuple[Diagnostic, ...] = ()
        self._transcriptions = KeptTranscriptions(self.tree)
        self._fewer: dict[tuple[Any, ...], FewerFrames | None] = {}  # of the last constants

    def forget(self) -> None:
        """Forget what earlier solves have planned: the next one ends as the first of a process does, to the last digit.

        What an earlier solve has allocated and planned shows in the last digits of the next one, and so, where a motion
        has several optima nearby, in which of them is found.  Derivatives and machine code are kept on disk and are not
        made anew.
        """
        from stc.solver.kkt.reuse import forget

        self._transcriptions, self._fewer = KeptTranscriptions(self.tree), {}
        gc.collect()  # transcriptions refer to themselves, and give back their plans when they are collected
        forget()

    def __reduce__(self) -> tuple[type[Model], tuple[Source, dict[str, float]]]:
        """Copies, here or in another process, are made from the text; compiled code is not copied."""
        return Model, (self.source, self.overrides)

    def _parsed(self) -> SpecTree:
        try:
            return parse(self.source)
        except SpecError:
            # What could be read has mistakes of meaning perhaps: tell all of them in one run.
            with suppress(UsageError):
                read_problem(self.source, self.overrides)
            raise

    def _repr_html_(self) -> str:
        # By name: nothing here is imported from the layers above.
        return str(import_module("stc.notebooks").of_model(self))

    @property
    def text(self) -> str:
        """The whole text of the spec."""
        return self.source.text

    def problem(self, method: str | None = None, **constants: float) -> Problem:
        """The problem in continuous time, with the values of its constants.

        Raises
        ------
        SpecError
            Mistakes in the spec, all of them.
        UsageError
            An unknown constant or method.
        """
        if method is not None:
            require_method(method)
        return self._transcriptions.problem(method, {**self.overrides, **numbers(constants)})

    def transcription(self, method: str | None = None, **constants: float) -> tuple[Problem, Transcription]:
        """The problem and its transcription; an earlier transcription is reused if only numbers have changed."""
        if method is not None:
            require_method(method)
        problem, transcription = self._transcriptions.of(method, {**self.overrides, **numbers(constants)})
        self.warnings = tuple(problem.warnings)
        return problem, transcription

    def prepare(
        self,
        method: str | None = None,
        *,
        max_iterations: int | None = None,
        time_limit: float | None = None,
        **overrides: float,
    ) -> ColdSolve:
        """Derive, compile and bind everything that a solve with these constants needs.

        Parameters
        ----------
        all
            As for :meth:`solve`, which raises the same.

        Returns
        -------
        ColdSolve
            The prepared solve: each call of its ``run`` solves and returns the solver's result.
        """
        given = {**self.overrides, **overrides}
        problem, transcription = self.compiled(method, given, at_once=True)
        transcription.bind(problem.constants)
        if not transcription.is_quadratic:
            fewer = self.on_fewer_frames(problem, given, FINE)
            if fewer is not None:
                small, reduced = self.compiled(problem.method, {**given, **fewer.constants}, at_once=True)
                reduced.bind(small.constants)
                self.warnings = tuple(problem.warnings)
        options = given_options(max_iterations=max_iterations, time_limit=time_limit)
        return ColdSolve(self, problem, transcription, given, options)

    def compiled(
        self, method: str | None, given: Mapping[str, float], at_once: bool = False
    ) -> tuple[Problem, Transcription]:
        """The problem and its transcription, compiled now if ``at_once``, otherwise as soon as compiling pays off."""
        problem, transcription = self.transcription(method, **given)
        transcription.provide_kernels(at_once)
        return problem, transcription

    def solve(
        self,
        *,
        method: str | None = None,
        tolerance: float | None = None,
        max_iterations: int | None = None,
        time_limit: float | None = None,
        warm_start: Solution | str | os.PathLike[str] | None = None,
        guess: Mapping[str, ArrayLike] | GivenValues | Solution | str | os.PathLike[str] | None = None,
        callback: Callback | None = None,
        optimizer: str = DEFAULT,
        minimizer: Minimizer | None = None,
        fewer_first: bool = True,
        constants: Mapping[str, float] | None = None,
        **overrides: float,
    ) -> Solution:
        """Solve the spec.

        Parameters
        ----------
        method : str | None
            ``central``, ``trapezoidal``, ``hermite-simpson`` or ``stepping`` instead of the spec's own.
        tolerance : float | None
            Tolerance of the optimality conditions, between 1e-14 and 1.
        max_iterations : int | None
            Limit on iterations.
        time_limit : float | None
            Limit in seconds of wall time, including deriving and compiling.
        warm_start : Solution | str | os.PathLike[str] | None
            An earlier solution or its file, whose multipliers and active set are used too; resampled
            if the number of frames differs.
        guess
            Values to start from by name, or a file of them (see :mod:`stc.guesses.file`); variables that it does not
            name keep the spec's guess. Arrays are spread evenly over the motion, or placed by an array ``t``, ``time``
            (both in seconds) or ``frame``.
        callback : Callback | None
            Called with a record after every iteration; returning True stops the solve.  In a
            notebook, a solve without a callback shows its progress.
        optimizer : str
            ``sqp`` (the default), ``nlopt:slsqp``, ...: see docs/optimizers.md.
        minimizer : Minimizer | None
            A function to call in place of the optimizer, for example to measure it (see
            :mod:`stc.studies.profile`).
        fewer_first : bool
            Whether a motion on many frames is solved on fewer frames first (see :mod:`stc.solving.fewer_frames`),
            unless it starts from a solution.
        constants : Mapping[str, float] | None
            Values of constants by name, for names that clash with the arguments above.
        **overrides : float
            Values of constants, such as ``n=120`` or ``g=1.62``.

        Returns
        -------
        Solution
            The solution, whatever its status is: read ``solution.status``.

        Raises
        ------
        SpecError, EvaluationError
            Mistakes in the spec, or a start where a function is undefined.
        EndedError
            The time limit was reached before there was a starting point.
        UsageError
            An unknown constant, method, optimizer or file, an invalid tolerance or limit, a
            problem that the optimizer cannot handle, or an earlier solution without a common variable.
        """
        options = given_options(tolerance, max_iterations, time_limit)
        in_progress.current = None
        with self._watched(callback) as watching, within(options.time_limit):
            try:
                solution = self._solved(
                    options,
                    method,
                    warm_start,
                    guess,
                    watching,
                    optimizer,
                    minimizer,
                    fewer_first,
                    {**numbers(constants or {}), **numbers(overrides)},
                )
            except EndedError as ended:
                solution = self._ended(ended)
        in_progress.current = None
        solution.origin = self
        return solution

    def _watched(self, callback: Callback | None) -> AbstractContextManager[Callback | None]:
        """A context that gives the callback of a solve: in a notebook, where there is none, one that shows progress."""
        if callback is not None or not in_notebook():
            return nullcontext(callback)
        # By name: nothing here is imported from the layers above.
        shown: AbstractContextManager[Callback | None] = import_module("stc.notebook_progress").solving(
            self.name
        )
        return shown

    def _ended(self, ended: EndedError) -> Solution:
        """The result of a solve that was ended before it had begun: its start, if that is known or can be computed.

        Raises:
            EndedError: it cannot.
        """
        under_way = in_progress.current
        solution = None if under_way is None else under_way.solution(Status(ended.status))
        if solution is None:
            raise ended
        return solution

    def _solved(
        self,
        options: Options,
        method: str | None,
        warm_start: Solution | str | os.PathLike[str] | None,
        guess: Mapping[str, ArrayLike] | GivenValues | Solution | str | os.PathLike[str] | None,
        callback: Callback | None,
        optimizer: str,
        minimizer: Minimizer | None,
        fewer_first: bool,
        constants: Mapping[str, float],
    ) -> Solution:
        """The part of :meth:`solve` within its time limit; same arguments."""
        begin, worked = time.perf_counter(), time.thread_time()
        parse_seconds, self._parse_seconds = self._parse_seconds, 0.0  # counts for the first solve only
        if callback is not None and not callable(callback):
            raise UsageError(f"the callback must be a function, not {callback!r}")
        given = {**self.overrides, **constants}
        problem, transcription = self.transcription(method, **given)
        in_progress.current = Unfinished(transcription, problem.constants, given, optimizer)
        seconds = {"parse": parse_seconds + time.perf_counter() - begin}
        seconds["derive"] = transcription.seconds.pop("derive", 0.0)
        seconds["parse"] = max(0.0, seconds["parse"] - seconds["derive"])
        transcription.provide_kernels(at_once=False)
        seconds["compile"] = transcription.seconds.pop("compile", 0.0)
        seconds["solve"] = 0.0
        if warm_start is not None and guess is not None:
            raise UsageError("a solve starts from a solution or from a guess, not from both")
        start: Start | None = None
        if warm_start is not None:
            start = self._start(warm_start, transcription, problem)
        elif guess is not None:
            from stc.guesses.file import guess_of

            values = guess_of(guess)
            check_names(values, problem)
            start = Start(transcription.bind(problem.constants, guess=values).x0)
        warm = start is not None and start.row_multipliers is not None
        options = replace(options, warm_start=warm)
        solving = time.perf_counter()
        if fewer_first and start is None and optimizer == DEFAULT:
            result = ColdSolve(
                self, problem, transcription, given, options, callback, minimizer, seconds
            ).run()
        else:
            _, result = solve(
                transcription, problem.constants, options, start, callback, optimizer, minimizer
            )
        seconds["solve"] += time.perf_counter() - solving
        self.warnings = tuple(problem.warnings)
        seconds["total"] = parse_seconds + time.perf_counter() - begin
        seconds["processor"] = time.thread_time() - worked
        return collect(transcription, result, problem.constants, given, seconds, optimizer)

    def on_fewer_frames(
        self, problem: Problem, given: Mapping[str, float], fineness: Fineness
    ) -> FewerFrames | None:
        """The same motion on fewer frames, if the spec allows it; the last results are kept."""
        numbers = tuple(sorted(problem.constants.items()))
        key = problem.method, fineness, numbers
        if key not in self._fewer:
            known = {k: v for k, v in self._fewer.items() if k[2] == numbers}
            self._fewer = {**known, key: fewer_frames(self.tree, given, problem, fineness)}
        return self._fewer[key]

    def reached(
        self,
        record: IterationRecord,
        *,
        method: str | None = None,
        constants: Mapping[str, float] | None = None,
    ) -> Solution:
        """The motion at an iterate, such as to display progress: to be called from the callback of :meth:`solve`.

        Args:
            record: the record passed to the callback.
            method, constants: those of the solve.

        Returns:
            A solution without multipliers, its status ``interrupted``.
        """
        given = {**self.overrides, **(constants or {})}
        problem, transcription = self.transcription(method, **given)
        assert record.x is not None
        message = f"iterate {record.iteration} of a solve that goes on"
        copied = replace(record, x=record.x.copy())
        solution = motion_at(transcription, copied, problem.constants, given, Status.INTERRUPTED, message)
        solution.origin = self
        return solution

    def _start(
        self,
        warm_start: Solution | str | os.PathLike[str],
        transcription: Transcription,
        problem: Problem,
    ) -> Start:
        """The start at an earlier solution; with its multipliers if it is optimal.

        Raises:
            UsageError: it is another spec's and has none of the problem's variables.
        """
        earlier = warm_start if isinstance(warm_start, Solution) else read(warm_start)
        if earlier.source != self.text:
            check_motion(earlier, problem)
        return self.follow(earlier, transcription, problem)[0]

    def follow(
        self,
        earlier: Solution,
        transcription: Transcription,
        problem: Problem,
        before: Problem | None = None,
    ) -> tuple[Start, BoundProgram | None]:
        """As :meth:`_start`, and the program that was bound for it.

        Args:
            earlier: the solution to start from.
            transcription, problem: to be solved.
            before: the earlier problem, if it is available.
        """

        def solved() -> Problem:
            if before is not None:
                return before
            known = self._transcriptions.known(earlier.method, earlier.overrides)
            # By its own numbers alone: this model may have been given others.
            return known[0] if known else self._transcriptions.problem(earlier.method, earlier.overrides)

        own = earlier.source == self.text
        alignment = aligned(earlier, problem, solved) if own else Alignment.even(earlier.n, problem.n)
        return start_from(earlier, alignment, transcription, problem)


def load(spec: str | os.PathLike[str], **constants: float) -> Model:
    """Read and parse a spec.

    Parameters
    ----------
    spec : str | os.PathLike[str]
        A path, a bundled name or the text itself.
    **constants : float
        Values of constants for every solve of this model, in the units of the spec.

    Returns
    -------
    Model
        The model, which can be solved.

    Raises
    ------
    SpecError
        Mistakes in the syntax.
    UsageError
        No such spec.
    """
    return Model(read_source(spec), constants)


__all__ = [
    "Model",
    "collect",
    "elaborate",
    "load",
    "parse",
    "read_source",
    "solve",
    "transcribe",
]
