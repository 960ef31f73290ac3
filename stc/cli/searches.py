"""Searches on the command line: their options, tables, and records for ``--json``."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from stc.cli.console import Rows, escape
from stc.cli.inputs import names_a_constant, number
from stc.errors import UsageError
from stc.records import dataclass, field

if TYPE_CHECKING:
    from pathlib import Path

    from stc.pipeline import Model
    from stc.solution import Solution
    from stc.studies.effort import Effort

#: Steps of a continuation that does not say how many.
DEFAULT_STEPS = 10
DEFAULT_SEED = 1


@dataclass(frozen=True, slots=True)
class Walk:
    """The argument of ``--continue``, ``NAME=FIRST:LAST:STEPS``: a constant that is changed step by step."""

    name: str
    first: float
    last: float
    steps: int


@dataclass(frozen=True, slots=True)
class Search:
    """The search around a solve; by default none.

    Attributes:
        guess: file of starting values.
        walk: the continuation of a constant.
        starts, seed, workers: number of starts of a multi-start, their seed, and the processes that share them.
        refine: tolerance of a mesh refinement.
        until: drift of the replay below which a motion counts as verified.
        until_passed: whether to add frames until the motion passes its validation.
    """

    guess: Path | None = None
    walk: Walk | None = None
    starts: int | None = None
    seed: int = DEFAULT_SEED
    workers: int = 1
    refine: float | None = None
    until: float | None = None
    until_passed: bool = False

    @property
    def adds_frames(self) -> bool:
        """Whether the search looks for the number of frames."""
        return self.refine is not None or self.until is not None or self.until_passed


@dataclass(slots=True)
class Found:
    """The solution of a search, and its record.

    Attributes:
        solution: the solution to show and save.
        status: ``optimal`` only if the search also reached its goal.
        message: why it did not, else empty.
        record: additional entries for ``--json``.
        remark: an additional note on the solution.
    """

    solution: Solution
    status: str
    message: str = ""
    record: dict[str, Any] = field(default_factory=dict)
    remark: str = ""

    @property
    def good(self) -> bool:
        """Whether the search reached its goal."""
        return self.status == "optimal" and not self.message

    def in_all(self) -> str:
        """The totals of all solves, in words; "" for a single one."""
        if not self.record:
            return ""
        known = self.record
        return (
            f"in all       {known['solves']} solve{'s' if known['solves'] != 1 else ''}, "
            f"{known['iterations']} iterations, {known['factorizations']} factorizations, "
            f"{known['total_seconds']:.3g} s"
        )

    def added_to(self, known: dict[str, Any]) -> dict[str, Any]:
        """A solution's record with the record of the search; iterations and factorizations are those of all its
        solves.
        """
        if not self.record:
            return known
        more = {name: value for name, value in self.record.items() if name != "solves"}
        seconds = {**known["seconds"], "total": more.pop("total_seconds")}
        message = self.message
        if not message or self.status == known["status"]:  # else that of the solution says something else
            message = f"{known['message']} {message}".strip()
        return {**known, "status": self.status, "message": message, "seconds": seconds, **more}


def search_options(
    warm_start: str | None,
    guess_from: str | None = None,
    walk: str | None = None,
    starts: int | None = None,
    seed: int | None = None,
    refine: float | None = None,
    until: float | None = None,
    workers: int | None = None,
    until_passed: bool = False,
) -> Search:
    """Check the options before any work is done.

    Raises:
        UsageError: an invalid value, or options that exclude each other.
    """
    from pathlib import Path

    if guess_from is not None and warm_start is not None:
        raise UsageError("--guess-from and --warm-start both say where to start: give one of them")
    if walk is not None and starts is not None:
        raise UsageError("--continue and --starts both choose the starts: give one of them")
    if starts is not None and warm_start is not None:
        raise UsageError("--starts chooses the starts and --warm-start gives one: give one of them")
    if starts is not None and starts < 1:
        raise UsageError(f"--starts must be at least 1, not {starts}")
    if seed is not None and starts is None:
        raise UsageError("--seed can only be used with --starts")
    if workers is not None and starts is None:
        raise UsageError("--workers can only be used with --starts")
    if workers is not None and workers < 1:
        raise UsageError(f"--workers must be at least 1, not {workers}")
    if seed is not None and seed < 0:
        raise UsageError(f"--seed must be 0 or more, not {seed}")
    if refine is not None and not refine > 0:
        raise UsageError(f"--refine must be a positive tolerance, not {refine:g}")
    if until is not None and not until > 0:
        raise UsageError(f"--until-verified must be a positive drift, not {until:g}")
    choosing = {
        "--refine": refine is not None,
        "--until-verified": until is not None,
        "--until-passed": until_passed,
    }
    if sum(choosing.values()) > 1:
        names = " and ".join(name for name, given in choosing.items() if given)
        raise UsageError(f"{names} both choose the frames: give one of them")
    if guess_from is not None and not Path(guess_from).is_file():
        raise UsageError(f"--guess-from: there is no file `{guess_from}`")
    return Search(
        None if guess_from is None else Path(guess_from),
        None if walk is None else walk_option(walk),
        starts,
        DEFAULT_SEED if seed is None else seed,
        1 if workers is None else workers,
        refine,
        until,
        until_passed,
    )


def walk_option(text: str) -> Walk:
    """Read ``NAME=FIRST:LAST`` or ``NAME=FIRST:LAST:STEPS``.

    Raises:
        UsageError: it is something else.
    """
    name, equals, values = text.partition("=")
    name, parts = name.strip(), values.split(":")
    if (
        not equals
        or not names_a_constant(name)
        or len(parts) not in (2, 3)
        or not all(p.strip() for p in parts)
    ):
        raise UsageError(
            f"--continue wants NAME=FIRST:LAST:STEPS, not `{text}`", "for example: --continue g=0:9.8:20"
        )
    numbers = [number(part, f"--continue {text}") for part in parts]
    steps = numbers[2] if len(numbers) == 3 else DEFAULT_STEPS
    if not float(steps).is_integer() or steps < 1:
        raise UsageError(f"--continue {text}: the number of steps must be a whole number, 1 or more")
    return Walk(name, numbers[0], numbers[1], round(steps))


def find(model: Model, search: Search, solve: Callable[..., Solution], show: bool, **options: Any) -> Found:
    """Carry out a search.

    Args:
        solve: solves the model once; takes the arguments of :meth:`stc.pipeline.Model.solve`.
        show: whether to print tables as the search proceeds.
        **options: options of every solve.

    Raises:
        StcError: mistakes in the input.
    """
    if search.guess is not None:
        from stc.guesses.file import read_guess

        options["guess"] = read_guess(search.guess)
    if search.walk is None and search.starts is None and not search.adds_frames:
        solution = solve(**options)
        return Found(solution, solution.status)
    found = None
    begin = time.monotonic()
    if search.walk is not None:
        found = _walk(model, search.walk, solve, show, options)
        options = {**options, "constants": {search.walk.name: search.walk.last}}
    elif search.starts is not None:
        found = _starts(model, search, solve, show, options)
    if found is not None and options.get("time_limit") is not None:
        options["time_limit"] = max(options["time_limit"] - (time.monotonic() - begin), 1e-3)
    if search.refine is not None and (found is None or found.good):
        found = _refined(model, search.refine, found, solve, show, options)
    if search.until is not None and (found is None or found.good):
        found = _verified(model, search.until, found, solve, show, options)
    if search.until_passed and (found is None or found.good):
        found = _passed(model, found, solve, show, options)
    assert found is not None
    return found


def _walk(
    model: Model, walk: Walk, solve: Callable[..., Solution], show: bool, options: dict[str, Any]
) -> Found:
    from stc.studies.continuation import continue_to

    table = _Table((walk.name, "status", "objective", "iterations"), show)
    result = continue_to(
        model,
        walk.name,
        walk.first,
        walk.last,
        walk.steps,
        solve=solve,
        on_step=lambda s: table.row(f"{s.value:.9g}", s.status, _figure(s.objective), str(s.iterations)),
        **options,
    )
    table.end()
    assert result.solution is not None
    record = {**_totals(result.effort), "continuation": result.to_dict()}
    return Found(result.solution, result.status, result.message, record)


def _starts(
    model: Model, search: Search, solve: Callable[..., Solution], show: bool, options: dict[str, Any]
) -> Found:
    from stc.cli.live import Line
    from stc.studies.multistart import StartRecord, multistart

    starts, seed, workers = search.starts, search.seed, search.workers
    assert starts is not None
    if workers == 1:
        result = multistart(model, starts, seed, solve=solve, **options)
    else:  # the solves of other processes cannot be watched, only counted
        line = Line()

        def done(one: StartRecord) -> None:
            if line.due:
                line.show(f"{model.name}  {one.start + 1} of {starts} starts")

        try:
            result = multistart(model, starts, seed, workers=workers, on_start=done, **options)
        finally:
            line.close()
    table = _Table(("objective", "count", "starts (0 is the spec's own guess)"), show)
    for one in result.optima:
        table.row(f"{one.objective:.10g}", str(len(one.starts)), _listed(one.starts))
    lost = [start for start in result.starts if start.optimum < 0]
    for status in dict.fromkeys(start.status for start in lost):
        where = [start.start for start in lost if start.status == status]
        table.row(status, str(len(where)), _listed(where))
    table.end()
    assert result.solution is not None
    record = {**_totals(result.effort), "multistart": {**result.to_dict(), "seed": seed}}
    message = result.message
    if not result.optima:
        message = f"none of {len(result.starts)} starts led to an optimum{'; ' if message else ''}{message}"
    return Found(result.solution, result.solution.status, message, record)


def _refined(
    model: Model,
    tolerance: float,
    before: Found | None,
    solve: Callable[..., Solution],
    show: bool,
    options: dict[str, Any],
) -> Found:
    from stc.studies.refinement import refine

    table = _Table(("n", "objective", "error", "iterations"), show)
    result = refine(
        model,
        tolerance,
        start=None if before is None else before.solution,
        solve=solve,
        on_level=lambda level: table.row(
            str(level.n), _figure(level.objective), _figure(level.error, ".2e"), str(level.iterations)
        ),
        **options,
    )
    table.end()
    assert result.solution is not None
    record, totals = _added(before, result.effort)
    last = result.best.status
    message = result.message and f"--refine {tolerance:g} was not reached: {result.message}"
    found = Found(result.solution, last, message, {**record, **totals, "refinement": result.to_dict()})
    found.remark = result.remark
    return found


def _verified(
    model: Model,
    tolerance: float,
    before: Found | None,
    solve: Callable[..., Solution],
    show: bool,
    options: dict[str, Any],
) -> Found:
    from stc.studies.verified import solve_until_verified

    table = _Table(("n", "objective", "drift", "of", "judged by", "iterations"), show)
    result = solve_until_verified(
        model,
        tolerance,
        start=None if before is None else before.solution,
        solve=solve,
        on_round=lambda one: table.row(
            str(one.n),
            _figure(one.objective),
            _figure(one.drift, ".2e"),
            one.subject or "-",
            one.judged_by or one.status,
            str(one.iterations),
        ),
        **options,
    )
    table.end()
    assert result.solution is not None
    record, totals = _added(before, result.effort)
    message = result.message and f"--until-verified {tolerance:g} was not reached: {result.message}"
    last = result.rounds[-1].status
    return Found(result.solution, last, message, {**record, **totals, "verification": result.to_dict()})


def _passed(
    model: Model, before: Found | None, solve: Callable[..., Solution], show: bool, options: dict[str, Any]
) -> Found:
    from stc.studies.passing import solve_until_passed

    table = _Table(("n", "objective", "iterations", "of its limit", "exceeded most by"), show)
    result = solve_until_passed(
        model,
        start=None if before is None else before.solution,
        solve=solve,
        on_attempt=lambda one: table.row(
            str(one.n),
            _figure(one.objective),
            str(one.iterations),
            f"{one.excess:.3g} times" if one.excess else "-",
            one.worst or "-",
        ),
        **options,
    )
    table.end()
    assert result.solution is not None
    record, totals = _added(before, result.effort)
    last = result.attempts[-1].status
    message = result.message and f"--until-passed ended: {result.message}"
    return Found(result.solution, last, message, {**record, **totals, "passing": result.to_dict()})


def _added(before: Found | None, effort: Effort) -> tuple[dict[str, Any], dict[str, Any]]:
    """An earlier record with the totals of all solves added."""
    record = {} if before is None else before.record
    return record, {name: value + record.get(name, 0) for name, value in _totals(effort).items()}


def _totals(effort: Effort) -> dict[str, Any]:
    """The totals of all solves."""
    return {
        "solves": effort.solves,
        "iterations": effort.iterations,
        "factorizations": effort.factorizations,
        "total_seconds": effort.seconds,
    }


def _figure(number: float, how: str = ".10g") -> str:
    """A number as text, or "" if there is none."""
    return f"{number:{how}}" if math.isfinite(number) else "-"


def _listed(numbers: Sequence[int]) -> str:
    """Numbers as text with ranges abbreviated: ``0, 3-7, 9``."""
    parts: list[list[int]] = []
    for one in numbers:
        if parts and one == parts[-1][-1] + 1:
            parts[-1].append(one)
        else:
            parts.append([one])
    return ", ".join(str(p[0]) if len(p) == 1 else f"{p[0]}-{p[-1]}" for p in parts)


class _Table:
    """A table that is printed row by row, each row as soon as it is computed."""

    WIDTH = 15

    def __init__(self, heading: Sequence[str], show: bool) -> None:
        self._rows = Rows(heading, [self.WIDTH] * len(heading)) if show else None
        self._begun = False

    def row(self, *cells: str) -> None:
        """Print one row of the table."""
        if self._rows is not None:
            self._rows.row(*map(escape, cells))
            self._begun = True

    def end(self) -> None:
        """End the table with an empty line, if it has rows."""
        if self._begun:
            print(flush=True)
