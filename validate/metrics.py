"""One measurement: a number with its unit, its limit and its verdict."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from stc.records import dataclass

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Metric:
    """One measured number.

    Attributes
    ----------
    name : str
        The measured quantity, such as ``open-loop drift, largest``.
    subject : str
        On what, such as ``joint x``.
    value : float
        The number; infinite or not a number where the simulation broke down.
    unit : str
        ``m``, ``rad``, ``s``, ``share`` (of one), ``times``, or "" where it has none that is known.
    limit : float | None
        The largest value that passes, or None for a number that is reported only.
    at_least : bool
        Whether the limit is the smallest value that passes instead.
    """

    name: str
    subject: str
    value: float
    unit: str
    limit: float | None = None
    at_least: bool = False

    @property
    def verdict(self) -> str:
        """``pass``, ``fail``, or ``info`` for a metric without a limit."""
        if self.limit is None:
            return "info"
        good = self.value >= self.limit if self.at_least else self.value <= self.limit
        return "pass" if good else "fail"

    def without_limit(self) -> Metric:
        """This metric without a limit, for information only."""
        return replace(self, limit=None)

    def to_dict(self) -> dict[str, Any]:
        """The metric for JSON; a value that is not finite becomes None."""
        return {
            "name": self.name,
            "subject": self.subject,
            "value": self.value if math.isfinite(self.value) else None,
            "unit": self.unit,
            "limit": self.limit,
            "at_least": self.at_least,
            "verdict": self.verdict,
        }


def drift(distances: FloatArray) -> tuple[float, float]:
    """Largest and root-mean-square distance of a replayed quantity from the solved one over the frames.

    Args:
        distances: (n+1,) at the frames, not finite once the simulation has broken down.

    Returns:
        The maximum and the RMS, infinite where the simulation broke down.
    """
    if not np.all(np.isfinite(distances)):
        return math.inf, math.inf
    return float(distances.max()), root_mean_square(distances)


def root_mean_square(sizes: FloatArray) -> float:
    """The root of the mean square of finite numbers >= 0, in their unit, without overflow of the squares."""
    largest = float(sizes.max(initial=0.0))
    return largest * float(np.sqrt(np.mean((sizes / largest) ** 2))) if largest > 0.0 else 0.0
