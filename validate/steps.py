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
    total = np.zeros(setup.solution.n)
    for tie in setup.ties:
        total += (motion.positions[1:, tie.position] - tie.line.value.before[1:]) ** 2
        if tie.line.rate is not None:
            gap = motion.velocities[1:, tie.velocity] - tie.line.rate.before[1:]
            total += (gap / limits.TRACKING_RATE) ** 2
    errors = np.sqrt(total)
    return np.where(np.isfinite(errors), errors, np.inf)
