"""Equalities that drift open between the frames because the spec states only their velocities or accelerations.

A loop g = 0 may be stated by its accelerations, g'' = 0 (index reduction: E. Hairer and G. Wanner, Solving Ordinary
Differential Equations II, 1996, section VII.2).  At every frame the accelerations of the joints then fit the loop, but
the error of each step is never corrected.  With g'' + 2 w g' + w^2 g = 0 it is (J. Baumgarte, Stabilization of
constraints and integrals of motion in dynamical systems, 1972), but errors of long steps may open the loop faster.
Wrong joint lines look different: the accelerations that they give satisfy no such equation with the same numbers at all
frames, or the equality is broken at the first frame already.
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
_NEAR = 1e-4
#: Rates that are smaller than this share of those that single joints give count as none.
_FITS = 1e-3
#: An equality is closed at first where it is broken there by less than this share of what it comes to.
_CLOSED = 0.01
#: A condition that pulls explains the derivatives if it leaves less than this share of them; on fewer frames than this
#: some condition does in any case.
_EXPLAINED, _FEW = 0.1, 6


def drifting_equalities(setup: Setup) -> dict[str, bool]:
    """The equalities that hold at the first frame and whose rates hold at all frames, but not their positions.

    Returns
    -------
    dict[str, bool]
        By the name of the equality, whether the spec's condition pulls it back once it is open.
    """
    model = setup.model(contacts=False)
    if not model.neq or setup.untied is not None or not all(tie.knows_acceleration for tie in setup.ties):
        return {}
    n = setup.solution.n
    # (frames, before now after), with the accelerations and with the velocities alone.
    curved, straight = (
        [_along(setup, model, frame, whole) for frame in range(n + 1)] for whole in (True, False)
    )
    found = {}
    for index in sorted(set.intersection(*(set(one[1]) for one in curved))):
        gaps = np.array([[rows[index] for rows in one] for one in curved])
        plain = np.array([[rows[index] for rows in one] for one in straight])
        broken = np.abs(gaps[:, 1]).max(axis=1)
        if not broken[0] <= _CLOSED * broken.max():
            continue
        gap, rate, bend = gaps[:, 1], (plain[:, 2] - plain[:, 0]) / (2.0 * _NEAR), _bends(gaps)
        pulled = _pulled(bend, [rate, gap], _FITS * float(np.abs(_bends(plain)).max()))
        if pulled is None:
            pulled = _pulled(rate, [gap], _FITS * _alone(setup, model, index))
        if pulled is not None:
            found[equality_title(model, index)] = pulled
    return found


def _bends(gaps: FloatArray) -> FloatArray:
    """(frames, rows) the second derivatives of residuals."""
    return np.asarray((gaps[:, 2] - 2.0 * gaps[:, 1] + gaps[:, 0]) / _NEAR**2)


def _pulled(highest: FloatArray, lower: list[FloatArray], nothing: float) -> bool | None:
    """Whether a condition with a pull holds at all frames, or one without.

    Args:
        highest: (frames, rows) the highest derivative of the residuals in the condition.
        lower: the lower ones; a pull is a sum of negative multiples of them, the same at all frames.
        nothing: a derivative that is smaller than this is zero.

    Returns:
        None if neither holds.
    """
    left = np.zeros(highest.shape)
    for row in range(highest.shape[1]):
        columns = np.stack([one[:, row] for one in lower], axis=1)
        factors = np.linalg.lstsq(columns, highest[:, row], rcond=None)[0]
        left[:, row] = highest[:, row] - columns @ np.minimum(factors, 0.0)
    whole, rest = float(np.abs(highest).max()), float(np.abs(left).max())
    if len(highest) >= _FEW and rest <= min(nothing, _EXPLAINED * whole):
        return True
    return False if whole <= nothing else None


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


def _alone(setup: Setup, model: mujoco.MjModel, index: int) -> float:
    """The largest rate that the motion of a single joint alone would give the residuals at a frame."""
    import mujoco

    from stc.validate.equalities import constraint_rows

    data, alone = mujoco.MjData(model), 0.0
    for frame in range(setup.solution.n + 1):
        setup.reference.put(
            data, setup.reference.at("after" if frame < setup.solution.n else "before", frame)
        )
        mujoco.mj_fwdPosition(model, data)
        parts = constraint_rows(model, data, equality_rows(data).get(index, np.zeros(0, int))) * data.qvel
        alone = max(alone, float(np.abs(parts).max(initial=0.0)))
    return alone
