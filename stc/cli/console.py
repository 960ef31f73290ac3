"""Results as people read them: tables on standard output, warnings and notes on standard error."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stc.errors import Diagnostic
    from stc.solution import Solution
    from stc.studies.compare import Run
    from stc.studies.profile import Part
    from stc.validate.certificate import Certificate

#: Width of what goes into a file or a pipe, where nothing should be cut or wrapped.
WIDE = 10_000

#: What rich takes for markup, behind backslashes of which an odd number makes it plain text.
_TAG = re.compile(r"(\\*)(\[[a-z#/@][^[]*?\])")

#: More parameters than this are counted instead of listed.
MOST_PARAMETERS = 12


def show_solution(solution: Solution, file: Path | None) -> None:
    """The outcome of a solve; ``file`` is where it is saved, None when it is not."""
    good = solution.status == "optimal"
    status = f"[green]{solution.status}[/green]" if good else f"[bold red]{solution.status}[/bold red]"
    rows = [
        ("status", status),
        ("objective", f"{solution.objective:.10g}"),
        ("violation", f"{solution.violation:.2e}"),
        ("optimality", f"{solution.optimality:.2e}"),
        ("iterations", f"{solution.iterations} ({solution.factorizations} factorizations)"),
        ("size", f"{len(solution.x)} variables, {len(solution.row_multipliers)} rows"),
    ]
    for name, value in list(solution.parameters.items())[:MOST_PARAMETERS]:
        rows.append((name, f"{value:.10g}"))
    if len(solution.parameters) > MOST_PARAMETERS:
        rows.append(("", f"and {len(solution.parameters) - MOST_PARAMETERS} more parameters"))
    rows.append(("time", times(solution)))
    if file is not None:
        rows.append(("saved", escape(str(file))))
    print_table(f"{solution.name}, {solution.method}, n = {solution.n}", rows)
    if not good and solution.message:
        print(solution.message)


def show_comparison(name: str, runs: Sequence[Run]) -> None:
    """What several optimizers made of one spec: a line for each, and the reason of each that found no optimum."""
    header = (
        *("optimizer", "status", "objective", "violation", "optimality"),
        *("iterations", "evaluations", "seconds"),
    )
    rows = []
    for run in runs:
        good = run.status == "optimal"
        status = f"[green]{run.status}[/green]" if good else f"[bold red]{run.status}[/bold red]"
        if run.status == "refused":
            rows.append((run.optimizer, status, "", "", "", "", "", ""))
            continue
        figures = (f"{run.objective:.10g}", f"{run.violation:.1e}", f"{run.optimality:.1e}")
        counts = (str(run.iterations), str(run.evaluations), f"{run.seconds:.3f}")
        rows.append((run.optimizer, status, *figures, *counts))
    print_table(name, rows, header)
    for run in runs:
        if run.status != "optimal":
            print(f"{run.optimizer}: {run.message}")


def times(solution: Solution) -> str:
    """The seconds of a solve, in all and by stage."""
    seconds = dict(solution.seconds)
    total = seconds.pop("total", sum(seconds.values()))
    stages = ", ".join(f"{stage} {value:.3f}" for stage, value in seconds.items())
    return f"{total:.3f} s ({stages})" if stages else f"{total:.3f} s"


def show_profile(parts: Sequence[Part]) -> None:
    """Where the time of a solve went, and how far each part is from its floor."""
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


def show_certificate(certificate: Certificate) -> None:
    """What the validation found, below the solution."""
    from rich.console import Console

    print()
    Console(highlight=False, width=None if sys.stdout.isatty() else WIDE).print(certificate)


def print_table(title: str, rows: Sequence[Sequence[str]], header: Sequence[str] = ()) -> None:
    """A title and an unframed table on standard output; cells may carry rich's markup."""
    if not sys.stdout.isatty():
        _print_plain(title, rows, header)
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(
        box=None, show_header=bool(header), pad_edge=False, padding=(0, 3, 0, 0), header_style="bold"
    )
    columns = header or [""] * max((len(row) for row in rows), default=0)
    for at, name in enumerate(columns):
        # The first column names things; where there is no header it stands back behind the values.
        table.add_column(name, style="dim" if at == 0 and not header else "", no_wrap=at == 0)
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False, soft_wrap=False)
    if title:
        console.print(title, style="bold", markup=False)
    console.print(table)


def _print_plain(title: str, rows: Sequence[Sequence[str]], header: Sequence[str]) -> None:
    """The same without colours for files and pipes, and without importing rich, which takes 16 ms."""
    if title:
        print(title)
    lines = [[_unmarked(cell) for cell in row] for row in ([header, *rows] if header else rows)]
    columns = max((len(line) for line in lines), default=0)
    widths = [max(len(line[k]) for line in lines if k < len(line)) for k in range(columns)]
    for line in lines:
        print("   ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())


def _unmarked(text: str) -> str:
    """What rich shows of a text, without colours."""
    return _TAG.sub(lambda tag: tag[1][: len(tag[1]) // 2] + tag[2] * (len(tag[1]) % 2), text)


def escape(text: str) -> str:
    """Text that is to be shown as it is, whatever looks like markup in it."""
    return _TAG.sub(lambda tag: f"{tag[1]}{tag[1]}\\{tag[2]}", text)


def warn(diagnostics: Iterable[Diagnostic]) -> None:
    """Warnings about a spec, on standard error."""
    for one in diagnostics:
        print(one.render(), file=sys.stderr)


@contextmanager
def warnings_as_notes() -> Iterator[None]:
    """Inside, warnings of the solver appear as notes, at once and each time."""

    def show(message: Warning | str, *_: object, **__: object) -> None:
        note(str(message))

    with warnings.catch_warnings():
        from stc.solver.optimizers import SizeWarning

        warnings.simplefilter("always", SizeWarning)
        warnings.showwarning = show
        yield


def note(text: str) -> None:
    """A remark on standard error."""
    print(f"note: {text}", file=sys.stderr)
