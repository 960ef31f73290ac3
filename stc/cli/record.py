"""The output of ``--json``: one object with the same keys for every result, null for unknown values."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from stc.cli import guard

if TYPE_CHECKING:
    from stc.errors import Diagnostic, StcError
    from stc.solution import Solution

#: Stages of a solve that are timed.
STAGES = ("parse", "derive", "compile", "solve", "total", "processor")

Record = dict[str, Any]


def blank(status: str, message: str = "") -> Record:
    """A record with the status of the command only."""
    return {
        "status": status,
        "message": message,
        "objective": None,
        "violation": None,
        "optimality": None,
        "iterations": 0,
        "factorizations": 0,
        "strategy": "",
        "variables": None,
        "rows": None,
        "parameters": {},
        "seconds": dict.fromkeys(STAGES),
    }


def of_solution(solution: Solution, file: str | None = None, warnings: Iterable[Diagnostic] = ()) -> Record:
    """The record of a solve, or of a solution read from a file; ``file`` is the path of the solution file."""
    record = blank(solution.status, solution.message)
    record.update(
        name=solution.name,
        method=solution.method,
        n=solution.n,
        objective=solution.objective,
        violation=solution.violation,
        optimality=solution.optimality,
        iterations=solution.iterations,
        factorizations=solution.factorizations,
        strategy=solution.strategy,
        optimizer=solution.optimizer,
        grid=None,
        ringing=None,
        complementarity=None,
        blame=None,
        active=None,
        sensitivities=None,
        estimation=None,
        variables=len(solution.x),
        rows=len(solution.row_multipliers),
        parameters=dict(solution.parameters),
        file=file,
        warnings=of_diagnostics(warnings),
        outside=list(solution.outside),
    )
    record["seconds"].update(solution.seconds)
    return record


def of_failure(status: str, message: str, error: StcError | None = None) -> Record:
    """The record of a command without a solution."""
    from stc.errors import Diagnostic

    record = blank(status, message)
    diagnostics = getattr(error, "diagnostics", ())
    if not diagnostics and getattr(error, "span", None) is not None:
        diagnostics = (Diagnostic("error", error.message, error.span),)  # type: ignore[union-attr]
    record["diagnostics"] = of_diagnostics(diagnostics)
    return record


def of_diagnostics(diagnostics: Iterable[Diagnostic]) -> list[Record]:
    """Mistakes and warnings, each with its position (null if there is none)."""
    found = []
    for one in diagnostics:
        span = one.span
        found.append(
            {
                "file": None if span is None else span.source.name,
                "line": None if span is None else span.line,
                "column": None if span is None else span.column,
                "severity": one.severity,
                "message": one.message,
                "hint": one.hint,
            }
        )
    return found


def write(record: Record) -> None:
    """Print a record as one line of standard output, the last output of the command."""
    guard.settle()
    put(record)


def put(record: Record) -> None:
    """Print a record, from any thread."""
    sys.stdout.write(json.dumps(finite(record), allow_nan=False) + "\n")
    sys.stdout.flush()


def finite(value: Any) -> Any:
    """The same data in plain JSON types, with null for every number that is not finite."""
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        return finite(value.tolist())
    number = float(value)
    return number if math.isfinite(number) else None
