"""One line that names the cause of a failure: the joint and the term.

Measurements are examined from cause to effect.  A term of the equations of motion that differs from the model's
explains a residual, and a residual explains a drift.  The differing term is therefore named first; among several
measurements of one kind, the one that exceeds its limit most.
"""

from __future__ import annotations

from collections.abc import Sequence

from stc.validate.certificate.table import EQUATIONS, bound, margin, quantity
from stc.validate.metrics import Metric

#: Names of metrics by their beginnings, causes before effects; what is not here comes in between.
_CAUSES = (
    "constraint violation",
    "KKT residual",
    "jump of position",
    "equality broken",
    "joint beyond",
    *EQUATIONS,
    "unexplained impulse",
    "contacts that the model",
    "inverse-dynamics residual",
    "momentum in flight",
    "angular momentum",
    "friction used",
    "contact force, solved one pulls",
    "friction missing",
    "contact force that no contact gives",
)
_EFFECTS = (
    "residual between",
    "inequality",
    "energy",
    "external",
    "tracked",
    "feedback",
    "open-loop",
    "order",
)


def rank(metric: Metric) -> int:
    """The position of a metric in the order of cause and effect; causes have lower ranks."""
    for at, beginning in enumerate(_CAUSES):
        if metric.name.startswith(beginning):
            return at
    for at, beginning in enumerate(_EFFECTS):
        if metric.name.startswith(beginning):
            return len(_CAUSES) + 1 + at
    return len(_CAUSES)


def headline(metrics: Sequence[Metric], findings: Sequence[str], compared: bool) -> str:
    """The verdict in one line: the first finding, else the worst failure, else the measurement closest to its limit.

    Args:
        metrics: everything that was measured.
        findings: the differences between the spec's and the model's equations of motion, the most important first.
        compared: whether these equations were compared at all.
    """
    failed = sorted((m for m in metrics if m.verdict == "fail"), key=lambda m: (rank(m), -(margin(m) or 0.0)))
    if findings:
        return findings[0]
    if not failed:
        return _all_well(metrics)
    worst = failed[0]
    text = f"{worst.subject}: {worst.name} {quantity(worst, worst.value)}, limit {bound(worst)}"
    if compared and worst.name.startswith("inverse-dynamics"):
        text += "; the spec's equations are the model's, but this solution does not satisfy them"
    return text


def _all_well(metrics: Sequence[Metric]) -> str:
    judged = [m for m in metrics if m.verdict == "pass"]
    if not judged:
        return "nothing was measured that has a limit"
    nearest = max(judged, key=lambda m: margin(m) or 0.0)
    share = 100.0 * (margin(nearest) or 0.0)
    return (
        f"{len(judged)} measurements within their limits; closest to its limit: {nearest.name} "
        f"({nearest.subject}), at {share:.2g} %"
    )


def others(metrics: Sequence[Metric], findings: Sequence[str], most: int = 8) -> list[str]:
    """Further findings and failures, one line each, which follow the headline."""
    lines = list(findings[1:])
    failed = sorted((m for m in metrics if m.verdict == "fail"), key=lambda m: (rank(m), -(margin(m) or 0.0)))
    start = 0 if findings else 1
    lines += [f"{m.subject}: {m.name} {quantity(m, m.value)}, limit {bound(m)}" for m in failed[start:]]
    if len(lines) > most:
        lines = [*lines[:most], f"and {len(lines) - most} more"]
    return lines
