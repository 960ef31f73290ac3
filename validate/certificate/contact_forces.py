"""The ground's forces: what the solution says against what MuJoCo's contacts give in the replay.

The replay's states at the frames are put into the model once more, and the wrench of all contacts of each body that
a ``contact`` line speaks of is added up.  MuJoCo's contacts are soft: right after a touchdown their forces oscillate
where the solved ones do not, so that the median of the differences is judged and not the largest.  A solved force
must also lie in the cone that the model's friction allows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.metrics import FloatArray, Metric
from stc.validate.replay import Replay
from stc.validate.setup import Setup
from stc.validate.verdict import Replays

if TYPE_CHECKING:
    import mujoco

_PARTS = ("fx", "fy", "fz", "mx", "my", "mz")

#: Of the largest vertical force, so much at least takes part in the judgement of friction.
_PRESSED = 1e-3


@dataclass(frozen=True, slots=True)
class ContactForces:
    """Forces on one body at the frames.

    Attributes:
        body: its name.
        time: (n+1,) seconds.
        solved: by part (``fx`` ... ``mz``), (n+1,) what the solution says, after jumps.
        found: by part what MuJoCo's contacts give in the replay; NaN after a breakdown.
        friction: sliding friction of the body's contacts with the ground; None where the replay had none.
    """

    body: str
    time: FloatArray
    solved: dict[str, FloatArray]
    found: dict[str, FloatArray]
    friction: float | None


def contact_forces(replays: Replays) -> list[ContactForces]:
    """The forces of every body that has ``contact body.NAME.fx`` lines or their like."""
    setup, motion = replays.setup, replays.open_loop
    by_body: dict[str, dict[str, FloatArray]] = {}
    for line, channel in zip(setup.contact.lines, setup.contact.channels):
        if line.path[0] == "body" and len(line.path) == 3 and line.path[2] in _PARTS:
            by_body.setdefault(line.path[1], {})[line.path[2]] = channel.after
    if not by_body:
        return []
    indices = {name: int(setup.compiled.body(name).id) for name in by_body}
    wrenches, friction = _wrenches(setup, motion, list(indices.values()))
    return [
        ContactForces(
            name,
            setup.solution.time,
            solved,
            {part: wrenches[indices[name]][:, _PARTS.index(part)] for part in solved},
            friction.get(indices[name]),
        )
        for name, solved in by_body.items()
    ]


def _wrenches(
    setup: Setup, motion: Replay, bodies: list[int]
) -> tuple[dict[int, FloatArray], dict[int, float]]:
    """Per body (n+1, 6) force and torque about the body's origin, along the world's axes, and its friction."""
    import mujoco

    model = setup.model()
    data = mujoco.MjData(model)
    n = setup.solution.n
    found = {body: np.full((n + 1, 6), np.nan) for body in bodies}
    friction: dict[int, float] = {}
    for frame in range(n + 1):
        if not np.all(np.isfinite(motion.positions[frame])):
            break
        data.qpos[:], data.qvel[:] = motion.positions[frame], motion.velocities[frame]
        part = "after" if frame < n else "before"
        data.ctrl[setup.controls.addresses] = setup.controls.at(part, frame)
        setup.applied.apply(model, data, setup.applied.at(part, frame))
        mujoco.mj_forward(model, data)
        for body in bodies:
            found[body][frame] = 0.0
        for number in range(data.ncon):
            _add(model, data, number, frame, found, friction)
    return found, friction


def _add(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    number: int,
    frame: int,
    found: dict[int, FloatArray],
    friction: dict[int, float],
) -> None:
    """Add one contact's wrench to the bodies that it touches."""
    import mujoco

    contact = data.contact[number]
    local = np.zeros(6)
    mujoco.mj_contactForce(model, data, number, local)
    # The rows of the frame are its axes; the force is the one on the second geom.
    axes = np.array(contact.frame).reshape(3, 3)
    force, torque = local[:3] @ axes, local[3:] @ axes
    for geom, sign in ((contact.geom[0], -1.0), (contact.geom[1], 1.0)):
        body = int(model.geom_bodyid[geom])
        if body in found:
            arm = np.array(contact.pos) - data.xpos[body]
            found[body][frame] += sign * np.concatenate([force, torque + np.cross(arm, force)])
            friction[body] = max(friction.get(body, 0.0), float(contact.friction[0]))


def contact_force_metrics(forces: list[ContactForces]) -> list[Metric]:
    """How much of the model's friction the solved forces use, and how near MuJoCo's forces come to them."""
    metrics = []
    for one in forces:
        if one.friction is not None and "fz" in one.solved:
            normal = one.solved["fz"]
            tangent = np.hypot(one.solved.get("fx", 0.0 * normal), one.solved.get("fy", 0.0 * normal))
            pressed = normal > _PRESSED * float(np.abs(normal).max(initial=0.0))
            slip = np.where(pressed, tangent / np.where(pressed, one.friction * normal, 1.0), 0.0)
            metrics.append(
                Metric(
                    "friction used, solved forces in the model's cone",
                    f"body {one.body}",
                    float(slip.max(initial=0.0)),
                    "share",
                    limits.FRICTION_CONE,
                )
            )
        acting = np.any([np.abs(values) > 0.0 for values in one.solved.values()], axis=0)
        for part, solved in one.solved.items():
            scale = float(np.abs(solved).max(initial=0.0))
            if scale > 0.0:
                error = np.nan_to_num(np.abs(one.found[part] - solved)[acting], nan=np.inf)
                typical = float(np.median(error)) / scale
                subject = f"body {one.body} {part}"
                name = "contact force, MuJoCo's against solved, median"
                metrics.append(Metric(name, subject, typical, "share", limits.CONTACT_FORCE))
    return metrics
