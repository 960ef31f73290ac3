"""From a motion to its certificate: validation, the spec's statements between frames, its equations of motion.

The validation alone reads numbers.  Here the spec that made them is at hand as well, so that a motion which fails
can be told apart: by the term of the equations of motion that differs from the model's.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from stc.bundled import is_solution
from stc.errors import StcError
from stc.solution import Solution, read

if TYPE_CHECKING:
    from pathlib import Path

    from stc.studies.equation_report import EquationReport
    from stc.validate.certificate import Certificate
    from stc.validate.metrics import Metric


def certify(
    motion: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    force: bool = False,
    equations: bool | None = None,
    further: Sequence[Metric] = (),
) -> Certificate:
    """Validate a motion and keep everything that its certificate shows.

    Args:
        motion: a solution, the path of a saved one, or a spec (a path, a bundled name, its text) to solve first.
        model: another model file than the one that the spec names.
        force: judge a solution that is not optimal as well.
        equations: whether to compare the spec's equations of motion with the model's; None compares them where
            the motion fails, to name the joint and the term.
        further: other measurements to show, such as the observed order of convergence.

    Raises:
        NotOptimalError: the solution's status is not ``optimal`` and ``force`` is not given.
        ModelError: there is no model, or a replay line does not fit it.
        UsageError: a solution file that cannot be used.
        SolutionError: the solution file is damaged, or time does not increase along the solution.
        SpecError, EvaluationError: mistakes in a spec.
    """
    from stc.pipeline import statements_between
    from stc.validate.certificate import certify as validated

    motion = motion_of(motion)
    solution = motion if isinstance(motion, Solution) else read(motion)
    # The file and not the solution is handed on: the model may lie beside it.
    statements = statements_between(solution)
    certificate = validated(motion, model, force=force, statements=statements, further=further)
    if equations or (equations is None and not certificate.passed):
        compared, why = _equations(solution, certificate.replays.setup.path)
        certificate.equations = compared
        if why:
            certificate.report.notes = [*certificate.report.notes, why]
    if not certificate.passed:
        certificate.more_frames = _twice_the_frames(solution)
    return certificate


def motion_of(motion: Solution | str | os.PathLike[str]) -> Solution | str | os.PathLike[str]:
    """What is to be validated: a solution or its file as it is, and what solving it gives for a spec.

    Args:
        motion: a solution, the path of a saved one, or a spec: a path, a bundled name, the text itself.

    Raises:
        SpecError, EvaluationError, UsageError: as :meth:`stc.pipeline.Model.solve`, and where there is no such spec.
    """
    if not isinstance(motion, str | os.PathLike) or is_solution(motion):
        return motion
    from stc.pipeline import load

    return load(motion).solve()


def _equations(solution: Solution, model: Path) -> tuple[EquationReport | None, str]:
    """The spec's equations against the model's, or None and why they are not compared."""
    from stc.pipeline import problem_of
    from stc.studies.equations import check_equations

    try:
        return check_equations(problem_of(solution), str(model)), ""
    except StcError as error:
        return None, f"the equations of motion are not compared: {str(error).splitlines()[0]}"


def _twice_the_frames(solution: Solution) -> str:
    """The options that give a spec twice the frames, the same motion otherwise; "" where there are none.

    Where n follows from other constants (``n = 60*k``) these are what is given.
    """
    from stc.pipeline import model_of
    from stc.studies.frames import Spread

    try:
        spread = Spread.of(model_of(solution), solution.method, solution.overrides)
        return " ".join(f"--set {name}={value:.15g}" for name, value in spread.multiplied(2).items())
    except StcError:
        return ""
