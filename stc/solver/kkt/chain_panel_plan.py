"""Which pivots of a chain's stage make a panel, and panels written down as chain_panel reads them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.codegen.native import f64, f64s, i32s, i64, i64s, native
from stc.records import dataclass
from stc.solver.kkt.chain_elimination import BLOCK
from stc.solver.kkt.ordering import SECOND

__all__ = ["Panels", "join_panels", "write_panels"]

Int32s = NDArray[np.int32]

#: Cycles that a panel takes, that it takes for each block of columns, and for each block of a row that it changes; by
#: members.
PANEL_OF_1, PANEL_OF_2, PANEL_OF_4 = 40.0, 55.0, 85.0
COLUMNS_OF_1, COLUMNS_OF_2, COLUMNS_OF_4 = 6.0, 10.0, 20.0
BLOCK_OF_1, BLOCK_OF_2, BLOCK_OF_4 = 1.8, 2.3, 3.2
#: More than any number of cycles.
FAR = 1e300


@dataclass(frozen=True)
class Panels:
    """Panels in the order of their elimination.

    Attributes:
        high: the highest row of each, (P,); members: of each, (P,).
        rows: those it couples with, increasing, panel by panel; begin: where each panel's begin, (P + 1,).
    """

    high: Int32s
    members: Int32s
    rows: Int32s
    begin: Int32s


def join_panels(size: int, kinds: Int32s, coupled: NDArray[np.int32]) -> tuple[Panels, float]:
    """Join consecutive pivots to panels so that all together take the fewest cycles; these, too.

    Args:
        kinds: of the pivots, from the highest row downwards.
        coupled: which rows couple, (size, size).
    """
    begins = np.flatnonzero(kinds != SECOND)
    units = begins.size
    high = (size - 1 - begins).astype(np.int32)
    members = np.where(kinds[begins] == 2, 2, 1).astype(np.int32)
    reach = np.zeros(units * size, dtype=np.int32)
    union = np.zeros(size, dtype=np.int32)
    cost, came = np.zeros(units + 1), np.zeros(units + 1, dtype=np.int32)
    _join(size, units, high, members, coupled.reshape(-1), union, reach, cost, came)
    tops, together, begin = (np.empty(units + 1, dtype=np.int32) for _ in range(3))
    rows = np.empty(reach.size, dtype=np.int32)
    count = _collect_panels(size, units, high, members, reach, came, union, tops, together, begin, rows)
    panels = Panels(tops[:count], together[:count], rows[: begin[count]], begin[: count + 1])
    return panels, float(cost[units])


@native(small=True)
def _collect_panels(
    size: i64, units: i64, high: i32s, members: i32s, reach: i32s, came: i32s, union: i32s, tops: i32s, together: i32s,
    begin: i32s, rows: i32s,
) -> i64:  # fmt: skip
    """The panels that ``_join`` has found, in the order of their elimination, and how many."""
    count = 0
    last = units
    while last > 0:
        count += 1
        last = came[last]
    last = units
    for k in range(count):
        tops[count - 1 - k] = came[last]  # the first unit, for now
        last = came[last]
    listed = 0
    for k in range(count):
        first = tops[k]
        end = tops[k + 1] if k + 1 < count else units
        total = 0
        for u in range(first, end):
            total += members[u]
            for r in range(size):
                union[r] = max(union[r], reach[u * size + r])
        begin[k] = listed
        for r in range(high[first] - total + 1):
            if union[r] != 0:
                rows[listed] = r
                listed += 1
        for r in range(size):
            union[r] = 0
        tops[k] = high[first]
        together[k] = total
    begin[count] = listed
    return count


@native(small=True)
def write_panels(
    count: i64, size: i64, stride: i64, high: i32s, members: i32s, begin: i32s, rows: i32s, kinds: i32s, blocks: i32s,
    lists: i32s, places: i32s, filled: i32s, totals: i64s,
) -> None:  # fmt: skip
    """Write panels down as chain_panel reads them.

    Args:
        count, high, members, begin, rows: see ``Panels``; kinds: of the pivots, from the highest row downwards.
        blocks: work space, (stride / BLOCK + 1,).
        lists, places: what PANELS_AT and PLACES_AT are for.
        filled: becomes 1 for the blocks of the window that panels change, (size * stride / BLOCK,).
        totals: become the numbers in ``lists``, those of the factors, and additions and multiplications.
    """
    at = 0
    factors = 0
    operations = 0
    width = stride // BLOCK
    for p in range(count):
        top = high[p]
        own = members[p]
        down = begin[p + 1] - begin[p]
        below = rows[begin[p] :]
        places[2 * p] = at
        places[2 * p + 1] = factors
        held = 0
        for e in range(down):
            block = below[down - 1 - e] // BLOCK
            if held == 0 or blocks[max(held - 1, 0)] != block:
                blocks[held] = block
                held += 1
        if down == 0:
            blocks[0] = 0
            held = 1
        pivot = size - 1 - top
        panel = lists[at:]
        panel[0] = own
        panel[1] = 2 if kinds[pivot] == 2 else 1
        panel[2] = 2 if own > 1 and kinds[max(pivot + own - 2, 0)] == 2 else 1
        panel[3] = top
        panel[4] = held
        panel[5] = down
        corner = 2 * BLOCK if own == 4 else BLOCK  # what is kept before the factors
        before = 0  # rows of higher blocks
        pairs = panel[6 + 2 * held :]
        for b in range(held):
            after = before
            while after < down and below[max(down - 1 - after, 0)] // BLOCK == blocks[b]:
                row = below[down - 1 - after]
                pairs[2 * after] = row * stride
                pairs[2 * after + 1] = corner + BLOCK * own * b + row % BLOCK
                after += 1
            before = after
            panel[6 + 2 * b] = BLOCK * blocks[b]
            panel[7 + 2 * b] = after
        for e in range(down + own):
            row = top - own + 1 + e - down
            if e < down:
                row = below[e]
            for b in range(held):
                filled[row * width + blocks[b]] = 1
            for k in range(own):
                filled[row * width + (top - k) // BLOCK] = 1
        at += 6 + 2 * held + 2 * down
        factors += corner + BLOCK * own * held
        operations += own * down * (down + 1 + own)
    totals[0] = at
    totals[1] = factors
    totals[2] = operations


@native(small=True)
def _cycles(members: i64, last: i64, union: i32s) -> f64:
    """What a panel takes that couples with the marked rows below ``last``."""
    rows = 0
    blocks = 0
    changed = 0
    k = last - 1
    while k >= 0:
        begin = k // BLOCK * BLOCK
        before = rows
        for r in range(begin, k + 1):
            rows += union[r]
        if rows > before:
            blocks += 1
            changed += rows
        k = begin - 1
    blocks = max(blocks, 1)
    if members == 4:
        return PANEL_OF_4 + COLUMNS_OF_4 * blocks + BLOCK_OF_4 * changed
    if members == 2:
        return PANEL_OF_2 + COLUMNS_OF_2 * blocks + BLOCK_OF_2 * changed
    return PANEL_OF_1 + COLUMNS_OF_1 * blocks + BLOCK_OF_1 * changed


@native(small=True)
def _join(
    size: i64, units: i64, high: i32s, members: i32s, coupled: i32s, union: i32s, reach: i32s, cost: f64s, came: i32s
) -> None:  # fmt: skip
    """The rows that each pivot couples with, (units * size,), and where the best panel that ends before each begins.

    Args:
        high, members: of each pivot, (units,).
        coupled: which rows couple, (size * size,); filled as pivots fill it.
        union: work space, zero, (size,); cost, came: (units + 1,).
    """
    for u in range(units):
        below = high[u] - members[u] + 1
        own = reach[u * size :]
        top = coupled[high[u] * size :]
        other = coupled[below * size :]
        for r in range(below):
            own[r] = max(top[r], other[r])
        for r in range(below):
            if own[r] != 0:
                row = coupled[r * size :]
                for e in range(below):
                    row[e] = max(row[e], own[e])
    for u in range(1, units + 1):
        cost[u] = FAR
    for u in range(units):
        together = 0
        last = u
        while last < units and together < 4:
            together += members[last]
            own = reach[last * size :]
            below = high[last] - members[last] + 1
            for r in range(below):
                union[r] = max(union[r], own[r])
            last += 1
            # Two that make one pivot begin at an even place.
            apart = members[u] == 1 and last > u + 1 and members[min(u + 1, units - 1)] == 2
            if (together == 1 or together == 2 or together == 4) and not apart:
                total = cost[u] + _cycles(together, below, union)
                if total < cost[last]:
                    cost[last] = total
                    came[last] = u
        for r in range(size):
            union[r] = 0
