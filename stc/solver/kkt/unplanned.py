"""Where the entries of the window are when pivots are not taken as planned.

Pivots that fail their test are tried again after the others of their group and in other pairs.  What a group then
adds to the window depends on what is taken, but lies among the pairs of its rows.  So besides the planned patterns
there is a surplus: what could be there if all pairs of rows were coupled by each group, whatever its order.  Once a
group has strayed, columns are also searched there, for nonzeros, until none are left.

An unknown that waits belongs to the next group that it is coupled with.  That one is among the rows of the unknown's
own group, all of which count as coupled, so the rows of the former hold those that are left of the latter: only the
waiting unknowns themselves are new (as with delayed pivots in the multifrontal method, Duff and Reid 1983).
"""

from __future__ import annotations

from stc.codegen.native import f64s, i32s, i64, native
from stc.solver.kkt.panel import LARGEST_GROUP
from stc.solver.kkt.window import entry

__all__ = ["adopt", "list_rows", "only_planned"]


@native(inline=True)
def _coupled(own: i64, members: i64, who: i32s, slot: i32s, stride: i64, window: f64s) -> i64:
    """With how many of the members a slot is coupled."""
    found = 0
    for k in range(members):
        found += entry(own, slot[who[k]], stride, window) != 0.0
    return found


@native(small=True)
def adopt(
    members: i64, who: i32s, waiting: i64, queue: i32s, slot: i32s, stride: i64, window: f64s
) -> i64:  # fmt: skip
    """Add those of the waiting unknowns that are coupled with a group to its members; how many it has then."""
    total = members
    for place in range(waiting):
        own = slot[queue[place]]
        if own >= 0 and total < LARGEST_GROUP and _coupled(own, members, who, slot, stride, window) > 0:
            who[total] = queue[place]
            total += 1
    return total


@native(inline=True)
def _insert(total: i64, own: i64, rows: i32s) -> None:
    """Insert a slot into an increasing list."""
    k = total
    while k > 0 and rows[max(k - 1, 0)] > own:
        rows[k] = rows[k - 1]
        k -= 1
    rows[k] = own


@native(small=True)
def list_rows(
    members: i64, who: i32s, waiting: i64, queue: i32s, slot: i32s, stride: i64, window: f64s, count: i64,
    listed: i32s, surplus_count: i64, surplus: i32s, rows: i32s,
) -> i64:  # fmt: skip
    """List the planned slots of a group, and those others that members are coupled with; how many there are.

    The lists given increase, and so does the result.
    """
    total = 0
    taken = 0
    for e in range(surplus_count):
        if _coupled(surplus[e], members, who, slot, stride, window) > 0:
            while taken < count and listed[taken] < surplus[e]:
                rows[total] = listed[taken]
                taken += 1
                total += 1
            rows[total] = surplus[e]
            total += 1
    while taken < count:
        rows[total] = listed[taken]
        taken += 1
        total += 1
    for place in range(waiting):
        own = slot[queue[place]]
        member = own < 0
        for k in range(members):
            member = member or who[k] == queue[place]
        if not member and _coupled(own, members, who, slot, stride, window) > 0:
            _insert(total, own, rows)
            total += 1
    return total


@native
def only_planned(count: i64, rows: i32s, columns: i32s, stride: i64, window: f64s) -> i64:
    """Whether there is none of the entries that are not planned."""
    for k in range(count):
        if window[rows[k] * stride + columns[k]] != 0.0:
            return 0
    return 1
