"""The ground's forces: what the solution says against what MuJoCo's contacts give in the replay.

The replay's states at the frames are put into the model once more, and the wrench of all contacts of each body that
a ``contact`` line speaks of is added up.  MuJoCo's contacts are soft: right after a touchdown their forces oscillate
where the solved ones do not, so that the median of the differences and their 90th percentile are judged and not the
largest.  Differences are shares of the whole force: a part of it that is nothing has no scale of its own.  A solved
force must also press, and lie in the cone that the model's friction allows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.metrics import FloatArray, Metric
from stc.validate.replay import Replay
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco

_PARTS = ("fx", "fy", "fz", "mx", "my", "mz")

#: Of the largest force, so much at least takes part in the judgement of friction.
_PRESSED = 1e-3

#: Forces below this share of the largest solved one count as none.
_NOTHING = 1e-9

#: Normals whose product is below this differ.
_SAME_DIRECTION = 0.999


@dataclass(frozen=True, slots=True)
class ContactForces:
    """Forces on one body at the frames.

    Attributes:
        body: its name.
        time: (n+1,) seconds.
        solved: by part (``fx`` ... ``mz``), (n+1,) what the solution says, after jumps.
        found: by part what MuJoCo's contacts give in the replay; NaN after a breakdown.
        friction: (n+1,) sliding friction of the body's contacts, the largest at each frame; NaN at frames without any.
        normal: (n+1, 3) the direction in which the contacts press on the body; NaN where there are none or several.
        size: of the body, in m: what a force is multiplied by to be compared with a torque.
    """

    body: str
    time: FloatArray
    solved: dict[str, FloatArray]
    found: dict[str, FloatArray]
    friction: FloatArray
    normal: FloatArray
    size: float

    @property
    def force(self) -> FloatArray:
        """(n+1, 3) the solved force, zero along axes that no line speaks of."""
        nothing = np.zeros(len(self.time))
        return np.stack([self.solved.get(part, nothing) for part in _PARTS[:3]], axis=1)

    def scale(self, part: str) -> float:
        """What a difference in a part is a share of, in N or N m: the largest solved force; its torque; 0 without."""
        force = float(np.linalg.norm(self.force, axis=1).max(initial=0.0))
        if part in _PARTS[:3]:
            return force
        torques = [np.abs(values).max(initial=0.0) for name, values in self.solved.items() if name[0] == "m"]
        return max(force * self.size, *(float(torque) for torque in torques))


def contact_forces(setup: Setup, motion: Replay) -> list[ContactForces]:
    """The forces of every body that has ``contact body.NAME.fx`` or ``contact site.NAME.fx`` lines or their like.

    Of a body with forces at sites torques are left out: their arms are the sites'.

    Args:
        setup: the motion.
        motion: its open-loop replay.
    """
    by_body: dict[int, dict[str, FloatArray]] = {}
    armed = set()
    for line, channel in zip(setup.contact.lines, setup.contact.channels):
        kind, *rest = line.path
        if kind not in ("body", "site"):
            continue
        at_site = kind == "site"
        index = int((setup.compiled.site if at_site else setup.compiled.body)(rest[0]).id)
        body = int(setup.compiled.site_bodyid[index]) if at_site else index
        parts = by_body.setdefault(body, {})
        parts[rest[1]] = parts.get(rest[1], 0.0) + channel.after
        if at_site:
            armed.add(body)
    if not by_body:
        return []
    for body in armed:
        by_body[body] = {part: values for part, values in by_body[body].items() if part[0] == "f"}
    seen = _Seen(setup, motion, list(by_body))
    return [
        ContactForces(
            setup.compiled.body(body).name or str(body),
            setup.solution.time,
            solved,
            {part: seen.wrenches[body][:, _PARTS.index(part)] for part in solved},
            seen.friction[body],
            seen.normals[body],
            _size(setup.compiled, body),
        )
        for body, solved in by_body.items()
    ]


def _size(model: mujoco.MjModel, body: int) -> float:
    """How far from the origin of a body's frame its geoms reach, in m; its radius of gyration where it has none."""
    own = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body and model.geom_rbound[g] > 0.0]
    reach = [float(np.linalg.norm(model.geom_pos[g]) + model.geom_rbound[g]) for g in own]
    mass = float(model.body_mass[body])
    return max(reach) if reach else float(np.sqrt(model.body_inertia[body].max() / mass)) if mass else 0.0


