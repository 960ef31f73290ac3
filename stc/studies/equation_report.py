"""The result of comparing a spec's equations of motion with its model's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from stc.records import dataclass, field
from stc.validate.metrics import Metric

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

#: Findings that a person is shown.
_SHOWN = 10


@dataclass(slots=True, kw_only=True)
class EquationReport:
    """The comparison of a spec's equations of motion with its model's.

    Attributes:
        spec: name of the spec.
        model: file name of the model.
        states: number of random states in each phase.
        metrics: per phase and joint the largest difference; per kind of term the same.
        findings: the differences, the most important line first; empty if they agree.
        notes: notes for the reader.
        steps: advice on findings that are not the difference of a term.
        plain: whether there are findings besides those.
    """

    spec: str
    model: str
    states: int
    metrics: list[Metric] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    plain: bool = False

    @property
    def passed(self) -> bool:
        """Whether something was compared and nothing differs."""
        verdicts = [metric.verdict for metric in self.metrics]
        return not self.findings and "pass" in verdicts and "fail" not in verdicts

    def to_dict(self) -> dict[str, Any]:
        """The report for JSON."""
        return {
            "passed": self.passed,
            "spec": self.spec,
            "model": self.model,
            "states": self.states,
            "metrics": [metric.to_dict() for metric in self.metrics],
            "findings": list(self.findings),
            "notes": list(self.notes),
        }

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Rich shows the differences first, then a table of the compared entries."""
        from rich.table import Table
        from rich.text import Text

        for finding in self.findings[:_SHOWN]:
            yield Text(finding, style="bold red")
        if len(self.findings) > _SHOWN:
            yield Text(f"and {len(self.findings) - _SHOWN} more terms", style="red")
        yield Text(f"{self.spec} against {self.model} at {self.states} random states", style="bold")
        table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0), header_style="bold")
        for heading in ("metric", "of", "value", "limit", "verdict"):
            justify: Any = "right" if heading in ("value", "limit") else "left"
            table.add_column(
                heading, justify=justify, overflow="fold", min_width=7 if heading == "verdict" else None
            )
        colours = {"pass": "green", "fail": "bold red", "info": "dim"}
        for metric in self.metrics:
            table.add_row(
                metric.name,
                metric.subject,
                f"{metric.value:.3g}",
                f"{metric.limit:.3g}",
                Text(metric.verdict, style=colours[metric.verdict]),
            )
        yield table
        for note in self.notes:
            yield Text(f"note: {note}", style="yellow")
        yield Text("passed" if self.passed else "failed", style="bold green" if self.passed else "bold red")
