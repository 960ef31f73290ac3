"""Equalities that drift open between the frames because the spec states only their velocities or accelerations.

A loop may be stated by its accelerations (index reduction: E. Hairer and G. Wanner, Solving Ordinary Differential
Equations II, 1996, section VII.2).  At every frame the accelerations of the joints then fit the loop, but the error of
each step is never corrected.  Wrong joint lines look different: their accelerations do not fit the equality either, or
the equality is broken at the first frame already.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.metrics import FloatArray
from stc.validate.solved_pose import equality_rows, equality_title

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup

__all__ = ["drifting_equalities"]

#: Seconds before and after a frame, for differences along the motion there.
_NEAR = 1e-3
#: Rates that are smaller than this share of those that single joints give count as none.
_FITS = 1e-3
#: An equality is closed at first where it is broken there by less than this share of what it comes to.
_CLOSED = 0.01


def drifting_equalities(setup: Setup) -> list[str]:
    """Names of the equalities that hold at the first frame and whose rates hold at all frames, but not their
    positions.
    """
    model = setup.model(contacts=False)
    if not model.neq or setup.untied is not None or not all(tie.knows_acceleration for tie in setup.ties):
        return []
    n = setup.solution.n
    # (frames, before now after), with the accelerations and with the velocities alone.
    curved, straight = (
        [_along(setup, model, frame, whole) for frame in range(n + 1)] for whole in (True, False)
    )
    found = []
    for index in sorted(set.intersection(*(set(one[1]) for one in curved))):
        gaps = np.array([[rows[index] for rows in one] for one in curved])
        plain = np.array([[rows[index] for rows in one] for one in straight])
        broken = np.abs(gaps[:, 1]).max(axis=1)
        if not broken[0] <= _CLOSED * broken.max():
            continue
        rate, speeds = _rates(setup, model, index)
        if _bend(gaps) <= _FITS * _bend(plain) or rate <= _FITS * speeds:
            found.append(equality_title(model, index))
    return found


def _bend(gaps: FloatArray) -> float:
    return float(np.abs(gaps[:, 2] - 2.0 * gaps[:, 1] + gaps[:, 0]).max()) / _NEAR**2


def _along(setup: Setup, model: mujoco.MjModel, frame: int, whole: bool) -> list[dict[int, FloatArray]]:
    """The residuals of each equality before, at and after a frame, extrapolated with the velocities and
    accelerations.
    """
    import mujoco

    data = mujoco.MjData(model)
    found = []
    for time in (-_NEAR, 0.0, _NEAR):
        setup.reference.put(
            data, setup.reference.at("after" if frame < setup.solution.n else "before", frame)
        )
        speed = data.qvel + (0.5 * time * data.qacc if whole else 0.0)
        mujoco.mj_integratePos(model, data.qpos, speed, time)
        mujoco.mj_fwdPosition(model, data)
        found.append({index: data.efc_pos[rows].copy() for index, rows in equality_rows(data).items()})
    return found


def _rates(setup: Setup, model: mujoco.MjModel, index: int) -> tuple[float, float]:
    """The largest rate of each residual at the frames, and its rate if single joints moved alone."""
    import mujoco

    from stc.validate.equalities import constraint_rows

    data, together, alone = mujoco.MjData(model), 0.0, 0.0
    for frame in range(setup.solution.n + 1):
        setup.reference.put(
            data, setup.reference.at("after" if frame < setup.solution.n else "before", frame)
        )
        mujoco.mj_fwdPosition(model, data)
        parts = constraint_rows(model, data, equality_rows(data).get(index, np.zeros(0, int))) * data.qvel
        together = max(together, float(np.abs(parts.sum(axis=1)).max(initial=0.0)))
        alone = max(alone, float(np.abs(parts).max(initial=0.0)))
    return together, alone
