"""Jumps of velocity: an impulse must come from somewhere.

A jump of velocity by dv takes the generalised impulse M dv.  Actuators and applied forces are finite and give
none; impulses come through the contacts that the spec names.  What no combination of these can give is an
error.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.dynamics import SmoothDynamics

if TYPE_CHECKING:
    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup


@dataclass(frozen=True, slots=True)
class VelocityJumps:
    """What the velocity jumps of a motion leave unexplained.

    Attributes:
        frames: at which some velocity jumps.
        residual: (k,) per tied joint, largest impulse in kg m/s or kg m^2/s that no contact gives.
        scale: largest generalised momentum at these frames.
    """

    frames: list[int]
    residual: FloatArray
    scale: float

    @property
    def share(self) -> FloatArray:
        """(k,) the residuals as a share of the scale."""
        return self.residual / self.scale if self.scale > 0.0 else self.residual


def velocity_jumps(setup: Setup) -> VelocityJumps | None:
    """Look at every frame where a tied joint's velocity jumps; None where there is none or a joint is not tied.

    Frames 0 and n count too: a motion that closes upon itself may jump there.
    """
    reference = setup.reference
    rates = [tie.line.rate for tie in setup.ties]
    jump = np.zeros(setup.solution.n + 1, dtype=bool)
    for rate in rates:
        assert rate is not None
        jump |= np.abs(rate.after - rate.before) > 1e-12 * max(1.0, float(np.abs(rate.before).max()))
    frames = [int(k) for k in np.flatnonzero(jump)]
    if not frames or not setup.all_tied:
        return None
    dynamics = SmoothDynamics(setup.model(contacts=False))
    worst, scale = np.zeros(setup.compiled.nv), 0.0
    position = dynamics.data.qpos.copy()
    for frame in frames:
        before, after = reference.at("before", frame), reference.at("after", frame)
        position[reference.positions] = after[0]
        dynamics.put(position)
        mass = dynamics.mass_matrix()
        old, new = np.zeros(len(worst)), np.zeros(len(worst))
        old[reference.velocities], new[reference.velocities] = before[1], after[1]
        impulse = mass @ (new - old)
        directions = _directions(setup, dynamics)
        if directions.shape[1]:
            given = directions @ np.linalg.lstsq(directions, impulse, rcond=None)[0]
            impulse = impulse - given
        worst = np.maximum(worst, np.abs(impulse))
        scale = max(scale, float(np.abs(mass @ old).max()), float(np.abs(mass @ new).max()))
    return VelocityJumps(frames, worst[reference.velocities], scale)


def _directions(setup: Setup, dynamics: SmoothDynamics) -> FloatArray:
    """(nv, k) generalised impulse of a unit impulse along each contact line, in the present position."""
    found = []
    for one in np.eye(len(setup.contact)):
        setup.contact.apply(dynamics.model, dynamics.data, one)
        found.append(dynamics.data.qfrc_applied.copy())
    return np.array(found).T if found else np.zeros((dynamics.model.nv, 0))
