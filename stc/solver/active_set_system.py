"""Newton's system on an active set: active variables held, rows that are not active left out.

Both nearly, by large diagonals, as those of a barrier method are near its end; and active inequalities give way a
little.  So the matrix is like others before it, and whatever has eliminated those eliminates it as well, which it would
not if entries were missing.  The diagonals are so large that what is left out adds next to nothing even to curvature
that is next to nothing itself; rows that give way leave a millionth of a step or so: the next one, or a correction with
the same factorisation, has it from the true conditions.  (As penalties and shifts that refinements take out: J. Nocedal
and S. J. Wright, Numerical Optimization, 2006, sections 17.1 and 16.3.)
"""

from __future__ import annotations

from collections.abc import Callable

from stc.solver.kkt.contract import KKTSystem, NotFinite
from stc.solver.products import NOTHING

__all__ = [
    "AGAINST_DEPENDENT_ROWS", "CHANGES", "REFINEMENTS", "factorize_restricted",
]  # fmt: skip

CHANGES = 12
"""How many active sets are tried, one after the other."""
REFINEMENTS = 10
"""Solutions are refined so many times at most."""
AGAINST_DEPENDENT_ROWS = 1
"""The regularity with the one shift alone."""


def factorize_restricted(
    write: Callable[[float, float, float], object], largest: float, kkt: KKTSystem, regularity: int = 0
) -> tuple[int, bool]:
    """Factorise the H and J in the arrays of a KKT system, regularised as much as it takes.

    Args:
        write: writes the diagonals of an active set (``conditions_restricted_diagonals`` in ``active_set.h``).
        largest: entry of the Hessian.
        kkt: the system that its matrix is in.
        regularity: what to begin with: 0 no shift; 1 one against dependent rows; 2 one of the Hessian, too.

    Returns:
        The regularity reached, and whether the curvature on the active set is positive with it.
    """
    size = max(1.0, largest)
    shifts = ((0.0, 0.0), (0.0, NOTHING), (NOTHING * size, NOTHING))
    m = kkt.dual.size
    while True:
        write(*shifts[regularity], size / NOTHING**2)
        try:
            inertia = kkt.refactor()
        except NotFinite:
            return regularity, False
        if inertia.zero == 0 and inertia.negative == m:
            return regularity, True
        if regularity == len(shifts) - 1:
            return regularity, False
        # What is subtracted from the diagonal of the rows makes no eigenvalue positive.
        regularity = len(shifts) - 1 if inertia.negative > m else regularity + 1
