"""Jumps of position: whatever a spec lets jump at a frame, a body is in one place at a time.

Replays go on from where they are, and what they are compared with at a frame that jumps is the nearer of two values, so
that a joint which is set aside by little shows in none of them: it is measured by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.metrics import Metric

if TYPE_CHECKING:
    from stc.validate.metrics import FloatArray
    from stc.validate.model import Tie
    from stc.validate.setup import Setup


def position_jumps(setup: Setup) -> list[Metric]:
    """The largest jump of each tied joint, in its unit; nothing where no joint has two values at a frame."""
    jumps = [_largest_jump(setup, tie) for tie in setup.ties]
    if not any(jumps):
        return []
    # Both sides are unknowns of their own, which rows hold together as well as the solver met them.
    left = limits.left_by_solver(setup.solution.violation)
    limit = limits.POSITION_JUMP * max(1.0, setup.reference.extent) + left
    return [
        Metric("jump of position", f"joint {tie.name}", jump, tie.unit, limit)
        for tie, jump in zip(setup.ties, jumps)
    ]


def _largest_jump(setup: Setup, tie: Tie) -> float:
    """How far the value after a frame is from the one before it, at most.

    Inside the motion the replay tells turns apart.  At its ends nothing does: a hinge that may turn all around is where
    it is however many turns are counted.
    """
    value = tie.line.value
    jump = value.after - value.before
    if tie.unit == "rad" and not setup.compiled.jnt_limited[setup.compiled.dof_jntid[tie.velocity]]:
        jump = np.concatenate([_less_turns(jump[:1]), jump[1:-1], _less_turns(jump[-1:])])
    return float(np.abs(jump).max(initial=0.0))


def _less_turns(angle: FloatArray) -> FloatArray:
    return np.asarray(angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi)))
