"""The display of solutions, specs, reports and sweeps in a notebook, and their conversion to tables of other libraries.

The classes call these functions without importing this module first (``_repr_html_``, ``to_dataframe``, ``to_xarray``).
pandas and xarray are imported when they are needed.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from stc.errors import UsageError
from stc.solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stc.pipeline import Model
    from stc.sweeps import Sweep
    from stc.validate.certificate import Certificate
    from stc.validate.report import Report

__all__ = ["dataframe", "dataset", "of_certificate", "of_model", "of_report", "of_solution", "of_sweep"]

#: Rows of a sweep's table that are shown.
_ROWS = 30
#: Height in pixels of the frame that holds a certificate's page.
_HEIGHT = 640


def of_solution(solution: Solution) -> str:
    """A solution as HTML: how the solve ended, its parameters, and every variable over time."""
    facts = [
        ("status", solution.status),
        ("objective", f"{solution.objective:.9g}"),
        ("violation", f"{solution.violation:.2e}"),
        ("iterations", str(solution.iterations)),
        ("motion", f"{solution.method}, n = {solution.n}, {solution.duration:.4g} s"),
        *((name, f"{value:.9g}") for name, value in solution.overrides.items()),
        *((name, f"{value:.9g}") for name, value in solution.parameters.items()),
    ]
    if solution.status != "optimal":
        facts.insert(1, ("message", solution.message))
    parts = [f"<b>{escape(solution.name)}</b>", _table((), facts)]
    if solution.n:
        from stc.validate.pictures.variables import figure

        parts.append(_svg(lambda: figure(solution)))
    return _shown(parts)


def of_model(model: Model) -> str:
    """A spec as HTML: its name, the constants that were given, and its text."""
    given = [(name, f"{value:.9g}") for name, value in model.overrides.items()]
    return _shown([f"<b>{escape(model.name)}</b>", _table((), given), f"<pre>{escape(model.text)}</pre>"])


def of_report(report: Report) -> str:
    """A report of the validation as HTML: the verdict, and every measurement with its limit."""
    rows = [
        (
            metric.name,
            metric.subject,
            f"{metric.value:.3g} {metric.unit}".strip(),
            "" if metric.limit is None else f"{metric.limit:.3g} {metric.unit}".strip(),
            metric.verdict,
        )
        for metric in report.metrics
    ]
    verdict = "passed" if report.passed else "failed"
    title = f"<b>{escape(report.spec)}: {verdict}</b>, replayed in {escape(report.simulator)}"
    lines = [f"<div>{escape(line)}</div>" for line in [*report.findings, *report.notes]]
    return _shown([title, *lines, _table(("metric", "of", "value", "limit", "verdict"), rows)])


def of_certificate(certificate: Certificate) -> str:
    """A certificate as HTML: its page, with film, table and plots, in a frame."""
    from stc.validate.certificate.page import page

    return (
        f'<iframe sandbox="allow-scripts" width="100%" height="{_HEIGHT}" style="border:1px solid #ccc" '
        f'srcdoc="{escape(page(certificate), quote=True)}"></iframe>'
    )


def of_sweep(sweep: Sweep) -> str:
    """A sweep as HTML: the number of finished points, the first rows of its table, and the objective drawn."""
    from stc.sweeps.picture import draw

    columns = sweep.columns()
    rows = [tuple(_cell(value) for value in row) for row in list(zip(*columns.values()))[:_ROWS]]
    more = len(sweep.facts) - len(rows)
    parts = [
        f"<b>{len(sweep.facts)} of {len(sweep.grid)} points</b> in {escape(str(sweep.folder))}",
        _table(tuple(columns), rows),
        f"<div>and {more} more rows</div>" if more > 0 else "",
        _svg(lambda: draw(sweep)),
    ]
    return _shown(parts)


def dataframe(solution: Solution, times: npt.ArrayLike | None = None) -> Any:
    """See :meth:`stc.solution.Solution.to_dataframe`."""
    pandas = _library("pandas")
    time, columns = _columns(solution, times)
    found = pandas.DataFrame(columns, index=pandas.Index(time, name="time"))
    found.attrs.update(_about(solution), parameters=dict(solution.parameters))
    return found


def dataset(solution: Solution, times: npt.ArrayLike | None = None) -> Any:
    """See :meth:`stc.solution.Solution.to_xarray`."""
    xarray = _library("xarray")
    time, columns = _columns(solution, times)
    known = {name: ("time", values) for name, values in columns.items()}
    coordinate = ("time", time, {"units": "s"})
    return xarray.Dataset(
        {**known, **solution.parameters}, coords={"time": coordinate}, attrs=_about(solution)
    )


def _columns(solution: Solution, times: npt.ArrayLike | None) -> tuple[Any, dict[str, Any]]:
    """The times, and each variable's and derivative's values there, by name."""
    names = [name for name in solution.names if name not in solution.parameters]
    if times is None:
        return solution.time, {name: solution[name] for name in names}
    given = np.atleast_1d(np.asarray(times))
    at = solution.at(given)  # which refuses what is no time of the motion
    return given.astype(np.float64), {name: at[name] for name in names}


def _about(solution: Solution) -> dict[str, Any]:
    """The facts about a motion that go with its table: spec, status and objective."""
    return {
        "spec": solution.name,
        "sha256": solution.sha256,
        "status": solution.status,
        "objective": solution.objective,
        "method": solution.method,
        "stc_version": solution.stc_version,
    }


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise UsageError(f"this table needs {name}, which is not installed: `pip install {name}`") from None


def _shown(parts: Iterable[str]) -> str:
    return f"<div>{''.join(parts)}</div>"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(map(_data, row)) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _data(cell: str) -> str:
    return f"<td style='text-align:left'>{escape(cell)}</td>"


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _svg(draw: Callable[[], Figure]) -> str:
    """A figure as an image inside the page: its names cannot clash with those of other figures."""
    stream = io.BytesIO()
    draw().savefig(stream, format="svg")
    content = base64.b64encode(stream.getvalue()).decode("ascii")
    return f"<img src='data:image/svg+xml;base64,{content}'>"
