"""The KKT system of a horizon that repeats itself: eight segments at once, then the few stages between them.

Segments are eliminated with pivots fixed before (see stc.solver.kkt.lanes), which are tested while they are taken.
Stages between them and irregular ones go through ``FrontalKKT``, which pivots as the values ask for, and so does the
whole matrix when a test fails with every plan. Another plan is made when that has cost as much as planning.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros, distinct, scattered
from stc.codegen.calls import Bound, chain_until
from stc.records import dataclass
from stc.solver.kkt import lanes
from stc.solver.kkt.arrangement import Couplings
from stc.solver.kkt.contract import FINE, Inertia, NotFinite
from stc.solver.kkt.entries import Arrays, ByCopies
from stc.solver.kkt.frontal import DOUBTFUL, REFINEMENTS, SWEEPS, FrontalKKT
from stc.solver.kkt.lane_panel import COUNTED, LARGEST, PANEL, STATE
from stc.solver.kkt.lane_program import Program, kind_of, plan_panels
from stc.solver.kkt.lane_tables import code_of, lay_out
from stc.solver.kkt.seams import sew
from stc.solver.kkt.segmented_passes import diagonal_of, eliminate_all, equilibrate_all, solve_all
from stc.solver.kkt.segments import LANES, Segmentation
from stc.solver.kkt.substitution import REPORT
from stc.solver.nlp import Floats

__all__ = ["SegmentedKKT"]

#: No product that is subtracted may exceed this, nor any entry of an inverted pivot, in the equilibrated matrix.
GROWTH = 1e16
INVERSE = 1e15
#: Where they are larger than this share of it, the factors are tried on a right-hand side: the residual, before
#: refinement, should be no larger than INACCURATE, and the solution no longer than SINGULAR times as much.
SUSPECT = 1e-6
INACCURATE = 1e-6
SINGULAR = 3e9
#: Where both are below this share of that, factors are not tried again until they are so many times as suspect, but
#: above this share in any case.
EASILY = 0.01
MORE = 3.0
TRUSTED = 1e-4
#: Stages of a kind whose entries are looked at for a plan.
SAMPLE = 32
#: Entries that are below this share of their mean somewhere count this much when pivots are planned.
VANISHING = 1e-6
UNRELIABLE = 1e-4
#: Another plan takes as long as ``FrontalKKT`` takes for matrices of so many unknowns together: it is made when all
#: plans have failed for so many.
PLANNING = 13_000
#: Plans that are kept; after so many matrices one that failed may be replaced.
PLANS = 4
MATRICES = 40
#: When a plan has served so many matrices another one is made, once, and used if it takes this share of the operations
#: at most.
SETTLED = 6
FEWER = 0.97
#: How much the last matrix counts in the share of matrices that a plan suits, and the share that makes a trial worth
#: its while.
RECENT = 0.3
UNLIKELY = 0.2
#: Room for factors, as a multiple of what the first plan needs.
ROOM = 1.25
#: A number of matrices that is never reached.
FAR = 2**62
#: A cheaper plan that has failed is tried again after twice so many matrices, then twice as many each time.
RESTING = 2
#: After so many failures in a row segments are skipped for one matrix, then for twice as many each time, up to this
#: power of two.
PATIENCE = 3
LONGEST_SKIP = 4


@dataclass
class _Prepared:
    """Calls for one plan, and what they work with."""

    tables: tuple[Any, ...]
    factors: Floats
    state: Floats
    space: tuple[Floats, Floats]
    eliminate: Bound
    equilibrate: Bound
    operations: int
    curved: bool  # whether H was not zero when it was made
    trusted: float  # share of what is acceptable up to which its factors are not tried
    won: float = 0.0  # share of the last matrices that it suited
    served: int = 0  # matrices that it suited
    failed: int = 0  # times in a row that it did not
    rest_until: int = 0  # the matrix from which on it may be tried again
    steps: Bound | None = None  # elimination, and those of the rest
    solve: Bound | None = None
    solve_both: Bound | None = None
    probe: Bound | None = None
    bindings: int = -1  # of the rest, that these are made for

    def suited(self) -> None:
        """Note that it did for a matrix."""
        self.won += RECENT * (1.0 - self.won)
        self.served += 1
        self.failed = 0

    def refused(self, number: int) -> None:
        """Note that it did not, for the matrix of that number."""
        self.won -= RECENT * self.won
        self.failed += 1
        self.rest_until = number + RESTING * 2 ** min(self.failed, LONGEST_SKIP)


class SegmentedKKT(ByCopies):
    """Sparse LDL^T of segments in vector lanes and of the rest by ``FrontalKKT``.

    See ``AttachedKKT`` for the members.
    """

    def __init__(self, couplings: Couplings, stage: NDArray[np.int64], found: Segmentation) -> None:
        self.n, self.m = couplings.n, couplings.m
        self.factorizations = 0
        self.nnz_factor = 0
        self.last_residual = 0.0
        self._couplings, self._stage, self._found = couplings, stage, found
        variables = np.bincount(found.stages.stage[: self.n], minlength=found.stages.pointers.size - 1)
        self._kinds = [kind_of(found, k, int(variables[example])) for k, example in enumerate(found.example)]
        self._sewn = sewn = sew(couplings, found, self._kinds)
        self._arrays = a = Arrays.of(couplings, sewn.added, (1.0, -1.0))
        self.hess, self.jac, self.primal, self.dual = a.hess, a.jac, a.primal, a.dual
        self.rhs, self.solution, self.second_rhs, self.second_solution = (
            vector[: couplings.size] for vector in (a.rhs, a.solution, a.second_rhs, a.second_solution)
        )
        self.report, self.accuracy = a.report, a.accuracy
        size = sewn.couplings.size
        one, minus_one = a.given.size - 2, a.given.size - 1
        self._source = np.concatenate(
            [
                couplings.hess_off,
                couplings.hess_count + np.arange(couplings.jac_count),
                np.full(sewn.added // 2, minus_one),
            ]
        ).astype(np.int32)
        self._curved_source = couplings.hess_diagonal.astype(np.int32)
        self._diagonal, self._curvatures = np.zeros(size), np.zeros(1, dtype=np.int64)
        self._layout = layout = lay_out(found, self._kinds, sewn, self._source, one)
        self._scale, self._most, *self._vectors = (aligned_zeros(layout.length) for _ in range(12))
        self._scale[:] = 1.0
        self._scaled = False
        rest = layout.rest
        self._matrix = aligned_zeros(layout.matrix)
        self._rest_matrix = np.zeros(rest.unknowns.size + rest.entry.size)
        self._rest = FrontalKKT.of_couplings(
            rest.couplings, sewn.stage[rest.unknowns], Arrays.of(rest.couplings), part=True
        )
        self._whole: FrontalKKT | None = None
        self._eliminated = int(size - rest.unknowns.size)
        self._added = sewn.added // 2
        self._probe_rhs = np.copysign(1.0, scattered(size))
        self._probe_result, self._probe_report = np.zeros(size), np.zeros(REPORT)
        self._tried = 0
        self._next_plan = 0
        self._failures = 0
        self._missed = 0
        self._skip = 0
        self._choose_at = 0  # the matrix from which on the plan to begin with is to be chosen anew
        self._settled = False
        self._by_segments = False
        self._factorized = False
        self._plans: list[_Prepared] = []
        self._factors = aligned_zeros(0)
        self._bind_entries()
        nothing = [np.zeros(kind.size * (kind.size + 1) // 2, dtype=bool) for kind in self._kinds]
        self._now = self._prepare([Program([], used, 0, 0) for used in nothing])  # for equilibration

    def restart(self) -> None:
        """Forget all matrices, as if new, but not the plans: they are taken up in the same order."""
        self.factorizations = 0
        self.nnz_factor = 0
        self.last_residual = 0.0
        self._scaled = False
        self._failures = self._skip = self._choose_at = 0
        if self._plans:
            self._now = self._plans[0]
        for plan in self._plans:
            plan.trusted = SUSPECT
        self._factorized = False
        self._rest.restart()
        if self._whole is not None:
            self._whole.restart()

    @property
    def nbytes(self) -> int:
        """Memory held, about."""
        own = 8 * self._arrays.given.size + 64 * self._diagonal.size + self._layout.index.nbytes
        own += self._factors.nbytes + self._matrix.nbytes + (2 + len(self._vectors)) * self._scale.nbytes
        return own + self._rest.nbytes + (self._whole.nbytes if self._whole is not None else 0)

    @property
    def operations(self) -> int:
        """Additions and multiplications of the last factorisation, updates only."""
        if not self._by_segments:
            return self._whole.operations if self._whole is not None else 0
        return self._now.operations + self._rest.operations

    @property
    def factor_bytes(self) -> int:
        """Memory that the last factorisation fills."""
        if not self._by_segments:
            return self._whole.factor_bytes if self._whole is not None else 0
        return self._now.factors.nbytes + self._rest.factor_bytes

    def refactor(self) -> Inertia:
        """See ``AttachedKKT.refactor``."""
        self._factorized = False
        if self._collect() != 0.0:
            raise NotFinite("the KKT matrix has entries that are not finite")
        self.factorizations += 1
        self.accuracy[0] = FINE
        if not self._scaled:
            self._scale[:] = 1.0
            self._now.equilibrate()
            self._scaled = True
        inertia = self._refactor_segments()
        self._by_segments = inertia is not None
        if inertia is None:
            inertia = self._refactor_whole()
        self._factorized = True
        return inertia

    @property
    def solve_call(self) -> Bound:
        """See ``AttachedKKT.solve_call``."""
        if not self._factorized:
            raise ValueError("factorize before solving")
        if self._by_segments:
            assert self._now.solve is not None
            return self._now.solve
        assert self._whole is not None
        return self._whole.solve_call

    @property
    def solve_both_call(self) -> Bound:
        """See ``AttachedKKT.solve_both_call``."""
        if not self._factorized:
            raise ValueError("factorize before solving")
        if self._by_segments:
            assert self._now.solve_both is not None
            return self._now.solve_both
        assert self._whole is not None
        return self._whole.solve_both_call

    def check_solution(self) -> bool:
        """See ``AttachedKKT.check_solution``."""
        repeated = False
        if self._by_segments:
            if self.report[0] > DOUBTFUL:
                self.factorizations += 1
                self._refactor_whole()
                self._by_segments = False
                self.solve_call()
                repeated = True
            self.last_residual = float(self.report[0])
        if not self._by_segments:
            assert self._whole is not None
            before = self._whole.factorizations
            repeated = self._whole.check_solution() or repeated
            self.factorizations += self._whole.factorizations - before
            self.last_residual = self._whole.last_residual
        return repeated

    def _refactor_segments(self) -> Inertia | None:
        """Inertia, or None when a pivot is not good enough."""
        if self._skip > 0:
            self._skip -= 1
            return None
        self._tried += 1
        rest = None
        for plan in self._candidates():
            self._now = plan
            rest = self._through(plan)
            if rest is not None:
                plan.suited()
                break
            plan.refused(self._tried)
        if rest is None:
            self._now = max(self._plans, key=lambda plan: plan.won)
            self._failures += 1
            if self._failures >= PATIENCE:
                self._skip = 2 ** min(self._failures - PATIENCE, LONGEST_SKIP)
            return None
        if rest.zero > 0:
            return None
        now = self._now
        if now.bindings != self._rest.bindings:
            self._bind_solve(now)
        if now.state[LARGEST] > now.trusted and not self._passes_probe(now):
            return None
        self._failures = 0
        self.nnz_factor = now.factors.size + self._rest.nnz_factor
        negative = int(now.state[COUNTED])
        # The seams have as many positive as negative eigenvalues.
        positive = self._eliminated - negative + rest.positive
        return Inertia(positive - self._added, negative + rest.negative - self._added, rest.zero)

    def _through(self, plan: _Prepared) -> Inertia | None:
        """Factorise by a plan: the inertia of the rest, or None where a pivot of the segments is refused."""
        rest = self._rest
        if plan.steps is not None and plan.bindings == rest.bindings and rest.follows_plan:
            rest.prepare_steps()
            ended = plan.steps()
            if ended != 1:
                return rest.complete(ended and ended - 1)
        elif not plan.eliminate():
            return rest.refactor()
        # The scale may have served its time.
        return rest.refactor() if plan.equilibrate() and not plan.eliminate() else None

    def _candidates(self) -> Iterator[_Prepared]:
        """Plans to try for the matrix at hand: that in use, others that suited some before, a new one."""
        first = self._now
        if self._tried >= self._choose_at or first.curved != bool(self._curvatures[0]):
            first = self._first()
            self._choose_at = self._tried + 1
            if first is self._now and (self._settled or not first.curved):
                # Nothing changes before another plan is to be tried again.
                self._choose_at = min((plan.rest_until for plan in self._cheaper(first)), default=FAR)
        yield first
        self._choose_at = 0
        others = (plan for plan in self._plans if plan is not first and plan.won > UNLIKELY)
        yield from sorted(others, key=lambda plan: -plan.won)
        self._missed += self._couplings.size
        if self._missed < PLANNING:
            return
        if len(self._plans) == PLANS:
            if self._tried < self._next_plan:
                return
            del self._plans[min(range(PLANS), key=lambda k: self._plans[k].won)]
        yield self._new_plan()

    def _first(self) -> _Prepared:
        """The plan in use, or the latest, of those that were made where H was zero or of the others, as it is now."""
        curved = bool(self._curvatures[0])
        now = self._now
        if now.served > 0 and now.curved == curved and (now.served != SETTLED or self._settled):
            return next((plan for plan in self._cheaper(now) if plan.rest_until <= self._tried), now)
        alike = [plan for plan in self._plans if plan.curved == curved]
        if not alike and len(self._plans) < PLANS:
            return self._new_plan()
        if alike and now.curved != curved:
            return [plan for plan in alike if plan.won > UNLIKELY or plan is alike[0]][-1]
        if now.served == SETTLED and curved and not self._settled:
            # By now the entries have the sizes that they will keep.
            self._settled = True
            other = self._prepare(self._programs())
            if other.operations < FEWER * now.operations and len(self._plans) < PLANS:
                self._plans.append(other)
                return other
        return now

    def _cheaper(self, now: _Prepared) -> list[_Prepared]:
        """Other plans for such matrices that take fewer operations, those with the fewest first."""
        cheaper = (
            plan
            for plan in self._plans
            if plan.curved == now.curved and plan.operations < FEWER * now.operations
        )
        return sorted(cheaper, key=lambda plan: plan.operations)

    def _new_plan(self) -> _Prepared:
        self._missed = 0
        self._next_plan = self._tried + MATRICES
        self._plans.append(self._prepare(self._programs()))
        return self._plans[-1]

    def _passes_probe(self, plan: _Prepared) -> bool:
        """Solve once: a matrix that is nearly singular has long solutions, inaccurate factors a large residual."""
        assert plan.probe is not None
        plan.probe()
        residual, _, gain = self._probe_report
        if residual < EASILY * INACCURATE and gain < EASILY * SINGULAR:
            plan.trusted = min(TRUSTED, MORE * float(plan.state[LARGEST]))
        return bool(residual < INACCURATE and gain < SINGULAR)

    def _refactor_whole(self) -> Inertia:
        if self._whole is None:
            self._whole = FrontalKKT.of_couplings(self._couplings, self._stage, self._arrays)
        inertia = self._whole.refactor()
        self.nnz_factor = self._whole.nnz_factor
        return inertia

    def _programs(self) -> list[Program]:
        """Plan the pivots of each kind for values like those of the matrix at hand, without p.

        What barrier and shifts add to the diagonal comes and goes: pivots that need it would fail sooner or later.
        """
        scale, couplings, found = self._scale[self._layout.places], self._couplings, self._found
        programs = []
        values = self._arrays.given[self._source[: couplings.first.size]]
        values *= scale[couplings.first] * scale[couplings.second]
        diagonal = np.concatenate([np.zeros(self.n), -self.dual])
        diagonal[couplings.hess_variable] += self._arrays.given[self._curved_source]
        diagonal *= scale[: couplings.size] ** 2
        for number, kind in enumerate(self._kinds):
            lanes_of = [group.stages for group in found.groups if group.kind == number]
            chosen = distinct(np.concatenate([stages.reshape(-1) for stages in lanes_of]))
            chosen = chosen[:: -(-chosen.size // SAMPLE)]
            inside = np.isin(found.edge_stage, chosen)
            codes = found.codes[number]
            entries = _middle(np.searchsorted(codes, found.edge_code[inside]), values[inside], codes.size)
            entries *= self._reliable(number, values, entries)
            unknowns = found.stages.order[found.stages.pointers[chosen][:, None] + np.arange(kind.own)]
            place = np.broadcast_to(np.arange(kind.own), unknowns.shape).reshape(-1)
            own = _middle(place, diagonal[unknowns.reshape(-1)], kind.own)
            programs.append(plan_panels(kind, entries, own))
        return programs

    def _reliable(self, number: int, values: Floats, entries: Floats) -> Floats:
        """What to multiply the entries (codes,) of a kind with, so that those that vanish somewhere are no pivots."""
        found = self._found
        stages = np.zeros(found.interior.size, dtype=bool)
        for group in found.groups:
            if group.kind == number:
                stages[group.stages] = True
        inside = np.flatnonzero((found.edge_stage >= 0) & stages[found.edge_stage])
        least = np.full(entries.size, np.inf)
        np.minimum.at(
            least, np.searchsorted(found.codes[number], found.edge_code[inside]), np.abs(values[inside])
        )
        return np.where(least < VANISHING * np.abs(entries), UNRELIABLE, 1.0)

    def _bind_entries(self) -> None:
        """Prepare the calls that do not depend on the plan."""
        c, layout, given = self._couplings, self._layout, self._arrays.given
        self._collect = diagonal_of.bind(
            c.n, c.m, c.hess_count + c.jac_count, c.hess_count, self._curved_source.size, c.hess_variable,
            self._curved_source, given, self._diagonal, self._curvatures,
        )  # fmt: skip
        entry = layout.rest.entry
        sewn = self._sewn.couplings
        self._rest_entries = (
            layout.places[sewn.first[entry]],
            layout.places[sewn.second[entry]],
            self._source[entry].copy(),
        )

    def _prepare(self, programs: list[Program]) -> _Prepared:
        """Prepare the calls that depend on the plan."""
        layout, groups, given = self._layout, self._found.groups, self._arrays.given
        rest = layout.rest
        code = code_of(layout.table, groups, self._kinds, programs)
        last = layout.table[-1]
        vectors = int(last[lanes.FACTORS] + last[lanes.STEPS] * last[lanes.FACTOR_STEP])
        widest = max(kind.size for kind in self._kinds)
        moved = max(int(row[lanes.MOVED]) for row in layout.table)
        if self._factors.size < 8 * vectors:
            self._factors = aligned_zeros(int(ROOM * 8 * vectors))
        factors = self._factors[: 8 * vectors]
        state = aligned_zeros(STATE)
        tables = len(groups), layout.table.reshape(-1).copy(), layout.index, code
        work, part = aligned_zeros(16 * widest), aligned_zeros(16 * widest)
        outside = layout.outer, rest.unknowns.size, rest.entry.size
        eliminate = eliminate_all.bind(
            *tables, 1.0 / GROWTH, 1.0 / INVERSE, given, self._diagonal, self._scale, self._rest.given,
            aligned_zeros(4 * widest * (widest + 1)), work, aligned_zeros(8 * moved),
            aligned_zeros(8 * PANEL * (widest + PANEL)), self._matrix, part, self._most, aligned_zeros(2 * LANES),
            factors, state, *outside, rest.target, *self._rest_entries, rest.couplings.n, rest.couplings.jac_count,
            self._rest_matrix,
        )  # fmt: skip
        equilibrate = equilibrate_all.bind(
            SWEEPS,
            *tables,
            *outside,
            *self._rest_entries,
            given,
            self._diagonal,
            self._scale,
            self._most,
            work,
            part,
        )
        operations = sum(
            group.segments * len(group.stages) * programs[group.kind].operations for group in groups
        )
        return _Prepared(
            tables,
            factors,
            state,
            (work, part),
            eliminate,
            equilibrate,
            operations,
            bool(self._curvatures[0]),
            SUSPECT,
        )

    def _bind_solve(self, plan: _Prepared) -> None:
        """Prepare the calls that depend on the rest's factors, too."""
        layout = self._layout
        rest = layout.rest
        rest_factors = self._rest.factors_in_order()
        common = (
            self.accuracy, *plan.tables, layout.outer, rest.unknowns.size, rest.entry.size, *self._rest_entries[:2],
            plan.factors, self._matrix, self._rest_matrix, self._scale, *plan.space, np.zeros(4),
            *rest_factors,
        )  # fmt: skip
        one, other = self._vectors[:5], self._vectors[5:]
        arrays = self._arrays
        second = arrays.second_rhs, *other, arrays.second_solution
        both = arrays.rhs, *one, arrays.solution, *second, self.report, np.zeros(REPORT)
        plan.solve, plan.solve_both = (
            solve_all.bind(how_many, REFINEMENTS, *common, *both) for how_many in (0, 1)
        )
        plan.probe = solve_all.bind(
            0,
            0,
            *common,
            self._probe_rhs,
            *one,
            self._probe_result,
            *second,
            self._probe_report,
            np.zeros(REPORT),
        )
        plan.steps = chain_until([(plan.eliminate, True), *self._rest.steps()])
        plan.bindings = self._rest.bindings


def _middle(place: NDArray[np.integer], values: Floats, count: int) -> Floats:
    """Geometric means of magnitudes by place, (count,), with the sign that most have."""
    many = np.maximum(np.bincount(place, minlength=count), 1)
    logs = np.bincount(place, np.log(np.maximum(np.abs(values), 1e-12)), count) / many
    size = np.where(logs < -27.0, 0.0, np.exp(logs))
    return np.copysign(size, np.bincount(place, np.sign(values), count))
