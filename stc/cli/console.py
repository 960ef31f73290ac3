"""Output for people: tables on standard output, warnings and notes on standard error."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stc.terminal_text import unfiltered, visible

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions

    from stc.cli.body_turns import Turn
    from stc.errors import Diagnostic
    from stc.solution import Solution
    from stc.studies.compare import Run
    from stc.studies.grid_error import GridError
    from stc.studies.profile import Part
    from stc.studies.uncertainty import Uncertainty
    from stc.validate.certificate import Certificate

#: Width of what goes into a file or a pipe, where nothing should be cut or wrapped.
WIDE = 10_000

#: What rich takes for markup, behind backslashes of which an odd number makes it plain text.
_TAG = re.compile(r"(\\*)(\[[a-z#/@][^[]*?\])")

#: Between two columns.
_GAP = "   "

#: So many warnings about a spec are shown.
MOST_WARNINGS = 20

#: More parameters than this are counted instead of listed.
MOST_PARAMETERS, MOST_IN_LINE = 12, 4


def show_solution(
    solution: Solution,
    file: Path | None,
    was_read: bool = False,
    uncertainty: Uncertainty | None = None,
    grid: GridError | None = None,
) -> None:
    """Print the result of a solve; ``file`` is the path of the solution file; None without a file."""
    good = solution.status == "optimal"
    status = f"[green]{solution.status}[/green]" if good else f"[bold red]{solution.status}[/bold red]"
    rows = [
        ("status", status),
        ("objective", f"{solution.objective:.10g}"),
        ("violation", f"{solution.violation:.2e}"),
        ("optimality", f"{solution.optimality:.2e}"),
        ("iterations", f"{solution.iterations} ({solution.factorizations} factorizations)"),
        *([("found by", solution.strategy)] if solution.strategy not in ("", "from the guess") else []),
        ("size", f"{len(solution.x)} variables, {len(solution.row_multipliers)} rows"),
    ]
    if grid is not None:
        rows.append(("grid error", str(grid)))
    for name, value in list(solution.parameters.items())[:MOST_PARAMETERS]:
        error = "" if uncertainty is None else f", standard error {uncertainty.errors[name]:.5g}"
        rows.append((name, f"{value:.10g}{error}"))
    if len(solution.parameters) > MOST_PARAMETERS:
        rows.append(("", f"and {len(solution.parameters) - MOST_PARAMETERS} more parameters"))
    if uncertainty is not None:
        rows.append(
            (
                "residuals",
                f"{uncertainty.residuals}, of standard deviation {uncertainty.deviation:.5g} "
                f"with {uncertainty.freedom} degrees of freedom",
            )
        )
    rows += [("turns", f"{escape(turn.joint)} {turn}") for turn in _turns(solution)]
    rows.append(("time", times(solution)))
    if file is not None:
        rows.append(("read from" if was_read else "saved", escape(str(file))))
    print_table(f"{solution.name}, {solution.method}, n = {solution.n}", rows)


def show_briefly(solution: Solution, file: Path | None, was_read: bool) -> None:
    """Print how a solve ended and what it found in two lines at most."""
    count = f"{solution.iterations} iteration{'s' * (solution.iterations != 1)}"
    seconds = solution.seconds.get("total", sum(solution.seconds.values()))
    saved = "" if file is None else f"; {'read from' if was_read else 'saved as'} {file}"
    print(
        f"{solution.name}: {solution.status}, objective {solution.objective:.10g} "
        f"({solution.method}, n = {solution.n}, {count}, {seconds:.3g} s{saved})"
    )
    values = [f"{name} = {value:.6g}" for name, value in solution.parameters.items()]
    if len(values) > MOST_IN_LINE:
        values[MOST_IN_LINE:] = [f"and {len(values) - MOST_IN_LINE} more"]
    if values:
        print(", ".join(values))


def _turns(solution: Solution) -> Sequence[Turn]:
    """The number of turns of each body that can turn."""
    if not any(name.endswith(".qw") for name in solution.variables):
        return []
    from stc.cli.body_turns import turns

    return turns(solution)


class Comparison:
    """The table of several optimizers for one spec: a row as each is done, then the reasons of those that failed.

    Args:
        name: name of the spec.
        optimizers: names of the optimizers.
    """

    _HEADER = (
        *("optimizer", "status", "objective", "violation", "optimality"),
        *("iterations", "evaluations", "seconds"),
    )

    def __init__(self, name: str, optimizers: Sequence[str]) -> None:
        self._title = name
        widths = [max(map(len, (*optimizers, self._HEADER[0]))), 15, 16, 9, *map(len, self._HEADER[4:])]
        self._rows = Rows(self._HEADER, widths)
        self._reasons: list[str] = []

    def add(self, run: Run) -> None:
        """Print the result of one optimizer."""
        if self._title:
            _print(self._title, "bold", markup=False)
            self._title = ""
        good = run.status == "optimal"
        status = f"[green]{run.status}[/green]" if good else f"[bold red]{run.status}[/bold red]"
        figures: tuple[str, ...] = ("",) * 6
        if run.status not in ("refused", "skipped"):
            figures = (
                *(f"{run.objective:.10g}", f"{run.violation:.1e}", f"{run.optimality:.1e}"),
                *(str(run.iterations), str(run.evaluations), f"{run.seconds:.3f}"),
            )
        self._rows.row(run.optimizer, status, *figures)
        if not good:
            self._reasons.append(f"{run.optimizer}: {run.message}")

    def end(self) -> None:
        """Print the reasons of the optimizers that found no optimum."""
        for reason in self._reasons:
            print(reason)


def times(solution: Solution) -> str:
    """The time of a solve in seconds, in total and by stage."""
    seconds = {stage: value for stage, value in solution.seconds.items() if stage != "processor"}
    total = seconds.pop("total", sum(seconds.values()))
    stages = ", ".join(f"{stage} {value:.3f}" for stage, value in seconds.items())
    return f"{total:.3f} s ({stages})" if stages else f"{total:.3f} s"


def show_profile(parts: Sequence[Part]) -> None:
    """Print the time of each part of a solve, and the least time that it could take."""
    total = sum(part.seconds for part in parts)
    rows = []
    for part in parts:
        times_floor = f"{part.seconds / part.floor:.1f}" if part.floor else ""
        floor = "" if part.floor is None else f"{1e3 * part.floor:.3f}"
        share = f"{100.0 * part.seconds / total:.1f}" if total else ""
        rows.append(
            (part.name, f"{1e3 * part.seconds:.3f}", share, str(part.calls or ""), floor, times_floor)
        )
    print()
    print_table("where the time went", rows, ("part", "ms", "%", "calls", "floor, ms", "times floor"))


def show_certificate(certificate: Certificate, table: bool) -> None:
    """Print the result of a validation: its summary, or the ``table`` of every measurement."""
    from rich.console import Group

    print()
    shown = certificate if table else Group(*certificate.summary())
    rich_console(width=None if sys.stdout.isatty() else WIDE).print(shown)


def print_table(title: str, rows: Sequence[Sequence[str]], header: Sequence[str] = ()) -> None:
    """Print a title and an unframed table on standard output; cells may contain rich's markup."""
    if title:
        _print(title, "bold", markup=False)
    lines = [header, *rows] if header else rows
    columns = max((len(line) for line in lines), default=0)
    table = Rows(
        header, [max(_shown_width(line[k]) for line in lines if k < len(line)) for k in range(columns)]
    )
    for row in rows:
        table.row(*row)


