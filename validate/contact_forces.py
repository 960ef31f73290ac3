"""The ground forces: those of the solution compared with those of MuJoCo's contacts in the replay.

For each body with a ``contact`` line, the forces of its contacts in the replay are averaged over short windows, since
MuJoCo's contacts are soft and bounce, so that a force at an instant means little.  Windows with a velocity jump are
left out, because the impulse would count as a force.  Right after a touchdown the forces oscillate while the solved
ones do not; therefore the median and the 90th percentile of the differences are judged, and not the largest one.
Differences are shares of the whole force, since a component that is zero has no scale.  A solved force must also push,
and lie in the cone of the model's friction, at every node; under a body that slides it must be the full friction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.contact_meter import ContactMeter, touchable, welded
from stc.validate.contact_nodes import (
    NodeForces,
    nearest_node,
    node_forces,
    nodes_of,
    press_and_friction,
)
from stc.validate.grips import grips
from stc.validate.impacts import jumping_frames
from stc.validate.metrics import FloatArray, Metric
from stc.validate.replay import Replay
from stc.validate.setup import Setup
from stc.validate.sliding import Sliding, sliding

if TYPE_CHECKING:
    import mujoco

_PARTS = ("fx", "fy", "fz", "mx", "my", "mz")

#: Of the largest force, so much at least takes part in the judgement of friction.
_PRESSED = 1e-3

#: Forces below this share of the largest solved one count as none.
_NOTHING = 1e-9

#: Weights that rise and fall take so many frame steps at least.
_RISING = 6


@dataclass(frozen=True, slots=True)
class ContactForces:
    """Forces on one body at the frames, and their means over k windows.

    Attributes:
        body: its name.
        time: (n+1,) seconds.
        solved: by part (``fx`` ... ``mz``), (n+1,) the solved values, after jumps.
        found: by part what MuJoCo's contacts give in the replay; NaN after a breakdown.
        solved_means: by part (k,) of the solved force.
        found_means: by part (k,) of what MuJoCo's contacts give in the replay; NaN after a breakdown.
        friction: (n+1,) sliding friction of what the body touches in the solved pose, or else in the replay's, the
            largest at each frame; NaN at frames without a contact.
        normal: (n+1, 3) the direction in which the contacts press on the body; NaN where there are none or several.
        slides: (n+1,) whether the body slides in the solved motion and has its friction.
        size: of the body, in m: factor by which a force is multiplied to be compared with a torque.
        at_nodes: the solved force and what the body touches at all nodes; None for the frames, after jumps.
        sliding: how the body slides at the nodes, where it does.
        swings: (n+1,) whether the velocities of its contacts alternate from node to node.
    """

    body: str
    time: FloatArray
    solved: dict[str, FloatArray]
    found: dict[str, FloatArray]
    solved_means: dict[str, FloatArray]
    found_means: dict[str, FloatArray]
    friction: FloatArray
    normal: FloatArray
    slides: FloatArray
    size: float
    at_nodes: NodeForces | None = None
    sliding: Sliding | None = None
    swings: FloatArray | None = None

    @property
    def judged(self) -> NodeForces:
        """The forces that must push and stay within the friction."""
        return self.at_nodes or NodeForces(self.time, self.force, self.force, self.friction, self.normal)

    @property
    def force(self) -> FloatArray:
        """(n+1, 3) the solved force; zero along axes without a line."""
        nothing = np.zeros(len(self.time))
        return np.stack([self.solved.get(part, nothing) for part in _PARTS[:3]], axis=1)

    def scale(self, part: str) -> float:
        """The force or torque by which differences of a component are divided, in N or N m; 0 without one."""
        force = float(np.linalg.norm(self.judged.force, axis=1).max(initial=0.0))
        if part in _PARTS[:3]:
            return force
        torques = [np.abs(values).max(initial=0.0) for name, values in self.solved.items() if name[0] == "m"]
        return max(force * self.size, *(float(torque) for torque in torques))


def contact_forces(setup: Setup, motion: Replay, meter: ContactMeter) -> list[ContactForces]:
    """The forces of every body that has ``contact body.NAME.fx`` or ``contact site.NAME.fx`` lines or their like.

    Args:
        setup: the motion.
        motion: its open-loop replay.
        meter: the contact forces recorded during the replay.
    """
    if not meter.columns:
        return []
    wide, nodes = touchable(setup.model()), nodes_of(setup, motion)
    seen = node_forces(setup, wide, nodes, meter.columns)
    slid = sliding(setup, wide, nodes, {body: at_nodes.force for body, at_nodes in seen.items()})
    nearest = nearest_node(nodes, setup.solution.n + 1)
    wrenches = _wrenches(setup, motion, meter)
    # Simpson's rule, exact for the parabolas through frame, midpoint and frame.
    weights = np.array([1.0, 4.0, 1.0]) / 6.0
    steps = np.diff(setup.solution.time)
    solved_steps = [
        step * (weights @ setup.contact.in_step(frame, np.array([0.0, 0.5, 1.0])))
        for frame, step in enumerate(steps)
    ]
    broken = ~np.all(np.isfinite(motion.positions[1:]), axis=1)

    forces = []
    for body, parts in meter.columns.items():
        after = {
            part: np.sum([setup.contact.channels[line].after for line in lines], axis=0)
            for part, lines in parts.items()
        }
        slides = slid[body].right[nearest]
        windows = windows_of(setup.solution.time, jumping_frames(setup), slides)
        found = np.where(broken[:, None], np.nan, meter.impulses[body])
        solved = np.array([[step[lines].sum() for lines in parts.values()] for step in solved_steps])
        forces.append(
            ContactForces(
                setup.compiled.body(body).name or str(body),
                setup.solution.time,
                after,
                {part: wrenches[body][:, _PARTS.index(part)] for part in parts},
                {part: windows @ solved[:, column] for column, part in enumerate(parts)},
                {part: windows @ found[:, _PARTS.index(part)] for part in parts},
                seen[body].friction[nearest],
                seen[body].normal[nearest],
                slides,
                _size(setup.compiled, body),
                seen[body],
                slid[body],
                slid[body].swings[nearest],
            )
        )
    return forces


def windows_of(time: FloatArray, jumps: list[int], slides: FloatArray) -> FloatArray:
    """(k, n) weights that make means of the impulses of the frame steps, one row per window, in 1/s.

    A window begins at each frame and is the shortest one that is long enough and free of jumps; a motion that is
    shorter is one window.  For a body that slides, windows are longer and their weights are triangular: the effect of
    a bounce on such a mean is its height divided by the square of the window's length.
    """
    rows = []
    for first in range(len(time) - 1):
        last = _end(time, first, limits.CONTACT_WINDOW, 2)
        sliding = last is not None and bool(np.all(slides[first : last + 1]))
        if sliding:
            last = _end(time, first, limits.SLIDING_WINDOW, _RISING)
        # Where the motion begins and ends the replay does not jump.
        if last is None or any(first <= jump <= last for jump in jumps if 0 < jump < len(time) - 1):
            continue
        steps = np.diff(time[first : last + 1])
        middles = (time[first:last] + time[first + 1 : last + 1]) / 2.0
        weights = np.minimum(middles - time[first], time[last] - middles) if sliding else np.ones(len(steps))
        row = np.zeros(len(time) - 1)
        row[first:last] = weights / (weights @ steps)
        rows.append(row)
    return np.array(rows).reshape(len(rows), len(time) - 1)


def _end(time: FloatArray, first: int, length: float, steps: int) -> int | None:
    """The last frame of a window of at least the given seconds and frame steps; None if the motion ends before."""
    least = min(length, float(time[-1] - time[0]))
    last = max(
        int(np.searchsorted(time, time[first] + least * (1.0 - 1e-9))), first + min(steps, len(time) - 1)
    )
    return last if last < len(time) else None


def _size(model: mujoco.MjModel, body: int) -> float:
    """The largest distance of its geoms from the origin of a body's frame, in m; its radius of gyration without
    geoms.
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = welded(model, body)
    own = [g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies and model.geom_rbound[g] > 0.0]
    reach = [float(np.linalg.norm(data.geom_xpos[g] - data.xpos[body]) + model.geom_rbound[g]) for g in own]
    mass = float(model.body_mass[body])
    return max(reach) if reach else float(np.sqrt(model.body_inertia[body].max() / mass)) if mass else 0.0


