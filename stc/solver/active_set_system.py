"""Newton's system on an active set: active variables held, rows that are not active left out.

Both nearly, by large diagonals, as those of a barrier method are near its end; and active inequalities give way a
little.  So the matrix is like others before it, and whatever has eliminated those eliminates it as well, which it would
not if entries were missing.  What that leaves is a millionth of a step or so: the next one, or a correction with the
same factorisation, has it from the true conditions.  (As penalties and shifts that refinements take out: J. Nocedal and
S. J. Wright, Numerical Optimization, 2006, sections 17.1 and 16.3.)
"""

from __future__ import annotations

from stc.solver.conditions import restricted_diagonals
from stc.solver.kkt.contract import NotFinite
from stc.solver.nlp import Floats
from stc.solver.products import NOTHING
from stc.solver.scaled_problem import ScaledProblem

__all__ = [
    "AGAINST_DEPENDENT_ROWS",
    "CHANGES",
    "REFINEMENTS",
    "RestrictedDiagonals",
    "factorize_restricted",
]

CHANGES = 12
"""How many active sets are tried, one after the other."""
REFINEMENTS = 10
"""Solutions are refined so many times at most."""
AGAINST_DEPENDENT_ROWS = 1
"""The regularity with the one shift alone."""


class RestrictedDiagonals:
    """The diagonals that go with an active set.

    Args:
        form: the problem, whose linear algebra's diagonals they become.
        active_x: 1 for variables that are held, else 0, (n,).
        active_rows: 1 for rows that are active, else 0, (m,).
    """

    def __init__(self, form: ScaledProblem, active_x: Floats, active_rows: Floats) -> None:
        self.kkt = kkt = form.attached_kkt
        self._call = call = restricted_diagonals.bind(
            active_x.size, active_rows.size, 0.0, 0.0, 0.0, 1.0 / NOTHING, NOTHING, form.held_factor,
            form.equality_factor, active_x, active_rows, kkt.primal, kkt.dual,
        )  # fmt: skip
        self._places = tuple(call.position(name) for name in ("shift_x", "shift_y", "firm"))

    def write(self, shift_x: float, shift_y: float, firm: float) -> None:
        """Write them, with shifts of the free variables and of the active rows."""
        floats = self._call.floats
        for place, value in zip(self._places, (shift_x, shift_y, firm), strict=True):
            floats[place] = value
        self._call()


def factorize_restricted(
    diagonals: RestrictedDiagonals, largest: float, regularity: int = 0
) -> tuple[int, bool]:
    """Factorise the H and J in the arrays of a KKT system, regularised as much as it takes.

    Args:
        diagonals: of the system on an active set.
        largest: entry of the Hessian.
        regularity: what to begin with: 0 no shift; 1 one against dependent rows; 2 one of the Hessian, too.

    Returns:
        The regularity reached, and whether the curvature on the active set is positive with it.
    """
    size = max(1.0, largest)
    shifts = ((0.0, 0.0), (0.0, NOTHING), (NOTHING * size, NOTHING))
    kkt = diagonals.kkt
    m = kkt.dual.size
    while True:
        diagonals.write(*shifts[regularity], size / NOTHING)
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