class Rows:
    """A table that prints each row as soon as it is added; on a narrow terminal each row is a sentence.

    Args:
        header: names of the columns; without one the first column names the others.
        widths: characters of each column.
    """

    def __init__(self, header: Sequence[str], widths: Sequence[int]) -> None:
        self._header, self._widths = list(header), list(widths)
        self._begun = not header

    def row(self, *cells: str) -> None:
        """Print one more row; cells may contain rich's markup."""
        if not sys.stdout.isatty():
            # Without colours for files and pipes, and without importing rich, which takes 16 ms.
            for line in self._lines([_unmarked(cell) for cell in cells]):
                print(_GAP.join(cell.ljust(width) for cell, width in zip(line, self._widths)).rstrip())
            sys.stdout.flush()
            return
        width = rich_console().width
        gap = next((gap for gap in (len(_GAP), 1) if self._extent(gap) <= width), len(_GAP))
        if self._header and self._extent(gap) > width:
            named = [f"{name.replace(',', '')} {cell}" for name, cell in zip(self._header, cells) if cell]
            _print(": ".join([named[0], ", ".join(named[1:])]))
            return
        for line in self._lines(cells):
            _print(self._grid(line, width, gap, heading=line is self._header))

    def _extent(self, gap: int) -> int:
        return sum(self._widths) + gap * (len(self._widths) - 1)

    def _lines(self, cells: Sequence[str]) -> Iterator[Sequence[str]]:
        """The heading where there was none yet, and the row."""
        if not self._begun:
            self._begun = True
            yield self._header
        yield cells

    def _grid(self, cells: Sequence[str], width: int, gap: int, heading: bool) -> Any:
        """One line of the table; long text is folded to the width of the terminal."""
        from rich.table import Table

        grid = Table.grid(padding=(0, gap, 0, 0))
        for at in range(len(cells)):
            wide = self._widths[at]
            if at == len(self._widths) - 1:  # takes what the others leave
                wide = max(8, width - sum(self._widths[:at]) - gap * at)
            # The first column names things; where there is no header it stands back behind the values.
            style = "bold" if heading else "dim" if at == 0 and not self._header else ""
            grid.add_column(style=style, width=wide, overflow="fold")
        grid.add_row(*cells)
        return grid


