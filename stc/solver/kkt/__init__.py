"""Factorisations of the KKT system: the structured one, and a dense one to judge it by."""

from __future__ import annotations

from stc.solver.kkt.contract import AttachedKKT, Inertia, KKTSystem
from stc.solver.kkt.dense import DenseKKT
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.reuse import StructuredKKT

__all__ = ["AttachedKKT", "DenseKKT", "Inertia", "KKTSystem", "MultifrontalKKT", "structured_kkt"]

structured_kkt = StructuredKKT
