"""The certificate in a terminal: the verdict with a line for each kind of check, or the page's whole table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from stc.validate.certificate import blame, table

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

    from stc.validate.certificate.certificate import Certificate
    from stc.validate.metrics import Metric

_COLOURS = {"pass": "green", "fail": "bold red", "info": "dim"}

#: Columns of the table, characters between them, and the least that the second one is folded to.
_HEADER, _GAP, _LEAST = ("metric", "of", "value", "limit", "verdict"), 3, 24


#: So many notes the summary shows; the table has all.
_MOST = 2


def summary(certificate: Certificate) -> Iterator[Any]:
    """The verdict in about a dozen lines: one for each kind of check, with the measurement closest to its limit; of a
    motion that failed, only the kinds that failed.

    Yields:
        Lines to print with rich; the verdict and the advice come last.
    """
    from rich.text import Text

    report = certificate.report
    yield Text(
        f"{report.spec} ({report.method}, n = {report.n}, {report.duration:.4g} s) replayed in {report.simulator}",
        style="bold",
    )
    sections = (
        (one, [m for m in one.metrics if m.limit is not None]) for one in table.sections(certificate.metrics)
    )
    for section, judged in sections:
        # Of a motion that failed, only what failed.
        if judged and (certificate.passed or any(metric.verdict == "fail" for metric in judged)):
            verdict = "fail" if any(metric.verdict == "fail" for metric in judged) else "pass"
            yield Text.assemble((f"  {verdict}  ", _COLOURS[verdict]), _nearest(section.title, judged))
    for note in certificate.notes[:_MOST]:
        yield Text(f"note: {note}", style="yellow")
    count, left = len(certificate.metrics), len(certificate.notes) - _MOST
    notes = f" and {left} more note{'s' if left > 1 else ''}" if left > 0 else ""
    yield Text(
        f"--table shows all {count} measurements{notes}; --report FILE.html writes them to a page with the film",
        style="dim",
    )
    yield from _verdict(certificate, 0)


def _nearest(title: str, judged: Sequence[Metric]) -> str:
    """The number of checks in a section, and the one that is closest to its limit or exceeds it most."""
    failed = sum(metric.verdict == "fail" for metric in judged)
    # A measurement past its limit comes before all others, though its limit be zero.
    worst = max(judged, key=lambda metric: (metric.verdict == "fail", table.margin(metric) or 0.0))
    count = (
        f"{failed} of {len(judged)} beyond their limits" if failed else f"{len(judged)} within their limits"
    )
    if len(judged) == 1:
        count = "beyond its limit" if failed else "within its limit"
    figures = f"{table.quantity(worst, worst.value)}, limit {table.bound(worst)}"
    return f"{title}: {count}; {'worst' if failed else 'closest'}: {worst.name}, {worst.subject}: {figures}"


def show(certificate: Certificate) -> Iterator[Any]:
    """The table with every measurement, all notes, and the verdict, in pieces for rich."""
    from rich.text import Text

    report = certificate.report
    heading = f"{report.spec}, {report.method}, n = {report.n}, {report.duration:.4g} s: replayed in {report.simulator}"
    yield Text(heading, style="bold")
    yield _Measurements(certificate)
    facts = dict(certificate.facts())
    for label in (
        "spec",
        "changed constants",
        "model",
        "integrator",
        "stated by the solution, not recomputed",
    ):
        if label in facts:
            yield Text(f"{label}: {facts[label]}", style="dim")
    for note in certificate.notes:
        yield Text(f"note: {note}", style="yellow")
    yield from _verdict(certificate, 8)


def _verdict(certificate: Certificate, most: int) -> Iterator[Any]:
    """The verdict with its headline; if the motion failed, at most ``most`` further failures, and the advice."""
    from rich.text import Text

    if certificate.passed:
        yield Text(f"passed: {certificate.headline}", style="bold green")
        return
    yield Text(f"failed: {certificate.headline}", style="bold red")
    for line in blame.others(certificate.metrics, certificate.findings, most) if most else ():
        yield Text(f"  {line}", style="red")
    for step in certificate.next_steps:
        yield Text(f"next: {step}", style="bold")


class _Measurements:
    """All measurements: a table, or if the screen is too narrow, a line for each."""

    def __init__(self, certificate: Certificate) -> None:
        self._sections = [
            (
                section.title,
                [
                    (
                        name,
                        [(m.subject, table.quantity(m, m.value), table.bound(m), m.verdict) for m in metrics],
                    )
                    for name, metrics in section.by_name().items()
                ],
            )
            for section in table.sections(certificate.metrics)
        ]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        widths = self._widths()
        spare = options.max_width - sum(widths) + widths[1] - _GAP * (len(widths) - 1)
        if spare < min(widths[1], _LEAST):
            yield from self._listed()
            return
        widths[1] = min(widths[1], spare)
        yield from self._table(widths)

    def _widths(self) -> list[int]:
        """Widths of the columns in characters, without folding."""
        from rich.cells import cell_len

        widths = [cell_len(name) for name in _HEADER]
        for _, names in self._sections:
            for name, rows in names:
                widths[0] = max(widths[0], 2 + cell_len(name))
                for row in rows:
                    widths[1:] = [max(width, cell_len(cell)) for width, cell in zip(widths[1:], row)]
        return widths

    def _table(self, widths: list[int]) -> Iterator[Any]:
        """The table, section by section: titles may be wider than the first column."""
        from rich.table import Table
        from rich.text import Text

        def part() -> Table:
            made = Table.grid(padding=(0, _GAP, 0, 0))
            for name, width in zip(_HEADER, widths):
                justify: Any = "right" if name in ("value", "limit") else "left"
                made.add_column(width=width, justify=justify, overflow="fold")
            return made

        header = part()
        header.add_row(*(Text(name, style="bold") for name in _HEADER))
        yield header
        for title, names in self._sections:
            yield Text(title, style="italic dim")
            lines = part()
            for name, rows in names:
                for k, (subject, value, limit, verdict) in enumerate(rows):
                    first, last = Text("" if k else f"  {name}"), Text(verdict, style=_COLOURS[verdict])
                    lines.add_row(first, Text(subject), value, limit, last)
            yield lines

    def _listed(self) -> Iterator[Any]:
        from rich.table import Table
        from rich.text import Text

        for title, names in self._sections:
            yield Text(title, style="italic dim", overflow="fold")
            for name, rows in names:
                yield Text(f"  {name}", overflow="fold")
                lines = Table.grid(padding=(0, 2, 0, 0))
                lines.add_column(width=2)
                lines.add_column(no_wrap=True)
                lines.add_column(overflow="fold")
                for subject, value, limit, verdict in rows:
                    figures = f"{value}, limit {limit}" if limit else value
                    lines.add_row("", Text(verdict, style=_COLOURS[verdict]), Text(f"{subject}: {figures}"))
                yield lines
