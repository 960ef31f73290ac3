"""Newton's system on an active set: active variables held, rows that are not active left out."""

from __future__ import annotations

from stc.solver.conditions import restricted_diagonals
from stc.solver.kkt.contract import AttachedKKT, NotFinite
from stc.solver.nlp import Floats

__all__ = ["DUAL_SHIFT", "factorize_restricted"]

DUAL_SHIFT = 1e-9
PRIMAL_SHIFT = 1e-8
"""Relative to the largest entry of the Hessian, or to 1."""


def factorize_restricted(
    kkt: AttachedKKT, active_x: Floats, active_rows: Floats, largest: float, regularity: int = 0
) -> tuple[int, bool]:
    """Factorise the H and J in the arrays of ``kkt``, regularised as much as it takes.

    Args:
        active_x: 1 for variables that are held, else 0, (n,).
        active_rows: 1 for rows that are active, else 0, (m,).
        largest: entry of the Hessian.
        regularity: what to begin with: 0 no shift; 1 one against dependent rows; 2 one of the Hessian, too.

    Returns:
        The regularity reached, and whether the curvature on the active set is positive with it.
    """
    flat = PRIMAL_SHIFT * max(1.0, largest)
    shifts = ((0.0, 0.0), (0.0, DUAL_SHIFT), (flat, DUAL_SHIFT))
    n, m = kkt.primal.size, kkt.dual.size
    while True:
        restricted_diagonals(n, m, *shifts[regularity], active_x, active_rows, kkt.primal, kkt.dual)
        try:
            inertia = kkt.refactor()
        except NotFinite:
            return regularity, False
        if inertia.zero == 0 and inertia.negative == m:
            return regularity, True
        if regularity == len(shifts) - 1:
            return regularity, False
        regularity += 1
