"""Starting values by name: a table of numbers or an earlier solution, evaluated at the frames of a motion."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from stc.errors import UsageError
from stc.guesses.alignment import Alignment
from stc.records import dataclass, field
from stc.solution import Solution

FloatArray = NDArray[np.float64]
NodeValues = tuple[FloatArray, FloatArray, FloatArray]
"""Values at the frames before (n+1,) and after (n+1,) a jump, and at the midpoints: (n,) or None. NaN means no
value.
"""

#: Names of the columns that say where a row stands.
PLACES = ("t", "time", "frame")

#: A table may end so far, as a share of the motion, before or after it without a warning.
UNCOVERED = 0.01

#: Unused columns that a warning names.
TOLD = 5

#: Derivatives up to this order are no surprise in a table.
ALWAYS_KNOWN = 2

#: How far, as a share of the table, the two sides of a jump are looked up beside it.
APART = 1e-9


class CoverageWarning(UserWarning):
    """A table of starting values covers a different time interval than the motion."""


class UnusedWarning(UserWarning):
    """Some starting values are not used by the spec."""


class GivenValues(Protocol):
    """Starting values by name. ``strict`` says whether a name that the spec does not contain is a mistake."""

    strict: bool

    def names(self) -> Iterable[str]:
        """The names of all variables, derivatives and parameters that have values; a derivative is written ``x'``."""

    def parameter(self, name: str) -> float | None:
        """The value of a parameter, or None if there is none of this name."""

    def values(self, name: str, order: int, time: FloatArray, midpoints: bool = True) -> NodeValues | None:
        """A variable (or derivative of it) at the frames of a motion.

        Args:
            time: (n+1,) of each frame, in seconds.
            midpoints: whether those between the frames are wanted; else there may be none.
        """


@dataclass(slots=True)
class TableValues:
    """Columns of numbers.

    Attributes:
        columns: name to (k,) numbers; NaN where one is missing.
        place: ``t``, ``frame`` or ``""`` for rows that are spread evenly.
        at: (k,) position of each row, not decreasing.
        where: name of the table in messages.
        judged: whether unused columns were already reported.
    """

    columns: Mapping[str, FloatArray]
    place: str = ""
    at: FloatArray = field(default_factory=lambda: np.zeros(0))
    where: str = "the guess"
    strict: bool = True
    judged: bool = False
    _warned: bool = False

    def names(self) -> Iterable[str]:
        return self.columns

    def parameter(self, name: str) -> float | None:
        column = self.columns.get(name)
        known = column[np.isfinite(column)] if column is not None else np.zeros(0)
        return float(known[0]) if len(known) else None

    def values(self, name: str, order: int, time: FloatArray, midpoints: bool = True) -> NodeValues | None:
        column = self.columns.get(name + "'" * order)
        if column is None:
            return None
        n = len(time) - 1
        known = np.isfinite(column)
        frames: FloatArray = np.arange(n + 1.0)
        if self.place == "t":
            frames = time
        elif not self.place:
            frames = frames / max(n, 1)
        self._check_coverage(frames)
        if len(column) == 1:
            return np.full(n + 1, column[0]), np.full(n + 1, column[0]), np.full(n, column[0])
        at = self.at if self.place else np.linspace(0.0, 1.0, len(column))
        at, column = at[known], column[known]
        aside = APART * max(float(at[-1] - at[0]), 1e-300) if (np.diff(at) == 0).any() else 0.0
        mids = 0.5 * (frames[:-1] + frames[1:])
        return (
            np.interp(frames - aside, at, column),
            np.interp(frames + aside, at, column),
            np.interp(mids, at, column),
        )

    def _check_coverage(self, frames: FloatArray) -> None:
        """Compare the positions of the rows with the motion.

        Raises:
            UsageError: a row for a frame that the motion does not have.
        """
        if not self.place:
            return
        first, last = float(self.at[0]), float(self.at[-1])
        begin, end = float(frames[0]), float(frames[-1])
        if self.place == "frame" and (first < begin or last > end):
            outside = first if first < begin else last
            raise UsageError(
                f"{self.where} has a row for frame {outside:g}; the motion has frames 0 to {end:g}",
                "without the column `frame` rows are spread evenly over the motion",
            )
        slack = UNCOVERED * (end - begin)
        if not self._warned and (abs(first - begin) > slack or abs(last - end) > slack):
            self._warned = True
            warnings.warn(
                f"{self.where} covers {self.place} = {first:g} to {last:g}, the motion {begin:g} to {end:g}; "
                "outside of its rows the nearest one is used",
                CoverageWarning,
                stacklevel=2,
            )


