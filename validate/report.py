"""The result of a validation: measurements with verdicts, their origin, and their display."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from stc.records import dataclass, field
from stc.validate.claims import Claims
from stc.validate.metrics import Metric

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult


@dataclass(slots=True, kw_only=True)
class Report:
    """The measurements of a validated motion.

    Attributes
    ----------
    spec : str
        Name of the spec.
    spec_sha256 : str
        Hash of its text.
    status : str
        How its solve ended.
    method : str
        Transcription.
    n : int
        Number of steps.
    duration : float
        Of the motion, in seconds.
    model : str
        File name of the model.
    model_sha256 : str
        Hash of the model file.
    fields : dict[str, float]
        Model fields that the spec set, by path.
    simulator : str
        Name and version of the simulator.
    integrator : str
        The integrator of the replay.
    model_integrator : str
        The integrator that the model file asks for.
    time_step : float
        Longest time step of the replay, in seconds.
    steps : int
        Number of time steps of the replay.
    tracked_by : str
        The feedback of the tracked replay, ``LQR`` or ``PD``; "" without one.
    metrics : Sequence[Metric]
        All measurements.
    claims : Claims
        The figures that the solution states, with their recomputed values, and those that cannot be recomputed.
    faults : Sequence[str]
        Other faults, one line each, such as a model that differs from the one that was solved for.
    unjudged : Sequence[str]
        Names of the measurements that could not be made for this motion and model.
    notes : Sequence[str]
        Notes for the reader.
    seconds : float
        Wall time of the validation.
    """

    spec: str
    spec_sha256: str
    status: str
    method: str
    n: int
    duration: float
    model: str
    model_sha256: str
    fields: dict[str, float]
    simulator: str
    integrator: str
    model_integrator: str
    time_step: float
    steps: int
    tracked_by: str = ""
    metrics: Sequence[Metric]
    claims: Claims = field(default_factory=Claims)
    faults: Sequence[str] = field(default_factory=list)
    unjudged: Sequence[str] = field(default_factory=list)
    notes: Sequence[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def passed(self) -> bool:
        """Whether there is a metric with a limit, all of them are within their limits, and the stated figures agree."""
        verdicts = [metric.verdict for metric in self.metrics]
        return "pass" in verdicts and "fail" not in verdicts and not self.findings

    @property
    def findings(self) -> list[str]:
        """Disagreements in the figures that the solution states, one line each, the most important first."""
        return [*self.claims.findings, *self.faults]

    def to_dict(self) -> dict[str, Any]:
        """The report for JSON; values that are not finite are None."""
        return {
            "passed": self.passed,
            "spec": self.spec,
            "spec_sha256": self.spec_sha256,
            "status": self.status,
            "method": self.method,
            "n": self.n,
            "duration": self.duration,
            "model": self.model,
            "model_sha256": self.model_sha256,
            "fields": dict(self.fields),
            "simulator": self.simulator,
            "integrator": self.integrator,
            "model_integrator": self.model_integrator,
            "time_step": self.time_step,
            "steps": self.steps,
            "tracked_by": self.tracked_by,
            "findings": self.findings,
            "words": dict(self.claims.words),
            "metrics": [metric.to_dict() for metric in self.metrics],
            "unjudged": list(self.unjudged),
            "notes": list(self.notes),
            "seconds": self.seconds,
        }

    def _repr_html_(self) -> str:
        # By name: nothing here is imported from the layers above.
        return str(import_module("stc.notebooks").of_report(self))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Rich shows a report as a table with the verdict below it."""
        from rich.table import Table
        from rich.text import Text

        colours = {"pass": "green", "fail": "bold red", "info": "dim"}
        title = (
            f"{self.spec}, {self.method}, n = {self.n}, {self.duration:.4g} s: replayed in {self.simulator}"
        )
        table = Table(title=title, title_justify="left", title_style="bold")
        for heading in ("metric", "of"):
            table.add_column(heading, overflow="fold")
        for heading in ("value", "limit"):
            table.add_column(heading, justify="right", overflow="fold")
        table.add_column("verdict", min_width=7)
        for metric in self.metrics:
            limit = "" if metric.limit is None else f"{metric.limit:.3g} {metric.unit}".strip()
            table.add_row(
                metric.name,
                metric.subject,
                f"{metric.value:.3g} {metric.unit}".strip(),
                limit,
                Text(metric.verdict, style=colours[metric.verdict]),
            )
        yield table
        yield Text(
            f"{self.model}, {self.integrator}, {self.steps} time steps of at most {self.time_step:.3g} s",
            style="dim",
        )
        if self.claims.words:
            yield Text(f"stated by the solution, not recomputed: {self.claims.told}", style="dim")
        for note in self.notes:
            yield Text(f"note: {note}", style="yellow")
        for line in self.findings:
            yield Text(line, style="bold red")
        verdict = "passed" if self.passed else "failed"
        if self.passed and self.unjudged:
            verdict += f"; not judged: {', '.join(self.unjudged)}"
        yield Text(verdict, style="bold green" if self.passed else "bold red")
