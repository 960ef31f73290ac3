"""A KKT system whose pivots are fixed before, by one of several plans, and tested while they are taken.

How the unknowns are gone through is up to ``SegmentedKKT`` and ``ChainKKT``.  What they have in common is here: which
plan to try for a matrix (see stc.solver.kkt.plan_choice), and the way out through ``MultifrontalKKT``, which pivots as
the values ask for, when a test fails with every plan.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros, scattered
from stc.core.calls import Bound, CallTable, chain_until
from stc.solver.kkt import plan_calls
from stc.solver.kkt.contract import FINE, REPORT, Inertia, NotFinite
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.entries import Arrays, ByCopies
from stc.solver.kkt.lane_state import COUNTED, DISTANCE, FETCHED, LARGEST, STATE, STREAMED, TRUSTED, UNWATCHED
from stc.solver.kkt.multifrontal import DOUBTFUL, MultifrontalKKT
from stc.solver.kkt.plan_choice import PLANS, Plans, Prepared
from stc.solver.kkt.segmented_passes import diagonal_of
from stc.solver.nlp import Floats

__all__ = ["GROWTH", "INVERSE", "ROOM", "SWEEPS", "WHOLE", "PlannedKKT", "new_state"]

#: No product that is subtracted may exceed this, nor any entry of an inverted pivot, in the equilibrated matrix.
GROWTH = 1e16
INVERSE = 1e15
#: Where they are larger than this share of it, the factors are tried on a right-hand side.
SUSPECT = 1e-6
#: Steps of iterative refinement at most.
REFINEMENTS = 10
#: The place of the elimination among the steps of an attempt, counted from 1; the rest and the end follow.
ELIMINATED = 3
#: The place in the table of what factorises the whole matrix; one plan may be made before it is kept.
WHOLE = PLANS + 1
#: Room for factors, as a multiple of what the first plan needs.
ROOM = 1.25
#: Sweeps of equilibration at most. Each takes the root of what is left to do: shifts of 1e40 need them all, and where
#: they were too few, regular matrices came out as singular.
SWEEPS = 12
#: Factors of so many bytes leave a processor's own memory; so many numbers before their place is written it is asked
#: for. Any distance from 800 to 1600 serves as well; with 400 it comes too late.
NEAR = 3 * 2**19
AHEAD = 1200
#: Factors of so many bytes leave what processors share as well: they are written past it, and substitutions, which read
#: them in order, wait for memory only there.
DISTANT = 2**22
#: With factors of so many bytes the matrix, and what is known of its order, have left it when they are needed again.
FAR = 2**24


def new_state(factors: Floats) -> Floats:
    """What an elimination needs to know and tells (see stc.solver.kkt.lane_state), for factors of that size."""
    state = aligned_zeros(STATE)
    state[TRUSTED] = SUSPECT
    state[DISTANCE] = AHEAD if factors.nbytes > NEAR else 0
    state[STREAMED] = 1.0 if factors.nbytes > DISTANT else 0.0
    state[FETCHED] = 1.0 if factors.nbytes > FAR else 0.0
    return state


def reading_distance(factors: Floats) -> int:
    """How far ahead substitutions ask for memory, 0 where it is near."""
    return AHEAD if factors.nbytes > DISTANT else 0


class PlannedKKT(ByCopies):
    """Sparse LDL^T by plans, or else by ``MultifrontalKKT``.

    See ``AttachedKKT`` for the members.  Whoever inherits sets ``_scale``, ``_vectors`` for solves, as many for either
    of two, and ``_plans`` with one that can only equilibrate, when it knows how.

    Attributes:
        tells_of_entries: whether the elimination fails where an entry is not finite, so that they need not be looked at
            before: that is to read all of the matrix once more.
    """

    tells_of_entries = False

    _scale: Floats
    _vectors: list[Floats]
    _plans: Plans

    def __init__(
        self,
        couplings: Couplings,
        stage: NDArray[np.int64],
        arrays: Arrays,
        rest: MultifrontalKKT | None = None,
    ) -> None:
        """``rest`` is what a plan leaves, as a system of its own, if it leaves anything.

        Vectors of ``arrays`` may have more unknowns than ``couplings``.
        """
        self.n, self.m = couplings.n, couplings.m
        self.inertia = np.zeros(3, dtype=np.int64)
        self._tally = np.zeros(plan_calls.TALLY, dtype=np.int64)
        self._counted = 0
        self.nnz_factor = 0
        self.last_residual = 0.0
        self._couplings, self._stage = couplings, stage
        self._arrays = a = arrays
        self.hess, self.jac, self.primal, self.dual = a.hess, a.jac, a.primal, a.dual
        self.rhs, self.solution, self.second_rhs, self.second_solution = (
            vector[: couplings.size] for vector in (a.rhs, a.solution, a.second_rhs, a.second_solution)
        )
        self.report, self.accuracy = a.report, a.accuracy
        size = a.rhs.size
        self._curved_source = couplings.hess_diagonal.astype(np.int32)
        self._diagonal, self._curvatures = np.zeros(size), np.zeros(1, dtype=np.int64)
        given = couplings.hess_count + couplings.jac_count
        self._collect_checked, self._collect = (
            diagonal_of.bind(
                self.n, self.m, given, couplings.hess_count, self._curved_source.size, couplings.hess_variable,
                self._curved_source, checked, a.given, self._diagonal, self._curvatures,
            )
            for checked in (given, 0 if self.tells_of_entries else given)
        )  # fmt: skip
        self._tally[plan_calls.FRESH] = 1
        self._rest = rest
        self._whole: MultifrontalKKT | None = None
        self._trusts_small_pivots = False
        self._rest_inertia = np.zeros(3, dtype=np.int64) if rest is None else rest.inertia
        self._eliminated = size - (0 if rest is None else rest.rhs.size)
        self._added = (size - couplings.size) // 2
        self._probe_rhs = np.copysign(1.0, scattered(size))
        self._probe_result = np.zeros(size)
        self._factorized = False
        self._factors = aligned_zeros(0)
        self._calls = CallTable(plan_calls.CALLS * (WHOLE + 1))
        self._eliminate = plan_calls.eliminate.bind(self._calls.cells, self._tally)
        self._solve, self._solve_both = (
            plan_calls.solve.bind(self._calls.cells, which, self._tally)
            for which in (plan_calls.SOLVE, plan_calls.SOLVE_BOTH)
        )
        self._begin = plan_calls.begin.bind(0, self._curvatures, self._calls.cells, self._tally)
        rests = [] if rest is None else [(rest.refactor_call, True)]
        end = plan_calls.end.bind(self._calls.cells, self._tally)
        self._attempt = chain_until(
            [(self._collect, True), (self._begin, True), (self._eliminate, True), *rests, (end, True)]
        )
        self._offered: Prepared | None = None
        self._found_by_effort: list[Any] = []  # programs of the last thorough search

    @property
    @abstractmethod
    def nbytes(self) -> int:
        """Memory held, about."""

    @abstractmethod
    def _programs(self, thorough: bool) -> list[Any]:
        """Plan the pivots for values like those of the matrix at hand, without p: those of the fewest operations first.

        What barrier and shifts add to the diagonal comes and goes: pivots that need it would fail sooner or later.
        """

    @abstractmethod
    def _prepare(self, programs: Any, slot: int) -> Prepared:
        """Prepare the calls that depend on the plan; ``slot`` is its place in the table."""

    @abstractmethod
    def _prepare_solve(
        self,
        plan: Prepared,
        place: int,
        refinements: int,
        vectors: tuple[Floats, ...],
        reports: tuple[Floats, Floats],
    ) -> Bound:
        """Prepare a solve by a plan.

        Args:
            place: PROBE, SOLVE or SOLVE_BOTH, which is for two right-hand sides.
            vectors: for either right-hand side: itself, ``_vectors``, the solution.
            reports: of either; see ``contract.REPORT``.
        """

    def _own_diagonal(self) -> Floats:
        """The diagonal of H and -d, of all unknowns but those added."""
        diagonal = np.concatenate([np.zeros(self.n), -self.dual])
        diagonal[self._couplings.hess_variable] += self._arrays.given[self._curved_source]
        return diagonal

    @property
    def factorizations(self) -> int:
        """See ``KKTSystem.factorizations``."""
        tally = self._tally
        before = int(tally[plan_calls.MADE_BEFORE]) if tally[plan_calls.OUTCOME] else 0
        return self._counted + before + int(tally[plan_calls.MADE])

    def restart(self) -> None:
        """Forget all matrices, as if new, but not the plans: they are taken up in the same order."""
        self._take_attempts()
        self._counted = 0
        self.last_residual = 0.0
        self._tally[plan_calls.FRESH] = 1
        self._scale[:] = 1.0
        self._plans.restart()
        for plan in self._plans:
            plan.state[TRUSTED], plan.state[UNWATCHED] = SUSPECT, 0.0
        self._factorized = False
        if self._rest is not None:
            self._rest.restart()
        if self._whole is not None:
            self._whole.restart()
        self._trusts_small_pivots = False

    def trust_small_pivots(self, trusted: bool) -> None:
        """See ``AttachedKKT.trust_small_pivots``."""
        self._trusts_small_pivots = trusted
        if self._rest is not None:
            self._rest.trust_small_pivots(trusted)
        if self._whole is not None:
            self._whole.trust_small_pivots(trusted)

    @property
    def operations(self) -> int:
        """Additions and multiplications of the last factorisation, updates only."""
        if not self._by_plan:
            return self._whole.operations if self._whole is not None else 0
        return self._plan_in_use().operations + (0 if self._rest is None else self._rest.operations)

    @property
    def factor_bytes(self) -> int:
        """Memory that the last factorisation fills."""
        if not self._by_plan:
            return self._whole.factor_bytes if self._whole is not None else 0
        return self._plan_in_use().factors.nbytes + (0 if self._rest is None else self._rest.factor_bytes)

    def refactor(self) -> Inertia:
        """See ``AttachedKKT.refactor``."""
        call = self._next_attempt()
        if call is None:
            return self._refactor()
        ended = call()
        if ended:
            return self.resume(ended)
        self._factorized = True
        return Inertia(*self.inertia.tolist())

    def _refactor(self) -> Inertia:
        """``refactor``, one step after the other."""
        self._factorized = False
        self._take_attempts()
        # Whoever still has an attempt made ready before, and makes it afterwards, is to ask for another one: the plan
        # that was tried last may not even have been bound.
        self._tally[plan_calls.ALLOWED], self._tally[plan_calls.OTHER] = 0, -1
        self._collect_all()
        if self._tally[plan_calls.FRESH]:
            self._plans.now.equilibrate()
            self._tally[plan_calls.FRESH] = 0
        return self._complete(None)

    def _plan_in_use(self) -> Prepared:
        """The plan of the factors."""
        self._take_attempts()
        slot = int(self._tally[plan_calls.NOW])
        return next((plan for plan in self._plans if plan.slot == slot), self._plans.now)

    @property
    def attempt_call(self) -> Bound | None:
        """See ``AttachedKKT.attempt_call``."""
        return self._next_attempt() if self._factorized else None

    def _next_attempt(self) -> Bound | None:
        """The same, also for the first matrix since a restart."""
        plans, tally = self._plans, self._tally
        first = bool(tally[plan_calls.FRESH])
        if not (self._factorized or first):
            return None
        self._take_attempts()
        if first:
            plans.begin()
        else:
            plans.foresee()
        if plans.now.is_accurate is None:  # not prepared to solve
            return None
        tally[plan_calls.NEXT], tally[plan_calls.ALLOWED] = plans.now.slot, plans.certain
        tally[plan_calls.OTHER] = -1
        due = plans.due
        if due is not None and due[0].is_accurate is not None:
            self._offered, tally[plan_calls.IF_SUITED], tally[plan_calls.IF_REFUSED] = due
            tally[plan_calls.OTHER] = self._offered.slot
        self._begin.set("curved", plans.now.curved)
        return self._attempt

    def resume(self, ended: int) -> Inertia:
        """See ``AttachedKKT.resume``."""
        if ended < ELIMINATED:
            return self._refactor()
        self._factorized = False
        self._take_attempts()
        return self._complete(ended)

    def _take_attempts(self) -> None:
        """Note what has come of the attempts."""
        tally = self._tally
        outcome = int(tally[plan_calls.OUTCOME])
        if outcome:
            assert self._offered is not None
            tally[plan_calls.OUTCOME] = 0
            self._note_made(int(tally[plan_calls.MADE_BEFORE]))
            self._plans.tried_other(self._offered, outcome == plan_calls.SUITED)
        self._note_made(int(tally[plan_calls.MADE]))
        tally[plan_calls.MADE] = 0

    def _note_made(self, made: int) -> None:
        if made:
            self._counted += made
            self._plans.went_well(made)

    def _collect_all(self) -> None:
        """Collect the diagonal, and look at all entries.

        Raises:
            NotFinite: one of them is not.
        """
        if self._collect_checked():
            # An elimination may have had another scale sought for them.
            self._scale[:] = 1.0
            self._tally[plan_calls.FRESH] = 1
            raise NotFinite("the KKT matrix has entries that are not finite")

    def _complete(self, ended: int | None) -> Inertia:
        """Factorise the matrix, collected and scaled; ``ended`` tells of an attempt."""
        if ended == ELIMINATED and self.tells_of_entries:
            self._collect_all()
        self._counted += 1
        self.accuracy[0] = FINE
        inertia = self._refactor_by_plans(ended)
        if inertia is None:
            inertia = self._refactor_whole()
        self._factorized = True
        return inertia

    @property
    def _by_plan(self) -> bool:
        """Whether the factors at hand are those of a plan."""
        return int(self._tally[plan_calls.NOW]) != WHOLE

    def check_solution(self) -> bool:
        """See ``AttachedKKT.check_solution``."""
        repeated = False
        if self._by_plan:
            if self.report[0] > DOUBTFUL:
                for plan in self._plans:
                    plan.state[TRUSTED] = SUSPECT
                self._counted += 1
                self._refactor_whole()
                self._solve()
                repeated = True
            self.last_residual = float(self.report[0])
        if not self._by_plan:
            assert self._whole is not None
            before = self._whole.factorizations
            if self._whole.check_solution():
                repeated = True
                self.nnz_factor = self._whole.nnz_factor
            self._counted += self._whole.factorizations - before
            self.last_residual = self._whole.last_residual
        return repeated

    def _refactor_by_plans(self, ended: int | None) -> Inertia | None:
        """Inertia, or None when a pivot is not good enough; ``ended`` tells of an attempt with the plan in use."""
        plans = self._plans
        if plans.paused():
            return None
        rest = None
        for plan in plans.candidates(bool(self._curvatures[0]), self._new_plan):
            rest = self._through(plan, ended)
            ended = None
            if rest is not None:
                if rest.zero > 0:
                    return None
                if self._has_proved(plan):
                    if plans.disappoints(plan):
                        rest = None
                        continue
                    plans.suited(plan)
                    break
                if plan.probed[2] >= plan_calls.SINGULAR:
                    return None  # no plan can help that
                rest = None
            plans.refused(plan)
        if rest is None:
            plans.failed()
            return None
        now = plans.now
        plans.succeeded()
        self.nnz_factor = now.factors.size + (0 if self._rest is None else self._rest.nnz_factor)
        negative = int(now.state[COUNTED])
        # The seams have as many positive as negative eigenvalues.
        positive = self._eliminated - negative + rest.positive
        return Inertia(positive - self._added, negative + rest.negative - self._added, rest.zero)

    def _has_proved(self, plan: Prepared) -> bool:
        """Whether the factors of a plan are accurate; prepares to solve with them."""
        if plan.is_accurate is None:
            self._bind_solve(plan)
        assert plan.is_accurate is not None
        return not plan.state[LARGEST] > plan.state[TRUSTED] or bool(plan.is_accurate())

    def _through(self, plan: Prepared, ended: int | None) -> Inertia | None:
        """Factorise by a plan: the inertia of the rest, or None where a pivot is refused."""
        if ended is None:
            self._tally[plan_calls.NEXT], self._tally[plan_calls.OTHER] = plan.slot, -1
            if self._eliminate():
                return None
        elif ended == ELIMINATED:
            return None
        if self._rest is not None and ended in (None, ELIMINATED + 1):
            try:
                return self._rest.refactor()
            except NotFinite:
                return None  # growth has overflowed
        return Inertia(*self._rest_inertia.tolist())

    def _refactor_whole(self) -> Inertia:
        if self._whole is None:
            self._whole = MultifrontalKKT.of_couplings(self._couplings, self._stage, self._arrays)
            self._whole.trust_small_pivots(self._trusts_small_pivots)
            places = plan_calls.SOLVE, plan_calls.SOLVE_BOTH
            for place, call in zip(places, self._whole.calls_of_solves, strict=True):
                self._calls.put(plan_calls.CALLS * WHOLE + place, call)
        inertia = self._whole.refactor()
        self.nnz_factor = self._whole.nnz_factor
        self._tally[plan_calls.NOW] = WHOLE
        return inertia

    def _new_plan(self, number: int) -> Prepared | None:
        """See ``plan_choice.Make``."""
        slot = min(set(range(PLANS + 1)) - {plan.slot for plan in self._plans})
        if number == 0:
            return self._prepare(self._programs(False)[0], slot)
        if number == 1:
            self._found_by_effort = self._programs(True)
        if number > len(self._found_by_effort):
            return None
        return self._prepare(self._found_by_effort[number - 1], slot)

    def _bind_solve(self, plan: Prepared) -> None:
        """Prepare what follows an elimination by a plan."""
        cells, report = self._calls.cells, plan.probed
        end = plan_calls.end_of_plan.bind(
            cells, plan.slot, self._rest_inertia, self._eliminated, self._added, plan.state, report, FINE,
            self.inertia, self.accuracy, self._tally,
        )  # fmt: skip
        plan.is_accurate = plan_calls.is_accurate.bind(cells, plan.slot, report, plan.state)
        half = len(self._vectors) // 2
        one, other, arrays = self._vectors[:half], self._vectors[half:], self._arrays
        second = arrays.second_rhs, *other, arrays.second_solution
        both = arrays.rhs, *one, arrays.solution, *second
        probe = self._probe_rhs, *one, self._probe_result, *second
        beside = np.zeros(REPORT)
        self._calls.put(plan_calls.CALLS * plan.slot + plan_calls.END, end)
        for place, refinements, vectors, told in (
            (plan_calls.PROBE, 0, probe, report),
            (plan_calls.SOLVE, REFINEMENTS, both, self.report),
            (plan_calls.SOLVE_BOTH, REFINEMENTS, both, self.report),
        ):
            call = self._prepare_solve(plan, place, refinements, vectors, (told, beside))
            self._calls.put(plan_calls.CALLS * plan.slot + place, call)
