"""Many starts: the local optima found from several guesses, and the best of them.

The first start is the spec's own guess.  Every other one adds a smooth random curve to each variable and moves
each parameter, by amounts that the bounds or the guess suggest; values that the spec fixes stay.  Numbers come from one
generator per start, seeded with the seed and the start's number: start 7 is the same whether 8 or 80 are asked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc import deadline
from stc.arguments import whole
from stc.errors import EvaluationError, SpecError, UsageError
from stc.guesses.file import read_guess
from stc.guesses.values import GivenValues, NodeValues
from stc.pipeline import Model
from stc.records import dataclass, field
from stc.solution import Solution
from stc.studies.effort import Clock, Effort
from stc.transcription import Transcription
from stc.transcription.bind import BoundProgram
from stc.workers import Workers

__all__ = ["MultiStart", "Optimum", "StartRecord", "multistart"]

FloatArray = NDArray[np.float64]

WAVES = 4
"""Number of cosines in a random curve."""
SAME_OBJECTIVE, SAME_MOTION = 1e-6, 1e-2
"""Optima are the same if their objectives differ by less than this share, and their motions by less than this share
of their range.
"""
ATTEMPTS = 5
"""Number of times that a start at which a function is undefined is moved half as far away."""
FAR = 10.0
"""Bounds are ignored if they are this many times farther away than the size of the guess."""


@dataclass(frozen=True, slots=True)
class StartRecord:
    """The result of one start; ``optimum`` is the index of its optimum, or -1 if there is none."""

    start: int
    status: str
    objective: float
    iterations: int
    factorizations: int
    optimum: int


@dataclass(slots=True)
class Optimum:
    """One of the optima found.

    Attributes
    ----------
    objective : float
        Its objective.
    starts : list[int]
        The starts that led to it.
    solution : Solution
        The first of its solutions.
    """

    objective: float
    starts: list[int]
    solution: Solution


@dataclass(slots=True)
class MultiStart:
    """The results of many starts.

    Attributes
    ----------
    starts : list[StartRecord]
        One record per start that was made.
    optima : list[Optimum]
        Distinct optima, best first.
    solution : Solution | None
        The best optimum, or if there is none the solution with the least violation.
    effort : Effort
        Totals of all solves.
    message : str
        Why not all starts were made; empty if they were.
    """

    starts: list[StartRecord] = field(default_factory=list)
    optima: list[Optimum] = field(default_factory=list)
    solution: Solution | None = None
    effort: Effort = field(default_factory=Effort)
    message: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The results for JSON."""
        return {
            "starts": [
                {**asdict(one), "optimum": one.optimum if one.optimum >= 0 else None} for one in self.starts
            ],
            "optima": [
                {"objective": one.objective, "count": len(one.starts), "starts": one.starts}
                for one in self.optima
            ],
            "solves": self.effort.solves,
        }


