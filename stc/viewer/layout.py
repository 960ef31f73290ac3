"""The place of the panel in the window, and the free part for the motion."""

from __future__ import annotations

from stc.records import dataclass

#: Size of the panel in pixels where it stands beside the motion, its distance from the window's edges, and the heights
#: of Studio's menu above and of its status bars below.
_WIDTH, _HEIGHT, _GAP, _MENU, _STATUS = 330.0, 640.0, 8.0, 34.0, 66.0

#: The motion needs so many times the panel's width beside it; otherwise the panel goes below the motion and takes this
#: share of the window's height.
_BESIDE, _BELOW = 1.0, 0.48


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Part of a window, in pixels from its upper left corner."""

    left: float
    top: float
    width: float
    height: float


def arrange(width: float, height: float) -> tuple[Rectangle, Rectangle]:
    """The panel, and the part that is free for the motion.

    Args:
        width: of the window, in pixels.
        height: of the window.
    """
    bottom = max(height - _STATUS, _MENU + 1.0)
    covered = _GAP + _WIDTH
    if width >= covered + _BESIDE * _WIDTH:
        panel = Rectangle(_GAP, _MENU, _WIDTH, min(_HEIGHT, bottom - _MENU))
        return panel, Rectangle(covered, 0.0, width - covered, height)
    top = max(bottom - _BELOW * height, _MENU + 1.0)
    panel = Rectangle(_GAP, top, max(width - 2.0 * _GAP, 1.0), bottom - top)
    return panel, Rectangle(0.0, _MENU, width, top - _MENU)
