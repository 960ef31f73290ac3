"""From a motion to its certificate: validation, statements between the frames, and equations of motion.

:func:`stc.validate.validate` knows only the numbers of a solution.  This module also has the spec, and can therefore
name the term of the equations of motion that differs from the model's when a motion fails.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from stc.bundled import is_solution
from stc.errors import StcError, UsageError
from stc.solution import Solution, read

if TYPE_CHECKING:
    from pathlib import Path

    from stc.pipeline import Model
    from stc.studies.equation_report import EquationReport
    from stc.validate.certificate import Certificate
    from stc.validate.certificate.listing import Statement
    from stc.validate.metrics import Metric


def certify(
    motion: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    force: bool = False,
    equations: bool | None = None,
    further: Sequence[Metric] = (),
) -> Certificate:
    """Validate a motion and return its certificate.

    Parameters
    ----------
    motion : Solution | str | os.PathLike[str]
        A solution, the path of a saved one, or a spec (a path, a bundled name, its text) to solve first.
    model : str | os.PathLike[str] | None
        A model file to use in place of the one that the spec names.
    force : bool
        Whether to judge a solution that is not optimal.
    equations : bool | None
        Whether to compare the spec's equations of motion with the model's; None compares them, to name the joint and
        the term, if the motion fails and the solved forces do not give its accelerations, or if a motor never pulls.
    further : Sequence[Metric]
        Additional measurements for the certificate, such as the observed order of convergence.

    Returns
    -------
    Certificate
        The certificate, with its verdict, measurements and advice.

    Raises
    ------
    NotOptimalError
        The solution's status is not ``optimal`` and ``force`` is not given.
    ModelError
        There is no model, or a replay line does not fit it.
    UsageError
        A solution file that cannot be used.
    SolutionError
        The solution file is damaged, or time does not increase along the solution.
    SpecError, EvaluationError
        Mistakes in a spec.
    """
    from stc.statements_between import statements_between
    from stc.validate.certificate import certify as validated

    motion = motion_of(motion)
    solution = motion if isinstance(motion, Solution) else read(motion)
    # The file and not the solution is handed on: the model may lie beside it.
    statements = statements_between(solution)
    certificate = validated(motion, model, force=force, statements=statements, further=further)
    if equations or (equations is None and not _tells_of_equations(certificate)):
        compared, why = _equations(solution, certificate.replays.setup.path)
        certificate.equations = compared
        certificate.refused = why
    certificate.statements = statements_of(solution)
    if not certificate.passed:
        certificate.more_frames = _more_frames(solution, certificate.metrics)
    return certificate


def statements_of(solution: Solution) -> list[Statement]:
    """The statements that the text of a spec contains, without those that a model or a contact adds; none if the text
    cannot be parsed.
    """
    from stc.language.syntax import Node, statement_text
    from stc.problem import ParameterRef, VariableRef
    from stc.solution_restated import problem_of
    from stc.symbolic.expr import symbols
    from stc.validate.certificate.listing import Statement

    try:
        problem = problem_of(solution)
    except StcError:
        return []
    found: dict[Statement, None] = {}
    for one in problem.relations:
        span = one.span
        written = one.coordinate or statement_text(span.source, Node(span.start, span.end)) == one.text
        if written and not (one.coordinate and problem.of_model):
            names = [str(key) for key in symbols(one.body) if isinstance(key, VariableRef | ParameterRef)]
            frames = one.range.first, one.range.last
            found[Statement(span.line, one.text, frames, frozenset(names), one.is_equality)] = None
    return list(found)


def _tells_of_equations(certificate: Certificate) -> bool:
    """Whether the motion shows that the spec's equations of motion are the model's, or failed for another reason.

    It says nothing of the force of a motor that never pulls, such as one that the equations leave out.
    """
    from stc.validate.limits import INVERSE_DYNAMICS

    names = ("inverse-dynamics residual", "residual between frames")
    obeys = {m.verdict for m in certificate.metrics if m.name in names} == {"pass"}
    most = [float(abs(channel.before).max()) for channel in certificate.replays.setup.controls.channels]
    idle = min(most, default=1.0) <= INVERSE_DYNAMICS * max(most, default=0.0)
    return (certificate.passed or obeys) and not idle


def motion_of(motion: Solution | str | os.PathLike[str]) -> Solution | str | os.PathLike[str]:
    """The solution to validate: a given solution or file, or the result of solving a spec.

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
    """The comparison of the spec's equations with the model's; or None and the reason why they are not compared."""
    from stc.studies.along import equations_along

    try:
        return equations_along(solution, str(model)), ""
    except StcError as error:
        return None, str(error).splitlines()[0]
    except Exception as error:  # a mistake of stc's: the verdict does not depend on this step
        if os.environ.get("STC_DEBUG"):
            raise
        what = f"{type(error).__name__}: {error}".strip().splitlines()[0]
        return None, (
            f"stc itself failed there ({what}). Please report it with the spec and the command; "
            "with STC_DEBUG=1 it shows where"
        )


def _more_frames(solution: Solution, metrics: Sequence[Metric]) -> str:
    """Advice on how to get more frames: the options for a sufficient number, and the search that finds it.

    The number is estimated from the method's order.  If ``n`` follows from other constants (``n = 60*k``), the advice
    names these.  If the spec cannot be refined as it is written, the advice is the reason.
    """
    from stc.solution_origin import model_of
    from stc.studies.frames import Spread, in_shares
    from stc.studies.passing import frames_needed

    try:
        model = model_of(solution)
        scaled = in_shares(model, solution.method, **solution.overrides)
        spread = Spread.of(scaled, solution.method, solution.overrides)
        finer = spread.multiplied(frames_needed(solution.method, metrics))
        more = " ".join(f"--set {name}={value:.15g}" for name, value in finer.items())
    except UsageError as reason:
        hint = f" ({reason.hint})" if reason.hint else ""
        return f"the spec has to be changed for that, since {reason.message}{hint}"
    except StcError:
        return ""
    search = f"{_until_passed(solution, model)}, which adds them until the motion passes"
    if scaled is model:
        return f"{more}, or {search}"
    return f"{search} (as n alone would not, since frames of the spec are plain numbers)"


def _until_passed(solution: Solution, model: Model) -> str:
    """The command that solves a spec until it passes, or the function call if the spec is not a file."""
    from shlex import quote

    spec = _spec_name(solution)
    if not spec:
        return "`solve_until_passed(model)`"
    given = [f"--set {name}={value:.15g}" for name, value in solution.overrides.items()]
    if model.problem(None, **solution.overrides).method != solution.method:
        given.append(f"--method {solution.method}")
    return f"`{' '.join(['stc run', quote(spec), *given])} --until-passed`"


def _spec_name(solution: Solution) -> str:
    """The name of a spec on the command line: a bundled name or a short path; "" for a spec given as text."""
    from pathlib import Path

    from stc.bundled import SUFFIX, find_spec

    if not solution.directory:
        return ""
    file = Path(solution.directory) / f"{solution.name}{SUFFIX}"
    if not file.is_file():
        return ""
    try:
        if find_spec(solution.name).samefile(file):
            return solution.name
    except (StcError, OSError):
        pass
    return str(file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file)
