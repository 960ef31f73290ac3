"""Assertions for the tests of specs: a spec solves, its equations are the model's, its motion is physical.

    from stc.testing import assert_equations, assert_physical, assert_solves

    def test_reach() -> None:
        assert_equations("reach.stc")
        assert_physical(assert_solves("reach.stc"))

They work under any test runner.  Under pytest the plugin :mod:`stc.pytest_plugin` adds fixtures and an option that
saves the certificates.  The message of a failure is that of the certificate: its first line names the joint and the
term, the measurements follow.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from stc.errors import StcError, UsageError

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution
    from stc.studies.equation_report import EquationReport
    from stc.validate.certificate import Certificate
    from stc.validate.metrics import Metric

#: Limits by the beginnings of metrics' names; None only reports.
Limits = Mapping[str, float | None]

_report_folder: Path | None = None


def keep_certificates(folder: str | os.PathLike[str] | None) -> None:
    """Let :func:`assert_physical` write the page of every motion into a folder; None stops this."""
    global _report_folder
    _report_folder = None if folder is None else Path(folder)


def assert_solves(
    spec: str | os.PathLike[str] | Model,
    *,
    status: str = "optimal",
    method: str | None = None,
    **constants: float,
) -> Solution:
    """Solve a spec, and fail unless the solve ends with the given status.

    Parameters
    ----------
    spec : str | os.PathLike[str] | Model
        A path, a bundled name, the text itself, or a loaded model.
    status : str
        The required status.
    method : str | None
        A transcription in place of the spec's own.
    **constants : float
        Values of constants.

    Returns
    -------
    Solution
        The solution.

    Raises
    ------
    AssertionError
        Another status, or mistakes in the spec, which the message lists.
    """
    __tracebackhide__ = True
    try:
        solution = _model(spec).solve(method=method, constants=constants)
    except StcError as error:
        raise AssertionError(str(error)) from None
    if solution.status != status:
        lines = [
            f"{solution.name}: the solve ended {solution.status}, not {status}",
            solution.message,
            f"  objective    {solution.objective:.10g}",
            f"  violation    {solution.violation:.2e}",
            f"  optimality   {solution.optimality:.2e}",
            f"  iterations   {solution.iterations}",
        ]
        raise AssertionError("\n".join(line for line in lines if line))
    return solution


def assert_physical(
    motion: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    limits: Limits | None = None,
) -> Certificate:
    """Validate a motion in MuJoCo, and fail unless every measurement is within its limit.

    Parameters
    ----------
    motion : Solution | str | os.PathLike[str]
        A solution, the path of a saved one, or a spec (a path, a bundled name, its text) to solve first.
    model : str | os.PathLike[str] | None
        A model file to use in place of the one that the spec names.
    limits : Limits | None
        Replacements of limits, by the beginning of the metrics' names: ``{"open-loop drift": 1e-3}``.  None as
        a limit reports without judging.

    Returns
    -------
    Certificate
        The certificate.

    Raises
    ------
    AssertionError
        The motion fails; the first line of the message names joint and term.
    UsageError
        A limit for something that was not measured.
    """
    __tracebackhide__ = True
    from stc.certification import certify, motion_of

    try:
        motion = motion_of(motion)
        certificate = certify(motion, model, equations=None if limits is None else False)
    except StcError as error:
        raise AssertionError(str(error)) from None
    if limits is not None:
        _relimit(certificate, limits)
        if not certificate.passed:
            # Where the motion fails by these limits too, the equations tell why.
            certificate = certify(motion, model, equations=True)
            _relimit(certificate, limits)
    _keep(certificate)
    if not certificate.passed:
        raise AssertionError(f"{certificate.headline}\n\n{certificate}")
    return certificate


def assert_equations(
    spec: str | os.PathLike[str] | Model,
    model: str | os.PathLike[str] | None = None,
    *,
    method: str | None = None,
    states: int | None = None,
    **constants: float,
) -> EquationReport:
    """Compare a spec's equations of motion with its model's at random states, and fail if they differ.

    Parameters
    ----------
    spec : str | os.PathLike[str] | Model
        A path, a bundled name, the text itself, or a loaded model.
    model : str | os.PathLike[str] | None
        A model file to use in place of the one that the spec names.
    method : str | None
        A transcription in place of the spec's own.
    states : int | None
        Number of random states, by default :data:`stc.validate.limits.EQUATION_STATES`.
    **constants : float
        Values of constants.

    Returns
    -------
    EquationReport
        The comparison.

    Raises
    ------
    AssertionError
        A difference, with joint and term in the first line of the message, or mistakes in the spec.
    """
    __tracebackhide__ = True
    from stc.studies.equations import check_equations
    from stc.validate import limits

    name = None if model is None else os.fspath(model)
    try:
        report = check_equations(
            _model(spec).problem(method, **constants), name, states=states or limits.EQUATION_STATES
        )
    except StcError as error:
        raise AssertionError(str(error)) from None
    if not report.passed:
        raise AssertionError(_told(report))
    return report


def _model(spec: str | os.PathLike[str] | Model) -> Model:
    from stc.pipeline import Model, load

    return spec if isinstance(spec, Model) else load(spec)


def _told(report: EquationReport) -> str:
    """The comparison as text, with the first finding in the first line."""
    from stc.validate.certificate.table import quantity

    failed = [metric for metric in report.metrics if metric.verdict == "fail"]
    first = report.findings or [f"{m.subject}: {m.name} {quantity(m, m.value)}" for m in failed[:1]]
    lines = [*(first[:1] or [f"{report.spec}: no measurement was compared with {report.model}"]), ""]
    lines += [f"  {finding}" for finding in report.findings[1:]]
    lines += [
        f"  {m.subject}: {m.name} {quantity(m, m.value)}, limit {quantity(m, m.limit)}: {m.verdict}"
        for m in report.metrics
    ]
    return "\n".join([*lines, *(f"  note: {note}" for note in report.notes)])


def _relimit(certificate: Certificate, limits: Limits) -> None:
    """Replace limits of a certificate by others."""
    unused = set(limits)
    for name, limit in limits.items():
        if limit is not None and limit != limit:
            raise UsageError(f"the limit of `{name}` is not a number", "use None for no limit")

    def changed(metric: Metric) -> Metric:
        for beginning, limit in limits.items():
            if metric.name.startswith(beginning):
                unused.discard(beginning)
                return replace(metric, limit=limit)
        return metric

    certificate.report.metrics = [changed(metric) for metric in certificate.report.metrics]
    if unused:
        from difflib import get_close_matches

        names = list(dict.fromkeys(metric.name for metric in certificate.report.metrics))
        wrong = sorted(unused)[0]
        near = get_close_matches(wrong, names, n=1, cutoff=0.4)
        hint = f"did you mean `{near[0]}`?" if near else f"measured were: {', '.join(names)}"
        raise UsageError(f"no measurement's name begins with `{wrong}`", hint)


def _keep(certificate: Certificate) -> None:
    """Write the page if pages are kept; one file per motion and test, also for tests in other processes."""
    if _report_folder is None:
        return
    _report_folder.mkdir(parents=True, exist_ok=True)
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0].rpartition("::")[2]
    name = re.sub(
        r"[^\w.-]+", "_", f"{test}-{certificate.solution.name}" if test else certificate.solution.name
    )
    for number in count(1):
        path = _report_folder / (f"{name}-{number}.html" if number > 1 else f"{name}.html")
        try:
            path.touch(exist_ok=False)
        except FileExistsError:
            continue
        certificate.write(path)
        return