def multistart(
    model: Model,
    starts: int = 20,
    seed: int = 1,
    *,
    workers: int | None = 1,
    solve: Callable[..., Solution] | None = None,
    on_start: Callable[[StartRecord], None] | None = None,
    **options: Any,
) -> MultiStart:
    """Solve from several starts: the spec's own guess and random ones.

    Parameters
    ----------
    model : Model
        The spec.
    starts : int
        Number of starts, including the spec's own guess.
    seed : int
        Seed of the random numbers.
    workers : int | None
        Number of processes; None for one per processor, or the setting of ``joblib.parallel_config``.  The
        results do not depend on it.
    solve : Callable[..., Solution] | None
        Function to use in place of ``model.solve``, with the same arguments (to watch it), if there is one worker.
    on_start : Callable[[StartRecord], None] | None
        Called with the record of every solve; the index of its optimum is that known so far.
    **options : Any
        Arguments of :meth:`stc.pipeline.Model.solve`; random guesses are drawn around a given guess, and a
        time limit applies to all solves together.

    Returns
    -------
    MultiStart
        The results of all starts, with the best optimum.

    Raises
    ------
    UsageError
        Fewer than one start.
    SpecError, EvaluationError
        Mistakes in the spec, or a guess where a function is undefined.
    """
    starts, seed = whole(starts, "the number of starts"), whole(seed, "the seed")
    if starts < 1:
        raise UsageError(f"at least one start is needed, not {starts}")
    if seed < 0:
        raise UsageError(f"a seed is a whole number, 0 or more, not {seed}")
    guess = options.pop("guess", None)
    if isinstance(guess, str) or hasattr(guess, "__fspath__"):
        guess = read_guess(guess)
    constants = dict(options.pop("constants", {}))
    clock = Clock(options.pop("time_limit", None))
    problem, transcription = model.transcription(options.get("method"), **constants)
    around = _Neighbourhood(transcription, transcription.bind(problem.constants, guess=guess, check=False))
    found = MultiStart()
    end = None if clock.left is None else time.time() + clock.left
    given = {"constants": constants, "guess": guess, **options}
    tasks = (_Task(model, around, seed, number, given, end) for number in range(starts))
    with Workers(workers) as side_by_side:
        solved = _solved if solve is None else partial(_solved, solve=solve)
        for number, solution in enumerate(side_by_side.in_order(solved, tasks)):
            found.starts.append(_sorted_in(found, number, solution))
            if on_start is not None:
                on_start(found.starts[-1])
            made = f"{number + 1} of {starts} starts were made"
            stopped = deadline.asked_to_stop and number + 1 < starts
            if stopped or (solution is not None and solution.status == "interrupted"):
                found.message = f"interrupted; {made}"
                break
            if clock.is_over and number + 1 < starts:
                found.message = f"the time limit of {clock.limit:g} s came first; {made}"
                break
    _rank(found)
    return found


@dataclass(frozen=True, slots=True)
class _Task:
    """One start: ``options`` are those of its solve, with the guess that the first start has.

    ``end`` is the time at which all starts end, in seconds since the epoch: the clock that processes share.
    """

    model: Model
    around: _Neighbourhood
    seed: int
    number: int
    options: dict[str, Any]
    end: float | None


def _solved(task: _Task, solve: Callable[..., Solution] | None = None) -> Solution | None:
    """The solution from one start, independent of the process and of earlier solves; None if a function has no value at
    the start."""
    for attempt in range(ATTEMPTS if task.number else 1):
        options = dict(task.options)
        if task.end is not None:
            options["time_limit"] = max(task.end - time.time(), 1e-3)
        if task.number:
            options["guess"] = task.around.start(task.seed, task.number, 0.5**attempt)
        task.model.forget()
        try:
            return (solve or task.model.solve)(**options)
        except (EvaluationError, SpecError):
            if task.number == 0:
                raise
    return None


def _sorted_in(found: MultiStart, number: int, solution: Solution | None) -> StartRecord:
    """The record of a start, its optimum noted."""
    if solution is None:
        return StartRecord(number, "undefined", float("nan"), 0, 0, -1)
    found.effort.add(solution)
    which = -1
    if solution.status == "optimal":
        which = next((k for k, one in enumerate(found.optima) if same_optimum(one.solution, solution)), -1)
        if which < 0:
            which = len(found.optima)
            found.optima.append(Optimum(solution.objective, [], solution))
        found.optima[which].starts.append(number)
    if not found.optima and (found.solution is None or solution.violation < found.solution.violation):
        found.solution = solution
    return StartRecord(
        number, solution.status, solution.objective, solution.iterations, solution.factorizations, which
    )


def _rank(found: MultiStart) -> None:
    """Put the best optimum first; optima were numbered in the order of their discovery."""
    order = sorted(range(len(found.optima)), key=lambda k: (found.optima[k].objective, k))
    place = {old: new for new, old in enumerate(order)}
    found.optima = [found.optima[k] for k in order]
    found.starts = [replace(one, optimum=place.get(one.optimum, -1)) for one in found.starts]
    if found.optima:
        found.solution = found.optima[0].solution


def same_optimum(one: Solution, other: Solution) -> bool:
    """Whether two solutions of one problem are the same motion."""
    scale = max(1.0, abs(one.objective), abs(other.objective))
    if abs(one.objective - other.objective) > SAME_OBJECTIVE * scale:
        return False
    for name in one.variables:
        a, b = one[name], other[name]
        size = max(float(np.ptp(a)), float(np.ptp(b)), 1e-3 * float(np.abs(a).max()), 1e-9)
        if np.abs(a - b).max() > SAME_MOTION * size:
            return False
    return all(
        abs(value - other.parameters[name])
        <= SAME_MOTION * max(abs(value), abs(other.parameters[name]), 1e-9)
        for name, value in one.parameters.items()
    )


