"""The nodes of a solved motion in the order of time, and the contacts of each body there.

A method imposes the equations of motion at its nodes: on both sides of a frame with a jump and, for hermite-simpson,
at the midpoints of the steps.  The solved contact forces are checked at all of them; if only one side were checked, a
floor could pull just before a take-off or at every midpoint.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.contact_meter import touching, welded
from stc.validate.inverse import places_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup

#: Normals whose product is below this differ.
_SAME_DIRECTION = 0.999


@dataclass(frozen=True, slots=True)
class Node:
    """One node of a motion.

    Attributes:
        part: ``before`` or ``after`` a frame, or ``mid`` of a step.
        index: of the frame or step.
        time: in seconds.
        position: (nq,) position in the replay, for the joints that are not tied.
        velocity: (nv,) likewise.
        forces: (k,) the values of the contact lines.
        lasting: (k,) the same, but their averages over the step if one of them jumps at its end: a law of friction that
            is stated up to a frame holds on the left of it, and at the midpoint before it, on average.
    """

    part: str
    index: int
    time: float
    position: FloatArray
    velocity: FloatArray
    forces: FloatArray
    lasting: FloatArray

    @property
    def ends_in_a_jump(self) -> bool:
        """Whether a contact force jumps at the end of the step, so that ``lasting`` holds averages."""
        return self.lasting is not self.forces


@dataclass(frozen=True, slots=True)
class NodeForces:
    """The solved force on one body at m nodes, and its contacts there.

    Attributes:
        time: (m,) seconds.
        force: (m, 3) zero along axes that no line speaks of, in N.
        lasting: (m, 3) the same, averaged over steps at whose end it jumps.
        friction: (m,) the largest sliding friction of its contacts; NaN without a contact.
        normal: (m, 3) the direction in which these press on the body; NaN where there are none or several.
    """

    time: FloatArray
    force: FloatArray
    lasting: FloatArray
    friction: FloatArray
    normal: FloatArray


def press_and_friction(force: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(m,) the parts of m forces (m, 3) along unit normals (m, 3), and (m,) the magnitudes of what is across these."""
    press = np.sum(force * normal, axis=1)
    return press, np.linalg.norm(force - press[:, None] * normal, axis=1)


def nodes_of(setup: Setup, motion: Replay) -> list[Node]:
    """The nodes at which the method imposes the equations of motion, up to where the replay broke down.

    A frame where nothing jumps is one node.
    """
    solution, jumps = setup.solution, _jumps(setup)
    first, last = solution.force_frames or (0, solution.n)

    lines = setup.contact.channels
    ends = np.any([line.before != line.after for line in lines], axis=0) if lines else np.zeros_like(jumps)

    def node(part: str, index: int) -> Node:
        forces = lasting = setup.contact.at(part, index)
        step = index if part == "mid" else index - 1
        if part in ("mid", "before") and 0 <= step and ends[step + 1]:
            # Simpson's rule, exact for the parabolas and lines that forces are.
            lasting = np.array([1.0, 4.0, 1.0]) / 6.0 @ setup.contact.in_step(step, np.array([0.0, 0.5, 1.0]))
        if part == "mid":
            time, state = float(np.mean(solution.time[index : index + 2])), _halfway(setup, motion, index)
        else:
            time, state = float(solution.time[index]), (motion.positions[index], motion.velocities[index])
        return Node(part, index, time, *state, forces, lasting)

    order = {"before": 0.0, "after": 0.25, "mid": 0.5}
    places = [
        (part, index)
        for part, index in places_of(first, last, solution.method)
        if part != "before" or jumps[index] or index == last
    ]
    places.sort(key=lambda place: place[1] + order[place[0]])
    return [one for one in (node(*place) for place in places) if np.all(np.isfinite(one.position))]


def step_integrals(setup: Setup, nodes: list[Node]) -> FloatArray:
    """(n, m) weights that give the integral over each step from values at the nodes, by the method's own quadrature."""
    steps = np.diff(setup.solution.time)
    simpson = setup.solution.method == "hermite-simpson"
    end = 1.0 / 6.0 if simpson else 0.5
    found = np.zeros((len(steps), len(nodes)))
    rows = {(node.part, node.index): row for row, node in enumerate(nodes)}
    for step, length in enumerate(steps):
        left = rows.get(("after", step), rows.get(("before", step)))
        right = rows.get(("before", step + 1), rows.get(("after", step + 1)))
        for row, share in ((left, end), (rows.get(("mid", step)), 4.0 * end), (right, end)):
            if row is not None:
                found[step, row] += share * length
    return found


