"""Consecutive pivots of a stage's order that are eliminated together, in panels (see stc.solver.kkt.panel).

Together they have the rows that any of them has.  What that wastes on zeros is weighed against what every panel costs
besides: groups are the cheapest ones of an order (by dynamic programming over where they end), for costs in cycles as
measured.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["MEMBERS", "group_stage"]

#: Pivots of a group, in unknowns, at most.
MEMBERS = 16

#: Cut the order that ``order_stage`` has found into groups.
group_stage = function("grouping_group_stage")