class _Seen:
    """What the contacts of a replay are at its frames.

    Attributes:
        wrenches: per body (n+1, 6) force and torque about the body's origin, along the world's axes.
        friction: per body (n+1,) the largest sliding friction.
        normals: per body (n+1, 3) the common direction of its contacts.
    """

    def __init__(self, setup: Setup, motion: Replay, bodies: list[int]) -> None:
        import mujoco

        model = setup.model()
        data = mujoco.MjData(model)
        n = setup.solution.n
        self.wrenches = {body: np.full((n + 1, 6), np.nan) for body in bodies}
        self.friction = {body: np.full(n + 1, np.nan) for body in bodies}
        self.normals = {body: np.full((n + 1, 3), np.nan) for body in bodies}
        for frame in range(n + 1):
            if not np.all(np.isfinite(motion.positions[frame])):
                break
            data.qpos[:], data.qvel[:] = motion.positions[frame], motion.velocities[frame]
            part = "after" if frame < n else "before"
            data.ctrl[setup.controls.addresses] = setup.controls.at(part, frame)
            setup.applied.apply(model, data, setup.applied.at(part, frame))
            mujoco.mj_forward(model, data)
            for body in bodies:
                self._look(model, data, body, frame)

    def _look(self, model: mujoco.MjModel, data: mujoco.MjData, body: int, frame: int) -> None:
        """Add up the contacts of one body."""
        import mujoco

        wrench, local, normals, friction = np.zeros(6), np.zeros(6), [], []
        for number in range(data.ncon):
            contact = data.contact[number]
            # The rows of the frame are its axes; the force is the one on the second geom.
            axes = np.array(contact.frame).reshape(3, 3)
            for geom, sign in ((contact.geom[0], -1.0), (contact.geom[1], 1.0)):
                if geom < 0 or int(model.geom_bodyid[geom]) != body:
                    continue
                mujoco.mj_contactForce(model, data, number, local)
                force, torque = local[:3] @ axes, local[3:] @ axes
                arm = np.array(contact.pos) - data.xpos[body]
                wrench += sign * np.concatenate([force, torque + np.cross(arm, force)])
                normals.append(sign * axes[0])
                friction.append(float(contact.friction[0]) if contact.dim > 1 else 0.0)
        self.wrenches[body][frame] = wrench
        if friction:
            self.friction[body][frame] = max(friction)
            if min(float(normals[0] @ other) for other in normals) > _SAME_DIRECTION:
                self.normals[body][frame] = normals[0]


def contact_force_metrics(forces: list[ContactForces]) -> list[Metric]:
    """How much of the model's friction the solved forces use, and how near MuJoCo's forces come to them."""
    metrics = []
    for one in forces:
        metrics += _cone_metrics(one)
        acting = _acting(one)
        for name, share, limit in (
            ("median", 0.5, limits.CONTACT_FORCE),
            ("90th percentile", 0.9, limits.CONTACT_FORCE_MOST),
        ):
            for part, solved in one.solved.items():
                scale = one.scale(part)
                if scale > 0.0 and acting.any():
                    error = np.nan_to_num(np.abs(one.found[part] - solved)[acting], nan=np.inf)
                    value = float(np.quantile(error, share, method="higher")) / scale
                    subject = f"body {one.body} {part}"
                    title = f"contact force, MuJoCo's against solved, {name}"
                    metrics.append(Metric(title, subject, value, "share", limit))
    return metrics


def _acting(one: ContactForces) -> FloatArray:
    """(n+1,) whether a force acts, solved or found."""
    acting = np.zeros(len(one.time), dtype=bool)
    for part, solved in one.solved.items():
        least = _NOTHING * one.scale(part)
        acting |= (np.abs(solved) > least) | (np.abs(one.found[part]) > least)
    return acting


def _cone_metrics(one: ContactForces) -> list[Metric]:
    """Whether the solved forces press, and with how much of the friction; where the replay's contacts tell how."""
    # Where the replay touches a frame earlier or later than the solution, the nearest frame tells.
    told = np.flatnonzero(np.isfinite(one.normal[:, 0]))
    largest = one.scale("fx")
    if not len(told) or not largest > 0.0:
        return []
    frames = np.arange(len(one.time))
    nearest = told[np.argmin(np.abs(frames[:, None] - told), axis=1)]
    # Where it touches in several directions at once, any mixture of them may press.
    known = np.isfinite(one.normal[:, 0]) | ~np.isfinite(one.friction)
    normal, friction = one.normal[nearest], one.friction[nearest]
    press = np.sum(one.force * normal, axis=1)
    tangent = np.linalg.norm(one.force - press[:, None] * normal, axis=1)
    pull = abs(float(np.min(press[known], initial=0.0))) / largest
    pressed = known & (press > _PRESSED * largest)
    with np.errstate(divide="ignore", invalid="ignore"):
        slip = np.where(tangent > _NOTHING * largest, tangent / (friction * press), 0.0)[pressed]
    subject = f"body {one.body}"
    return [
        Metric(
            "friction used, solved forces in the model's cone",
            subject,
            float(slip.max(initial=0.0)),
            "share",
            limits.FRICTION_CONE,
        ),
        Metric("contact force, solved one pulls", subject, pull, "share", limits.CONTACT_PULL),
    ]
