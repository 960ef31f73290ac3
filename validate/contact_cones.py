"""Whether the contacts of the model can give the solved forces at all, with their moments.

At every node the generalised force of all ``contact`` lines is fitted by what the contact points in the solved pose
can give: each a force that presses, within its friction, and no moment but what its ``condim`` allows.  A foot whose
centre of pressure lies outside its sole is found by that, and a force on a joint that no contact moves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.contact import can_touch
from stc.validate.contact_meter import TOUCHES, contact_jacobian, touchable, touching, welded
from stc.validate.contact_nodes import Node, nodes_of, pose
from stc.validate.equalities import Equalities

if TYPE_CHECKING:
    from collections.abc import Mapping

    from stc.validate.metrics import FloatArray
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup

#: Edges of a friction cone.  It is the one around the round cone, 0.1 % wider at most.
_EDGES = 64

#: The shortest lever that counts, as a share of the model's extent.
_LEVER = 1e-2


def beyond_contacts(setup: Setup, motion: Replay) -> float | None:
    """The largest part of the solved contact forces that no contact gives, as a share of the largest of them.

    Moments are shares of that force's at the longest lever that a contact has about the joint.  Nodes at which nothing
    is touched are left to the replay, and so are bodies that touch nothing, and what holds a joint at its limit.

    Args:
        setup: the motion.
        motion: its replay, which stands for the joints that are not tied.

    Returns:
        The share; None where no contact tells.
    """
    if not len(setup.contact) or not can_touch(setup.compiled):
        return None
    fit = ContactFit(setup)
    found = [one for node in nodes_of(setup, motion) if (one := fit.asked(node)) is not None]
    largest = fit.largest()
    if not found or not largest > 0.0:
        return None
    levers = np.maximum(np.max([reach for _, _, reach in found], axis=0), fit.least_levers())
    return max(_left_over(edges / levers[:, None], force / (levers * largest)) for force, edges, _ in found)


def _left_over(edges: FloatArray, force: FloatArray) -> float:
    """The largest entry of a force (nv,) that no sum of the columns (nv, k), none taken away, gives."""
    from scipy.optimize import nnls

    lengths = np.linalg.norm(edges, axis=0)
    edges = edges[:, lengths > 0.0] / lengths[lengths > 0.0]
    if not edges.shape[1] or not force.any():
        return float(np.abs(force).max(initial=0.0))
    return float(np.abs(edges @ nnls(edges, force)[0] - force).max())


class ContactFit:
    """Node by node what the contact lines ask for and what contacts give."""

    def __init__(self, setup: Setup) -> None:
        import mujoco

        self._setup, self._model = setup, touchable(setup.model())
        self.data = mujoco.MjData(self._model)
        self._equalities = Equalities(setup.model())
        slides, free = (
            self._model.jnt_type == int(kind)
            for kind in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_FREE)
        )
        joint = self._model.dof_jntid
        #: Of a free joint's coordinates the first three slide.
        first = np.arange(self._model.nv) < self._model.jnt_dofadr[joint] + 3
        self._turns = ~slides[joint] & ~(free[joint] & first)
        lines = setup.contact.lines
        self._joints = {
            column: int(self._model.joint(line.path[1]).id)
            for column, line in enumerate(lines)
            if line.path[0] == "joint"
        }
        self._wholes = {
            column: welded(self._model, self._body(*line.path[:2]))
            for column, line in enumerate(lines)
            if column not in self._joints
        }

    def _body(self, kind: str, name: str) -> int:
        if kind == "body":
            return int(self._model.body(name).id)
        return int(self._model.site_bodyid[self._model.site(name).id])

    def largest(self) -> float:
        """The largest solved force, in N; where all lines are moments, the largest of them at the model's extent."""
        size = float(self._model.stat.extent)
        found = []
        for column, (line, channel) in enumerate(
            zip(self._setup.contact.lines, self._setup.contact.channels)
        ):
            joint = self._joints.get(column)
            turns = line.path[-1][0] == "m" if joint is None else self._turns[self._model.jnt_dofadr[joint]]
            sides = [channel.before, channel.after, *([] if channel.mid is None else [channel.mid])]
            found.append((turns, max(float(np.abs(side).max(initial=0.0)) for side in sides)))
        forces = [value for turns, value in found if not turns]
        return max(forces) if any(forces) else max(value for _, value in found) / size

    def least_levers(self) -> FloatArray:
        """(nv,) the smallest lever of each coordinate that counts: 1 where it slides, a length in m where it turns."""
        return np.where(self._turns, _LEVER * float(self._model.stat.extent), 1.0)

    def asked(self, node: Node) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """What is asked for (nv,), what is given (nv, k), the longest levers (nv,); None where nothing is touched."""
        if not pose(self._setup, self._model, self.data, node):
            return None
        edges, _, reach = self.edges(widened=limits.FRICTION_MISSING if node.ends_in_a_jump else 0.0)
        return self.force(node), np.array([*edges, *self.free()]).reshape(-1, self._model.nv).T, reach

    def force(self, node: Node) -> FloatArray:
        """(nv,) what the contact lines amount to where that lasts, in the pose that the simulation is in."""
        self._setup.contact.apply(self._model, self.data, node.lasting)
        return self.data.qfrc_applied.copy()

    def free(self) -> list[FloatArray]:
        """The generalised forces (nv,) that may be anything in this pose, each with its opposite."""
        free = [
            self._direction(column) for column in range(len(self._setup.contact)) if self._is_free(column)
        ]
        free += list(self._equalities.directions(self.data.qpos.copy()).T)
        return [*free, *(-one for one in free)]

    def edges(
        self, slid: Mapping[int, FloatArray] | None = None, widened: float = 0.0
    ) -> tuple[list[FloatArray], list[int], FloatArray]:
        """The edges of all contacts' cones in this pose.

        Args:
            slid: (k, 3) the edges of contacts that slide, by their numbers, along their axes.
            widened: how much more friction the contacts have, as a share.

        Returns:
            The generalised force (nv,) of each per unit of its normal force; the contact that each belongs to; the
            longest levers (nv,).
        """
        model, data = self._model, self.data
        angles = 2.0 * np.pi * np.arange(_EDGES) / _EDGES
        around = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / _EDGES)
        found, owners, reach = [], [], np.zeros(model.nv)
        for number, contact in enumerate(data.contact):
            if contact.dist > TOUCHES or min(contact.geom) < 0:
                continue
            axes = np.array(contact.frame).reshape(3, 3)
            moves, turns = (axes @ part for part in contact_jacobian(model, data, number))
            reach = np.maximum(reach, np.abs(moves).max(axis=0))
            # Of a <pair> the two directions across the normal may have friction of their own.
            slips, (spin, *roll) = np.split((1.0 + widened) * np.array(contact.friction), [2])
            forces = moves[0] + (around * slips) @ moves[1:] if contact.dim > 1 else moves[:1]
            if slid is not None and number in slid:
                forces = slid[number] @ moves
            # A moment about each axis that the contact has friction about, as if there were no other friction.
            for axis, share in enumerate((spin, *roll)[: {4: 1, 6: 3}.get(int(contact.dim), 0)]):
                moment = share * turns[axis]
                forces = np.concatenate([forces + moment, forces - moment])
            found += list(forces)
            owners += [number] * len(forces)
        return found, owners, reach

    def _is_free(self, column: int) -> bool:
        """Whether a line may be anything here: at a limit of its joint, or on a body that touches nothing."""
        if column in self._joints:
            return bool(self._model.jnt_limited[self._joints[column]])
        return not any(touching(self._model, self.data, self._wholes[column]))

    def _direction(self, column: int) -> FloatArray:
        """(nv,) the generalised force of a unit force along a contact line."""
        self._setup.contact.apply(self._model, self.data, np.eye(len(self._setup.contact))[column])
        return self.data.qfrc_applied.copy()
