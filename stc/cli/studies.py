"""The options ``--equations`` and ``--order`` of ``stc validate``: compare equations, measure the order of
convergence.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from stc.bundled import is_solution
from stc.cli import console, record
from stc.cli.inputs import load
from stc.cli.live import Watch
from stc.cli.options import SolveOptions, existing_solution
from stc.cli.statuses import BAD, GOOD

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution
    from stc.studies.equation_report import EquationReport
    from stc.studies.order import OrderReport


def run(target: str, options: SolveOptions, *, equations: bool, order: bool, as_json: bool) -> int:
    """Carry out the requested studies and print them; nothing is saved.

    Raises:
        UsageError: the spec has no model, or cannot be refined as it is written.
    """
    model, method = subject(target, options)
    compared = compare_equations(model, method) if equations else None
    observed = observe_order(model, method, options) if order else None
    found = [report for report in (compared, observed) if report is not None]
    good = all(report.passed for report in found)
    if as_json:
        facts: dict[str, Any] = {**record.blank("ok"), "name": model.name}
        facts["equations"] = None if compared is None else compared.to_dict()
        facts["order"] = None if observed is None else observed.to_dict()
        record.write(facts)
    else:
        _show(found)
    return GOOD if good else BAD


def subject(target: str, options: SolveOptions) -> tuple[Model, str | None]:
    """The spec of the command, or that of a solution, and its method."""
    if not is_solution(target):
        return load(target, options.constants), options.method
    from stc.pipeline import Model
    from stc.solution import read
    from stc.solution_restated import source_of

    path = existing_solution(target)
    solution = read(path)
    model = Model(source_of(solution, beside=path.parent), {**solution.overrides, **options.constants})
    model.name = solution.name
    return model, options.method or solution.method


def compare_equations(model: Model, method: str | None) -> EquationReport:
    """The comparison of the spec's equations of motion with its model's."""
    from stc.studies.equations import check_equations

    problem = model.problem(method)
    console.warn(problem.warnings)
    return check_equations(problem)


def observe_order(model: Model, method: str | None, options: SolveOptions) -> OrderReport:
    """Three solves with a progress line, and the order of convergence of their replays."""
    from stc.studies.frames import in_shares
    from stc.studies.order import observe_order as observe

    model = in_shares(model, method)

    def solve(**settings: Any) -> Solution:
        with Watch(model.name) as watch, console.warnings_as_notes():
            return model.solve(
                callback=watch,
                max_iterations=options.max_iterations,
                time_limit=options.time_limit,
                **settings,
            )

    return observe(model, method, solve)


def _show(reports: list[EquationReport | OrderReport]) -> None:
    wide = None if sys.stdout.isatty() else console.WIDE
    for report in reports:
        console.rich_console(width=wide).print(report)