def _wrenches(setup: Setup, motion: Replay, meter: ContactMeter) -> dict[int, FloatArray]:
    """Per body (n+1, 6) force and torque about its origin in the replay, in the world frame; NaN after a breakdown."""
    import mujoco

    model, n = setup.model(), setup.solution.n
    data, held = mujoco.MjData(model), grips(setup)
    found = {body: np.full((n + 1, 6), np.nan) for body in meter.columns}
    for frame in range(n + 1):
        if not np.all(np.isfinite(motion.positions[frame])):
            break
        data.qpos[:], data.qvel[:] = motion.positions[frame], motion.velocities[frame]
        part = "after" if frame < n else "before"
        data.ctrl[setup.controls.addresses] = setup.controls.at(part, frame)
        setup.applied.apply(model, data, setup.applied.at(part, frame))
        for grip in held:
            data.eq_active[grip.equality] = grip.on[min(frame, n - 1)]
        mujoco.mj_forward(model, data)
        for body, wrench in meter.wrenches(model, data).items():
            found[body][frame] = wrench
    return found


def contact_force_metrics(forces: list[ContactForces]) -> list[Metric]:
    """The share of the model's friction that the solved forces use, and the differences between MuJoCo's and solved
    forces.
    """
    metrics = []
    for one in forces:
        metrics += [*_cone_metrics(one), *_sliding_metrics(one)]
        acting = _acting(one)
        for name, share, limit in (
            ("median", 0.5, limits.CONTACT_FORCE),
            ("90th percentile", 0.9, limits.CONTACT_FORCE_MOST),
        ):
            for part, solved in one.solved_means.items():
                scale = one.scale(part)
                if scale > 0.0 and acting.any():
                    error = np.nan_to_num(np.abs(one.found_means[part] - solved)[acting], nan=np.inf)
                    value = float(np.quantile(error, share, method="higher")) / scale
                    subject = f"body {one.body} {part}"
                    title = f"contact force, MuJoCo's against solved, {name}"
                    metrics.append(Metric(title, subject, value, "share", limit))
    return metrics


