"""Plots of a motion over time: joints, outputs, controls and outer forces, solved against replayed, and paths.

Plots are drawn by Matplotlib, which is a required dependency, so that plotting always works.  It is imported only when
something is drawn.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.atomic import replacing
from stc.errors import UsageError
from stc.solution import Solution
from stc.validate import limits
from stc.validate.certificate.curves import Panel, panels
from stc.validate.certificate.plots import DASHES, WIDTHS, draw_lines, style
from stc.validate.metrics import FloatArray
from stc.validate.pictures.motion import paths
from stc.validate.verdict import Replays

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Kinds of file.
PLOTS = (".png", ".svg", ".pdf")

#: Of what is replayed, by kind; then of controls and of the parts of a force, which have no replay.
#: The hues are Okabe and Ito's, which everyone can tell apart.
_COLOURS = {"solved": "#9aa7b8", "replayed": "#d55e00", "tracked": "#0072b2"}
_ALONE = "#1f2937"
_PARTS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")

#: Size of one plot in inches, and the resolution of a PNG in dots per inch.
_PLOT, _DPI = (4.2, 2.5), 150

_TITLES = {
    "joint": "joint",
    "output": "",
    "actuator": "actuator",
    "apply": "force on",
    "contact": "contact on",
}


def save_plot(replays: Replays, path: str | os.PathLike[str]) -> None:
    """Draw everything about a motion into a file.

    Args:
        replays: the motion and its simulations.
        path: the file; its suffix is one of :data:`PLOTS`.

    Raises:
        UsageError: another ending.
        OSError: the file cannot be written.
    """
    save_figure(lambda: figure(replays), path)


def save_figure(draw: Callable[[], Figure], path: str | os.PathLike[str]) -> None:
    """Draw a figure in the style of all plots into a file; errors as of :func:`save_plot`."""
    target = Path(path)
    if target.suffix.lower() not in PLOTS:
        raise UsageError(f"cannot draw {target.name!r}: a plot is saved as {', '.join(PLOTS)}")
    import matplotlib

    with matplotlib.rc_context({"svg.hashsalt": "stc", "svg.fonttype": "none", "font.size": 9}):
        metadata = {"Date": None} if target.suffix.lower() == ".svg" else None
        drawn = draw()
        with replacing(target) as temporary:
            drawn.savefig(temporary, dpi=_DPI, metadata=metadata)


def figure(replays: Replays) -> Figure:
    """All plots of a motion as one Matplotlib figure."""
    found = panels(replays)
    ways = _paths(replays)
    made, axes = grid_of_plots(len(found) + bool(ways), replays.setup.solution)
    for one, panel in zip(axes, found):
        _draw(one, panel, replays)
    if ways:
        _draw_paths(axes[len(found)], ways)
    _legend(made, found, replays)
    return made


def grid_of_plots(count: int, solution: Solution) -> tuple[Figure, Sequence[Axes]]:
    """A figure with the motion's name above it, and the given number of axes."""
    from matplotlib.figure import Figure

    columns = 2 if count in (2, 4) else min(3, max(1, count))
    rows = -(-count // columns)
    made = Figure(figsize=(columns * _PLOT[0], rows * _PLOT[1] + 0.75), layout="constrained")
    axes = list(np.atleast_1d(made.subplots(rows, columns, squeeze=False)).ravel())
    for one in axes[count:]:
        one.set_visible(False)
    made.suptitle(
        f"{solution.name}: {solution.method}, n = {solution.n}, {solution.duration:.4g} s", fontweight="bold"
    )
    return made, axes


def _legend(made: Figure, found: Sequence[Panel], replays: Replays) -> None:
    """The legend of the lines, once for all plots."""
    from matplotlib.lines import Line2D

    kinds = [kind for kind in _COLOURS if any(line.kind == kind for panel in found for line in panel.lines)]
    words = {
        "solved": "solved",
        "replayed": "replayed by MuJoCo, forces alone",
        "tracked": f"replayed with feedback ({replays.tracked_by})",
    }
    handles = [
        Line2D(
            [], [], color=_COLOURS[kind], linestyle=DASHES[kind], linewidth=WIDTHS[kind], label=words[kind]
        )
        for kind in kinds
    ]
    made.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)


def _draw(axes: Axes, panel: Panel, replays: Replays) -> None:
    parts = len(panel.lines) > 1 and all(line.kind == "solved" for line in panel.lines)
    draw_lines(axes, panel.lines, _COLOURS, _PARTS if parts else (_ALONE,))
    if parts:
        axes.legend(frameon=False, fontsize=8, ncols=3)
    title = f"{_TITLES.get(panel.group, panel.group)} {panel.name}".strip()
    gaps = [np.abs(line.value[np.isfinite(line.value)]).max(initial=0.0) for line in panel.differences[:1]]
    axes.set_title(title, loc="left", fontsize=9, fontweight="bold")
    if gaps:
        axes.set_title(
            f"drift {gaps[0]:.1e} {panel.unit}", loc="right", fontsize=8, color=_drift(gaps[0], replays)
        )
    axes.set_ylabel(panel.unit)
    axes.set_xlabel("s")
    style(axes)


def _drift(gap: float, replays: Replays) -> str:
    """The colour of a drift: that of plain text within its limit, otherwise that of the replay's line."""
    method = replays.setup.solution.method
    return "#4b5563" if gap <= limits.OPEN_LOOP_DRIFT[method] else _COLOURS["replayed"]


def _paths(replays: Replays) -> list[tuple[str, FloatArray]]:
    """The paths of end points: kind and (k, 3) points, solved and replayed."""
    setup = replays.setup
    if setup.solution.n == 0:
        return []
    found = [("solved", points) for points in paths(setup)]
    found += [("replayed", points) for points in paths(setup, replays.open_loop)]
    if replays.tracked is not None:
        found += [("tracked", points) for points in paths(setup, replays.tracked)]
    moved = [points for kind, points in found if kind == "solved" and np.ptp(points, axis=0).max() > 1e-6]
    return found if moved else []


def _draw_paths(axes: Axes, ways: Sequence[tuple[str, FloatArray]]) -> None:
    """Draw paths in the plane in which they are largest."""
    solved = np.concatenate([points for kind, points in ways if kind == "solved"])
    spread = np.ptp(solved, axis=0)
    first, second = sorted(np.argsort(-spread)[:2].tolist()) if spread.min() < spread.max() else (0, 2)
    low, high = solved.min(axis=0), solved.max(axis=0)
    room = float(spread.max())
    for kind, points in ways:
        inside = ((points > low - room) & (points < high + room)).all(axis=1)
        shown = np.where(inside[:, None], points, np.nan)
        axes.plot(
            shown[:, first],
            shown[:, second],
            color=_COLOURS[kind],
            linestyle=DASHES[kind],
            linewidth=WIDTHS[kind],
        )
        if kind == "solved":
            start, end = points[0, [first, second]], points[-1, [first, second]]
            axes.plot(*start, "o", color=_ALONE, markersize=6, markerfacecolor="white", zorder=5)
            axes.plot(*end, "o", color=_ALONE, markersize=6, zorder=5)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(
        "path, from \N{WHITE CIRCLE} to \N{BLACK CIRCLE}", loc="left", fontsize=9, fontweight="bold"
    )
    axes.set_xlabel(f"{'xyz'[first]}, m")
    axes.set_ylabel(f"{'xyz'[second]}, m")
    style(axes)
