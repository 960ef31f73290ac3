"""Jumps of position: whatever a spec lets jump at a frame, a body is in one place at a time.

Replays go on from where they are, and what they are compared with at a frame that jumps is the nearer of two values, so
that a joint which is set aside by little shows in none of them: it is measured by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stc.validate import limits
from stc.validate.metrics import Metric

if TYPE_CHECKING:
    from stc.validate.setup import Setup


def position_jumps(setup: Setup) -> list[Metric]:
    """The largest jump of each tied joint, in its unit; nothing where no joint has two values at a frame."""
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