def _print(what: Any, style: str | None = None, markup: bool = True) -> None:
    """Print a line on standard output, in colour on a terminal."""
    if not sys.stdout.isatty():
        print(what)
        return
    rich_console().print(what, style=style, markup=markup)


def rich_console(**settings: Any) -> Console:
    """Rich's console on standard output, or with ``stderr=True`` on standard error.

    It bypasses the filter of these streams, since colours are terminal controls too; its text passes the same filter
    before it is coloured.
    """
    from rich.console import Console, RenderHook
    from rich.segment import Segment

    class Shown:
        def __init__(self, what: Any) -> None:
            self.what = what

        def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
            for segment in console.render(self.what, options):
                yield segment if segment.control else Segment(visible(segment.text), segment.style)

    class Hook(RenderHook):
        def process_renderables(self, renderables: list[Any]) -> list[Any]:
            return [Shown(one) for one in renderables]

    stream = sys.stderr if settings.pop("stderr", False) else sys.stdout
    console = Console(file=unfiltered(stream), highlight=False, soft_wrap=False, **settings)
    console.push_render_hook(Hook())
    return console


def _shown_width(cell: str) -> int:
    """The displayed width of a cell in characters."""
    return len(_unmarked(cell))


def _unmarked(text: str) -> str:
    """The text that rich displays, without colours."""
    return _TAG.sub(lambda tag: tag[1][: len(tag[1]) // 2] + tag[2] * (len(tag[1]) % 2), text)


def escape(text: str) -> str:
    """Text with rich's markup escaped."""
    return _TAG.sub(lambda tag: f"{tag[1]}{tag[1]}\\{tag[2]}", text)


def warn(diagnostics: Iterable[Diagnostic]) -> None:
    """Warnings about a spec, on standard error."""
    found = list(diagnostics)
    for one in found[:MOST_WARNINGS]:
        print(one.render(), file=sys.stderr)
    if len(found) > MOST_WARNINGS:
        print(f"and {len(found) - MOST_WARNINGS} more warnings", file=sys.stderr)


@contextmanager
def warnings_as_notes() -> Iterator[None]:
    """A context in which warnings of the solver are printed as notes, at once and each time."""

    def show(message: Warning | str, *_: object, **__: object) -> None:
        note(str(message))

    with warnings.catch_warnings():
        from stc.optimizers import SizeWarning

        warnings.simplefilter("always", SizeWarning)
        warnings.showwarning = show
        yield


def note(text: str) -> None:
    """Print a note on standard error."""
    print(f"note: {text}", file=sys.stderr)
