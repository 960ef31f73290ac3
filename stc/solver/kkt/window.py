"""The dense window of the elimination: reading a column, taking a pivot out.

The method and its code are in ``stc/core/staged/window.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["LANES", "clear", "gather", "gather_listed", "largest", "merge", "subtract_one", "subtract_two"]

#: Rows are padded to whole vectors.
LANES = 8

#: List the nonzeros of a column among the slots below ``top`` and from ``low`` to ``high``; their number.
gather = function("window_gather")
#: Values of a column at the listed slots (the column's own is not among them).
gather_listed = function("window_gather_listed")
#: Largest magnitude of a column.
largest = function("window_largest")
#: Set a column to zero at the listed slots and on the diagonal.
clear = function("window_clear")
#: Bring two columns to their common list of slots, leaving out one slot of each; its length.
merge = function("window_merge")
#: ``window -= factors values^T`` on the listed slots; ``spread`` (stride,) is zero before and after.
subtract_one = function("window_subtract_one")
#: ``window -= factors_1 first^T + factors_2 second^T`` on the listed slots.
subtract_two = function("window_subtract_two")
