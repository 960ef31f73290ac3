"""The certificate of a validated motion."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from stc.atomic import replacing
from stc.records import dataclass, field
from stc.solution import Solution
from stc.validate import limits
from stc.validate.certificate import advice, blame, causes, contact_causes
from stc.validate.certificate.listing import Statement
from stc.validate.certificate.staleness import stale
from stc.validate.metrics import Metric
from stc.validate.report import Report
from stc.validate.statements import StatementCheck
from stc.validate.verdict import Replays, examine

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult


class ComparedEquations(Protocol):
    """The comparison of a spec's equations of motion with its model's, made by a module that can evaluate the spec."""

    metrics: list[Metric]
    findings: list[str]
    notes: list[str]
    steps: list[str]
    plain: bool


@dataclass(slots=True)
class Certificate:
    """The certificate of one motion.

    Attributes
    ----------
    solution : Solution
        The motion.
    report : Report
        The validation's measurements.
    replays : Replays
        The simulations.
    equations : ComparedEquations | None
        The comparison of the equations of motion, if it was made.
    statements : Sequence[Statement]
        The statements that the spec's text contains.
    refused : str
        Why the equations could not be compared, if that was tried.
    further : Sequence[Metric]
        Additional measurements, such as the observed order of convergence.
    faults : list[str]
        Faults that are not measurements, one line each, such as a spec that has changed since the solve.
    more_frames : str
        The options for twice the frames, such as ``--set n=120``.
    """

    solution: Solution
    report: Report
    replays: Replays
    equations: ComparedEquations | None = None
    further: Sequence[Metric] = ()
    faults: list[str] = field(default_factory=list)
    more_frames: str = ""
    refused: str = ""
    statements: Sequence[Statement] = ()

    @property
    def metrics(self) -> list[Metric]:
        """All measurements."""
        equations = self.equations.metrics if self.equations is not None else []
        return [
            *equations,
            *self.report.metrics,
            *self.further,
        ]

    @property
    def findings(self) -> list[str]:
        """Faults that come before all measurements: figures that do not agree, equations that differ from the model's,
        and others.
        """
        return [
            *self.report.findings,
            *self.faults,
            *(self.equations.findings if self.equations is not None else []),
        ]

    @property
    def passed(self) -> bool:
        """Whether the validation passed, no additional measurement failed, and there are no findings."""
        return (
            self.report.passed
            and not self.findings
            and all(metric.verdict != "fail" for metric in self.metrics)
            and self.solution.status == "optimal"
        )

    @property
    def headline(self) -> str:
        """The verdict in one line; if the motion failed, with the joint and the term."""
        if self.solution.status != "optimal" and not self.findings:
            return f"the solve ended {self.solution.status}, not optimal"
        text = blame.headline(self.metrics, self.findings, self.equations is not None)
        if self.passed and self.report.unjudged:
            text += f"; not judged: {', '.join(self.report.unjudged)}"
        if not self.passed and not self.findings:
            setup = self.replays.setup
            touching = [touch.line for touch in self.replays.touching]
            why = [self.replays.explanation] if self.replays.explanation else []
            limits = [*self._drifts, *causes.beyond_limits(setup), *causes.clamped_controls(setup)]
            text = "; ".join([text, *why, *limits, *touching])
        return text

    @property
    def _drifts(self) -> list[str]:
        """The equalities that drift open, if one of them is broken."""
        broken = any(m.name.startswith("equality broken") and m.verdict == "fail" for m in self.metrics)
        return causes.drifts(self.replays.setup) if broken else []

    @property
    def next_steps(self) -> list[str]:
        """Advice on a motion that failed, one line for each kind of failure; empty if it passed."""
        if self.report.claims.findings:
            return ["solve it again: nothing else that this solution says can be relied on"]
        if self.passed or self.solution.status != "optimal" or self.faults or self.report.faults:
            return []
        setup, drifts = self.replays.setup, self._drifts
        steps = advice.next_steps(
            self.metrics,
            self.equations is not None,
            self.more_frames,
            [*causes.steps(setup, self.replays.touching), *contact_causes.causes(self.replays)],
            contact_causes.friction_steps(self.replays),
            contact_causes.contact_steps(self.replays),
            causes.swing_steps(setup),
            refused=bool(self.refused),
            clamped=bool(causes.clamped_controls(setup)),
            unjudged="inverse-dynamics residual" in self.report.unjudged,
            drift=causes.drift_step(setup, self.more_frames, drifts) if drifts else "",
            soft=contact_causes.soft_step(self.replays),
        )
        if advice.only_effects(self.metrics):
            steps = [*contact_causes.slip_steps(self.replays), *steps]
        if self.equations is None or not self.equations.steps:
            return steps
        plain = [step for step in steps if self.equations.plain or step != advice.EQUATIONS_STEP]
        return [*dict.fromkeys(self.equations.steps), *plain]

    @property
    def notes(self) -> list[str]:
        """Notes for the reader."""
        equations = self.equations.notes if self.equations is not None else []
        refused = [f"the equations of motion are not compared: {self.refused}"] if self.refused else []
        # What a motion that failed ran into, when it had gone astray.
        strays = [] if self.passed else [touch.line for touch in self.replays.strays]
        return list(dict.fromkeys([*self.report.notes, *refused, *equations, *strays]))

    def facts(self) -> list[tuple[str, str]]:
        """The origin of the numbers, as pairs of label and text."""
        from stc.version import __version__

        report, solution = self.report, self.solution
        made = solution.stc_version
        version = made if made == __version__ else f"{made} solved, {__version__} validated"
        facts = [
            ("spec", f"{report.spec}, sha256 {report.spec_sha256[:16]}"),
            ("motion", f"{report.method}, n = {report.n}, {report.duration:.4g} s"),
            (
                "solved",
                f"{solution.status}, {solution.iterations} iterations, objective {solution.objective:.9g}",
            ),
            ("stc", version),
            ("simulator", report.simulator),
            ("model", f"{report.model}, sha256 {report.model_sha256[:16]}"),
            ("integrator", f"{report.integrator}, {report.steps} steps of at most {report.time_step:.3g} s"),
        ]
        if solution.overrides:
            changed = ", ".join(f"{name} = {value:.9g}" for name, value in solution.overrides.items())
            facts.insert(1, ("changed constants", changed))
        if report.tracked_by:
            facts.append(("feedback", report.tracked_by))
        if report.claims.words:
            facts.append(("stated by the solution, not recomputed", report.claims.told))
        return facts

    def to_dict(self) -> dict[str, Any]:
        """The certificate for JSON: the keys of the report, with all metrics, the headline and the next steps."""
        found = self.report.to_dict()
        found["passed"] = self.passed
        found["headline"] = self.headline
        found["findings"] = self.findings
        found["next_steps"] = self.next_steps
        found["metrics"] = [metric.to_dict() for metric in self.metrics]
        found["notes"] = self.notes
        return found

    def write(self, path: str | os.PathLike[str], *, pictures: bool = True) -> Path:
        """Write the certificate as one HTML page that needs no other file.

        Parameters
        ----------
        path : str | os.PathLike[str]
            File of the page; missing folders are created.
        pictures : bool
            Whether to render the filmstrip and the video.

        Raises
        ------
        OSError
            The file cannot be written.
        """
        from stc.validate.certificate.page import page

        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        text = page(self, pictures=pictures)
        with replacing(target) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return target

    def summary(self) -> Iterator[Any]:
        """The verdict in about a dozen lines, for printing with rich."""
        from stc.validate.certificate.terminal import summary

        return summary(self)

    def _repr_html_(self) -> str:
        # By name: nothing here is imported from the layers above.
        return str(import_module("stc.notebooks").of_certificate(self))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Rich shows the table that the page shows, with the verdict below it."""
        from stc.validate.certificate.terminal import show

        return show(self)

    def __str__(self) -> str:
        """The table as plain text."""
        import io

        from rich.console import Console

        stream = io.StringIO()
        Console(file=stream, width=120, color_system=None, legacy_windows=False).print(self)
        return stream.getvalue()


def certify(
    solution: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    force: bool = False,
    time_step: float = limits.TIME_STEP,
    integrator: str = "rk4",
    statements: Sequence[StatementCheck] = (),
    equations: ComparedEquations | None = None,
    further: Sequence[Metric] = (),
) -> Certificate:
    """Validate a motion and return its certificate, without the spec.

    Args:
        solution: a solution, or the path of a saved one.
        model: a model file to use in place of the one that the spec names.
        force: whether to judge a solution that is not optimal.
        time_step: longest time step of the replay, in seconds.
        integrator: one of :data:`stc.validate.replay.INTEGRATORS`.
        statements: violations of the spec's statements between the nodes.
        equations: the comparison of the spec's equations of motion with the model's.
        further: additional measurements.

    Raises:
        NotOptimalError, ModelError, UsageError, SolutionError: as :func:`stc.validate.validate`.
    """
    report, replays = examine(
        solution, model, force=force, time_step=time_step, integrator=integrator, statements=statements
    )
    motion = replays.setup.solution
    return Certificate(motion, report, replays, equations, further, stale(motion))