@dataclass(slots=True)
class SolutionValues:
    """A solution's own curves, by frame index.

    Attributes:
        solution: the solution.
        alignment: the correspondence of its frames; None keeps each frame's share of the motion.
        judged: whether unused values were already reported.
    """

    solution: Solution
    alignment: Alignment | None = None
    strict: bool = False
    judged: bool = False
    _sampled: dict[int, tuple[dict[str, Any], dict[str, Any]]] = field(default_factory=dict, repr=False)
    _between: dict[int, dict[str, Any]] = field(default_factory=dict, repr=False)

    def names(self) -> Iterable[str]:
        return self.solution.names

    def parameter(self, name: str) -> float | None:
        return self.solution.parameters.get(name)

    def values(self, name: str, order: int, time: FloatArray, midpoints: bool = True) -> NodeValues | None:
        if (name, order) not in self.solution.trajectories:
            return None
        n = len(time) - 1
        key = name + "'" * order
        before, after = (np.asarray(values[key]) for values in self._at_frames(n))
        return before, after, np.asarray(self._at_midpoints(n)[key]) if midpoints else np.zeros(0)

    def _aligned(self, n: int) -> Alignment:
        return self.alignment or Alignment.even(self.solution.n, n)

    def _at_frames(self, n: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """All curves before and after the frames of a motion of n steps."""
        if n not in self._sampled:
            frames = self._aligned(n).to_old(np.arange(n + 1))
            after = self.solution.at_frame(frames, "after")
            jumps = self.solution.frames_that_jump().size > 0
            before = self.solution.at_frame(frames, "before") if jumps else after
            self._sampled[n] = before, after
        return self._sampled[n]

    def _at_midpoints(self, n: int) -> dict[str, Any]:
        """The values of all curves halfway between the frames of a motion of n steps, (n,) each, by name."""
        if n not in self._between:
            self._between[n] = self.solution.at_frame(self._aligned(n).to_old(np.arange(n) + 0.5))
        return self._between[n]


def warn_of_unused(given: GivenValues, spec: str, known: Mapping[str, int | None]) -> None:
    """Warn once of values that the spec does not use.

    Args:
        given: the values.
        spec: the spec's name.
        known: variables with the highest derivative that the spec uses of each, parameters with None.
    """
    if not isinstance(given, TableValues | SolutionValues) or given.judged:
        return
    given.judged = True
    # Tables of a motion have derivatives of forces as well, as far as of positions.
    highest = max(ALWAYS_KNOWN, *(order or 0 for order in known.values()))
    unused = []
    for name in given.names():
        base = name.rstrip("'")
        if base not in known:
            unused.append(base)
        elif len(name) - len(base) > (0 if known[base] is None else highest):
            unused.append(name)
    unused = list(dict.fromkeys(unused))
    if not unused:
        return
    where = given.where if isinstance(given, TableValues) else f"the motion of {given.solution.name}"
    listed = ", ".join(f"`{name}`" for name in unused[:TOLD])
    more = f" and {len(unused) - TOLD} more" if len(unused) > TOLD else ""
    hints = "".join(f"; {hint}" for name in unused[:TOLD] if (hint := _hint(name, known)))
    warnings.warn(
        f"{where} has {listed}{more}, which {spec} does not use{hints}", UnusedWarning, stacklevel=3
    )


def _hint(name: str, known: Mapping[str, int | None]) -> str:
    """A suggestion for a name that is not used."""
    base = name.rstrip("'")
    if base not in known:
        from difflib import get_close_matches

        near = get_close_matches(base, known, n=1)
        return f"did you mean `{near[0]}` by `{base}`?" if near else ""
    highest = known[base]
    if highest is None:
        return f"{base} is a parameter"
    return f"it uses {', '.join(base + chr(39) * k for k in range(highest + 1))}"


def table(columns: Mapping[str, Any], where: str = "the guess") -> TableValues:
    """Starting values from arrays of equal length (and single numbers) by name; ``t`` or ``frame`` places them.

    Raises:
        UsageError: lengths differ, a place is missing, or what should be numbers is not.
    """
    arrays: dict[str, FloatArray] = {}
    for name, numbers in columns.items():
        if not isinstance(name, str):
            raise UsageError(f"{where} is numbers by name, and {name!r} is not a name")
        try:
            arrays[name] = column = np.atleast_1d(np.asarray(numbers, dtype=float))
        except (TypeError, ValueError):
            column = np.zeros(0)
        if column.ndim > 1 or not column.size:
            raise UsageError(f"`{name}` in {where} is neither a number nor a list of numbers")
        if np.isinf(column).any():
            raise UsageError(f"in {where}, {name} is infinite somewhere")
        if not np.isfinite(column).any():
            raise UsageError(f"in {where}, {name} has no number at all")
    place = next((name for name in PLACES if name in arrays), "")
    values = {name: column for name, column in arrays.items() if name not in PLACES}
    if not place:
        return TableValues(values, where=where)
    at = arrays[place]
    wrong = next((name for name, c in values.items() if len(c) not in (1, len(at))), None)
    if wrong is not None:
        raise UsageError(f"in {where}, {wrong} has {len(values[wrong])} numbers and {place} has {len(at)}")
    if not np.isfinite(at).all():
        raise UsageError(f"in {where}, {place} has a gap")
    order = np.argsort(at, kind="stable")
    values = {name: column[order] if len(column) == len(at) else column for name, column in values.items()}
    return TableValues(values, "frame" if place == "frame" else "t", at[order], where)
