"""Small deviations along a solved motion: their growth, and the effect of controls on them.

MuJoCo's finite differences (``mjd_transitionFD``) give, at instants along the motion, the linear map of one time step:
deviation' = A deviation + B change of control.  Deviations are ordered positions, then velocities.  The model's own
contacts are switched off; contacts with a solved force are treated as rigid (:mod:`stc.validate.held`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.held import Holding
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError
from stc.validate.progress import steps

if TYPE_CHECKING:
    from stc.validate.setup import Setup


@dataclass(frozen=True, slots=True)
class Linearisation:
    """Maps of small deviations, one per instant; K instants, nv coordinates, m driven actuators.

    Attributes:
        first: (n+1,) index of the first instant of each frame step, and K at the end.
        step: (K,) duration of each map, in seconds.
        state: (K, 2 nv, 2 nv) the maps A.
        control: (K, 2 nv, m) the maps B.
    """

    first: np.ndarray
    step: FloatArray
    state: FloatArray
    control: FloatArray

    def index(self, frame: int, shares: FloatArray) -> np.ndarray:
        """(s,) the instants that hold for shares (s,) of a frame step."""
        count = int(self.first[frame + 1] - self.first[frame])
        inside = np.minimum((np.asarray(shares) * count + 1e-9).astype(np.intp), count - 1)
        return np.asarray(self.first[frame] + inside)


def linearise(setup: Setup, held: bool = True) -> Linearisation:
    """Linearise along the solved motion.

    Args:
        setup: the motion and its model; the motion of every coordinate must be known.
        held: whether pressing contacts are rigid; otherwise their forces do not change.

    Raises:
        ModelError: the motion of a coordinate is not known, or MuJoCo cannot differentiate the model.
    """
    import mujoco

    untied = setup.untied
    if not (setup.all_tied or untied):
        raise ModelError("the motion is not linearised: some joints of the model are not tied to the spec")
    model = setup.model(contacts=False)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(model)
    forces = setup.all_forces
    holding = Holding(setup, forces, held)
    durations = np.diff(setup.solution.time)
    parts = np.array([max(1, math.ceil(d / limits.TRACKING_STEP - 1e-9)) for d in durations], dtype=np.intp)
    first = np.concatenate([[0], np.cumsum(parts)]).astype(np.intp)
    nv, total = model.nv, int(first[-1])
    state = np.zeros((total, 2 * nv + model.na, 2 * nv + model.na))
    control = np.zeros((total, 2 * nv + model.na, model.nu))
    for frame in steps("linearisation", setup.solution.n):
        count = parts[frame]
        # Where each part begins, its middle, and where the last one ends.
        every = np.arange(2 * count + 1) / (2 * count)
        shares = every[1::2]
        motion, poses = setup.reference.in_step(frame, shares), setup.reference.in_step(frame, every)[0]
        controls, outer = setup.controls.in_step(frame, shares), forces.in_step(frame, shares)
        pressing = setup.contact.in_step(frame, shares)
        model.opt.timestep = durations[frame] / count
        rests = [] if untied is None else untied.in_step(frame, shares)
        for k in range(count):
            if untied is not None:
                untied.put(data, rests[k])
            setup.reference.put(data, [motion[0][k], motion[1][k]])
            data.ctrl[setup.controls.addresses] = controls[k]
            forces.apply(model, data, outer[k])
            at = first[frame] + k
            try:
                mujoco.mjd_transitionFD(model, data, 1e-6, True, state[at], control[at], None, None)
            except mujoco.FatalError as error:
                raise ModelError(f"the motion is not linearised: {error}") from None
            positions = [data.qpos.copy() for _ in range(3)]
            for position, pose in zip(positions, poses[2 * k : 2 * k + 3]):
                position[setup.reference.positions] = pose
            holding.add(
                frame,
                (state[at], control[at]),
                positions,
                data.qvel,
                model.opt.timestep,
                outer[k],
                pressing[k],
            )
    # The tied joints may come in another order than the model's: deviations follow the model's.
    step = np.repeat(durations / parts, parts)
    return Linearisation(
        first, step, state[:, : 2 * nv, : 2 * nv], control[:, : 2 * nv, setup.controls.addresses]
    )


def linearised(setup: Setup, held: bool = True) -> Linearisation | None:
    """As :func:`linearise`; None if that is refused, or if an actuator has a state.

    MuJoCo does not differentiate models with bodies that sleep or actuators with a delay.
    """
    if setup.compiled.na:
        return None
    try:
        return linearise(setup, held)
    except ModelError:
        return None


def growth(
    maps: Linearisation, joints: np.ndarray | None = None, restarts: Sequence[int] | np.ndarray = ()
) -> float:
    """The largest factor by which a small deviation of some positions grows over any part of the motion.

    Args:
        maps: of the motion.
        joints: (k,) indices of the positions, by default all; other positions matter only through these.
        restarts: frames at which deviations restart.

    It is the largest spectral norm of the positions' part of the transition matrices between two instants,
    of which at most :data:`stc.validate.limits.GROWTH_INSTANTS` are used.  A value near one means that errors do not
    grow; an upright pole multiplies them by e for every 1/rate seconds.
    """
    total, size = len(maps.step), maps.state.shape[1]
    if not total or not np.all(np.isfinite(maps.state)):
        return math.inf if total else 1.0
    joints = np.arange(size // 2) if joints is None else joints
    ends = maps.first[np.asarray(restarts, dtype=np.intp)]
    cuts = np.unique([*np.linspace(0, total, min(total, limits.GROWTH_INSTANTS) + 1).astype(int), *ends])
    pieces = []
    for a, b in pairwise(cuts):
        product = np.eye(size)
        for k in range(a, b):
            product = maps.state[k] @ product
        pieces.append(product)
    worst = 1.0
    running = np.zeros((0, size, size))
    for begin, piece in zip(cuts, pieces):
        if begin in ends:
            running = running[:0]
        # Row r of `running` is the map from the r-th cut to here.
        running = np.concatenate([running, np.eye(size)[None]])
        with np.errstate(over="ignore", invalid="ignore"):
            running = piece @ running
            if not np.all(np.isfinite(running)):
                return math.inf
            worst = max(
                worst, float(np.linalg.norm(running[:, joints[:, None], joints], 2, axis=(1, 2)).max())
            )
    return worst
