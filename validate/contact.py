"""Motions on the ground: MuJoCo's contact solver supplies what the solution's ``contact`` lines say.

Such a motion is measured as a whole: how far the base strays as a share of the way that it goes, how far the joints
do, and where it stands in the end.  The base is what slides, the joints are what motors turn.  A body that stands
on a foot without moving it is unstable by nature (it is an inverted pendulum), so that after a landing
an open-loop replay is judged by its last frame too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.metrics import FloatArray, Metric

if TYPE_CHECKING:
    import mujoco

    from stc.validate.model import Tie
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup


def travelled(setup: Setup) -> float:
    """How far the base goes, in m: the largest distance between two places of its path; 1 where it stays."""
    slides = [tie.line.value.before for tie in _base(setup)]
    if not slides:
        return 1.0
    extent = float(np.hypot.reduce([np.ptp(values) for values in slides]))
    return extent if extent > 1e-3 else 1.0


def contact_metrics(name: str, setup: Setup, motion: Replay) -> list[Metric]:
    """How far a replay on the ground strays.

    Args:
        name: of the replay, ``open-loop`` or ``tracked``.
        setup: the motion.
        motion: what the simulation did.
    """
    length = travelled(setup)
    base, joints = _distances(_base(setup), motion), _distances(_turned(setup), motion)
    tracked = name == "tracked"
    found = []
    for subject, distance, unit, limit, at_end in (
        (
            "base",
            np.sqrt(np.sum(base**2, axis=0)) / length,
            "of its way",
            limits.CONTACT_TRACKED_BASE if tracked else limits.CONTACT_BASE,
            limits.CONTACT_END_BASE,
        ),
        (
            "joints",
            np.sqrt(np.mean(joints**2, axis=0)) if len(joints) else np.zeros(base.shape[1:]),
            "rad",
            limits.CONTACT_TRACKED_JOINTS if tracked else limits.CONTACT_JOINTS,
            limits.CONTACT_END_JOINTS,
        ),
    ):
        found.append(Metric(f"{name} error on the ground, RMS", subject, _rms(distance), unit, limit))
        if not tracked:
            last = float(distance[-1]) if np.all(np.isfinite(distance)) else np.inf
            found.append(Metric(f"{name} error on the ground, at the end", subject, last, unit, at_end))
    return found


def ground_distances(setup: Setup, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance of many replays from the solved motion, coordinate by coordinate.

    Args:
        setup: the motion.
        positions: (samples, n+1, nq) of the replays at the frames.

    Returns:
        (samples, k, n+1) of the base's sliding joints in m and of the joints that motors turn in rad.  Where the
        motion is not one on the ground: of all sliding joints and of all hinges.
    """
    ground = bool(len(setup.contact))
    base = _base(setup) if ground else [tie for tie in setup.ties if tie.unit == "m"]
    turned = _turned(setup) if ground else [tie for tie in setup.ties if tie.unit == "rad"]
    found = []
    for ties in (base, turned):
        rows = [
            np.minimum(
                np.abs(positions[:, :, tie.position] - tie.line.value.before),
                np.abs(positions[:, :, tie.position] - tie.line.value.after),
            )
            for tie in ties
        ]
        count, frames = positions.shape[:2]
        found.append(np.array(rows).reshape(len(rows), count, frames).swapaxes(0, 1))
    return found[0], found[1]


def friction_note(setup: Setup) -> str:
    """Which friction the contacts of the model have, for the report."""
    import mujoco

    model = setup.compiled
    parts = []
    for geom in range(model.ngeom):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"geom {geom}"
            parts.append(f"{name} {model.geom_friction[geom, 0]:.4g}")
    return f"MuJoCo's own contacts give every ground force; friction: {', '.join(parts)}"


def _base(setup: Setup) -> list[Tie]:
    driven = _driven(setup.compiled, setup.controls.actuators)
    return [tie for tie in setup.ties if tie.unit == "m" and tie.velocity not in driven]


def _turned(setup: Setup) -> list[Tie]:
    driven = _driven(setup.compiled, setup.controls.actuators)
    return [tie for tie in setup.ties if tie.unit == "rad" and tie.velocity in driven]


def _driven(model: mujoco.MjModel, actuators: list[int]) -> set[int]:
    """The degrees of freedom on which actuators act."""
    return {int(model.jnt_dofadr[model.actuator_trnid[actuator, 0]]) for actuator in actuators}


def _distances(ties: list[Tie], motion: Replay) -> FloatArray:
    """(k, n+1) distance of each coordinate from the solved one."""
    found = [
        np.minimum(
            np.abs(motion.positions[:, tie.position] - tie.line.value.before),
            np.abs(motion.positions[:, tie.position] - tie.line.value.after),
        )
        for tie in ties
    ]
    return np.array(found).reshape(len(found), len(motion.positions))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if np.all(np.isfinite(values)) else np.inf
