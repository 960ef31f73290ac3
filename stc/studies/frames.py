"""The same motion on more frames: which constants say so, and a check that it is the same motion.

A spec says where its phases begin and end in constants: ``n`` alone, others made from it (``a = n/2``), others
of their own (``a = 30, b = 50``), or all of them from one more (``k = 2, a = 20*k, n = 60*k``).  All frames are
multiplied through the constants that the others follow from; single phases by giving the constants at their ends
other values.  Whether the result states the same motion is not taken on trust: the finer problem is elaborated,
and every frame that a statement names, the time at every one of them, and the weights of the objective have to be
where they were.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stc.errors import Span, SpecError, UsageError
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.names import collect_names
from stc.phases import resolved, stretches
from stc.pipeline import Model
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.symbolic.expr import Expr, evaluate, symbols

__all__ = ["MOST_AT_ONCE", "ORDER", "Spread", "growth_for"]

FloatArray = NDArray[np.float64]

ORDER = {"central": 2, "trapezoidal": 2, "hermite-simpson": 4}
"""Order of a motion's error in its step: a step's own is higher by one, and there are the more steps."""
LOWEST_ORDER = 0.7
"""Kinks lower the order; what was observed counts, but not less than this."""

MOST_AT_ONCE = 8
"""No phase gets more than so many times as many frames from one solve to the next."""
BESIDE = 1
"""A frame number may stand this many frames beside one that scales: n/2 + 1, a - 1."""
CLOSE = 1e-9
TRIALS = (1.0, 1.7)
"""Values of all parameters at which durations are compared."""


@dataclass(slots=True)
class Spread:
    """The frame counts of a spec, and how to change them.

    Attributes:
        model: the spec.
        method: transcription instead of the spec's own, or None.
        constants: given from outside.
        problem: with these constants.
        ends: constants that name a frame each, with their values, in rising order; ``n`` is the last.
        own: those constants that no other one determines and that shape the problem, with their values.
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
        free = _independent(model, {**model.overrides, **constants})
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
        """Steps from one end to the next."""
        ends = [0, *(value for _, value in self.ends)]
        return [b - a for a, b in pairwise(ends)]

    def finer(self, factors: Sequence[int]) -> dict[str, float]:
        """Constants for a motion with this many times as many frames between the ends.

        Where different factors would make another motion, the largest one is taken for all.

        Args:
            factors: one per entry of :attr:`lengths`.

        Raises:
            UsageError: the spec does not say what the same motion on more frames is; the message says where.
        """
        if len(set(factors)) > 1:
            try:
                return self._checked(self._phase_by_phase(factors), factors)
            except (UsageError, SpecError):
                pass
        return self.multiplied(max(factors))

    def multiplied(self, factor: int) -> dict[str, float]:
        """Constants for a motion with so many times as many frames everywhere.

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
        """Every end by name."""
        new = np.cumsum(np.array(factors) * np.array(self.lengths))
        return {name: float(value) for (name, _), value in zip(self.ends, new, strict=True)}

    def _names_its_frame(self, name: str, frame: int) -> bool:
        """Whether some statement's range or index at this very frame moves with a constant."""
        before = [where for where, _ in named_frames(self.problem)]
        for other in (2, -2, 1, -1):
            try:
                changed = self.model.problem(self.method, **{**self.constants, name: frame + other})
            except (SpecError, UsageError):
                continue
            after = [where for where, _ in named_frames(changed)]
            return len(before) == len(after) and any(
                abs(old - frame) <= BESIDE and new - old == other
                for old, new in zip(before, after, strict=True)
            )
        return False

    def _checked(self, overrides: dict[str, float], factors: Sequence[int]) -> dict[str, float]:
        """These constants, and a step to go with them, if they state the same motion.

        Raises:
            UsageError, SpecError: they do not.
        """
        old = np.array([0, *(value for _, value in self.ends)])
        new = np.concatenate([[0], np.cumsum(np.array(factors) * np.diff(old))])
        finer = self.model.problem(self.method, **{**self.constants, **overrides})
        if finer.n != new[-1]:
            raise UsageError(f"{' and '.join(overrides)} do not decide the number of frames")
        wrong = self._takes_longer(finer, old, new)
        if wrong and "h" in self.problem.constants and len(set(factors)) == 1:
            overrides = {**overrides, "h": self.problem.constants["h"] / factors[0]}
            finer = self.model.problem(self.method, **{**self.constants, **overrides})
            wrong = self._takes_longer(finer, old, new)
        named, moved = list(named_frames(self.problem)), list(named_frames(finer))
        if len(named) != len(moved):
            raise UsageError(
                f"{self.problem.name} reads other frames with n = {finer.n} than with n = {self.problem.n}"
            )
        for (frame, span), (other, _) in zip(named, moved, strict=True):
            if not _scales(frame, other, old, new):
                place = span.location if span is not None else self.problem.name
                raise UsageError(
                    f"{place}: frame {frame:g} of {self.problem.n} would be frame {other:g} of {finer.n}: "
                    "it does not keep its share of the motion",
                    f"write frame numbers as shares of n, here `{frame:g}/{self.problem.n}*n`, or as constants "
                    "such as `a = n/2`",
                )
        if wrong:
            times = f"{finer.n / self.problem.n:.3g} times as many frames"
            raise UsageError(
                f"{self.problem.name} takes another time with {times}",
                "give the duration and let h follow from it, as in `T = 2, h = T/n`",
            )
        _check_objective(self.problem, finer, old, new)
        return overrides

    def _takes_longer(self, finer: Problem, old: NDArray[np.int_], new: NDArray[np.int_]) -> bool:
        """Whether the ends, or a frame where another definition or statement begins, come at another time."""
        cuts = np.array(sorted({first for first, _ in stretches(self.problem, self.problem.relations)}))
        cuts = np.append(cuts, self.problem.n)
        for trial in TRIALS:
            before, after = frame_times(self.problem, trial), frame_times(finer, trial)
            there = np.interp(np.interp(cuts, old, new), np.arange(finer.n + 1), after)
            if not np.allclose(there, before[cuts], rtol=CLOSE, atol=CLOSE * abs(before[-1])):
                return True
        return False


