"""The observed order of convergence: solve with n, 2n and 4n frames, replay each, and compare the drifts.

A replay integrates the solved forces with a much smaller step than the transcription, so that its drift is the
transcription's own error (plus that of the equations, if they are wrong; then it does not decrease).  With half the
step, an error of order p is 2^p times smaller.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.errors import UnsolvedError, UsageError
from stc.pipeline import Model
from stc.problem import Problem
from stc.records import dataclass, field
from stc.solution import Solution
from stc.solving.same_motion import instead_of_sum
from stc.studies.frames import Spread, in_shares
from stc.validate import limits
from stc.validate.metrics import Metric
from stc.validate.replay import replay
from stc.validate.verdict import open_setup

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult


@dataclass(frozen=True, slots=True)
class Level:
    """One of the three solves.

    Attributes:
        n: number of steps.
        objective: of the solution.
        iterations: of the solver.
        drift: largest open-loop drift over the frames, all joints together, in m and rad.
        joints: the same for each joint.
    """

    n: int
    objective: float
    iterations: int
    drift: float
    joints: Mapping[str, float]


@dataclass(slots=True, kw_only=True)
class OrderReport:
    """The convergence of the replay.

    Attributes:
        spec: name of the spec.
        method: transcription.
        levels: coarsest first.
        metrics: the observed order with its limit, then those of the joints.
        notes: notes for the reader.
    """

    spec: str
    method: str
    levels: list[Level]
    metrics: list[Metric]
    notes: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether the order was observed and is high enough."""
        return all(metric.verdict != "fail" for metric in self.metrics)

    def to_dict(self) -> dict[str, Any]:
        """The report for JSON."""
        return {
            "passed": self.passed,
            "spec": self.spec,
            "method": self.method,
            "levels": [
                {
                    "n": level.n,
                    "objective": level.objective,
                    "iterations": level.iterations,
                    "drift": level.drift if math.isfinite(level.drift) else None,
                }
                for level in self.levels
            ],
            "metrics": [metric.to_dict() for metric in self.metrics],
            "notes": list(self.notes),
        }

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Rich shows the levels and the observed order."""
        from rich.table import Table
        from rich.text import Text

        table = Table(
            box=None,
            pad_edge=False,
            padding=(0, 3, 0, 0),
            header_style="bold",
        )
        yield Text(f"{self.spec}, {self.method}: convergence of the replay", style="bold")
        for heading in ("n", "objective", "iterations", "drift", "order"):
            table.add_column(heading, justify="right", overflow="fold")
        for k, level in enumerate(self.levels):
            coarse = self.levels[k - 1].drift
            seen = k > 0 and coarse > limits.ORDER_FLOOR
            order = f"{_order(coarse, level.drift):.2f}" if seen else ""
            table.add_row(
                str(level.n), f"{level.objective:.9g}", str(level.iterations), f"{level.drift:.3g}", order
            )
        yield table
        for metric in self.metrics:
            limit = "" if metric.limit is None else f" (at least {metric.limit:g}: {metric.verdict})"
            value = f"{metric.value:.2f}" if metric.value < math.inf else "too fine to be seen"
            yield Text(f"{metric.name}, {metric.subject}: {value}{limit}")
        for note in self.notes:
            yield Text(f"note: {note}", style="yellow")
        yield Text("passed" if self.passed else "failed", style="bold green" if self.passed else "bold red")


def observe_order(
    model: Model,
    method: str | None = None,
    solve: Callable[..., Solution] | None = None,
) -> OrderReport:
    """Solve with n, 2n and 4n frames in the same time, replay each, and compare the drifts.

    Args:
        model: the spec; its n is that of the coarsest solve.
        method: a transcription in place of the spec's own.
        solve: function to use in place of ``model.solve``, with the same arguments (to watch it), of a model with
            its frames as shares of n (:func:`stc.studies.frames.in_shares`).

    Raises:
        UsageError: the spec cannot be refined as it is written (the message says where), or it names no model.
        UnsolvedError: a solve does not end optimal.
    """
    if solve is None:
        model = in_shares(model, method)
    problem = model.problem(method)
    if problem.model is None:
        raise UsageError(f"{problem.name} names no model", "a `replay:` section ties a spec to its model")
    _require_integrals(problem)
    spread = Spread.of(model, method, {})
    settings = [{}, spread.multiplied(2), spread.multiplied(4)]
    solve = solve or model.solve
    levels: list[Level] = []
    solution: Solution | None = None
    for overrides in settings:
        solution = solve(
            method=method, tolerance=limits.ORDER_TOLERANCE, warm_start=solution, constants=overrides
        )
        if solution.status != "optimal":
            raise UnsolvedError(
                f"no order of convergence: with n = {solution.n} the solve ended {solution.status}",
                solution.message,
                solution.status,
            )
        levels.append(_level(solution))
    return _judged(problem, levels)


def _level(solution: Solution) -> Level:
    setup = open_setup(solution)
    # On the ground the solved forces act in place of MuJoCo's contacts: those would hide the order.
    motion = replay(setup, external=bool(len(setup.contact)))
    gaps = {}
    for tie in setup.ties:
        gaps[tie.name] = tie.distances(motion.positions)
    together = np.sqrt(sum(gap**2 for gap in gaps.values()))
    return Level(
        solution.n,
        solution.objective,
        solution.iterations,
        _largest(np.asarray(together)),
        {name: _largest(gap) for name, gap in gaps.items()},
    )


def _largest(gap: np.ndarray) -> float:
    return float(gap.max()) if np.all(np.isfinite(gap)) else math.inf


def _order(coarse: float, fine: float) -> float:
    """The order p for which halving the step takes one drift to the other."""
    if not (math.isfinite(coarse) and math.isfinite(fine)):
        return math.nan
    if fine == 0.0:
        return math.inf
    return math.log2(coarse / fine) if coarse > 0.0 else math.nan


def _judged(problem: Problem, levels: list[Level]) -> OrderReport:
    limit = limits.ORDER[problem.method]
    coarse, fine = levels[-2], levels[-1]
    report = OrderReport(spec=problem.name, method=problem.method, levels=levels, metrics=[])
    grids = f"n = {coarse.n} to {fine.n}"
    if coarse.drift <= limits.ORDER_FLOOR:
        report.notes.append(
            f"the drift is {coarse.drift:.1e} already with n = {coarse.n}: rounding hides its order"
        )
        report.metrics.append(Metric("order of convergence", grids, math.inf, "", limit, at_least=True))
        return report
    value = _order(coarse.drift, fine.drift)
    report.metrics.append(Metric("order of convergence", grids, value, "", limit, at_least=True))
    for name, drift in fine.joints.items():
        if coarse.joints[name] > limits.ORDER_FLOOR:
            value = _order(coarse.joints[name], drift)
            report.metrics.append(Metric("order of convergence", f"joint {name}", value, ""))
    return report


def _require_integrals(problem: Problem) -> None:
    """Refuse plain sums over frames, whose optimum is only a first-order approximation of the continuous one.

    Raises:
        UsageError: there is one.
    """
    for term in problem.objective:
        if not term.integral and term.range.first < term.range.last:
            raise UsageError(
                f"{term.span.location}: a plain sum over frames grows with n and converges only at first order",
                instead_of_sum(term),
            )


__all__ = ["Level", "OrderReport", "observe_order"]
