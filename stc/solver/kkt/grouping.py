"""Consecutive pivots of a stage's order that are eliminated together, in panels (see stc.solver.kkt.panel).

The method and its code are in ``stc/core/staged/grouping.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["MEMBERS", "group_stage"]

#: Pivots of a group, in unknowns, at most.
MEMBERS = 16

#: Cut the order that ``order_stage`` has found into groups.
group_stage = function("grouping_group_stage")
