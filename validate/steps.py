"""Each step of a motion simulated alone, from the solved state at its left frame.

Errors do not accumulate or grow, so that this also works for an unstable motion, and shows which step is wrong.
"""

from __future__ import annotations

import numpy as np

from stc.validate import limits
from stc.validate.metrics import FloatArray
from stc.validate.replay import replay
from stc.validate.setup import Setup


def step_errors(setup: Setup, time_step: float = limits.TIME_STEP) -> FloatArray:
    """The distance of MuJoCo's state at the end of each step from the solved one, in m and rad, over all tied joints.
    (n,)

    Errors of the velocity are multiplied by the time constant of the feedback,
    1/:data:`stc.validate.limits.TRACKING_RATE`.  Solved contact forces act in place of the model's contacts.

    Args:
        setup: the motion and its model.
        time_step: longest time step of the simulation, in seconds.
    """
    motion = replay(setup, time_step, external=bool(len(setup.contact)), every_step=True)
    reference, total = setup.reference, np.zeros(setup.solution.n)
    for frame in range(1, setup.solution.n + 1):
        place, rate = reference.at("before", frame)[:2]
        gaps = [
            reference.deviation(place, motion.positions[frame, reference.positions]),
            (motion.velocities[frame, reference.velocities] - rate) / limits.TRACKING_RATE,
        ]
        total[frame - 1] = np.sum(np.square(gaps))
    errors = np.sqrt(total)
    return np.where(np.isfinite(errors), errors, np.inf)
