"""Each step of a motion on its own: from the solved state at its left frame, where does MuJoCo go?

Nothing accumulates and nothing grows, so that an unstable motion can be asked as well, and the step that is at fault
shows itself.
"""

from __future__ import annotations

import numpy as np

from stc.validate import limits
from stc.validate.metrics import FloatArray
from stc.validate.replay import replay
from stc.validate.setup import Setup


def step_errors(setup: Setup, time_step: float = limits.TIME_STEP) -> FloatArray:
    """How far MuJoCo ends each step from the solved state, in m and rad, all tied joints together. (n,)

    What the step adds to the velocity counts with the time in which feedback takes deviations back,
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
