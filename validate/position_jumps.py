"""Jumps of position: a spec may state any jump at a frame, but a body cannot change its place abruptly.

At a frame with a jump, a replay continues from its own position and is compared with the nearer of the two values, so
that a small jump of a joint does not show there.  It is measured separately.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stc.validate import limits
from stc.validate.metrics import Metric

if TYPE_CHECKING:
    from stc.validate.setup import Setup


def position_jumps(setup: Setup) -> list[Metric]:
    """The largest jump of each tied joint, in its unit; empty if no joint has two values at a frame."""
    jumps = [tie.largest_jump(bool(setup.compiled.jnt_limited[tie.joint])) for tie in setup.ties]
    if not any(jumps):
        return []
    # Both sides are unknowns of their own, which rows hold together as well as the solver met them.
    left = limits.left_by_solver(setup.solution.violation)
    limit = limits.POSITION_JUMP * max(1.0, setup.reference.extent) + left
    return [
        Metric("jump of position", f"joint {tie.name}", jump, tie.unit, limit)
        for tie, jump in zip(setup.ties, jumps)
    ]