def _acting(one: ContactForces) -> FloatArray:
    """(k,) whether a force acts in a window, solved or found."""
    acting = np.zeros(len(next(iter(one.solved_means.values()))), dtype=bool)
    for part, solved in one.solved_means.items():
        least = _NOTHING * one.scale(part)
        acting |= (np.abs(solved) > least) | ~(np.abs(one.found_means[part]) <= least)
    return acting


def _cone_metrics(one: ContactForces) -> list[Metric]:
    """Whether the solved forces push, and the share of the friction that they use, if there are contacts."""
    # Where the replay touches a frame earlier or later than the solution, the nearest node tells.
    seen = one.judged
    told = np.flatnonzero(np.isfinite(seen.normal[:, 0]))
    largest = one.scale("fx")
    if not len(told) or not largest > 0.0:
        return []
    nearest = told[np.argmin(np.abs(seen.time[:, None] - seen.time[told]), axis=1)]
    # Where it touches in several directions at once, any mixture of them may press.
    known = np.isfinite(seen.normal[:, 0]) | ~np.isfinite(seen.friction)
    normal, friction = seen.normal[nearest], seen.friction[nearest]
    pull = abs(float(np.min(np.sum(seen.force * normal, axis=1)[known], initial=0.0))) / largest
    press, tangent = press_and_friction(seen.lasting, normal)
    pressed = known & (press > _PRESSED * largest)
    with np.errstate(divide="ignore", invalid="ignore"):
        slip = np.where(tangent > _NOTHING * largest, tangent / (friction * press), 0.0)
    # A mean over a step before a jump is what the steps before have left, with their rounding.
    mean = np.any(seen.lasting != seen.force, axis=1)
    slip = np.where(mean & (slip <= 1.0 + limits.FRICTION_MISSING), np.minimum(slip, 1.0), slip)[pressed]
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


def _sliding_metrics(one: ContactForces) -> list[Metric]:
    """The distance over which the body slides with a force other than its friction; empty if it does not slide."""
    if one.sliding is None or not one.sliding.slides.any():
        return []
    way, limit = one.sliding.way_without, limits.SLID_WITHOUT_FRICTION
    return [Metric("friction missing, distance slid without it", f"body {one.body}", way, "m", limit)]
