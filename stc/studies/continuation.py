"""Continuation: change a constant step by step, from an easy problem to the desired one.

Every solve starts from the one before, with its multipliers and active set.  When one fails the step is halved;
after successes it grows back (the usual step-length rule of predictor-corrector methods: E. L. Allgower and
K. Georg, Introduction to numerical continuation methods, 1990, chapter 6; the first step of Newton's method on the
new problem is the Euler predictor).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from math import inf
from typing import Any

from stc.arguments import number
from stc.arguments import whole as whole_number
from stc.errors import EvaluationError, SpecError, UsageError
from stc.pipeline import Model
from stc.records import dataclass, field
from stc.solution import Solution
from stc.studies.effort import Clock, Effort

__all__ = ["Continuation", "ContinuationStep", "continue_to"]

#: The walk ends where this share of the first step still fails.
SMALLEST = 1.0 / 256
#: After so many successes in a row a halved step is doubled.
SUCCESSES = 2


@dataclass(frozen=True, slots=True)
class ContinuationStep:
    """One solve of a continuation.

    Attributes
    ----------
    value : float
        Value of the constant.
    status : str
        Status of the solve.
    objective, iterations, factorizations
        Results of the solve.
    """

    value: float
    status: str
    objective: float
    iterations: int
    factorizations: int


@dataclass(slots=True)
class Continuation:
    """The result of a continuation.

    Attributes
    ----------
    name : str
        Name of the constant.
    first, last : float
        The first and the desired last value.
    steps : list[ContinuationStep]
        Every solve in order, including failed ones.
    solution : Solution | None
        The last optimal solution; that of the first solve if it failed.
    value : float
        The constant's value there.
    effort : Effort
        Totals of all solves.
    message : str
        Why the continuation stopped early; empty if it reached the last value.
    """

    name: str
    first: float
    last: float
    steps: list[ContinuationStep] = field(default_factory=list)
    solution: Solution | None = None
    value: float = float("nan")
    effort: Effort = field(default_factory=Effort)
    message: str = ""

    @property
    def arrived(self) -> bool:
        """Whether the last value was reached."""
        return not self.message

    @property
    def status(self) -> str:
        """``optimal`` if the last value was reached, else the status of the solve that stopped it."""
        return self.steps[-1].status if self.steps else "failed"

    def to_dict(self) -> dict[str, Any]:
        """The continuation for JSON."""
        return {
            "constant": self.name,
            "first": self.first,
            "last": self.last,
            "reached": self.value,
            "arrived": self.arrived,
            "solves": self.effort.solves,
            "steps": [asdict(step) for step in self.steps],
        }


def continue_to(
    model: Model,
    name: str,
    first: float,
    last: float,
    steps: int = 10,
    *,
    solve: Callable[..., Solution] | None = None,
    on_step: Callable[[ContinuationStep], None] | None = None,
    **options: Any,
) -> Continuation:
    """Change a constant in steps from ``first`` to ``last``, each solve starting from the one before.

    Parameters
    ----------
    model : Model
        The spec.
    name : str
        Name of the constant.
    first : float
        First value; solved from the spec's guess (or as ``options`` say).
    last : float
        Last value.
    steps : int
        Number of steps if none fails; a step that fails is halved.
    solve : Callable[..., Solution] | None
        Function to use in place of ``model.solve``, with the same arguments (to watch it).
    on_step : Callable[[ContinuationStep], None] | None
        Called with the record of every solve.
    **options : Any
        Arguments of :meth:`stc.pipeline.Model.solve`; a time limit applies to all solves together.

    Returns
    -------
    Continuation
        The continuation, with its last optimal solution.

    Raises
    ------
    UsageError
        No such constant, or no step.
    SpecError
        The first or the last value is not valid in the spec.
    """
    if not isinstance(name, str):
        raise UsageError(f"a continuation changes a constant, given by its name, not {name!r}")
    first, last = number(first, f"the first value of {name}"), number(last, f"the last value of {name}")
    steps = whole_number(steps, "the number of steps")
    if steps < 1:
        raise UsageError(f"a continuation takes at least one step, not {steps}")
    if any(value in (inf, -inf) for value in (first, last)):
        raise UsageError(f"a continuation goes from one number to another, not from {first:g} to {last:g}")
    if first == last:
        raise UsageError(f"a continuation from {name} = {first:g} to the same value goes nowhere")
    solve = solve or model.solve
    constants = dict(options.pop("constants", {}))
    clock = Clock(options.pop("time_limit", None))
    walk = Continuation(name, first, last)
    counts = _counts_frames(model, name, (first, last), options.get("method"), constants)
    undefined = ""

    def whole_near(value: float) -> float:
        """The whole number closest to a value that is valid in the spec; if there is none, the closest one."""
        for away in (0, 1, -1, 2, -2):
            near = float(round(value) + away)
            if near == walk.value or not min(first, last) < near < max(first, last):
                continue
            try:
                model.problem(options.get("method"), **{**constants, name: near})
            except SpecError:
                continue
            return near
        return float(round(value))

    def attempt(share: float, **start: Any) -> Solution | None:
        nonlocal undefined
        value = last if share == 1.0 else first + share * (last - first)
        value = whole_near(value) if counts and 0.0 < share < 1.0 else value
        try:
            solution = solve(constants={**constants, name: value}, **{**options, **start}, **clock.option())
        except (EvaluationError, SpecError) as error:
            if walk.solution is None:
                raise
            walk.steps.append(ContinuationStep(value, "failed", float("nan"), 0, 0))
            undefined = str(error)
        else:
            undefined = ""
            walk.effort.add(solution)
            walk.steps.append(
                ContinuationStep(
                    value, solution.status, solution.objective, solution.iterations, solution.factorizations
                )
            )
            if solution.status == "optimal" or walk.solution is None:
                walk.solution, walk.value = solution, value
            if on_step is not None:
                on_step(walk.steps[-1])
            return solution if solution.status == "optimal" else None
        if on_step is not None:
            on_step(walk.steps[-1])
        return None

    if attempt(0.0) is None:
        walk.message = f"the solve with {name} = {first:g} ended {walk.status}; the continuation cannot begin"
        return walk
    share, whole, successes = 0.0, 1.0 / steps, 0
    step = whole
    while share < 1.0:
        target = share + step
        target = 1.0 if target > 1.0 - 1e-9 else target
        found = attempt(target, warm_start=walk.solution, guess=None)
        if found is not None:
            share, successes = target, successes + 1
            if successes >= SUCCESSES and step < whole:
                step, successes = min(2.0 * step, whole), 0
            continue
        if walk.status == "interrupted":
            walk.message = f"interrupted; {name} = {walk.value:g} was reached"
            return walk
        if clock.is_over:
            walk.message = (
                f"the time limit of {clock.limit:g} s came first; {name} = {walk.value:.9g} was reached"
            )
            return walk
        step, successes = 0.5 * step, 0
        if step < SMALLEST * whole or (counts and step * abs(last - first) < 1.0):
            walk.message = (
                f"stopped at {name} = {walk.value:.9g}: the solve a little farther, "
                f"with {name} = {walk.steps[-1].value:.9g}, ended {walk.status}"
            )
            walk.message += f":\n{undefined}" if undefined else ""
            return walk
    return walk


def _counts_frames(
    model: Model, name: str, ends: tuple[float, float], method: str | None, constants: dict[str, float]
) -> bool:
    """Whether a constant must be a whole number, as far as its first and last value show.

    Raises:
        SpecError, UsageError: an end of the walk that the spec cannot take, or no such constant.
    """
    problems = [model.problem(method, **{**constants, name: value}) for value in ends]
    if name not in problems[0].structural or any(value != round(value) for value in ends):
        return False
    if name == "n":
        return True
    try:
        model.problem(method, **{**constants, name: 0.5 * (ends[0] + ends[1]) + 1.0 / 3.0})
    except SpecError:
        return True
    return False