def observed_order(method: str, coarse: tuple[int, float], fine: tuple[int, float]) -> float:
    """The order at which an error falls, as far as two grids tell, between :data:`LOWEST_ORDER` and the method's.

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
    """How many times as many steps each phase needs for the sum of all errors to fall to a share of itself.

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


def _independent(model: Model, overrides: Mapping[str, float]) -> list[str]:
    """Constants that no other constant determines."""
    diagnostics = Diagnostics(model.source)
    table = collect_names(model.tree, diagnostics)
    constants = Constants(table, overrides, diagnostics, model.tree.damaged)
    return [name for name in constants.values if constants.made_from(name) == {name}]


def _scales(frame: float, other: float, old: NDArray[np.int_], new: NDArray[np.int_]) -> bool:
    """Whether a frame went where the ends take it, or stays this far beside such a one."""
    for beside in range(-BESIDE, BESIDE + 1):
        at = frame - beside
        if old[0] <= at <= old[-1] and abs(np.interp(at, old, new) + beside - other) <= CLOSE * old[-1]:
            return True
    return False


def named_frames(problem: Problem) -> Iterator[tuple[float, Span | None]]:
    """Every frame number that a spec names, in an order that does not depend on n."""
    for relation in problem.relations:
        yield float(relation.range.first), relation.range.span or relation.span
        yield float(relation.range.last), relation.range.span or relation.span
        for bound in (relation.body, relation.lower, relation.upper):
            yield from _absolute(bound, relation.span)
    for term in problem.objective:
        yield float(term.range.first), term.range.span or term.span
        yield float(term.range.last), term.range.span or term.span
        yield from _absolute(term.body, term.span)
    for guess in problem.guesses:
        yield float(guess.range.first), guess.range.span or guess.span
        yield float(guess.range.last), guess.range.span or guess.span
    for pieces in problem.definitions.values():
        for piece in pieces:
            yield float(piece.range.first), piece.range.span or piece.span
            yield float(piece.range.last), piece.range.span or piece.span
            yield from _absolute(piece.body, piece.span)
    for jump in problem.jumps:
        yield float(jump.frame), jump.span


def _absolute(body: Expr | None, span: Span) -> Iterator[tuple[float, Span | None]]:
    """Absolute indices such as ``x[20]``."""
    keys = [] if body is None else [k for k in symbols(body) if isinstance(k, VariableRef) and k.scale == 0]
    for key in sorted(keys, key=lambda k: (k.name, k.order, float(k.shift))):
        yield float(key.shift), span


def frame_times(problem: Problem, trial: float) -> FloatArray:
    """The time of every frame where each parameter has the value ``trial``. (n+1,)"""
    known: dict[object, object] = {ConstantRef(name): value for name, value in problem.constants.items()}
    known.update({ParameterRef(name): trial for name in problem.parameters})
    lengths = np.zeros(problem.n)
    for first, last in stretches(problem, ()):
        step = resolved(problem, problem.step, first)
        values = {**known, IndexRef(): np.arange(first, last, dtype=float)}
        lengths[first:last] = np.asarray(evaluate(step, values))
    return np.concatenate([[0.0], np.cumsum(lengths)])


def _check_objective(coarse: Problem, fine: Problem, old: NDArray[np.int_], new: NDArray[np.int_]) -> None:
    """Plain sums over frames have to weigh as before against everything else in the objective.

    Raises:
        UsageError: one does not.
    """
    ratios: list[float] = []
    blamed = None
    for term, other in zip(coarse.objective, fine.objective, strict=True):
        if term.integral or term.range.first == term.range.last:
            ratios.append(1.0)
            continue
        blamed = term
        before, after = (
            _sum(p, t.body, t.range.first, t.range.last) for p, t in ((coarse, term), (fine, other))
        )
        ratios.append(after / before if before else 1.0)
    # The ends of a range count as whole frames in a sum: a relative difference of that size is the sum's own.
    tolerance = 4.0 / max(1, min(int(np.diff(old).min()), int(np.diff(new).min())))
    if blamed is not None and max(ratios) > min(ratios) * (1.0 + tolerance):
        raise UsageError(
            f"{blamed.span.location}: a plain sum over frames grows with n, so that the objective would be another one",
            f"write `integral({blamed.text})`",
        )


def _sum(problem: Problem, body: Expr, first: int, last: int) -> float:
    """A term's sum over its frames where every variable has a fixed value of its own."""
    values: dict[object, object] = {ConstantRef(name): value for name, value in problem.constants.items()}
    values.update({ParameterRef(name): 1.3 for name in problem.parameters})
    total = 0.0
    for a, b in stretches(problem, ()):
        start, end = max(a, first), min(b, last)
        if start >= end:
            continue
        here = resolved(problem, body, a)
        index = np.arange(start, end, dtype=float)
        known = {**values, IndexRef(): index / problem.n, TimeRef(): index / problem.n}
        for key in symbols(here):
            if isinstance(key, VariableRef):
                known[key] = 0.7 + 0.11 * (len(key.name) + key.order)
        total += float(np.sum(np.broadcast_to(np.asarray(evaluate(here, known)), index.shape)))
    return total
