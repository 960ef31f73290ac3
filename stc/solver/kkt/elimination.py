"""LDL^T of a sparse symmetric matrix in a window that slides over the stages, with threshold pivoting.

At each stage the rows of its unknowns are added to the window, and the unknowns are taken out in the planned
order by 1x1 and 2x2 pivots:

    1x1   d = a_pp                 accepted when  |d| >= u max_j |a_pj|
    2x2   D = [a_pp a_pq]          accepted when  |D^-1| [max_j |a_pj|] <= 1/u  (in each row)
              [a_pq a_qq]                                [max_j |a_qj|]

(Duff and Reid 1983), so no factor exceeds 1/u.  What is not accepted is tried again after the others, then delayed
to the next stage; at the last one, pivots are chosen by size alone (Bunch and Parlett 1971).  The entries are
expected equilibrated, near 1.

Columns are gathered along the planned lists of slots; what to do where not all goes to plan is found in
stc.solver.kkt.unplanned.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.panel import CHANGED, take_group
from stc.solver.kkt.pivots import (
    COUNTS,
    DELAYED,
    NEGATIVE,
    PIVOTS,
    POSITIVE,
    REJECTED,
    STRAYED,
    ZERO,
    best_partner,
    pair_up,
    place_of,
    strongest,
    take_one,
    take_two,
)
from stc.solver.kkt.unplanned import adopt, list_rows, only_planned
from stc.solver.kkt.window import clear, gather, largest

__all__ = ["FACTORS_FULL", "HOPELESS", "WINDOW_FULL", "factorize"]

#: Results of ``factorize``.
DONE = 0
FACTORS_FULL = 1
WINDOW_FULL = 2
HOPELESS = 3

#: Rounds over the candidates of a stage before the rest is delayed.
ROUNDS = 3
#: Thresholds below this are not tried.
LOWEST_THRESHOLD = 1e-10


@native(small=True)
def _enter(first: i64, last: i64, entering: i32s, slot: i32s, owner: i32s, growth: f64s) -> None:
    """Give the entering positions their slots."""
    for k in range(first, last):
        own = slot[entering[k]]
        owner[own] = entering[k]
        growth[own] = 1.0


@native(small=True)
def _assemble(
    first: i64, last: i64, size: i64, pointers: i32s, targets: i32s, values: f64s, window: f64s
) -> None:  # fmt: skip
    """Add the rows of the positions from ``first`` to ``last`` to the window."""
    for k in range(first, last):
        window[targets[k]] += values[k]
    for e in range(size + pointers[first], size + pointers[last]):
        window[targets[e]] += values[e]


@native(small=True)
def _take_leaf(
    p: i64, threshold: f64, tiny: f64, begin: i64, count: i64, columns: i32s, diagonal: f64, upper: f64s,
    slot: i32s, growth: f64s, stride: i64, window: f64s, pivots: i32s, starts: i32s, inverse: f64s, counts: i64s,
) -> i64:  # fmt: skip
    """Eliminate a position whose column is still as in the matrix; 0 when it is no good pivot."""
    most = 0.0
    for e in range(count):
        most = max(most, fabs(upper[e]))
    if fabs(diagonal) < threshold * most or fabs(diagonal) <= tiny:
        return 0
    k = counts[PIVOTS]
    reciprocal = 1.0 / diagonal
    for e in range(count):
        own = slot[columns[e]]
        factor = upper[e] * reciprocal
        growth[own] = max(growth[own], fabs(factor) * most)
        for before in range(e + 1):
            other = slot[columns[before]]
            window[max(own, other) * stride + min(own, other)] -= factor * upper[before]
    pivots[2 * k] = p
    pivots[2 * k + 1] = -1
    starts[2 * k] = begin
    starts[2 * k + 1] = -1 - count
    inverse[3 * k] = reciprocal
    counts[POSITIVE if diagonal > 0.0 else NEGATIVE] += 1
    counts[PIVOTS] = k + 1
    return 1


@native(small=True)
def _hold(
    p: i64, top: i64, low: i64, high: i64, stride: i64, slot: i32s, owner: i32s, growth: f64s,
    window: f64s, found: i32s, values: f64s,
) -> i64:  # fmt: skip
    """Move a delayed unknown out of the planned slots to the first free one from ``low``; new end, or -1."""
    old = slot[p]
    if old >= low:
        return high
    new = low
    while new < high and owner[new] >= 0 and slot[owner[new]] == new:
        new += 1
    if new >= stride:
        return -1
    d = window[old * stride + old]
    count = gather(old, top, low, high, stride, window, found, values)
    clear(old, count, found, stride, window)
    for k in range(count):
        other = found[k]
        window[max(other, new) * stride + min(other, new)] = values[k]
    window[new * stride + new] = d
    slot[p] = new
    owner[new] = p
    growth[new] = growth[old]
    return max(high, new + 1)


@native(small=True)
def factorize(
    size: i64,
    stages: i64,
    variables: i64,
    threshold: f64,
    tiny: f64,
    replacement: f64,
    delay_limit: i64,
    most_held: i64,
    capacity: i64,
    stride: i64,
    held_from: i64,
    planned: i64,
    stage_pointers: i32s,
    pointers: i32s,
    columns: i32s,
    values: f64s,
    order: i32s,
    planned_slot: i32s,
    targets: i32s,
    enter_pointers: i32s,
    entering: i32s,
    inner_top: i32s,
    top: i32s,
    plan_kind: i32s,
    plan_group: i32s,
    plan_start: i32s,
    plan_count: i32s,
    surplus_start: i32s,
    surplus_count: i32s,
    plan_slots: i32s,
    state: i32s,
    state_starts: i32s,
    state_rows: i32s,
    state_columns: i32s,
    window: f64s,
    panel: f64s,
    lower: f64s,
    sums: f64s,
    masks: f64s,
    spread_1: f64s,
    spread_2: f64s,
    slot: i32s,
    owner: i32s,
    growth: f64s,
    queue: i32s,
    found_1: i32s,
    found_2: i32s,
    found_12: i32s,
    values_1: f64s,
    values_2: f64s,
    first_12: f64s,
    second_12: f64s,
    pivots: i32s,
    starts: i32s,
    indices: i32s,
    factors: f64s,
    inverse: f64s,
    counts: i64s,
) -> i64:
    """Factorise; the window must be zero and is left so when the result is 0.

    Args:
        size, stages, variables: N, number of stages, how many of the N unknowns are variables of the problem.
        threshold: u above.
        tiny: columns no larger than this, times their growth, are zero pivots.
        replacement: magnitude of what replaces them: plus for variables, minus for rows.
        delay_limit: with more unknowns delayed than this, lower thresholds are accepted.
        most_held: with more than this that even the lowest threshold refuses, the matrix is given up as singular.
        capacity: room in ``indices`` and in ``factors``.
        stride: slots of the window.
        held_from: first slot for delayed unknowns.
        planned: whether the plan's patterns hold for this matrix.
        stage_pointers: positions of each stage, (stages + 1,).
        pointers, columns, values: the matrix (see stc.solver.kkt.values).
        order: unknown at each position, (N,).
        planned_slot: slot at each position, (N,).
        targets: where the entries of ``values`` go in the window, (N + E,).
        enter_pointers, entering: the positions that enter the window at each stage, (stages + 1,) and (N,).
        inner_top, top: slots in use at each stage, without and with those of leaves, (stages,).
        plan_kind: 1 or 2 where a planned pivot begins, 0 for the second of a pair, -1 without plan, (N,).
        plan_group: how many unknowns are eliminated together from here on, 0 where no group begins, -1 for
            leaves, which are first in their stages, (N,).
        plan_start, plan_count, plan_slots: the slots of a group's columns.
        surplus_start, surplus_count: others that they may have when not all goes to plan.
        state, state_starts, state_rows, state_columns: what may be in the window before each stage unplanned.
        growth: work space (see stc.solver.kkt.pivots), (stride,).
        slot: work space; afterwards ``-1 - stage`` with the stage at which a position was eliminated, (N,).
        counts: results, (COUNTS,).

    Returns:
        0, 1 when the factors are full, 2 when the window is full, 3 when the matrix was given up: all unknowns that are
        left count as zero pivots then, and nothing can be solved with the factors.
    """
    for k in range(COUNTS):
        counts[k] = 0
    for k in range(stride):
        owner[k] = -1
    for k in range(size):
        slot[k] = planned_slot[k]
    held = 0
    high = held_from
    exact = planned != 0
    for stage in range(stages):
        begin = stage_pointers[stage]
        end = stage_pointers[stage + 1]
        slots_top = inner_top[stage]
        last_stage = stage == stages - 1
        if not exact and planned != 0 and held == 0:
            # The column lists hold again as soon as nothing is in the window but what the plan expects.
            others = state_starts[state[stage]]
            exact = 0 != only_planned(
                state_starts[state[stage] + 1] - others,
                state_rows[others:],
                state_columns[others:],
                stride,
                window,
            )
        _enter(enter_pointers[stage], enter_pointers[stage + 1], entering, slot, owner, growth)
        waiting = held
        position = begin
        while position < end and plan_group[position] < 0:
            at = pointers[position]
            taken = _take_leaf(
                position, threshold, tiny, at, pointers[position + 1] - at, columns[at:], values[position],
                values[size + at :], slot, growth, stride, window, pivots, starts, inverse, counts,
            )  # fmt: skip
            if taken != 0:
                slot[position] = -1 - stage
            else:
                exact = False
                slots_top = top[stage]
                _assemble(position, position + 1, size, pointers, targets, values, window)
                queue[waiting] = position
                waiting += 1
            position += 1
        _assemble(position, end, size, pointers, targets, values, window)
        while position < end:
            planned_here = plan_group[position]
            members = planned_here
            for k in range(members):
                found_1[k] = position + k
            count = max(plan_count[position], -1 - plan_count[position])
            listed = plan_slots[plan_start[position] :]
            if not exact:
                members = adopt(members, found_1, waiting, queue, slot, stride, window)
                count = list_rows(
                    members, found_1, waiting, queue, slot, stride, window, count, listed, surplus_count[position],
                    plan_slots[surplus_start[position] :], found_2,
                )  # fmt: skip
                listed = found_2[0:]
            taken = take_group(
                planned_here, members, found_1, count, listed, plan_kind[position:], stage, threshold, tiny,
                capacity, stride, window, slot, owner, growth, found_12, panel, lower, values_1, sums, masks, pivots,
                starts, indices, factors, inverse, counts,
            )  # fmt: skip
            if taken < 0:
                return FACTORS_FULL
            if taken >= CHANGED:
                taken -= CHANGED
                if plan_count[position] < 0:
                    exact = False
            if taken < members:
                exact = False
                for k in range(planned_here):
                    if slot[position + k] >= 0:
                        queue[waiting] = position + k
                        waiting += 1
            position += planned_here
        needed = threshold
        forced = -1
        forced_pair = False
        hopeless = False
        rounds = 0
        while waiting > 0:
            kept = 0
            progress = False
            for place in range(waiting):
                p = queue[place]
                row_p = slot[p]
                if row_p < 0:
                    continue
                a = window[row_p * stride + row_p]
                b = 0.0
                c = 0.0
                most = 0.0
                noise = tiny * growth[row_p]
                q = -1
                size_of_pivot = 0
                count = 0
                listed = found_1[0:]
                first = values_1[0:]
                second = values_2[0:]
                if size_of_pivot == 0:
                    accepted = needed
                    noise = tiny * growth[row_p]
                    listed = found_1[0:]
                    count = gather(row_p, slots_top, held_from, high, stride, window, found_1, values_1)
                    most = largest(count, values_1)
                    if p == forced:
                        accepted = 0.0
                        for k in range(count):
                            noise = max(noise, tiny * growth[found_1[k]])
                    if max(most, fabs(a)) <= noise or (p == forced and hopeless):
                        counts[ZERO] += 1
                        clear(row_p, count, listed, stride, window)
                        count = 0
                        most = 0.0
                        # Counted as zero, and not by the sign of what takes its place.
                        a = replacement if order[p] < variables else -replacement
                        counts[POSITIVE if a > 0.0 else NEGATIVE] -= 1
                        size_of_pivot = 1
                    # The planned partner first, then alone, then with the strongest partner.
                    planned_partner = -1
                    if plan_kind[p] == 2:
                        planned_partner = slot[p + 1]
                    elif plan_kind[p] == 0:
                        planned_partner = slot[p - 1]
                    for attempt in range(3):
                        if size_of_pivot != 0 or (p == forced and attempt == 0):
                            continue
                        if attempt == 1:
                            enough = fabs(a) >= accepted * most and fabs(a) > noise
                            if enough if p != forced else not forced_pair:
                                size_of_pivot = 1
                            continue
                        best = -1
                        if attempt == 2:
                            best = best_partner(count, found_1, values_1, owner, end)
                        elif planned_partner >= 0:
                            best = place_of(planned_partner, count, found_1)
                        if best >= 0:
                            row_q = found_1[best]
                            b = values_1[best]
                            c = window[row_q * stride + row_q]
                            least = 0.0 if p == forced else max(noise, tiny * growth[row_q])
                            swapped = a == 0.0 and c != 0.0
                            union = pair_up(
                                row_p, row_q, a, b, c, swapped, accepted, least, count, found_1, values_1,
                                slots_top, held_from, high, stride, window, found_2, values_2, found_12,
                                first_12, second_12,
                            )  # fmt: skip
                            if union >= 0:
                                size_of_pivot = 2
                                count = union
                                listed = found_12[0:]
                                first = first_12[0:]
                                second = second_12[0:]
                                q = owner[row_q]
                                if swapped:
                                    p, q = q, p
                                    a, c = c, a
                if size_of_pivot == 0:
                    counts[REJECTED] += 1
                    queue[kept] = queue[place]
                    kept += 1
                    continue
                progress = True
                room = 1
                if size_of_pivot == 2:
                    room = take_two(
                        p, q, a, b, c, count, listed, first, second, capacity, slot, owner, growth, stride,
                        window, spread_1, spread_2, pivots, starts, indices, factors, inverse, counts,
                    )  # fmt: skip
                    slot[q] = -1 - stage
                else:
                    room = take_one(
                        p, a, most, count, listed, first, capacity, slot, owner, growth, stride, window,
                        spread_1, pivots, starts, indices, factors, inverse, counts,
                    )  # fmt: skip
                slot[p] = -1 - stage
                if room == 0:
                    return FACTORS_FULL
            waiting = kept
            rounds += 1
            # What has overflowed is no pivot even when forced, and counts as zero.
            hopeless = forced >= 0 and not progress
            if hopeless:
                continue
            forced = -1
            if last_stage:
                if not progress and waiting > 0:
                    exact = False
                    forced = strongest(
                        waiting, queue, slots_top, held_from, high, stride, slot, window, found_1, values_1
                    )
                    forced_pair = forced < 0
                    if forced_pair:
                        forced = -1 - forced
            elif not progress or rounds >= ROUNDS:
                if needed <= LOWEST_THRESHOLD and waiting > most_held:
                    counts[ZERO] = size - counts[POSITIVE] - counts[NEGATIVE]
                    return HOPELESS
                if waiting <= delay_limit or needed <= LOWEST_THRESHOLD:
                    break
                needed *= 0.1 if progress else 1e-3
        if not exact:
            counts[STRAYED] += 1
        held = 0
        for place in range(waiting):
            p = queue[place]
            if slot[p] < 0:
                continue
            queue[held] = p
            held += 1
            if slot[p] < held_from:
                counts[DELAYED] += 1
                high = _hold(
                    p, slots_top, held_from, high, stride, slot, owner, growth, window, found_1, values_1
                )
                if high < 0:
                    return WINDOW_FULL
        if held == 0:
            high = held_from
        else:
            exact = False
    return DONE