class _Neighbourhood:
    """Starts around a guess."""

    def __init__(self, transcription: Transcription, bound: BoundProgram) -> None:
        layout = transcription.layout
        self.middle: dict[str, NodeValues] = {}
        self.size: dict[str, float] = {}
        self.pinned: dict[str, FloatArray] = {}
        self.parameters: dict[str, tuple[float, float, float]] = {}
        x, low, high = bound.x0, bound.bounds.lower, bound.bounds.upper
        n = transcription.grid.n
        for name, order, before, after, mid in layout.slots():
            if order == 0:
                self.middle[name] = (
                    x[before],
                    x[after],
                    x[mid] if len(mid) else 0.5 * (x[after][:-1] + x[before][1:]),
                )
                self.size[name] = _amplitude(x[before], low[before], high[before])
                frames = np.flatnonzero((low[before] == high[before]) | (low[after] == high[after]))
                self.pinned[name] = frames / max(n, 1)
        for name, at in layout.parameters.items():
            self.parameters[name] = float(x[at]), float(low[at]), float(high[at])

    def start(self, seed: int, number: int, share: float) -> GivenValues:
        """The start of this number, perturbed by ``share`` of the usual amount."""
        rng = np.random.default_rng([seed, number])
        columns: dict[str, NodeValues] = {}
        for name, (before, after, mid) in self.middle.items():
            n = len(before) - 1
            curve = _smooth_curve(rng, np.linspace(0.0, 1.0, 2 * n + 1), self.pinned[name])
            curve *= share * self.size[name]
            columns[name] = before + curve[::2], after + curve[::2], mid + curve[1::2]
        numbers = {name: _moved(rng, *range_, share) for name, range_ in self.parameters.items()}
        return _Start(columns, numbers)


def _amplitude(x: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """The amplitude of the perturbation of a variable: half of its bounds' distance, or the size of its guess."""
    loose = low < high
    if not loose.any():
        return 0.0
    size = max(float(np.ptp(x)), float(np.abs(x).max()))
    both = loose & np.isfinite(low) & np.isfinite(high)
    if both.any():
        half = 0.5 * float(np.median(high[both] - low[both]))
        return half if half <= FAR * max(size, 1.0) else max(size, 1.0)
    return size if size > 0.0 else 1.0


def _smooth_curve(rng: np.random.Generator, s: FloatArray, pinned: FloatArray) -> FloatArray:
    """A random curve of size about 1 on 0..1 that is 0 where the variable is fixed."""
    k = np.arange(WAVES)
    weights = rng.normal(size=WAVES) / (1.0 + k)
    phases = rng.uniform(0.0, 2.0 * np.pi, WAVES)
    curve: FloatArray = np.cos(np.pi * k * s[:, None] + phases) @ weights
    if len(pinned):
        curve = curve - np.interp(s, pinned, np.interp(pinned, s, curve))
    return curve


def _moved(rng: np.random.Generator, value: float, low: float, high: float, share: float) -> float:
    """A random value of a parameter: anywhere between narrow bounds, else multiplied by a factor."""
    draw, size = rng.random(), rng.normal()
    if low == high:
        return value
    if np.isfinite(low) and np.isfinite(high) and high - low <= FAR * max(abs(value), 1.0):
        there = low + draw * (high - low)
    elif value != 0.0:
        there = value * np.exp(0.5 * size)
    else:
        there = size
    return float(np.clip(value + share * (there - value), low, high))


@dataclass(slots=True)
class _Start:
    """Starting values that are known at every node."""

    columns: dict[str, NodeValues]
    numbers: dict[str, float]
    strict: bool = False

    def names(self) -> Iterable[str]:
        return [*self.columns, *self.numbers]

    def parameter(self, name: str) -> float | None:
        return self.numbers.get(name)

    def values(self, name: str, order: int, time: FloatArray, midpoints: bool = True) -> NodeValues | None:
        return self.columns.get(name) if order == 0 else None
