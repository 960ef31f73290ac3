"""The rows of a certificate in sections: the same for the terminal, the page and failing tests."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from stc.records import dataclass
from stc.validate.metrics import Metric


@dataclass(frozen=True, slots=True)
class Section:
    """Metrics that belong together.

    Attributes:
        title: title of the section.
        metrics: in the order in which they were measured, those of one name together.
    """

    title: str
    metrics: list[Metric]

    def by_name(self) -> dict[str, list[Metric]]:
        """The metrics of each name."""
        found: dict[str, list[Metric]] = {}
        for metric in self.metrics:
            found.setdefault(metric.name, []).append(metric)
        return found


#: How the names of metrics begin that compare equations of motion, causes before effects.
EQUATIONS = (
    "equations of motion",
    "mass matrix",
    "static force",
    "gravity",
    "velocity product",
    "damping",
    "force, entry",
)

#: Which section a metric belongs to, by how its name begins; the first that fits counts.
_SECTIONS: Sequence[tuple[str, tuple[str, ...]]] = (
    ("The solver's answer", ("KKT residual", "constraint violation", "claim against")),
    ("Equations of motion, spec against model", EQUATIONS),
    (
        "Physics, instant by instant",
        (
            "jump of position",
            "joint beyond",
            "equality broken",
            "inverse-dynamics",
            "residual between",
            "energy",
            "momentum",
            "angular",
        ),
    ),
    ("Contacts and impacts", ("contact", "friction", "unexplained impulse", "normal", "penetration", "slip")),
    ("Replay, forces alone", ("open-loop", "growth")),
    ("Replay with feedback", ("tracked", "feedback")),
    ("Replay with the solved contact forces", ("external",)),
    ("The spec's statements between the frames", ("inequality", "equation between")),
    ("Refinement", ("order of convergence",)),
)
_OTHER = "Further measurements"


def sections(metrics: Iterable[Metric]) -> list[Section]:
    """All metrics in sections; metrics that belong to no section come last."""
    found: dict[str, list[Metric]] = {title: [] for title, _ in _SECTIONS}
    found[_OTHER] = []
    for metric in metrics:
        found[_section_of(metric)].append(metric)
    return [Section(title, _together(rows)) for title, rows in found.items() if rows]


def _section_of(metric: Metric) -> str:
    for title, beginnings in _SECTIONS:
        if metric.name.startswith(beginnings):
            return title
    return _OTHER


def _together(metrics: Sequence[Metric]) -> list[Metric]:
    """The metrics in an order in which those of one name are adjacent; names in the order of their first appearance."""
    names = list(dict.fromkeys(metric.name for metric in metrics))
    return sorted(metrics, key=lambda metric: names.index(metric.name))


def number(value: float) -> str:
    """A number with three digits: whole numbers and numbers near one without, others with a power of ten."""
    if not math.isfinite(value):
        return "broke down" if math.isnan(value) else "unbounded" if value > 0 else "-unbounded"
    if value == 0.0:
        return "0"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:.3g}"
    mantissa, _, exponent = f"{value:.2e}".partition("e")
    return f"{mantissa.rstrip('0').rstrip('.')}e{exponent}"


def quantity(metric: Metric, value: float | None) -> str:
    """A value or limit of a metric with the metric's unit; "" for None."""
    if value is None:
        return ""
    unit = "" if metric.unit == "share" else metric.unit
    return f"{number(value)} {unit}".strip()


def bound(metric: Metric) -> str:
    """The limit with its unit, with a sign if it is a lower limit; "" without a limit."""
    return (
        ("≥ " if metric.at_least else "") + quantity(metric, metric.limit) if metric.limit is not None else ""
    )


def margin(metric: Metric) -> float | None:
    """The ratio of the value to its limit: above one the limit is exceeded; None without a meaningful limit."""
    if metric.limit is None or not metric.limit > 0.0:
        return None
    if metric.at_least:
        return metric.limit / metric.value if metric.value > 0.0 else math.inf
    return abs(metric.value) / metric.limit if math.isfinite(metric.value) else math.inf
