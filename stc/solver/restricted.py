"""Newton's system on an active set: active variables held, rows that are not active left out."""

from __future__ import annotations

from stc.solver.conditions import restricted_diagonals
from stc.solver.kkt.contract import AttachedKKT, NotFinite
from stc.solver.nlp import Floats

__all__ = ["AGAINST_DEPENDENT_ROWS", "DUAL_SHIFT", "RestrictedDiagonals", "factorize_restricted"]

DUAL_SHIFT = 1e-9
PRIMAL_SHIFT = 1e-8
"""Relative to the largest entry of the Hessian, or to 1."""
AGAINST_DEPENDENT_ROWS = 1
"""The regularity with the one shift alone."""


class RestrictedDiagonals:
    """The diagonals that go with an active set.

    Args:
        kkt: whose diagonals they become.
        active_x: 1 for variables that are held, else 0, (n,).
        active_rows: 1 for rows that are active, else 0, (m,).
    """

    def __init__(self, kkt: AttachedKKT, active_x: Floats, active_rows: Floats) -> None:
        self.kkt = kkt
        self._call = call = restricted_diagonals.bind(
            active_x.size, active_rows.size, 0.0, 0.0, active_x, active_rows, kkt.primal, kkt.dual
        )
        self._places = call.position("shift_x"), call.position("shift_y")

    def write(self, shift_x: float, shift_y: float) -> None:
        """Write them, with shifts of the free variables and of the active rows."""
        floats = self._call.floats
        floats[self._places[0]], floats[self._places[1]] = shift_x, shift_y
        self._call()


def factorize_restricted(
    diagonals: RestrictedDiagonals, largest: float, regularity: int = 0, *, irregular: bool = True
) -> tuple[int, bool]:
    """Factorise the H and J in the arrays of a KKT system, regularised as much as it takes.

    Args:
        diagonals: of the system on an active set.
        largest: entry of the Hessian.
        irregular: whether the active set leaves anything out.
        regularity: what to begin with: 0 no shift; 1 one against dependent rows; 2 one of the Hessian, too.

    Returns:
        The regularity reached, and whether the curvature on the active set is positive with it.
    """
    flat = PRIMAL_SHIFT * max(1.0, largest)
    shifts = ((0.0, 0.0), (0.0, DUAL_SHIFT), (flat, DUAL_SHIFT))
    kkt = diagonals.kkt
    m = kkt.dual.size
    while True:
        diagonals.write(*shifts[regularity])
        kkt.irregular = irregular
        try:
            inertia = kkt.refactor()
        except NotFinite:
            return regularity, False
        finally:
            kkt.irregular = False
        if inertia.zero == 0 and inertia.negative == m:
            return regularity, True
        if regularity == len(shifts) - 1:
            return regularity, False
        regularity += 1
