"""Factorisations of the KKT system."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from stc.solver.kkt.contract import Inertia, KKTSystem
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.reuse import StructuredKKT

__all__ = ["Inertia", "KKTSystem", "MultifrontalKKT", "structured_kkt"]

structured_kkt = cast("Callable[..., KKTSystem]", StructuredKKT)
