"""The plot of a sweep: the objective over the constant with the most values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stc.atomic import replacing
from stc.sweeps.folder import Sweep, is_good

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw", "save_picture"]

#: Size in inches and resolution in dots per inch.
_SIZE, _DPI = (6.4, 4.0), 150
_GOOD, _BAD = "#0072b2", "#d55e00"


def draw(sweep: Sweep) -> Figure:
    """A figure with a line for each combination of the other constants, coloured by the constant with the second most
    values.

    Points without an optimum, or that failed in the replay, are crossed out; points without an objective are left out.
    """
    from matplotlib.figure import Figure

    axes = sorted(sweep.grid.axes, key=lambda name: -len(sweep.grid.axes[name]))
    along, colouring = axes[0], next((name for name in axes[1:] if len(sweep.grid.axes[name]) > 1), None)
    figure = Figure(figsize=_SIZE, layout="constrained")
    plot = figure.add_subplot()
    colour = _colours(figure, plot, sweep, colouring)
    lines: dict[tuple[float, ...], list[tuple[float, float]]] = {}
    bad = []
    for index in sorted(sweep.facts):
        at, facts = sweep.grid.constants(index), sweep.facts[index]
        if facts["objective"] is None:
            continue
        where = at[along], facts["objective"]
        lines.setdefault(tuple(value for name, value in at.items() if name != along), []).append(where)
        if not is_good(facts):
            bad.append(where)
    others = [name for name in sweep.grid.axes if name != along]
    for values, points in lines.items():
        shade = _GOOD if colouring is None else colour(dict(zip(others, values))[colouring])
        plot.plot(*zip(*sorted(points)), "o-", color=shade, linewidth=1.0, markersize=3.0)
    if bad:
        plot.plot(*zip(*bad), "x", color=_BAD, markersize=8.0, label="no optimum, or failed in the replay")
        plot.legend()
    plot.set_xlabel(along)
    plot.set_ylabel("objective")
    plot.grid(alpha=0.3)
    return figure


def _colours(figure: Figure, plot: Any, sweep: Sweep, name: str | None) -> Any:
    """The colour of each value of a constant, and the scale drawn beside the plot."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    if name is None:
        return None
    values = np.array(sweep.grid.axes[name])
    scale = ScalarMappable(Normalize(values.min(), values.max()), colormaps["viridis"])
    figure.colorbar(scale, ax=plot, label=name)
    return scale.to_rgba


def save_picture(sweep: Sweep) -> None:
    """Draw the sweep into ``plot.png`` in its folder."""
    with replacing(sweep.folder / "plot.png") as temporary:
        draw(sweep).savefig(temporary, dpi=_DPI)
