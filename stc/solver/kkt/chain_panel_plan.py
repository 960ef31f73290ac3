"""Which pivots of a chain's stage make a panel, and panels written down as chain_panel reads them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.records import dataclass
from stc.solver.kkt.ordering import SECOND

__all__ = ["Panels", "join_panels", "write_panels"]

Int32s = NDArray[np.int32]


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


#: The panels that ``_join`` has found, in the order of their elimination, and how many.
_collect_panels = function("chain_panel_plan_collect_panels")
#: Write panels down as chain_panel reads them.
write_panels = function("chain_panel_plan_write_panels")
#: The rows that each pivot couples with, (units * size,), and where the best panel that ends before each begins.
_join = function("chain_panel_plan_join")
