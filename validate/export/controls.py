"""The inputs of a MuJoCo program that plays a motion: controls for every time step, and feedback gains.

The file holds NumPy arrays for a model with nq positions, nv velocities and nu controls, over K equal steps:

==================  ================  =====================================================================
``timestep``        ()                seconds, to put into ``model.opt.timestep``
``time``            (K+1,)            seconds, from the start of the motion
``ctrl``            (K, nu)           controls to hold during each step
``qpos``, ``qvel``  (K+1, nq or nv)   the solved motion
``qfrc_applied``    (K, nv)           forces of ``apply`` lines; only where the spec has any
``gain``            (K, nu, 2 nv)     feedback, where there is one: add ``gain[k] @ concatenate([way, qvel[k] -
                                      data.qvel])`` to the control, with ``way`` from ``mj_differentiatePos(model,
                                      way, 1, data.qpos, qpos[k])``: ``qpos[k] - data.qpos`` without quaternions
==================  ================  =====================================================================

Each control is that at the middle of its step, so that the error of holding it is of second order in the step.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from stc.atomic import replacing
from stc.validate.export.proportion import require_proportion
from stc.validate.export.states import controls, velocities
from stc.validate.linearisation import linearised
from stc.validate.metrics import FloatArray
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import Setup
from stc.validate.signals import steps_at
from stc.validate.tracking import Feedback, proportional, regulator


def steps(setup: Setup, time_step: float | None = None) -> tuple[int, float]:
    """Number and duration, in seconds, of the equal steps of the motion."""
    wanted = float(setup.compiled.opt.timestep) if time_step is None else time_step
    count = max(1, math.ceil(setup.solution.duration / wanted - 1e-9))
    return count, setup.solution.duration / count


def played(setup: Setup, time_step: float | None = None) -> dict[str, FloatArray]:
    """The arrays of the file without ``gain``; see the module's table.

    Raises:
        UsageError: with such steps the file is out of proportion.
    """
    model, solution = setup.compiled, setup.solution
    wanted = float(model.opt.timestep) if time_step is None else time_step
    numbers = 1 + model.nq + 2 * model.nv + model.nu * (1 + 2 * model.nv)
    require_proportion(solution.duration / wanted, numbers, f"a time step of {wanted:g} s")
    edges, middles = _times(setup, time_step)
    found = {
        "timestep": np.array(steps(setup, time_step)[1]),
        "time": edges - edges[0],
        "ctrl": controls(setup, middles),
        "qpos": solved_at(setup, edges),
        "qvel": velocities(setup, edges),
    }
    if len(setup.applied):
        forces = setup.applied.at_times(middles)
        found["qfrc_applied"] = _generalised(setup, solved_at(setup, middles), forces)
    return found


def sequence(setup: Setup, time_step: float | None = None) -> dict[str, FloatArray]:
    """The arrays of the file; see the module's table.

    Raises:
        UsageError: with such steps the file is out of proportion.
    """
    found, model = played(setup, time_step), setup.compiled
    law = _law(setup)
    if law is not None:
        found["gain"] = np.zeros((len(found["ctrl"]), model.nu, 2 * model.nv))
        order = np.concatenate([setup.reference.velocities, model.nv + setup.reference.velocities])
        steps, shares = steps_at(setup.solution.time, _times(setup, time_step)[1])
        for step in np.unique(steps):
            mine = np.flatnonzero(steps == step)
            gains = law.gains(int(step), shares[mine])
            found["gain"][np.ix_(mine, setup.controls.addresses, order)] = gains
    return found


def _times(setup: Setup, time_step: float | None) -> tuple[FloatArray, FloatArray]:
    """The ends of the steps, and their middles."""
    solution, (count, length) = setup.solution, steps(setup, time_step)
    edges = solution.time[0] + length * np.arange(count + 1)
    edges[-1] = solution.time[-1]
    return edges, 0.5 * (edges[:-1] + edges[1:])


def write(setup: Setup, path: Path, time_step: float | None = None) -> None:
    """Write the arrays; see the module's table.

    Raises:
        UsageError: with such steps the file is out of proportion.
        OSError: the file cannot be written.
    """
    arrays = sequence(setup, time_step)
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez(stream, **arrays)  # type: ignore[arg-type]


def _law(setup: Setup) -> Feedback | None:
    """The feedback: the regulator if there is one, else proportional-derivative control."""
    if not setup.solution.n or not len(setup.controls):
        return None
    maps = linearised(setup)
    law = None if maps is None else regulator(setup, maps)
    if law is not None:
        return law
    return proportional(setup)


def _generalised(setup: Setup, positions: FloatArray, forces: FloatArray) -> FloatArray:
    """(k, nv) the generalised forces of external forces at the solved positions."""
    import mujoco

    model = setup.model()
    data = mujoco.MjData(model)
    found = np.zeros((len(positions), model.nv))
    for k, position in enumerate(positions):
        data.qpos[:] = position
        setup.applied.apply(model, data, forces[k])
        found[k] = data.qfrc_applied
    return found
