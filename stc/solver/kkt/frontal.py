"""The structured KKT system: LDL^T stage by stage in a small window, time and memory linear in the stages."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.core.calls import Bound, chain_until
from stc.solver.kkt import attempts, pivots
from stc.solver.kkt.arrangement import (
    Arrangement,
    Couplings,
    arrange,
    enter_window,
    tops_without_leaves,
    window_targets,
)
from stc.solver.kkt.contract import FINE, Inertia, NotFinite
from stc.solver.kkt.elimination import FACTORS_FULL, HOPELESS, factorize
from stc.solver.kkt.entries import Arrays, ByCopies
from stc.solver.kkt.panel import LARGEST_GROUP, MASKS
from stc.solver.kkt.planning import Plan, plan_elimination
from stc.solver.kkt.singularity import confirm_zeros
from stc.solver.kkt.staging import assign_stages
from stc.solver.kkt.substitution import REPORT, solve
from stc.solver.kkt.values import choose_plan, count_nonzero, equilibrate, load
from stc.solver.kkt.window import LANES
from stc.solver.nlp import Ints

__all__ = ["FrontalKKT"]

#: Pivot threshold u: no factor exceeds its inverse.
PIVOT_THRESHOLD = 1e-4
#: Where a solve leaves a larger relative residual than DOUBTFUL, the threshold is raised, up to the highest.
DOUBTFUL = 1e-9
HIGHEST_THRESHOLD = 0.3
#: Columns of the equilibrated matrix no larger than this, times their growth, are zero.
SINGULAR = 3e-14
#: Magnitude of the pivot that takes the place of a zero one.
REPLACEMENT = 1e-8
#: Where small pivots are trusted, those that exceed the noise in them so many times are not zero.
CERTAIN, NEVER = 1e3, 1e300
#: Sweeps of equilibration at most. Each takes the root of what is left to do: shifts of 1e40 need them all, and where
#: they were too few, regular matrices came out as singular.
SWEEPS = 12
#: A scale serves as long as the largest entries of all rows are within this factor of 1.
STALE = 4.0
#: For a matrix that comes scaled as part of another one, less is enough.
SWEEPS_OF_PART = 4
STALE_OF_PART = 64.0
#: Steps of iterative refinement at most.
REFINEMENTS = 10
#: A plan is made anew when what matrices cost beyond it (see stc.solver.kkt.attempts) adds up to the cost of planning:
#: in entries of the factor, this much at least, for each unknown of the stages that are ordered, and for each unknown.
PLANNING = 80_000
ORDERING = 1000
ARRANGING = 50
#: In a window of more slots an order costs more in proportion, since all of a row is looked at for each pivot; stages
#: that stray cost less, since columns are searched once and subtracted many times (measured up to 1200 slots).
WIDE_WINDOW = 220
#: A system taken over from an earlier solve counts as one that has been planned so often: its plan came from matrices
#: like those to come, and the first ones of a solve, which are unlike them, are no reason for another one.
SETTLED = 3
#: Entries that are always zero are left out where there are others of less than this share of all; when some of them
#: have turned out not to be zero so many times, all are kept.
FEW_ZEROS = 0.95
GROWTHS = 3
#: Entries of the factor that there is room for, to begin with, as a multiple of those planned.
ROOM = 1.5
#: Slots for delayed unknowns, to begin with.
HELD_SLOTS = 32
#: With more unknowns delayed than this, smaller pivots are taken instead: in matrices close to singular they would
#: gather, hundreds of them, and fill the window.
DELAYED_FREELY = 8
#: So many and half a window of unknowns that nothing eliminates tell of a singular matrix: to look at all of them at
#: every stage would take hundreds of times as long as a factorisation.
DELAYED_IN_VAIN = 24


#: The place of the elimination among the steps, counted from 1.
ELIMINATION = 4


class FrontalKKT(ByCopies):
    """Sparse LDL^T with threshold pivoting on a window that slides over the stages.

    The pattern is arranged at once; the order of elimination is planned from the values of the first
    factorisation. See ``AttachedKKT`` for the arguments and the other members.

    Attributes:
        pivot_threshold: u, between 0 and 0.5: larger is more accurate, smaller keeps closer to the plan.
    """

    def __init__(
        self,
        n: int,
        m: int,
        jac_rows: Ints,
        jac_cols: Ints,
        hess_rows: Ints,
        hess_cols: Ints,
        var_stage: Ints,
        row_stage: Ints,
        held: NDArray[np.bool_] | None = None,
    ) -> None:
        couplings = Couplings.of(n, m, jac_rows, jac_cols, hess_rows, hess_cols)
        stage = np.concatenate([np.asarray(given).astype(np.int64) for given in (var_stage, row_stage)])
        self._prepare(couplings, stage, Arrays.of(couplings))

    @classmethod
    def of_couplings(
        cls,
        couplings: Couplings,
        stage: NDArray[np.int64],
        arrays: Arrays,
        *,
        part_filled: NDArray[np.int64] | None = None,
    ) -> FrontalKKT:
        """For a pattern that is known already, whose rows may also couple with each other.

        Args:
            stage: elimination group of each unknown, (N,).
            arrays: those it works with.
            part_filled: given where the matrix is what the elimination of others has left, scaled: the unknowns whose
                diagonal entries that fills, whatever the pattern says.
        """
        system = cls.__new__(cls)
        system._prepare(couplings, stage, arrays, part_filled)
        return system

    def _prepare(
        self,
        couplings: Couplings,
        stage: NDArray[np.int64],
        arrays: Arrays,
        filled: NDArray[np.int64] | None = None,
    ) -> None:
        part = filled is not None
        self._scaling = (SWEEPS_OF_PART, STALE_OF_PART) if part else (SWEEPS, STALE)
        self.n, self.m = n, m = couplings.n, couplings.m
        self.inertia = np.zeros(3, dtype=np.int64)
        self._tally = np.zeros(attempts.TALLY, dtype=np.int64)
        self.account = np.zeros(attempts.ACCOUNT)
        self._has_served = attempts.has_served.bind(self.account)
        self._attempt: tuple[int, Bound, int] | None = None
        self.factorizations = 0
        self.nnz_factor = 0
        self.last_residual = 0.0
        self.pivot_threshold = PIVOT_THRESHOLD
        self._certain = np.array([NEVER])
        self._pattern = self._couplings = couplings
        self._present = np.zeros(couplings.first.size, dtype=bool)
        self._is_part = part
        self._growths = 0
        size = n + m
        self._structural_diagonal = np.zeros(size, dtype=bool)
        self._structural_diagonal[self._couplings.hess_variable] = True
        if filled is not None:
            self._structural_diagonal[filled] = True
        self._diagonal_seen = np.zeros(size, dtype=bool)
        self.given = arrays.given
        self.hess, self.jac, self.primal, self.dual = arrays.hess, arrays.jac, arrays.primal, arrays.dual
        self.rhs, self.solution = arrays.rhs, arrays.solution
        self.second_rhs, self.second_solution = arrays.second_rhs, arrays.second_solution
        self.report, self.accuracy = arrays.report, arrays.accuracy
        self._values = np.zeros(size + self._couplings.first.size)
        self._scale, self._most, self._inverse = np.zeros(size), np.zeros(size), np.zeros(3 * size)
        self._zeros = np.zeros(size)
        self._vectors = [np.zeros(size) for _ in range(6)]
        self._slot = np.zeros(size, dtype=np.int32)
        self._pivots = np.zeros(2 * size, dtype=np.int32)
        self._starts = np.zeros(2 * size, dtype=np.int32)
        self._counts = np.zeros(pivots.COUNTS, dtype=np.int64)
        self._note_waste = attempts.note_waste.bind(self._counts, self.account)
        self._found = self._counts.tolist()
        self._capacity = 0
        self._held_slots = HELD_SLOTS
        self.bindings = 0  # counts how often the arrays of the factors were replaced
        self._plans_made = 0
        self._plan: Plan | None = None
        self._factorized = False
        self._stage = stage
        self._arrange_anew(couplings)

    def _arrange_anew(self, couplings: Couplings) -> None:
        """Arrange a pattern by stages only: the order inside them is planned when there are values."""
        self._couplings, self._plan = couplings, None
        self._staging = assign_stages(self._stage, self.n, couplings.first, couplings.second)
        rank = np.zeros(couplings.size, dtype=np.int32)
        self._use(arrange(couplings, self._staging.stage, self._staging.stages, rank))

    def restart(self) -> None:
        """Forget all matrices, as if new, but not the plan."""
        self.factorizations = 0
        self.nnz_factor = 0
        self.last_residual = 0.0
        self.pivot_threshold = PIVOT_THRESHOLD
        self._plans_made = min(self._plans_made, SETTLED)
        if self._plan is not None:
            wasted = self.account[attempts.WASTED]  # many short solves are to be worth another plan as well
            self._open_account()
            self.account[attempts.WASTED] = wasted
        self._scale[:] = 1.0
        self._factorized = False
        self._certain[0] = NEVER

    def trust_small_pivots(self, trusted: bool) -> None:
        """See ``AttachedKKT.trust_small_pivots``."""
        self._certain[0] = CERTAIN if trusted else NEVER

    @property
    def factorizations(self) -> int:
        """See ``KKTSystem.factorizations``."""
        return self._counted + int(self._tally[attempts.MADE])

    @factorizations.setter
    def factorizations(self, count: int) -> None:
        self._counted, self._tally[attempts.MADE] = count, 0

    @property
    def nbytes(self) -> int:
        """Memory held, about: the factors and the window, and the given matrix several times."""
        return (
            self._indices.nbytes + self._factors.nbytes + self._window.nbytes if self._plan is not None else 0
        ) + 12 * self._values.nbytes

    @property
    def operations(self) -> int:
        """Additions and multiplications of the last factorisation, updates of the window only."""
        used = int(self._counts[pivots.PIVOTS])
        lengths = self._starts[1 : 2 * used : 2]
        lengths = np.maximum(lengths, -1 - lengths)
        unknowns = np.where(self._pivots[1 : 2 * used : 2] < 0, 1, 2)
        return int((unknowns * lengths * (lengths + 1)).sum())

    @property
    def factor_bytes(self) -> int:
        """Memory that the last factorisation fills: entries, their indices, pivots."""
        counts = self._counts
        return int(8 * counts[pivots.FACTORS] + 4 * counts[pivots.INDICES] + 40 * counts[pivots.PIVOTS])

    def refactor(self) -> Inertia:
        """See ``AttachedKKT.refactor``."""
        self._factorized = False
        if self._load():
            raise NotFinite("the KKT matrix has entries that are not finite")
        self.factorizations += 1
        self.accuracy[0] = FINE
        planned = self._follow_plan()
        self._equilibrate()
        self._threshold = self.pivot_threshold
        self._eliminate_all(planned)
        return self._conclude()

    @property
    def attempt_call(self) -> Bound | None:
        """See ``AttachedKKT.attempt_call``."""
        if self._plan is None or not self._factorized or self._has_served():
            return None
        if self._attempt is None or self._attempt[0] != self.bindings:
            end = attempts.end.bind(
                self._counts, self.account, FINE, self.inertia, self.accuracy, self._tally
            )
            (load, _), *others = self.steps()
            first = [(load, True), (self._has_served, True)]
            if self._strangers is not None:
                first.append((self._strangers, True))
            elimination = len(first) + ELIMINATION - 1
            self._attempt = self.bindings, chain_until([*first, *others, (end, True)]), elimination
        self.follow()
        return self._attempt[1]

    def resume(self, ended: int) -> Inertia:
        """See ``AttachedKKT.resume``."""
        assert self._attempt is not None
        elimination = self._attempt[2]
        if ended > elimination:
            return self.complete(0)
        if ended == elimination:
            self._window[:] = 0.0  # as ever before it begins
        return self.refactor()

    def _conclude(self) -> Inertia:
        """What a factorisation has found."""
        self._note_waste()
        self._factorized = True
        return Inertia(*self._found[pivots.POSITIVE : pivots.ZERO + 1])

    @property
    def counts(self) -> NDArray[np.int64]:
        """What an elimination counts, (COUNTS,)."""
        return self._counts

    @property
    def follows_plan(self) -> bool:
        """Whether ``steps`` may be tried: there is a plan, and it has not wasted too much."""
        return self._plan is not None and self._strangers is None and not self._has_served()

    def steps(self) -> list[tuple[Bound, bool]]:
        """The calls of ``refactor`` where all goes to plan, for ``chain_until``; as long as ``bindings`` stays.

        ``prepare_steps`` comes before them and ``complete`` afterwards.
        """
        return [
            (self._load, False), (self._choose_plan, False), (self._equilibrate, False), (self._eliminate, True),
            (self._confirm_zeros, False),
        ]  # fmt: skip

    def prepare_steps(self) -> None:
        """Make ready for the steps."""
        self._factorized = False
        self.follow()

    def follow(self) -> None:
        """Let the next elimination follow the plan."""
        self._threshold = self.pivot_threshold
        self._eliminate.floats[self._threshold_at] = self._threshold

    def complete(self, ended: int) -> Inertia:
        """End a factorisation: all steps were made when ``ended`` is 0, else that one, from 1 on, was the last."""
        if ended:
            if ended == ELIMINATION:
                self._window[:] = 0.0  # as ever before it begins
            return self.refactor()
        self.factorizations += 1
        self.accuracy[0] = FINE
        self._take_counts()
        return self._conclude()

    def check_solution(self) -> bool:
        """See ``AttachedKKT.check_solution``."""
        repeated = False
        while self.report[0] > DOUBTFUL and self._raise_threshold():
            self._solve()
            repeated = True
        self.last_residual = float(self.report[0])
        return repeated

    def factors_in_order(self) -> tuple[Any, ...]:
        """What ``substitute`` needs, order and scale first, for a system that has this one as a part."""
        a = self._arrangement
        return (
            a.order, self._scale, self._counts, a.columns, self._values, self._pivots, self._starts, self._indices,
            self._factors, self._inverse, self._vectors[0], self._parts[0], self._vectors[1], self._parts[1],
        )  # fmt: skip

    def _raise_threshold(self) -> bool:
        """Factorise the same matrix again with a larger threshold; False when that cannot help."""
        if self._threshold >= HIGHEST_THRESHOLD or self._found[pivots.ZERO] > 0:
            return False
        self._threshold = min(max(10.0 * self._threshold, PIVOT_THRESHOLD), HIGHEST_THRESHOLD)
        self.factorizations += 1
        self._eliminate_all(bool(self._eliminate.integers[self._planned_at]))
        return True

    def _follow_plan(self) -> bool:
        """Make a plan when there is none, or none that suits; whether the plan's patterns hold for the values."""
        strangers = self._strangers is not None and self._strangers() > 0
        if self._plan is not None and not strangers and not self._has_served():
            if self._appeared() == 0:
                return True
            # What shifts leave on the diagonal comes again: the next plan is to hold for it.
            self._diagonal_seen[self._arrangement.order] |= self._values[: self.n + self.m] != 0.0
            return False
        if self._plans_made > 0 and not self._is_part:
            self._leave_out_zeros(strangers)
        size = self.n + self.m
        a = self._arrangement
        has_diagonal = self._structural_diagonal | self._diagonal_seen
        has_diagonal[a.order] |= self._values[:size] != 0.0
        self._plans_made += 1
        self._equilibrate()
        self._plan = plan_elimination(self._couplings, self._staging, a, self._values, has_diagonal)
        self._open_account()
        self._capacity = max(self._capacity, int(ROOM * self._plan.nnz) + 256)
        self._use(arrange(self._couplings, self._staging.stage, self._staging.stages, self._plan.rank))
        self._load()
        return True

    def _leave_out_zeros(self, strangers: bool) -> None:
        """Forget entries that have been zero whenever a plan was made, but for the first one.

        Derivatives have many of them: a tenth of all, and a quarter of the factor. ``strangers``: whether some of those
        left out are not zero now.
        """
        pattern = self._pattern
        self._growths += strangers
        if self._growths > GROWTHS:
            self._present[:] = True
        self._present |= np.concatenate([self.hess[pattern.hess_off], self.jac]) != 0.0
        kept = np.flatnonzero(self._present)
        if kept.size > FEW_ZEROS * self._present.size:
            kept = np.arange(self._present.size)
        if kept.size != self._couplings.first.size or strangers:
            self._arrange_anew(pattern.only(kept))
            self._load()

    def _open_account(self) -> None:
        """Begin to count what matrices cost beyond the plan."""
        assert self._plan is not None
        self.account[:] = 0.0, self._planning_cost(), self._plan.nnz, self._staging.stages * self._width()

    def _planning_cost(self) -> float:
        """What may be wasted with a plan before the next one: more each time, since some matrices suit none.

        The first plan comes from matrices of the beginning, often unlike all later ones.
        """
        assert self._plan is not None
        ordering = ORDERING * self._width() * self._plan.ordered
        cost = PLANNING + ordering + ARRANGING * (self.n + self.m)
        return cost * 0.5 * self._plans_made**2

    def _width(self) -> float:
        """How many times as wide as an ordinary one the window is, at least 1."""
        return max(1.0, self._staging.window / WIDE_WINDOW)

    def _use(self, arrangement: Arrangement) -> None:
        """Adopt an arrangement of the entries."""
        self._arrangement = a = arrangement
        self._scale[:] = 1.0
        size = self.n + self.m
        self._load = load.bind(
            self.n, self.m, self.hess.size, self.jac.size, self.hess, self.jac, self.primal, self.dual,
            a.position, a.hess_target, a.jac_target, self._values,
        )  # fmt: skip
        self._equilibrate = equilibrate.bind(
            size, *self._scaling, a.pointers, a.columns, self._values, self._scale, self._most
        )
        places = np.arange(size + self._couplings.first.size, self._values.size, dtype=np.int32)
        self._strangers = count_nonzero.bind(places.size, places, self._values) if places.size else None
        plan = self._plan
        if plan is None:
            return
        self._planned_slot = self._staging.slot[a.order]
        self._entering = enter_window(a, self._staging.stages)
        self._targets = np.empty_like(self._values, dtype=np.int32)
        self._inner_top = np.empty_like(self._staging.top)
        tops_without_leaves(
            self._staging.stages, a.stage_pointers, *self._entering, plan.group[a.order], self._planned_slot,
            self._inner_top,
        )  # fmt: skip
        parts = plan.kind, plan.group, plan.start, plan.count, plan.surplus_start, plan.surplus_count
        self._plan_arrays = tuple(part[a.order] for part in parts)
        self._absent = absent = np.flatnonzero(plan.no_diagonal[a.order]).astype(np.int32)
        self._appeared = count_nonzero.bind(absent.size, absent, self._values)
        self._allocate_window()
        self._allocate_factors()
        self._bind()

    def _eliminate_all(self, planned: bool) -> None:
        """Factorise the equilibrated values, making room until there is enough."""
        shortage = -1
        while shortage:
            self._eliminate.floats[self._threshold_at] = self._threshold
            self._eliminate.integers[self._planned_at] = planned
            shortage = self._eliminate()
            if shortage == HOPELESS:
                self._window[:] = 0.0
                break
            if shortage:
                self._enlarge(shortage)
                self._bind()
        else:
            self._confirm_zeros()
        self._take_counts()

    def _take_counts(self) -> None:
        self._found = self._counts.tolist()
        if self._found[pivots.ZERO] > 0 and not np.isfinite(self._window).all():
            self._window[:] = 0.0  # something has overflowed
        self.nnz_factor = self._found[pivots.FACTORS]

    def _enlarge(self, shortage: int) -> None:
        """Make room for what did not fit."""
        if shortage == FACTORS_FULL:
            self._capacity *= 2
            self._window[:] = 0.0
            self._allocate_factors()
        else:
            self._held_slots *= 2
            self._allocate_window()

    def _allocate_factors(self) -> None:
        self._indices = np.zeros(self._capacity, dtype=np.int32)
        self._factors = np.zeros(self._capacity + LANES)

    def _allocate_window(self) -> None:
        self._held_from = -(-self._staging.window // LANES) * LANES
        self._stride = stride = self._held_from + self._held_slots
        self._window = aligned_zeros(stride * stride)
        a = self._arrangement
        window_targets(self.n + self.m, a.pointers, a.columns, self._planned_slot, stride, self._targets)
        self._columns = [aligned_zeros(stride + 2 * LANES) for _ in range(7)]
        self._panels = [
            aligned_zeros(rows * (stride + 2 * LANES)) for rows in (LARGEST_GROUP, LARGEST_GROUP, LANES)
        ]
        self._lists = [np.zeros(stride + LARGEST_GROUP, dtype=np.int32) for _ in range(5)]

    def _bind(self) -> None:
        """Prepare the calls of the compiled functions."""
        self.bindings += 1
        a, staging, plan, size = self._arrangement, self._staging, self._plan, self.n + self.m
        assert plan is not None
        growth, spread_1, spread_2, values_1, values_2, first, second = self._columns
        owner, queue, found_1, found_2, found_12 = self._lists
        self._eliminate = factorize.bind(
            size, staging.stages, self.n, self.pivot_threshold, SINGULAR, REPLACEMENT, DELAYED_FREELY,
            self._held_from // 2 + DELAYED_IN_VAIN, self._capacity, self._stride, self._held_from, True,
            a.stage_pointers, a.pointers, a.columns, self._values, a.order, self._planned_slot, self._targets,
            *self._entering, self._inner_top, staging.top,
            *self._plan_arrays, plan.slots, plan.state, plan.state_starts, plan.state_rows, plan.state_columns,
            self._window, *self._panels, MASKS, spread_1, spread_2, self._slot, owner, growth, queue, found_1, found_2,
            found_12, values_1, values_2, first, second, self._pivots, self._starts, self._indices, self._factors,
            self._inverse, self._counts,
        )  # fmt: skip
        self._threshold_at, self._planned_at = (self._eliminate.position(k) for k in ("threshold", "planned"))
        self._choose_plan = choose_plan.bind(
            self._absent.size, self._absent, self._values, self._planned_at,
            np.frombuffer(memoryview(self._eliminate.integers), dtype=np.int64),
        )  # fmt: skip
        self._confirm_zeros = confirm_zeros.bind(
            size, self.n, REPLACEMENT, self._certain, a.order, a.pointers, a.columns, self._values, self._pivots,
            self._starts, self._indices, self._factors, self._inverse, self._zeros, *self._vectors[:2], self._counts,
        )  # fmt: skip
        self._parts = [np.zeros(self._stride + 2 * LANES) for _ in range(2)]
        both = (
            size, REFINEMENTS, self.accuracy, a.pointers, a.columns, self._values, self._scale, a.order, self._counts,
            self._pivots, self._starts, self._indices, self._factors, self._inverse, self.rhs, *self._vectors[:3],
            self.solution, self._parts[0], self.second_rhs, *self._vectors[3:], self.second_solution, self._parts[1],
            self.report, np.zeros(REPORT),
        )  # fmt: skip
        self._solve, self._solve_both = solve.bind(0, *both), solve.bind(1, *both)