def _jumps(setup: Setup) -> np.ndarray:
    """(n+1,) whether the motion or a contact force has two values at a frame."""
    channels = [channel for tie in setup.ties for part in (0, 1) for channel in tie.channels(part)]
    differ = [channel.before != channel.after for channel in [*channels, *setup.contact.channels]]
    return np.asarray(np.any(differ, axis=0))


def _halfway(setup: Setup, motion: Replay, step: int) -> tuple[FloatArray, FloatArray]:
    """(nq,), (nv,) position and velocity between two frames of the replay; NaN after a breakdown."""
    import mujoco

    start, end = motion.positions[step : step + 2]
    found, change = np.full_like(start, np.nan), np.zeros(setup.compiled.nv)
    if np.all(np.isfinite([start, end])):
        found = start.copy()
        mujoco.mj_differentiatePos(setup.compiled, change, 1.0, start, end)
        mujoco.mj_integratePos(setup.compiled, found, change, 0.5)
    return found, motion.velocities[step : step + 2].mean(axis=0)


def nearest_node(nodes: list[Node], frames: int) -> np.ndarray:
    """(frames,) the node for each frame: on its right side, else on its left, else the nearest one."""
    at = np.array([node.index + (0.5 if node.part == "mid" else 0.0) for node in nodes])
    distance = np.abs(np.arange(frames)[:, None] - at)
    return distance.shape[1] - 1 - np.argmin(distance[:, ::-1], axis=1)


def pose(
    setup: Setup, model: mujoco.MjModel, data: mujoco.MjData, node: Node, bodies: Iterable[int] = ()
) -> bool:
    """Set a simulation to the solved pose, or to the replay's if that one touches and the solved one does not.

    Args:
        setup: the motion.
        model: its model, which detects contacts a little before they touch.
        data: the simulation; its velocities become the solved ones in either pose.
        node: the node.
        bodies: the bodies that should touch something; any body if empty.

    Returns:
        Whether the solved pose touches.
    """
    import mujoco

    wholes = [welded(model, body) for body in bodies]
    position, velocity = setup.reference.at(node.part, node.index)[:2]
    for solved in (True, False):
        data.qpos[:], data.qvel[:] = node.position, node.velocity
        data.qvel[setup.reference.velocities] = velocity
        if solved:
            data.qpos[setup.reference.positions] = position
        mujoco.mj_fwdPosition(model, data)
        near = [any(touching(model, data, whole)) for whole in wholes]
        if any(near or [contact.dist <= contact.includemargin for contact in data.contact]):
            return solved
    return False


def node_forces(
    setup: Setup, model: mujoco.MjModel, nodes: list[Node], columns: dict[int, dict[str, list[int]]]
) -> dict[int, NodeForces]:
    """The solved forces on bodies at the nodes, and the contacts of each body in the solved pose, or else in the
    replay's.

    Args:
        setup: the motion.
        model: its model, which finds contacts a little before they touch.
        nodes: of the motion.
        columns: per body and part (``fx`` ... ``mz``) which contact lines speak of it.
    """
    import mujoco

    data, time = mujoco.MjData(model), np.array([node.time for node in nodes])
    sides = [np.array([node.forces for node in nodes]), np.array([node.lasting for node in nodes])]
    found = {}
    for body, parts in columns.items():
        force, lasting = (
            np.stack([side[:, parts.get(part, [])].sum(axis=1) for part in ("fx", "fy", "fz")], axis=1)
            for side in sides
        )
        friction, normals = np.full(len(nodes), np.nan), np.full((len(nodes), 3), np.nan)
        whole = welded(model, body)
        for row, node in enumerate(nodes):
            pose(setup, model, data, node, [body])
            contacts = list(touching(model, data, whole))
            if contacts:
                friction[row] = max(slip for _, _, slip in contacts)
                directions = [axes[0] for _, axes, _ in contacts]
                if min(float(directions[0] @ other) for other in directions) > _SAME_DIRECTION:
                    normals[row] = directions[0]
        found[body] = NodeForces(time, force, lasting, friction, normals)
    return found
