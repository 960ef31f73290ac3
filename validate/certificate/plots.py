"""Plots as SVG for a page, drawn by Matplotlib and coloured by the page's style.

Matplotlib writes colours into its files.  The plots are drawn with placeholder colours, which are replaced by the
page's variables, so that one plot serves light and dark mode.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.records import dataclass
from stc.validate.certificate.curves import Line, Panel
from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Stand-in colours and the page's variables for them.
_INK, _GRID = "#000001", "#000002"
_LINES = {"solved": "#000011", "replayed": "#000012", "tracked": "#000013", "cone": "#000003"}
_PARTS = ("#000019", "#000014", "#000015", "#000016", "#000017", "#000018")
_VARIABLES = {
    _INK: "--ink",
    _GRID: "--grid",
    "#000003": "--quiet",
    "#000011": "--solved",
    "#000012": "--replayed",
    "#000013": "--tracked",
    "#000014": "--part1",
    "#000015": "--part2",
    "#000016": "--part3",
    "#000017": "--part4",
    "#000018": "--part5",
    "#000019": "--alone",
}

#: Of each kind of line.  The solved one is broad, for the others to lie on.
DASHES: dict[str, Any] = {"solved": "-", "replayed": (0, (5, 2)), "tracked": (0, (1, 1.3)), "cone": "-"}
WIDTHS = {"solved": 4.0, "replayed": 1.4, "tracked": 1.4, "cone": 0.8}

#: Width of a plot and heights with and without a plot of differences, in inches.
_WIDTH, _TALL, _LOW = 4.4, 2.9, 2.0

_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f", 3: "k"}


@dataclass(frozen=True, slots=True)
class Plot:
    """A drawn panel; ``svg`` is the element for a page."""

    panel: Panel
    svg: str


def draw(panels: Sequence[Panel]) -> list[Plot]:
    """Draw all panels; the identifiers in each SVG are unique."""
    import matplotlib

    settings: Any = {
        "svg.fonttype": "none",
        "svg.hashsalt": "stc",
        "font.size": 9,
        "axes.linewidth": 0.6,
        "lines.linewidth": 1.5,
        "path.simplify_threshold": 0.3,
        "axes.unicode_minus": True,
    }
    with matplotlib.rc_context(settings):
        return [Plot(panel, _panel(panel, f"p{k}")) for k, panel in enumerate(panels)]


def _panel(panel: Panel, key: str) -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _TALL if panel.differences else _LOW))
    figure.patch.set_visible(False)
    if panel.differences:
        top, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.7, 1])
        draw_lines(top, panel.lines, _LINES, _PARTS)
        top.tick_params(labelbottom=False)
        scale, prefix = _scale(panel.differences)
        scaled = [Line(d.kind, d.time, d.value / scale) for d in panel.differences]
        draw_lines(below, scaled, _LINES, _PARTS)
        below.set_ylabel(f"difference, {prefix}{panel.unit}")
        axes = [top, below]
    else:
        axes = [figure.subplots(1, 1)]
        draw_lines(axes[0], panel.lines, _LINES, _PARTS)
        if all(line.kind == "solved" for line in panel.lines) and len(panel.lines) > 1:
            legend = axes[0].legend(frameon=False, fontsize=8, ncols=3, loc="best")
            for text in legend.get_texts():
                text.set_color(_INK)
    axes[0].set_ylabel(panel.unit or "control")
    axes[-1].set_xlabel("t, s")
    for one in axes:
        style(one, _GRID, _GRID)
        one.patch.set_visible(False)
        one.tick_params(colors=_INK)
        for label in (one.xaxis.label, one.yaxis.label):
            label.set_color(_INK)
    left, right = panel.lines[0].time[0], panel.lines[0].time[-1]
    axes[0].set_xlim(left, right if right > left else left + 1.0)
    figure.subplots_adjust(
        left=0.16, right=0.965, top=0.97, bottom=0.15 if len(axes) == 2 else 0.21, hspace=0.12
    )
    figure.align_ylabels()
    stream = io.StringIO()
    figure.savefig(
        stream, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
    )
    spans = [one.get_position() for one in axes]
    return _embedded(stream.getvalue(), key, panel, (spans[0].x0, spans[0].x1), (spans[-1].y0, spans[0].y1))


def draw_lines(axes: Axes, lines: Sequence[Line], colours: Mapping[str, str], parts: Sequence[str]) -> None:
    """Draw curves in colours by kind; where all are solved, as the parts of a force, by their order."""
    alone = all(line.kind == "solved" for line in lines)
    for k, line in enumerate(lines):
        if not np.any(np.isfinite(line.value)):
            continue
        axes.plot(
            line.time,
            _within(line.value, lines),
            color=parts[k % len(parts)] if alone else colours[line.kind],
            linestyle=DASHES[line.kind],
            linewidth=1.4 if alone else WIDTHS[line.kind],
            label=line.label or line.kind,
        )


def _within(values: FloatArray, lines: Sequence[Line]) -> FloatArray:
    """Values clipped to a range, so that a diverged simulation does not flatten the other curves."""
    solved = [line.value for line in lines if line.kind == "solved"]
    if not solved:
        return np.where(np.abs(values) < 1e9, values, np.nan)
    low, high = float(np.min(solved[0])), float(np.max(solved[0]))
    room = 3.0 * max(high - low, 1e-3)
    return np.where((values > low - room) & (values < high + room), values, np.nan)


def _scale(lines: Sequence[Line]) -> tuple[float, str]:
    """A power of a thousand and its prefix that makes the largest value a number of one to three digits."""
    largest = max(
        (float(np.nanmax(np.abs(v))) for line in lines if len(v := line.value[np.isfinite(line.value)])),
        default=0.0,
    )
    if largest == 0.0:
        return 1.0, ""
    exponent = int(3 * np.floor(np.log10(largest) / 3))
    exponent = min(max(exponent, -15), 3)
    return 10.0**exponent, _PREFIXES[exponent]


def style(axes: Axes, grid: str = "#e5e7eb", spines: str = "#9ca3af") -> None:
    """The common look of all plots: light grid, few ticks, two spines."""
    axes.grid(color=grid, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.locator_params(axis="both", nbins=6)
    axes.tick_params(length=2.5, width=0.6)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(spines)


def _embedded(svg: str, key: str, panel: Panel, across: tuple[float, float], up: tuple[float, float]) -> str:
    """The SVG element alone, its identifiers made unique, its colours the page's, with a cursor of time."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    used = set(re.findall(r'(?:url\(#|href="#)([\w.-]+)', svg))
    svg = re.sub(r' id="([\w.-]+)"', lambda m: f' id="{key}-{m[1]}"' if m[1] in used else "", svg)
    svg = re.sub(r'(url\(#|href="#)([\w.-]+)', rf"\g<1>{key}-\g<2>", svg)
    for stand_in, variable in _VARIABLES.items():
        svg = svg.replace(stand_in, f"var({variable})")
    svg = re.sub(r"font: ([\d.]+)px [^;\"]*", r"font-size: \1px", svg)
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' d="([^"]*)"', lambda m: f' d="{_short(m[1])}"', svg)
    svg = re.sub(r"\n\s*", "\n", svg)
    box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    assert box is not None
    width, height = float(box[1]), float(box[2])
    x0, x1 = across[0] * width, across[1] * width
    y0, y1 = (1.0 - up[1]) * height, (1.0 - up[0]) * height
    label = f"{panel.group} {panel.name} over time"
    head = (
        f'<svg class="plot" viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{label}" '
        f'data-x0="{x0:.2f}" data-x1="{x1:.2f}">'
    )
    cursor = f'<line class="cursor" x1="{x0:.2f}" x2="{x0:.2f}" y1="{y0:.2f}" y2="{y1:.2f}"/>'
    return head + svg[svg.index(">") + 1 :].replace("</svg>", f"{cursor}</svg>").strip()


def _short(path: str) -> str:
    """A path with coordinates rounded to a tenth of a point."""
    path = re.sub(r"-?\d+\.\d+", lambda m: f"{float(m[0]):.1f}", path)
    return " ".join(path.split())
