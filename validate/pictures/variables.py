"""A plot of a motion without a model: every variable over time, as it was solved."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from stc.errors import UsageError
from stc.solution import Solution
from stc.validate.certificate.plots import style
from stc.validate.metrics import FloatArray
from stc.validate.pictures.plot import grid_of_plots, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A curve has about so many points at most, and a step so many.
_POINTS, _INSIDE = 2000, 8

_COLOUR = "#1f2937"


def save_variables(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Draw every variable of a motion over time into a file.

    Args:
        solution: the motion, with or without a model.
        path: the file; its suffix is one of :data:`stc.validate.pictures.plot.PLOTS`.

    Raises:
        UsageError: another ending, or a motion of a single instant.
        SolutionError: time does not increase along the solution.
        OSError: the file cannot be written.
    """
    save_figure(lambda: figure(solution), path)


def figure(solution: Solution) -> Figure:
    """The plots of all variables as one Matplotlib figure; errors as of :func:`save_variables`."""
    if solution.n == 0:
        raise UsageError(
            f"{solution.name} has a single instant: there is nothing to draw over time",
            "`stc export FILE.npz --format csv` writes its values",
        )
    time, curves = sampled(solution)
    made, axes = grid_of_plots(len(curves), solution)
    for one, (name, values) in zip(axes, curves.items()):
        one.plot(time, values, color=_COLOUR, linewidth=1.7)
        one.set_title(name, loc="left", fontsize=9, fontweight="bold")
        one.set_xlabel("s")
        style(one)
    return made


def sampled(solution: Solution) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Times (k,) in seconds and each variable's values (k,) there, in its own unit.

    A frame has two points, its value before and after, so that a jump is drawn vertically.
    """
    solution.require_increasing_times()
    n = solution.n
    inside = max(1, min(_INSIDE, _POINTS // n))
    shares = np.arange(inside) / inside
    starts = (np.arange(n)[:, None] + shares).ravel()
    after = solution.at_frame(starts, "after")
    before = solution.at_frame(np.arange(1, n + 1), "before")
    time = np.insert(np.interp(starts, np.arange(n + 1), solution.time), _ends(n, inside), solution.time[1:])
    names = [name for name, order in solution.trajectories if order == 0]
    return time, {name: np.insert(after[name], _ends(n, inside), before[name]) for name in names}


def _ends(n: int, inside: int) -> np.ndarray:
    """The index of each step's right end among the points of all steps."""
    return inside * np.arange(1, n + 1)
