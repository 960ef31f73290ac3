"""One panel of pivots taken out of eight segments at once (see stc.solver.kkt.lanes).

The method and its code are in ``stc/core/staged/lane_panel.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["KNOWN", "PANEL", "panel_vectors", "take_panel"]

#: Unknowns of a panel at most.
PANEL = 4
#: Numbers of what is known of the members of a panel.
KNOWN = 136

#: How many vectors are kept of a panel.
panel_vectors = function("lane_panel_panel_vectors")
#: Take the members out of ``work``.
take_panel = function("lane_panel_take_panel")
