"""One point of a sweep: solve it, judge it, and return the result as bytes.

The result depends on the task alone, and not on earlier solves in the process or the number of its threads.  A task can
therefore be carried out by any process, twice if necessary, and on a machine without access to the caller's files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from stc.errors import EvaluationError, Source, SpecError, StcError
from stc.pipeline import Model
from stc.records import dataclass
from stc.solution import Solution

__all__ = ["Found", "Task", "solve_point"]

GUESS, NEIGHBOUR = "guess", "neighbour"

#: Iterations within which a neighbour's motion has to lead to an optimum; else the spec's guess is tried.  From a
#: neighbour most motions take 3 to 30, and where it leads astray thousands.
NEIGHBOUR_ITERATIONS = 200


@dataclass(frozen=True, slots=True)
class Task:
    """The definition of one point.

    Attributes:
        index: index of the point in its grid.
        source: the text of the spec.
        constants: values by name.
        options: arguments of :meth:`stc.pipeline.Model.solve`.
        replay: whether the motion is also judged in MuJoCo, if the spec names a model.
        start: the solution file of the neighbour to start from, as bytes; None for the spec's own guess.
    """

    index: int
    source: Source
    constants: Mapping[str, float]
    options: Mapping[str, Any]
    replay: bool
    start: bytes | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """The result of one point.

    Attributes:
        index: index of the point in its grid.
        facts: the columns of the table for the point, without its constants: ``status``, ``objective``, ``violation``,
            ``optimality``, ``iterations`` of the solve; ``start``, where it started; ``verdict`` of the replay
            (``passed``, ``failed``, or "" without a replay) and ``margin``, the largest ratio of a measurement to its
            limit (None without a verdict); ``message``, the verdict or the failure in words.
        file: the solution file as bytes; None without a solution.
    """

    index: int
    facts: dict[str, Any]
    file: bytes | None


def solve_point(task: Task) -> Found:
    """Solve and judge one point.

    Raises:
        EndedError: the process was asked to stop.
    """
    facts: dict[str, Any] = dict.fromkeys(("objective", "violation", "optimality", "iterations", "margin"))
    facts |= {"status": "error", "start": GUESS, "verdict": "", "message": ""}
    with TemporaryDirectory(prefix="stc-sweep-") as folder:
        file = Path(folder) / "solution.npz"
        try:
            solution, facts["start"] = _solved(task, file)
        except (EvaluationError, SpecError) as error:
            return Found(task.index, {**facts, "message": str(error)}, None)
        facts |= {"status": solution.status, "iterations": solution.iterations}
        facts |= {name: _finite(getattr(solution, name)) for name in ("objective", "violation", "optimality")}
        if solution.status != "optimal":
            facts["message"] = solution.message
        solution.save(file)
        if task.replay and solution.status == "optimal" and solution.model is not None:
            facts |= _judged(file)
        return Found(task.index, facts, file.read_bytes())


def _solved(task: Task, file: Path) -> tuple[Solution, str]:
    """The solution from the neighbour if that is an optimum, otherwise from the spec's guess; and which start was
    used.
    """
    given = {"constants": task.constants, **task.options}
    if task.start is not None:
        file.write_bytes(task.start)
        most = given.get("max_iterations")
        few = NEIGHBOUR_ITERATIONS if most is None else min(most, NEIGHBOUR_ITERATIONS)
        try:
            solution = _fresh(task.source).solve(warm_start=file, **{**given, "max_iterations": few})
        except (EvaluationError, SpecError):
            pass  # a function has no value at the neighbour's motion; the guess may have one
        else:
            if solution.status in ("optimal", "interrupted"):
                return solution, NEIGHBOUR
    return _fresh(task.source).solve(**given), GUESS


def _fresh(source: Source) -> Model:
    """A model that solves as the first one of a process does."""
    model = Model(source)
    model.forget()
    return model


def _judged(file: Path) -> dict[str, Any]:
    """The verdict on a saved motion."""
    from stc.certification import certify
    from stc.validate.certificate.table import margin

    try:
        certificate = certify(file, equations=False)
    except StcError as error:
        if getattr(error, "status", "") == "interrupted":
            raise
        return {"verdict": "failed", "message": str(error)}
    margins = [used for metric in certificate.metrics if (used := margin(metric)) is not None]
    return {
        "verdict": "passed" if certificate.passed else "failed",
        "margin": _finite(max(margins, default=math.nan)),
        "message": certificate.headline,
    }


def _finite(value: float) -> float | None:
    """The number, or None if it is not finite, for which JSON has no notation."""
    return float(value) if math.isfinite(value) else None
