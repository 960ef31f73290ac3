"""Inverse dynamics: do the solved forces produce the solved accelerations, instant by instant?

MuJoCo computes from position, velocity and acceleration the generalised force that the motion needs; what
the solved actuators deliver is subtracted.  The rest is the residual.  Nothing is integrated, so an unstable
system is judged as sharply as a stable one, and an error in the equations of motion shows wherever it acts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stc.solution import Solution
from stc.trajectory import Channel
from stc.validate.forces import Controls
from stc.validate.metrics import FloatArray
from stc.validate.model import Tie

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, slots=True)
class InverseDynamics:
    """Largest residuals of a motion.

    Attributes:
        residual: (k,) per tied joint, N or N m.
        scale: the motion's largest generalised force: needed, delivered or due to gravity and inertia.
    """

    residual: FloatArray
    scale: float

    @property
    def share(self) -> FloatArray:
        """(k,) the residuals as a share of the scale."""
        return self.residual / self.scale if self.scale > 0.0 else self.residual


def inverse_dynamics(
    model: mujoco.MjModel, solution: Solution, ties: list[Tie], controls: Controls
) -> InverseDynamics | None:
    """Residuals at every instant where the transcription imposes the equations of motion.

    These are the frames (both sides of those that jump) and, for hermite-simpson, the midpoints; for central
    only frames whose stencils were not clipped.  Contacts are switched off in ``model``.

    Returns:
        None where it cannot be said: a joint of the model is not tied, the solution lacks an acceleration,
        or an actuator has a state of its own.
    """
    import mujoco

    if len(ties) != model.nv or model.na or any(tie.line.acceleration is None for tie in ties):
        return None
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    first, last = solution.force_frames or (0, solution.n)
    worst, scale = np.zeros(model.nv), 0.0
    for part, index in _instants(first, last, solution.method):
        for tie in ties:
            assert tie.line.rate is not None
            assert tie.line.acceleration is not None
            data.qpos[tie.position] = _value(tie.line.value, part, index)
            data.qvel[tie.velocity] = _value(tie.line.rate, part, index)
            data.qacc[tie.velocity] = _value(tie.line.acceleration, part, index)
        data.ctrl[controls.addresses] = [_value(channel, part, index) for channel in controls.channels]
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse.copy()
        mujoco.mj_fwdActuation(model, data)
        worst = np.maximum(worst, np.abs(needed - data.qfrc_actuator))
        scale = max(
            scale,
            float(np.max(np.abs(needed))),
            float(np.max(np.abs(data.qfrc_actuator))),
            float(np.max(np.abs(data.qfrc_bias))),
        )
    return InverseDynamics(worst[[tie.velocity for tie in ties]], scale)


def _instants(first: int, last: int, method: str) -> list[tuple[str, int]]:
    """Sides of frames and midpoints: what lies before the first frame or after the last one is left out."""
    found = [("after", k) for k in range(first, max(last, first + 1))]
    found += [("before", k) for k in range(first + 1, last + 1)]
    if method == "hermite-simpson":
        found += [("mid", k) for k in range(first, last)]
    return found


def _value(channel: Channel, part: str, index: int) -> float:
    values = {"before": channel.before, "after": channel.after, "mid": channel.mid}[part]
    assert values is not None
    return float(values[index])
