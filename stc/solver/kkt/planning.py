"""The elimination planned ahead: one order for all stages that look alike.

Stages are alike when the same slots of the window couple and leave.  Their entries' strengths are judged together,
from the values of the first factorisation; what the stage before leaves in the window is part of the pattern, so
the plan of a stage depends on its kind and on the state before it, and long regular chains need few plans.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.records import dataclass
from stc.solver.kkt.arrangement import Arrangement, Couplings, enter_window
from stc.solver.kkt.grouping import group_stage
from stc.solver.kkt.ordering import (
    COMPARED,
    MARGIN,
    SETS,
    SMALLEST,
    follow_order,
    order_stage,
    take_leaves,
)
from stc.solver.kkt.slot_sets import words_of
from stc.solver.kkt.staging import Staging
from stc.solver.nlp import Floats

__all__ = ["Plan", "plan_elimination"]

Int32s = NDArray[np.int32]

#: Stages of one kind that are looked at.
SAMPLE = 32
#: A stage is ordered anew when it comes so many times: what is in the window at first, near an end of the horizon, may
#: be unlike what is there later.
SETTLED = 6
#: This is done for horizons of so many stages.
LONG = 100
#: Pivots of about equal cost that are compared.
CANDIDATES = 500
#: The threshold that pivots are planned for: those that fail theirs are taken later.
PLANNED = 0.1 * MARGIN


@dataclass(frozen=True)
class Plan:
    """Orders and column patterns of all stages.

    Attributes:
        rank: place of each unknown in the order of its stage, (N,).
        kind: 1 or 2 where a pivot begins, 0 for the second of two, -1 for unknowns that are bound to be delayed;
            by unknown, (N,).
        group: how many unknowns are eliminated together from here on, 0 where no group begins, -1
            for leaves, (N,).
        start, count: the slots of a group's columns, ``slots[start:start + count]``, (N,); where a group's order is
            fixed, because what it adds to the window depends on it, count is -1 less that.
        surplus_start, surplus_count: further slots that its columns may have entries at when some pivots of its stage
            or of those before were not as planned, (N,).
        slots: all the lists.
        state: what the window may have before each stage beyond what is planned, (stages,): the entries of state k
            are at ``state_rows[state_starts[k]:state_starts[k + 1]]``, the same of ``state_columns``.
        no_diagonal: unknowns whose diagonal entries are taken for zero, (N,).
        plans: how many different orders there are.
        ordered: how many unknowns these have together.
        nnz: entries of the factor, if all goes to plan.
    """

    rank: Int32s
    kind: Int32s
    group: Int32s
    start: Int32s
    count: Int32s
    surplus_start: Int32s
    surplus_count: Int32s
    slots: Int32s
    state: Int32s
    state_starts: Int32s
    state_rows: Int32s
    state_columns: Int32s
    no_diagonal: NDArray[np.bool_]
    plans: int
    ordered: int
    nnz: int


def plan_elimination(
    couplings: Couplings,
    staging: Staging,
    arrangement: Arrangement,
    values: Floats,
    has_diagonal: NDArray[np.bool_],
) -> Plan:
    """Plan all stages from the values of one equilibrated matrix.

    Args:
        values: as arranged (see stc.solver.kkt.values).
        has_diagonal: unknowns that may have a diagonal entry, (N,).
    """
    window = staging.window
    size = couplings.size
    order = arrangement.order
    slot, stage = staging.slot[order].astype(np.int64), staging.stage[order]
    row = np.repeat(np.arange(size, dtype=np.int32), np.diff(arrangement.pointers))
    slot_1, slot_2 = slot[row], slot[arrangement.columns]
    diagonal = np.flatnonzero(has_diagonal[order])
    places = np.concatenate(
        [np.maximum(slot_1, slot_2) * window + np.minimum(slot_1, slot_2), slot[diagonal] * (window + 1)]
    )
    place_stages = np.concatenate([stage[row], stage[diagonal]])
    entries = np.concatenate([values[size : size + couplings.first.size], values[diagonal]])

    pointers, entering = enter_window(arrangement, staging.stages)
    fresh = entering[np.repeat(np.arange(staging.stages), np.diff(pointers)) == stage[entering]]
    kind = _alike(staging.stages, (place_stages, places), (stage, slot), (stage[fresh], slot[fresh]))
    chosen = _sample(kind)
    inside = chosen[place_stages]
    keys, members = np.unique(kind[place_stages[inside]] * window**2 + places[inside], return_inverse=True)
    logs = np.log(np.maximum(np.abs(entries[inside]), 1e-12))
    sizes = np.maximum(np.exp(np.bincount(members, logs) / np.bincount(members)), SMALLEST)
    sizes = np.copysign(sizes, np.bincount(members, np.sign(entries[inside])))
    inside = chosen[stage]
    leaving = distinct(kind[stage[inside]] * window + slot[inside])
    fresh = fresh[chosen[stage[fresh]]]
    walk = _Walk(window, keys, sizes, leaving, distinct(kind[stage[fresh]] * window + slot[fresh]))
    plan_of_stage, state_of_stage = walk.all_stages(kind, staging.top)
    return walk.result(staging, plan_of_stage, state_of_stage, has_diagonal)


def _alike(stages: int, *features: tuple[NDArray[np.integer], NDArray[np.int64]]) -> NDArray[np.int64]:
    """Kind of each stage, (stages,): stages are alike when they have the same sets of numbers.

    Args:
        features: pairs of arrays, a stage and a number of it each.
    """
    total = np.zeros(stages, dtype=np.uint64)
    for salt, (stage, numbers) in enumerate(features):
        np.add.at(total, stage, _mix(numbers, salt))
    return np.unique(total, return_inverse=True)[1]


def _mix(numbers: NDArray[np.int64], salt: int) -> NDArray[np.uint64]:
    """Scramble whole numbers (the finaliser of splitmix64), so that sums of them tell sets apart."""
    bits = numbers.astype(np.uint64) * np.uint64(3) + np.uint64(salt + 1)
    bits *= np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))


def _sample(kind: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Some SAMPLE stages of each kind, evenly spread."""
    order = np.argsort(kind, kind="stable")
    many = np.bincount(kind)
    number = np.empty(kind.size, dtype=np.int64)
    number[order] = np.arange(kind.size) - np.repeat(np.cumsum(many) - many, many)
    return number % (-(-many // SAMPLE))[kind] == 0


@dataclass(frozen=True)
class _StagePlan:
    """Order of one stage: slots, kinds of pivots, groups, where the groups' columns begin in all lists, their lengths,
    whether their order is fixed; the same of the surplus of their columns."""

    slots: Int32s
    kinds: Int32s
    groups: Int32s
    starts: Int32s
    counts: Int32s
    fixed: Int32s
    surplus_starts: Int32s
    surplus_counts: Int32s

    @property
    def nnz(self) -> int:
        groups = np.maximum(self.groups, 0)
        return int((groups * (self.counts + 0.5 * (groups - 1))).sum())


class _Walk:
    """Goes through the stages, and orders each pair of kind and state that it meets for the first time."""

    def __init__(
        self,
        window: int,
        keys: NDArray[np.int64],
        sizes: Floats,
        leaving: NDArray[np.int64],
        fresh: NDArray[np.int64],
    ) -> None:
        self.fresh_kind, self.fresh_slot = fresh // window, fresh % window
        self.window = window
        self.key_kind, self.key_place = keys // window**2, keys % window**2
        self.sizes = sizes
        self.leaving_kind, self.leaving_slot = leaving // window, (leaving % window).astype(np.int32)
        self.plans: list[_StagePlan] = []
        self.lists: list[Int32s] = []
        self.listed = 0
        self.states: list[tuple[Floats, Floats]] = []
        self.known_states: dict[tuple[int, bytes], int] = {}

    def all_stages(self, kind: NDArray[np.int64], top: Int32s) -> tuple[Int32s, Int32s]:
        """Plan and state of each stage."""
        nothing = np.zeros((0, 0))
        state = self._state_number(nothing, nothing)
        steps: dict[tuple[int, int], tuple[int, int]] = {}
        times: dict[tuple[int, int], int] = {}
        long = kind.size >= LONG
        plan_of_stage, state_of_stage = (
            np.empty(kind.size, dtype=np.int32),
            np.empty(kind.size, dtype=np.int32),
        )
        for stage, stage_kind in enumerate(kind.tolist()):
            key = stage_kind, state
            step = steps.get(key)
            times[key] = times.get(key, 0) + 1
            if step is None or (times[key] == SETTLED and long):
                step = steps[key] = self._step(stage_kind, state, int(top[stage]))
            elif times[key] < SETTLED and long:
                self._repeat(stage_kind, state, int(top[stage]), *step)
            plan_of_stage[stage], state_of_stage[stage] = step[0], state
            state = step[1]
        return plan_of_stage, state_of_stage

    def _state_number(self, sizes: Floats, cover: Floats) -> int:
        """States with the same patterns are one; the sizes are those of the last.

        Only the slots in use are kept: that is little of a window.

        Args:
            sizes: entries of the window if all goes to plan.
            cover: nonzero where there may be one otherwise.
        """
        used = int(np.flatnonzero(cover.any(axis=0)).max(initial=-1)) + 1
        sizes, cover = sizes[:used, :used].copy(), cover[:used, :used].copy()
        pattern = used, np.packbits([sizes != 0.0, cover != 0.0]).tobytes()
        number = self.known_states.setdefault(pattern, len(self.states))
        if number == len(self.states):
            self.states.append((sizes, cover))
        self.states[number] = sizes, cover
        return number

    def _assembled(self, kind: int, state: int, top: int) -> tuple[Floats, Floats]:
        """The slots in use at a stage of some kind after some state: sizes and cover, (top, top) each."""
        sizes, cover = np.zeros((top, top)), np.zeros((top, top))
        for part, before in zip((sizes, cover), self.states[state], strict=True):
            part[: len(before), : len(before)] = before
        begin, end = np.searchsorted(self.key_kind, [kind, kind + 1])
        rows, columns = np.divmod(self.key_place[begin:end], self.window)
        sizes[rows, columns] += self.sizes[begin:end]
        sizes[columns, rows] = sizes[rows, columns]
        cover[rows, columns] = cover[columns, rows] = 1.0
        return sizes, cover

    def _repeat(self, kind: int, state: int, top: int, plan: int, following: int) -> None:
        """Eliminate a stage like one before, for the following state's sizes."""
        sizes, _ = self._assembled(kind, state, top)
        known = self.plans[plan]
        degree, row_p, row_q, lists = (np.empty(top, dtype=np.int32) for _ in range(4))
        follow_order(
            top, known.slots.size, known.slots, known.kinds, sizes.reshape(-1), degree, np.empty(top), row_p, row_q,
            lists,
        )  # fmt: skip
        before, cover = self.states[following]
        after = sizes[: len(before), : len(before)]
        self.states[following] = np.where(before != 0.0, np.where(after != 0.0, after, SMALLEST), 0.0), cover

    def _step(self, kind: int, state: int, top: int) -> tuple[int, int]:
        """Order a stage of some kind after some state; the plan's and the following state's number."""
        sizes, cover = self._assembled(kind, state, top)
        fresh = np.zeros(top, dtype=np.int32)
        begin, end = np.searchsorted(self.fresh_kind, [kind, kind + 1])
        fresh[self.fresh_slot[begin:end]] = 1
        begin, end = np.searchsorted(self.leaving_kind, [kind, kind + 1])
        waiting = self.leaving_slot[begin:end].copy()
        degree, row_p, row_q = (np.empty(top, dtype=np.int32) for _ in range(3))
        most = np.empty(top)
        leaves = take_leaves(top, waiting.size, waiting, fresh, sizes.reshape(-1), degree, most, row_p, row_q)
        leaf_slots, waiting = waiting[:leaves], waiting[leaves:].copy()
        cover[sizes != 0.0] = 1.0
        cover[leaf_slots] = cover[:, leaf_slots] = 0.0
        count = waiting.size
        order, kinds = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
        starts = np.empty(count + 1, dtype=np.int32)
        lists = np.empty((count + 1) * top, dtype=np.int32)
        first, second = np.empty(CANDIDATES, dtype=np.int32), np.empty(CANDIDATES, dtype=np.int32)
        before = sizes.reshape(-1).copy()
        bits = np.empty((top + SETS) * words_of(top), dtype=np.int64)
        order_stage(
            top, count, waiting, PLANNED, COMPARED, 0, sizes.reshape(-1), degree, most, row_p, row_q, bits,
            first.size, first, second, np.empty(first.size), order, kinds, starts, lists.size, lists,
        )  # fmt: skip
        fixed = np.zeros_like(order)
        groups, rows = np.empty_like(order), np.empty(2 * lists.size, dtype=np.int32)
        group_starts, surplus_starts = np.empty_like(starts), np.empty_like(starts)
        used = group_stage(
            top, count, order, kinds, starts, lists, before, bits, sizes.reshape(-1), cover.reshape(-1), row_p, row_q,
            np.empty(count + 1), np.empty(count + 1), np.empty_like(starts), groups, fixed, group_starts,
            surplus_starts, rows,
        )  # fmt: skip
        leaf = np.ones(leaves, dtype=np.int32)
        self.plans.append(
            _StagePlan(
                np.concatenate([leaf_slots, order]),
                np.concatenate([leaf, kinds]),
                np.concatenate([-leaf, groups]),
                np.concatenate([leaf - 1, group_starts[:-1] + self.listed]),
                np.concatenate([leaf - 1, np.diff(group_starts)]),
                np.concatenate([leaf - 1, fixed]),
                np.concatenate([leaf - 1, surplus_starts[:-1] + self.listed]),
                np.concatenate([leaf - 1, np.diff(surplus_starts)]),
            )
        )
        self.lists.append(rows[:used].copy())
        self.listed += used
        return len(self.plans) - 1, self._state_number(sizes, cover)

    def result(
        self,
        staging: Staging,
        plan_of_stage: Int32s,
        state_of_stage: Int32s,
        has_diagonal: NDArray[np.bool_],
    ) -> Plan:
        """Everything by unknown."""
        window = self.window
        rank, kind, group, start, count, surplus_start, surplus_count = (
            np.zeros((len(self.plans), window), dtype=np.int32) for _ in range(7)
        )
        for number, plan in enumerate(self.plans):
            rank[number, plan.slots] = np.arange(plan.slots.size)
            kind[number, plan.slots] = plan.kinds
            group[number, plan.slots] = plan.groups
            start[number, plan.slots] = plan.starts
            count[number, plan.slots] = np.where(plan.fixed != 0, -1 - plan.counts, plan.counts)
            surplus_start[number, plan.slots] = plan.surplus_starts
            surplus_count[number, plan.slots] = plan.surplus_counts
        where = plan_of_stage[staging.stage], staging.slot
        entries = [np.nonzero(np.tril((cover != 0.0) & (sizes == 0.0))) for sizes, cover in self.states]
        nnz = np.array([plan.nnz for plan in self.plans], dtype=np.int64)
        return Plan(
            rank[where],
            kind[where],
            group[where],
            start[where],
            count[where],
            surplus_start[where],
            surplus_count[where],
            np.concatenate([*self.lists, np.zeros(1, dtype=np.int32)]),
            state_of_stage,
            np.cumsum([0, *(rows.size for rows, _ in entries)]).astype(np.int32),
            np.concatenate([rows for rows, _ in entries]).astype(np.int32),
            np.concatenate([columns for _, columns in entries]).astype(np.int32),
            ~has_diagonal,
            len(self.plans),
            sum(plan.slots.size for plan in self.plans),
            int(nnz[plan_of_stage].sum()),
        )
