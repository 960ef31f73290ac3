"""Nested iteration: the same motion on fewer frames is solved first, as a start for the solve on all frames.

Finding the course of a motion takes as many iterations on few frames as on many, but each of them costs less; from
there a few steps lead to the solution on all frames (nested iteration of multigrid methods, and the refinement of
meshes in J. T. Betts, Practical methods for optimal control, 2010, section 4.7).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from math import ceil, gcd

import numpy as np

from stc import deadline
from stc.errors import EndedError, SpecError, UsageError
from stc.guesses.alignment import Alignment
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.elaborate import elaborate
from stc.language.names import collect_names
from stc.language.syntax import SpecTree
from stc.phases import named_cuts
from stc.problem import Problem
from stc.records import dataclass
from stc.solution import Solution
from stc.solver import IterationRecord, Options, Result, Start, Status
from stc.solver.status import advice, sentence
from stc.solving.same_motion import check_same_motion, takes_longer

__all__ = [
    "COARSE",
    "FINE",
    "FewerFrames",
    "Fineness",
    "Nested",
    "fewer_frames",
    "own_constants",
]


@dataclass(frozen=True, slots=True)
class Fineness:
    """The smallest acceptable numbers of frames.

    Attributes:
        fewest, shortest: least number of frames of a motion, and of each of its phases.
        worthwhile: least factor by which the number of frames is reduced.
    """

    fewest: int
    shortest: int
    worthwhile: float


FINE = Fineness(50, 25, 6.0)
"""Limits for starts from a guess. On fewer frames the optimum may be a different motion, and the solve on all frames
then takes as many iterations as from the guess. The factor 6 is the break-even of random motions of twelve kinds: with
three times fewer frames, both solves take 1.4 times as long as one (swings of rods and cart-poles half as long, motions
with many optima longer)."""
COARSE = Fineness(20, 8, 1.6), Fineness(40, 16, 1.6), Fineness(80, 32, 1.6)
"""Limits where the guess leads nowhere on all frames, tried one after the other."""
ITERATIONS = 150
"""Limits of iterations: a motion on fewer frames, or the solve from it on all frames, that takes more is not worth
while.
"""
WORSE = 0.05
"""A solution whose objective exceeds that on fewer frames by this share is probably a different and worse motion."""

Callback = Callable[[IterationRecord], bool | None]


@dataclass(frozen=True, slots=True)
class FewerFrames:
    """The same motion on fewer frames.

    Attributes:
        constants: the constants of that motion.
        ratio: ratio of the objective on all frames to that on fewer: 1 except for plain sums over frames.
    """

    constants: Mapping[str, float]
    ratio: float


def own_constants(tree: SpecTree, overrides: Mapping[str, float]) -> list[str]:
    """Constants that no other constant determines."""
    diagnostics = Diagnostics(tree.source)
    constants = Constants(collect_names(tree, diagnostics, overrides), overrides, diagnostics, tree.damaged)
    return [name for name in constants.values if constants.made_from(name) == {name}]


def fewer_frames(
    tree: SpecTree, overrides: Mapping[str, float], problem: Problem, fineness: Fineness = FINE
) -> FewerFrames | None:
    """Constants for the same motion on fewer frames; None if the spec does not allow it.

    Args:
        tree: the spec.
        overrides: constants given from outside.
        problem: the problem with these.
        fineness: the limits of the number of frames.
    """
    cuts = named_cuts(problem)
    knots = Alignment.of(cuts, cuts).old
    phases = np.diff(knots)
    most = min(problem.n / fineness.fewest, float(phases.min(initial=np.inf)) / fineness.shortest)
    if not fineness.worthwhile <= most < np.inf:
        return None
    shaping = {k: problem.constants[k] for k in own_constants(tree, overrides) if k in problem.structural}
    for way in _ways(shaping, most, knots.astype(int).tolist()):
        try:
            other = elaborate(tree, {**overrides, **way}, problem.method)
            if not 0 < other.n * fineness.worthwhile <= problem.n:
                continue
            pairs = Alignment.of(cuts, named_cuts(other))
            if takes_longer(problem, other, pairs.old, pairs.new) and "h" in problem.constants:
                way = {**way, "h": problem.constants["h"] * problem.n / other.n}
                other = elaborate(tree, {**overrides, **way}, problem.method)
            if takes_longer(problem, other, pairs.old, pairs.new):
                continue
            return FewerFrames(way, 1.0 / check_same_motion(problem, other, pairs.old, pairs.new))
        except (SpecError, UsageError):
            continue
    return None


def _ways(shaping: Mapping[str, float], most: float, knots: list[int]) -> Iterator[dict[str, float]]:
    """Other values for the constants that shape a motion, the likeliest first, up to ``most`` times smaller.

    ``knots`` are the frames where phases end.
    """
    whole = {name: int(value) for name, value in shaping.items() if value == int(value) and value > 1}
    for name in sorted(whole, key=lambda name: name != "n"):
        value, least = whole[name], ceil(whole[name] / most)
        # Phases that are shares of the motion, as up to `n/3`, end at frames for multiples of this.
        unit = value // gcd(value, *knots)
        fitting = unit * ceil(least / unit)
        if least < fitting:
            yield {name: float(fitting)}
        yield {name: float(least)}
    if len(whole) > 1:
        for factor in range(int(most), 1, -1):
            if all(value % factor == 0 for value in whole.values()):
                yield {name: float(value // factor) for name, value in whole.items()}
                return


def _uncounted(found: Result) -> Result:
    """A result whose iterations and factorisations are counted already."""
    return replace(found, iterations=0, factorizations=0)


@dataclass(slots=True)
class Nested:
    """A solve on all frames and on fewer of them, with its limits and totals.

    Args:
        coarse: solves the motion on fewer frames.
        start: the resulting start on all frames.
        fine: solves on all frames, from the spec's own guess if the start is None.
        options, callback: options and callback of the whole solve.
    """

    coarse: Callable[[Options, Callback | None], Solution]
    start: Callable[[Solution], Start]
    fine: Callable[[Options, Start | None, Callback | None], Result]
    options: Options
    callback: Callback | None
    _iterations: int = 0
    _factorizations: int = 0
    _stopped: bool = False
    _best: Result | None = None  # on all frames

    def fewer_first(self, ratio: float) -> Result:
        """The result on all frames, with the iterations and factorisations of all solves.

        The solve from the motion on fewer frames is accepted if its objective is hardly worse than on fewer frames;
        otherwise the spec's own guess is tried as well.

        Args:
            ratio: see :class:`FewerFrames`.
        """
        before = self._before()
        if self._stopped or self._over:  # the next solve ends at once, with the motion so far
            return self._counted(self._on_all(self._left(), Start(self.start(before).x)))
        found: Result | None = None
        if before.status == "optimal":
            found = self._on_all(self._from_other_frames(), self.start(before))
            promised = ratio * before.objective
            worst = promised + WORSE * max(abs(promised), abs(found.objective))
            if self._stopped or (found.status is Status.OPTIMAL and found.objective <= worst):
                return self._counted(found)
            self._count(found)
            if self._over:
                return self._counted(_uncounted(found))
        other = self._on_all(self._left(), None)
        if found is not None and found.status is Status.OPTIMAL:
            if other.status is not Status.OPTIMAL or found.objective < other.objective:
                self._count(other)
                other = _uncounted(found)
        return self._counted(other)

    def fewer_for_help(self, offered: Callable[[Fineness], bool]) -> Result:
        """The result from the spec's own guess; if that leads nowhere, from the motion on fewer frames.

        Args:
            offered: whether there are fewer frames to be solved, of that fineness; called when they are needed.
        """
        found = self._on_all(self.options, None)
        with suppress(EndedError):  # while fewer frames were being derived
            for fineness in COARSE:
                if found.status not in (Status.FAILED, Status.INFEASIBLE) or self._stopped:
                    break
                self._count(found)
                found = _uncounted(found)
                if self._over or not offered(fineness):
                    break
                before = self._before()
                if before.status != "optimal" or self._over:
                    continue
                other = self._on_all(self._from_other_frames(), self.start(before))
                if other.status is Status.OPTIMAL:
                    return self._counted(other)
                self._count(other)
        return self._counted(found)

    def _on_all(self, options: Options, start: Start | None) -> Result:
        """Solve on all frames, and keep the best of all such solves."""
        found = self.fine(options, start, self._teller)
        if self._best is None or self._rank(found) < self._rank(self._best):
            self._best = found
        return found

    def _rank(self, found: Result) -> tuple[float, float]:
        """A sort key of points: smaller for better ones, feasible ones first."""
        violated = found.violation > self.options.feasibility_tolerance
        return found.violation if violated else 0.0, found.objective

    def _before(self) -> Solution:
        """The motion on fewer frames, counted."""
        # Not to a rougher tolerance: multipliers would not tell any more which constraints are active.
        before = self.coarse(self._attempt(), self._afar)
        self._count(before)
        self._stopped = self._stopped or before.status == "interrupted"
        return before

    @property
    def _over(self) -> bool:
        """Whether a limit of the whole solve is reached."""
        return self._iterations >= self.options.max_iterations or deadline.left() <= 0.0

    def _left(self) -> Options:
        """The options with the remaining limits; zero if the user has stopped the solve."""
        most = 0 if self._stopped else max(0, self.options.max_iterations - self._iterations)
        return replace(self.options, max_iterations=most)

    def _attempt(self) -> Options:
        """The options of a solve that is given up after some iterations without success."""
        left = self._left()
        return replace(left, max_iterations=min(left.max_iterations, ITERATIONS), retries=0)

    def _from_other_frames(self) -> Options:
        """The options of an attempt on all frames that starts from a motion on other frames."""
        return replace(self._attempt(), warm_start=True, trusting=False)

    def _count(self, done: Solution | Result) -> None:
        self._iterations += done.iterations
        self._factorizations += done.factorizations

    def _counted(self, result: Result) -> Result:
        """The result with the totals of all solves and, if it is not a solution, with the best point of all."""
        if result.status is not Status.OPTIMAL:
            result = self._with_best(result)
        if not (self._iterations or self._factorizations):
            return result
        return replace(
            result,
            iterations=result.iterations + self._iterations,
            factorizations=result.factorizations + self._factorizations,
        )

    def _with_best(self, result: Result) -> Result:
        """The best point of all solves on all frames, with the status that what has happened allows."""
        best = self._best
        assert best is not None
        status = result.status
        if self._stopped:
            status = Status.INTERRUPTED
        elif status is Status.INFEASIBLE and self._rank(best)[0] == 0.0:
            status = Status.FAILED
        if status is not result.status:
            result = replace(result, status=status, message=f"{sentence(status)} {advice(status)}")
        if status is Status.UNBOUNDED or not self._rank(best) < self._rank(result):
            return result
        return replace(
            best,
            status=result.status,
            message=result.message,
            iterations=result.iterations,
            factorizations=result.factorizations,
            history=result.history,
        )

    @property
    def _teller(self) -> Callback | None:
        """The callback of the solves; None if there is none, which saves time."""
        return self._told if self.callback is not None else None

    @property
    def _afar(self) -> Callback | None:
        """The callback for solves on fewer frames, if there is one."""
        return self._told_from_afar if self.callback is not None else None

    def _told(self, record: IterationRecord) -> bool:
        """Pass a record on, with the earlier iterations counted."""
        assert self.callback is not None
        if self.callback(replace(record, iteration=record.iteration + self._iterations)):
            self._stopped = True
        return self._stopped

    def _told_from_afar(self, record: IterationRecord) -> bool:
        """Pass on a record of a solve on fewer frames, without its variables, which differ from those on all frames."""
        return self._told(replace(record, x=None))
