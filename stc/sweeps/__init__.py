"""Sweeps: one spec solved and judged for every combination of values of some constants.

    import stc

    found = stc.sweep("luxo_jump", {"D": [0.3, 0.35, 0.4], "g": [9.81, 3.7]}, "jumps")
    found.columns()["verdict"]          # one per point, in the order of the grid
    found.solution(4)                   # the motion of point 4

:mod:`stc.sweeps.grid` says which points there are and from which neighbour each starts, :mod:`stc.sweeps.point` solves
one of them, :mod:`stc.workers` does so on several processors or machines, and :mod:`stc.sweeps.folder` keeps
what was found.
"""

from __future__ import annotations

from stc.sweeps.folder import Sweep
from stc.sweeps.grid import Grid
from stc.sweeps.rounds import sweep

__all__ = ["Grid", "Sweep", "sweep"]
