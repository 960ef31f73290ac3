"""Entries of K in elimination order: loading, equilibration, products.

The method and its code are in ``stc/core/staged/values.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["choose_plan", "count_nonzero", "equilibrate", "find_scale", "load", "residual"]

#: A scale is good when the largest entries of all rows are within this factor of 1.
GOOD = 2.0

#: Put the values of H, J, p and d at their places; returns 0, or 1 when a value is not finite.
load = function("values_load")
#: How many of some values differ from zero.
count_nonzero = function("values_count_nonzero")
#: Make ``cells[at]`` tell whether all of some values are zero, as a plan takes them to be.
choose_plan = function("values_choose_plan")
#: Improve the scale by the largest entries of the rows; 0 when it is good, or is now.
find_scale = function("values_find_scale")
#: Scale rows and columns alike until the largest entries of all rows are near 1 (Ruiz 2001).
equilibrate = function("values_equilibrate")
#: ``remainder = rhs - K solution``; returns its largest magnitude, nan when not finite.
residual = function("values_residual")
