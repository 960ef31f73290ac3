"""Comparison of a spec's equations of motion with its model's, at states along a motion."""

from __future__ import annotations

from dataclasses import replace

from stc.errors import StcError
from stc.solution import Solution
from stc.solution_restated import problem_of
from stc.studies.equation_report import EquationReport
from stc.studies.equations import check_equations


def equations_along(motion: Solution, model: str) -> EquationReport:
    """Compare equations of motion at positions and velocities from the ranges of a motion.

    Equations that hold only there (a body that stays flat, a spring that is never slack) are accepted.  Differences are
    reported with the values, and in the order, of a comparison at states from everywhere, which shows causes best.

    Args:
        motion: the solution.
        model: path of the model.

    Raises:
        UsageError, ModelError: as :func:`stc.studies.equations.check_equations`.
    """
    problem = problem_of(motion)
    near = check_equations(problem, model, motion=motion)
    if not near.findings:
        return near
    try:
        everywhere = check_equations(problem, model).findings
    except StcError:  # no value at some states
        return near
    differs = [_what(finding) for finding in near.findings]
    known = [finding for finding in everywhere if _what(finding) in differs]
    named = [_what(finding) for finding in known]
    rest = [finding for finding in near.findings if _what(finding) not in named]
    return replace(near, findings=known + rest)


def _what(finding: str) -> str:
    """A finding without its numbers."""
    return finding.partition(": spec ")[0]
