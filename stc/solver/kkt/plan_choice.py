"""Which of several plans for segments to try for a matrix, and when to make another one.

A plan fixes the pivots; which plan suits a matrix shows when it is tried. One is made for the first matrix without
curvature, one for the first with it, one more when the entries have reached their sizes, and others when those have
failed so often that falling back has cost as much as planning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from stc.core.calls import Bound
from stc.records import dataclass, field
from stc.solver.kkt.contract import COARSE, REPORT
from stc.solver.kkt.lane_state import LARGEST
from stc.solver.nlp import Floats

__all__ = ["Plans", "Prepared"]

#: Another plan takes as long as ``MultifrontalKKT`` takes for matrices of so many unknowns together: it is made when
#: all plans have failed for so many.
PLANNING = 13_000
#: Plans that are kept; after so many matrices one that failed may be replaced.
PLANS = 4
MATRICES = 40
#: When a plan has served so many matrices, or as many more as take as long as planning does, another one is made with
#: more effort, and used if it takes this share of the operations at most: once early, and once more where that was in
#: vain.
SETTLED = (6, 30)
FEWER = 0.97
#: It is given up at once where its factors have to be tried on a right-hand side, that leaves more than solves are
#: content with, and what tests its pivots is so many times larger than it was before: to refine solutions takes longer
#: then than fewer operations save.
DOUBTED = 3.0
#: How much the last matrix counts in the share of matrices that a plan suits, and the share that makes a trial worth
#: its while.
RECENT = 0.3
UNLIKELY = 0.2
#: Each plan in a row that does not even suit the matrix for which it was made has the next one wait for twice as many,
#: up to this power of two.
MOST_FUTILE = 6
#: A number of matrices that is never reached.
FAR = 2**62
#: A cheaper plan that has failed is tried again after twice so many matrices, then twice as many each time, up to this
#: power of two.
RESTING = 2
LONGEST_REST = 8
#: After so many matrices in a row that no plan suited, plans are not tried for one matrix, then for twice as many each
#: time, up to this power of two.
PATIENCE = 3
LONGEST_PAUSE = 4


@dataclass
class Prepared:
    """Calls for one plan, and what they work with; how it has done."""

    slot: int  # where its calls are in the system's table
    tables: tuple[Any, ...]
    factors: Floats
    state: Floats
    space: tuple[Floats, ...]
    equilibrate: Bound
    operations: int
    effort: int  # so many operations take as long as it takes to make such a plan with more effort
    curved: bool  # whether H was not zero when it was made
    won: float = 0.0  # share of the last matrices that it suited
    served: int = 0  # matrices that it suited
    served_before: int = 0  # those before the last restart
    failed: int = 0  # times in a row that it did not
    rest_until: int = 0  # the matrix from which on it may be tried again
    suited_from: int = 0  # the first matrix since the last restart that it suited, counted from 1, or 0
    suits_from: int = 0  # the same of the last time that it suited any
    likely_from: int = (
        0  # from which one on it may suit, where it was made later than that, until it has suited one
    )
    is_accurate: Bound | None = None  # as soon as all its calls are made
    probed: Floats = field(default_factory=lambda: np.zeros(REPORT))  # what its probe reports

    def suited(self, matrices: int = 1) -> None:
        """Note that it did, for so many in a row."""
        self.won = 1.0 - (1.0 - RECENT) ** matrices * (1.0 - self.won)
        self.served += matrices
        self.failed = 0

    def refused(self, number: int) -> None:
        """Note that it did not, for the matrix of that number."""
        self.won -= RECENT * self.won
        self.rest_until = number + self.rest_next
        self.failed += 1

    @property
    def rest_next(self) -> int:
        """So many matrices it is to rest for when it is refused once more."""
        return RESTING * 2 ** min(self.failed + 1, LONGEST_REST)


#: Makes a plan for the matrix at hand: in one way for 0, in the best of several for 1; then in the second best of these
#: for 2, and so on, or none when there are no more.
Make = Callable[[int], Prepared | None]


class Plans:
    """The plans of one system.

    Attributes:
        now: the plan in use.
        tried: matrices for which plans were tried.
    """

    def __init__(self, unknowns: int, first: Prepared) -> None:
        """``first`` stands in before there is a plan."""
        self.now = first
        self.tried = 0
        self._unknowns = unknowns
        self._plans: list[Prepared] = []
        self._known_cheaper: dict[int, list[Prepared]] = {}
        self._next_at = self._missed = 0
        self._latest: Prepared | None = None  # the plan that was made for a matrix which no other one suited
        self._futile = 0  # how often in a row that did not suit it either, up to a limit
        self._failures = self._pause = 0
        self._choose_at = 0  # the matrix from which on the plan to begin with is to be chosen anew
        self._settled = 0  # how often another one was made with more effort, or all there is to it
        self._number = (
            0  # of the last plan made with more effort, among those that were found at the same time
        )
        self._begun_at = 0  # the number of matrices before the last restart
        # One made for its few operations and not yet tried, and what tested the pivots of that before it.
        self._frugal: tuple[Prepared, float] | None = None

    def __iter__(self) -> Iterator[Prepared]:
        return iter(self._plans)

    def restart(self) -> None:
        """Take up the plans in the same order as at first, each where it has first suited since the last time."""
        self._failures = self._pause = self._choose_at = 0
        self._begun_at = self.tried
        for plan in self._plans:
            plan.suits_from = plan.suited_from or plan.suits_from
            plan.suited_from = 0
            plan.served_before = plan.served
            if plan.suits_from:
                plan.failed = 0
                plan.rest_until = self.tried + plan.suits_from
        if self._plans:
            self.now = self._plans[0]

    def paused(self) -> bool:
        """Whether none is to be tried for the next matrix."""
        if self._pause > 0:
            self._pause -= 1
            return True
        self.tried += 1
        return False

    def candidates(self, curved: bool, make: Make) -> Iterator[Prepared]:
        """Plans to try for the matrix at hand, each in use meanwhile: that in use, others that suited some, a new one.

        Args:
            curved: whether its H is not zero.
            make: plans for it, see ``Make``.
        """
        first = self.now
        if self.tried >= self._choose_at or first.curved != curved:
            first = self._first(curved, make)
            self._take_up(first, self.tried)
        yield first
        # Those for matrices of the other kind do not suit this one.
        alike = (plan for plan in self._plans if plan is not first and plan.curved == curved)
        others = (plan for plan in alike if plan.won > UNLIKELY)
        for plan in sorted(others, key=lambda plan: -plan.won):
            self._take_up(plan, self.tried)
            yield plan
        self._choose_at = 0
        self._missed += self._unknowns
        if self._missed < (max(PLANNING, self._unknowns) << self._futile if self._futile else PLANNING):
            return
        if len(self._plans) == PLANS:
            if self.tried < self._next_at:
                return
            del self._plans[min(range(PLANS), key=lambda k: self._plans[k].won)]
        self.now = self._latest = self._another(make)
        yield self.now

    @property
    def _settle_at(self) -> int:
        """How many matrices the plan in use is to serve before another one is made with more effort."""
        if self._settled >= len(SETTLED):
            return FAR
        now = self.now
        return SETTLED[self._settled] * max(1, now.effort // max(1, SETTLED[0] * now.operations))

    def _settles_after(self, number: int) -> int:
        """In how many matrices from that one on it is time for that.

        Where solves are short, that is early in one of them, but when the entries have reached their sizes.
        """
        now = self.now
        if now.served_before >= self._settle_at:
            return now.suits_from + SETTLED[0] - (number - self._begun_at)
        return self._settle_at - (now.served - now.served_before)

    def _take_up(self, plan: Prepared, number: int) -> None:
        """Use a plan from a matrix on, until another one is to be tried again, or more is known of this one."""
        self.now = plan
        self._choose_at = number + 1
        if plan.served > 0:
            last = number + max(1, self._settles_after(number)) if plan.curved else FAR
            self._choose_at = min([last, *(other.rest_until for other in self._cheaper(plan))])

    def begin(self) -> None:
        """Take up the plan for the first matrix since a restart, where it is like the one at that time."""
        now = self.now
        number = self.tried + 1
        if now.served > 0 and not (now.curved and self._settles_after(number) <= 0):
            self._take_up(self._rested(now, number), number)

    def foresee(self) -> None:
        """Take up the plan that matrices with curvature have begun with before, where there is one."""
        if self.now.curved:
            return
        alike = [plan for plan in self._plans if plan.curved]
        if alike:
            self._take_up(self._earliest(alike), self.tried + 1)

    @property
    def certain(self) -> int:
        """So many of the next matrices, if they are alike, are tried with the plan in use first."""
        return 0 if self._pause else max(0, self._choose_at - 1 - self.tried)

    @property
    def due(self) -> tuple[Prepared, int, int] | None:
        """The old plan to try after those, if one is; how long to stay with that, or else with the one in use."""
        if self._pause or self.now.served == 0 or (self.now.curved and self._settled == 0):
            return None
        cheaper = self._cheaper(self.now)
        other = next((plan for plan in cheaper if plan.rest_until <= self._choose_at), None)
        if other is None or other.served == 0:
            return None
        suited = min((plan.rest_until for plan in self._cheaper(other)), default=FAR)
        later = [plan.rest_until for plan in cheaper if plan is not other]
        refused = min([self._choose_at + other.rest_next, *later])
        return other, max(0, suited - self._choose_at - 1), max(0, refused - self._choose_at - 1)

    def went_well(self, matrices: int) -> None:
        """Note that so many were factorised by the plan in use."""
        self._note_first(self.now, self.tried + 1)
        self.tried += matrices
        self.now.suited(matrices)
        self.succeeded()

    def tried_other(self, other: Prepared, suited: bool) -> None:
        """Note what came of a plan that was due, for the next matrix."""
        if suited:
            self._take_up(other, self.tried + 1)
        else:
            other.refused(self.tried + 1)
            self._take_up(self.now, self.tried + 1)

    def suited(self, plan: Prepared) -> None:
        """Note that a plan did, for the last matrix."""
        if plan is self._latest:
            self._futile, self._latest = 0, None
        self._note_first(plan, self.tried)
        plan.suited()

    def disappoints(self, plan: Prepared) -> bool:
        """Whether a plan that the last matrix suited was made for its few operations, but is less accurate.

        It is given up then.
        """
        if self._frugal is None or self._frugal[0] is not plan:
            return False
        largest = self._frugal[1]
        if plan.probed[0] <= COARSE or plan.state[LARGEST] <= DOUBTED * largest:
            self._frugal = None
            return False
        self._give_up(plan)
        return True

    def refused(self, plan: Prepared) -> None:
        """Note that a plan did not suit the last matrix."""
        if self._frugal is not None and self._frugal[0] is plan:
            self._give_up(plan)
        else:
            plan.refused(self.tried)

    def _give_up(self, plan: Prepared) -> None:
        """Forget a plan that was made for its few operations; the one with the next fewest is tried then."""
        self._plans = [other for other in self._plans if other is not plan]
        self._known_cheaper.clear()
        self._frugal = None
        self._settled = 0

    def _note_first(self, plan: Prepared, number: int) -> None:
        if not plan.suited_from:
            plan.suited_from = number - self._begun_at
            if plan.likely_from:
                plan.suited_from = min(plan.suited_from, plan.likely_from)
                plan.likely_from = 0

    def succeeded(self) -> None:
        """The factors of the plan in use are good."""
        self._failures = 0

    def failed(self) -> None:
        """None of the candidates would do."""
        self.now = max(self._plans, key=lambda plan: plan.won)
        if self._latest is not None and self._latest.served == 0:
            self._futile = min(self._futile + 1, MOST_FUTILE)
        self._latest = None
        self._failures += 1
        if self._failures >= PATIENCE:
            self._pause = 2 ** min(self._failures - PATIENCE, LONGEST_PAUSE)

    def _first(self, curved: bool, make: Make) -> Prepared:
        """The plan in use, or the latest, of those that were made where H was zero or of the others."""
        now = self.now
        is_settled = not curved or self._settles_after(self.tried) > 0
        if now.served > 0 and now.curved == curved and is_settled:
            return self._rested(now, self.tried)
        alike = [plan for plan in self._plans if plan.curved == curved]
        if not alike and len(self._plans) < PLANS:
            return self._another(make)
        if alike and now.curved != curved:
            return self._earliest(alike)
        if not is_settled:
            # By now the entries have the sizes that they will keep.
            self._number += 1
            other = make(self._number)
            found = other is not None and other.operations < FEWER * now.operations
            self._settled = len(SETTLED) if found else self._settled + 1
            while self._settle_at <= now.served:
                self._settled += 1
            if not found:
                self._number = 0
            if other is not None and found and len(self._plans) < PLANS:
                self._keep(other)
                self._frugal = other, float(now.state[LARGEST])
                if now.suited_from:
                    # It is made late, for the time that takes, but may suit all matrices but the earliest.
                    other.likely_from = now.suited_from + SETTLED[0]
                return other
        return now

    def _rested(self, now: Prepared, number: int) -> Prepared:
        """A cheaper plan that may be tried again from the matrix of that number on, or this one."""
        return next((plan for plan in self._cheaper(now) if plan.rest_until <= number), now)

    def _earliest(self, alike: list[Prepared]) -> Prepared:
        """That of some plans that may be tried first, the latest of several."""
        likely = [plan for plan in alike if plan.won > UNLIKELY or plan is alike[0]]
        return min(reversed(likely), key=lambda plan: plan.rest_until)

    def _cheaper(self, now: Prepared) -> list[Prepared]:
        """Other plans for such matrices that take fewer operations, those with the fewest first."""
        known = self._known_cheaper.get(now.slot)
        if known is None:
            most = FEWER * now.operations
            cheaper = (plan for plan in self._plans if plan.curved == now.curved and plan.operations < most)
            known = self._known_cheaper[now.slot] = sorted(cheaper, key=lambda plan: plan.operations)
        return known

    def _keep(self, plan: Prepared) -> None:
        self._plans.append(plan)
        self._known_cheaper.clear()

    def _another(self, make: Make) -> Prepared:
        self._missed = 0
        self._next_at = self.tried + MATRICES
        made = make(0)
        assert made is not None
        self._keep(made)
        return self._plans[-1]
