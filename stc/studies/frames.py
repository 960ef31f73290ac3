"""The same motion on more frames: its constants, and a check that it is the same motion.

The phases of a spec begin and end at frames given by constants: ``n`` alone, constants computed from it (``a = n/2``),
independent ones (``a = 30, b = 50``), or all of them computed from another (``k = 2, a = 20*k, n = 60*k``).  The
number of all frames is multiplied through the constants from which the others are computed; single phases are changed
by the constants at their ends.  To check that the result states the same motion, the finer problem is elaborated, and
the named frames, their times, and the weights of the objective are compared.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stc.errors import SpecError, UsageError
from stc.pipeline import Model
from stc.problem import Problem
from stc.records import dataclass
from stc.solving.fewer_frames import own_constants
from stc.solving.same_motion import (
    BESIDE,
    check_same_motion,
    growing_sum,
    is_of_parameters,
    takes_longer,
)

__all__ = ["MOST_AT_ONCE", "ORDER", "SAFETY", "Spread", "growth_for", "in_shares"]

FloatArray = NDArray[np.float64]

ORDER = {"stepping": 1, "central": 2, "trapezoidal": 2, "hermite-simpson": 4}
"""Order of a motion's error in the step size; the local error's order is higher by one."""
LOWEST_ORDER = 0.7
"""Least order that is assumed if the observed order is lower, as it is with kinks."""

MOST_AT_ONCE = 8
"""Largest factor by which the frames of a phase increase from one solve to the next."""
SAFETY = 0.5
"""The number of frames is chosen so that the errors fall to this share of their limits."""


def in_shares(model: Model, method: str | None = None, **constants: float) -> Model:
    """A spec with its plain frame numbers as shares of n: ``[25]`` is written ``[25*n/60]`` where n is 60.

    With another n it states the same motion; as it was written it would not.  The frame 1, which stays beside the
    first one, is kept.

    Args:
        model, method, constants: the spec, and what it is going to be solved with.

    Returns:
        The same model if there is nothing to change.

    Raises:
        SpecError, UsageError: mistakes in the spec.
    """
    problem, text = model.problem(method, **constants), model.source.written
    edits: dict[int, str] = {}
    for one in problem.named:
        start, end = one.span.source.place(one.span.start, one.span.end)
        for part in re.finditer(r"[^\[\],]+", text[start:end]):
            if one.frame > BESIDE and part[0].strip() == str(one.frame):
                edits[start + part.start() + part[0].index(str(one.frame))] = str(one.frame)
    for begin in sorted(edits, reverse=True):
        end = begin + len(edits[begin])
        text = f"{text[:begin]}{edits[begin]}*n/{problem.n}{text[end:]}"
    if not edits:
        return model
    return Model(replace(model.source, text=text, origins=None, _line_starts=None), model.overrides)


@dataclass(slots=True)
class Spread:
    """The frame counts of a spec, and how to change them.

    Attributes:
        model: the spec.
        method: transcription instead of the spec's own, or None.
        constants: constants given by the caller.
        problem: with these constants.
        ends: constants that name a frame each, with their values, in increasing order; ``n`` is the last.
        own: independent structural constants, with their values.
    """

    model: Model
    method: str | None
    constants: Mapping[str, float]
    problem: Problem
    ends: list[tuple[str, int]]
    own: dict[str, float]

    @classmethod
    def of(cls, model: Model, method: str | None, constants: Mapping[str, float]) -> Spread:
        """The frame counts of a spec with some constants given.

        Raises:
            UsageError: the motion has one frame only.
        """
        problem = model.problem(method, **constants)
        if problem.n == 0:
            raise UsageError(f"{problem.name} has one frame only: there is nothing between the frames")
        values = problem.constants
        free = own_constants(model.tree, {**model.overrides, **constants})
        own = {name: values[name] for name in free if name in problem.structural}
        spread = cls(model, method, constants, problem, [], own)
        found: dict[int, str] = {}
        for name in sorted(problem.structural - {"n"}):
            frame = round(values[name])
            if frame == values[name] and 0 < frame < problem.n and spread._names_its_frame(name, frame):
                found.setdefault(frame, name)
        spread.ends = [*((found[frame], frame) for frame in sorted(found)), ("n", problem.n)]
        return spread

    @property
    def lengths(self) -> list[int]:
        """The numbers of frames between the frames that constants name (``ends``)."""
        ends = [0, *(value for _, value in self.ends)]
        return [b - a for a, b in pairwise(ends)]

    def finer(self, factors: Sequence[int]) -> dict[str, float]:
        """Constants for the motion with the number of frames between the ends multiplied by factors.

        Where different factors would make another motion, the largest one is taken for all.

        Args:
            factors: one per entry of :attr:`lengths`.

        Raises:
            UsageError: the spec does not define the same motion on more frames; the message gives the position.
        """
        if len(set(factors)) > 1:
            try:
                return self._checked(self._phase_by_phase(factors), factors)
            except (UsageError, SpecError):
                pass
        return self.multiplied(max(factors))

    def multiplied(self, factor: int) -> dict[str, float]:
        """Constants for the motion with the number of all frames multiplied by a factor.

        Raises:
            UsageError: as :meth:`finer`.
        """
        factors = [factor] * len(self.ends)
        ends = [name for name, _ in self.ends if name in self.own or name == "n"]
        ways = [{name: factor * self.problem.constants[name] for name in ends}]
        ways += [{name: factor * value} for name, value in self.own.items() if name not in ends]
        ways.append(self._phase_by_phase(factors))
        first: UsageError | SpecError | None = None
        for way in ways:
            try:
                return self._checked(way, factors)
            except (UsageError, SpecError) as error:
                first = first or error
        if isinstance(first, UsageError):
            raise first
        raise UsageError(
            f"{self.problem.name} cannot be given {factor} times as many frames:\n{first}",
            "write frame numbers as shares of n, such as `a = n/2`",
        ) from None

    def counts(self, overrides: Mapping[str, float]) -> list[int]:
        """Steps from one end to the next with other constants."""
        problem = self.model.problem(self.method, **{**self.constants, **overrides})
        ends = [0, *(round(problem.constants[name]) for name, _ in self.ends)]
        return [b - a for a, b in pairwise(ends)]

    def _phase_by_phase(self, factors: Sequence[int]) -> dict[str, float]:
        """The new last frame of every phase, by the constant that holds it."""
        new = np.cumsum(np.array(factors) * np.array(self.lengths))
        return {name: float(value) for (name, _), value in zip(self.ends, new, strict=True)}

    def _names_its_frame(self, name: str, frame: int) -> bool:
        """Whether the range or index of a statement at this frame moves with a constant."""
        before = self.problem.named
        for other in (2, -2, 1, -1):
            try:
                changed = self.model.problem(self.method, **{**self.constants, name: frame + other})
            except (SpecError, UsageError):
                continue
            after = changed.named
            return len(before) == len(after) and any(
                abs(old.frame - frame) <= BESIDE and new.frame - old.frame == other
                for old, new in zip(before, after, strict=True)
            )
        return False

    def _checked(self, overrides: dict[str, float], factors: Sequence[int]) -> dict[str, float]:
        """The given constants with a matching step, if they state the same motion.

        Raises:
            UsageError, SpecError: they do not.
        """
        old = np.array([0, *(value for _, value in self.ends)])
        new = np.concatenate([[0], np.cumsum(np.array(factors) * np.diff(old))])
        finer = self.model.problem(self.method, **{**self.constants, **overrides})
        if finer.n != new[-1]:
            raise UsageError(f"{' and '.join(overrides)} do not decide the number of frames")
        wrong = takes_longer(self.problem, finer, old, new)
        if wrong and "h" in self.problem.constants and len(set(factors)) == 1:
            overrides = {**overrides, "h": self.problem.constants["h"] / factors[0]}
            finer = self.model.problem(self.method, **{**self.constants, **overrides})
            wrong = takes_longer(self.problem, finer, old, new)
        check_same_motion(self.problem, finer, old, new)
        for term in filter(is_of_parameters, self.problem.objective):
            raise growing_sum(term)
        if wrong:
            times = f"{finer.n / self.problem.n:.3g} times as many frames"
            raise UsageError(
                f"{self.problem.name} takes another time with {times}",
                "give the duration and let h follow from it, as in `T = 2, h = T/n`",
            )
        return overrides


def observed_order(method: str, coarse: tuple[int, float], fine: tuple[int, float]) -> float:
    """The observed order of an error on two grids, between :data:`LOWEST_ORDER` and the method's.

    Args:
        method: transcription.
        coarse: number of steps and error of the one grid.
        fine: the same of the other.
    """
    (few, large), (many, small) = coarse, fine
    if not (large > 0.0 and small > 0.0 and np.isfinite(large)) or many <= few:
        return ORDER[method]
    return float(np.clip(np.log(large / small) / np.log(many / few), LOWEST_ORDER, ORDER[method]))


def growth_for(errors: FloatArray, counts: NDArray[np.int_], order: float, share: float) -> FloatArray:
    """The factor by which the steps of each phase must be multiplied to reduce the sum of all errors to a share of
    itself.

    A phase with error E on N steps that gets r times as many keeps E/r^p.  The least number of steps for a given
    sum has r proportional to (E/N)^(1/(p+1)), and never below 1.

    Args:
        errors: (k,) of each phase; where one is not finite, that phase alone grows as far as it may.
        counts: (k,) steps of each phase.
        order: p.
        share: below 1.

    Returns:
        (k,) factors between 1 and :data:`MOST_AT_ONCE`.
    """
    unknown = ~np.isfinite(errors)
    if unknown.any():
        return np.where(unknown, float(MOST_AT_ONCE), 1.0)
    shape = (errors / counts) ** (1.0 / (order + 1.0))
    low, high = 0.0, MOST_AT_ONCE / max(float(shape.max()), 1e-300)
    for _ in range(60):
        scale = 0.5 * (low + high)
        kept = float((errors * np.maximum(1.0, scale * shape) ** -order).sum())
        low, high = (scale, high) if kept > share * float(errors.sum()) else (low, scale)
    return np.asarray(np.clip(high * shape, 1.0, MOST_AT_ONCE))
