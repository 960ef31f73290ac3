"""The certificate in a terminal: the page's table, notes, and the verdict in lines that point at the cause."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from stc.validate.certificate import blame, table

if TYPE_CHECKING:
    from stc.validate.certificate.certificate import Certificate

_COLOURS = {"pass": "green", "fail": "bold red", "info": "dim"}


def show(certificate: Certificate) -> Iterator[Any]:
    """What rich is to print, piece by piece."""
    from rich.table import Table
    from rich.text import Text

    report = certificate.report
    heading = f"{report.spec}, {report.method}, n = {report.n}, {report.duration:.4g} s: replayed in {report.simulator}"
    yield Text(heading, style="bold")
    rows = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0), header_style="bold")
    rows.add_column("metric", no_wrap=True)
    rows.add_column("of")
    rows.add_column("value", justify="right", no_wrap=True)
    rows.add_column("limit", justify="right", no_wrap=True)
    rows.add_column("verdict", no_wrap=True)
    for section in table.sections(certificate.metrics):
        rows.add_row(Text(section.title, style="italic dim"))
        for name, metrics in section.by_name().items():
            for k, metric in enumerate(metrics):
                rows.add_row(
                    Text(f"  {name}" if not k else ""),
                    Text(metric.subject),
                    table.quantity(metric, metric.value),
                    table.bound(metric),
                    Text(metric.verdict, style=_COLOURS[metric.verdict]),
                )
    yield rows
    facts = dict(certificate.facts())
    for label in ("spec", "changed constants", "model", "integrator"):
        if label in facts:
            yield Text(f"{label}: {facts[label]}", style="dim")
    for note in certificate.notes:
        yield Text(f"note: {note}", style="yellow")
    if certificate.passed:
        yield Text(f"passed: {certificate.headline}", style="bold green")
        return
    yield Text(f"failed: {certificate.headline}", style="bold red")
    for line in blame.others(certificate.metrics, certificate.findings):
        yield Text(f"  {line}", style="red")
    for step in certificate.next_steps:
        yield Text(f"next: {step}", style="bold")
