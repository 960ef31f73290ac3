"""Whether the contacts of the model can supply the solved forces, including their moments.

At every node the generalised force of all ``contact`` lines is fitted by the forces that the contact points in the
solved pose can give: each pushes, within its friction, and gives only the moments that its ``condim`` allows.  This
detects a foot whose centre of pressure is outside its sole, and a force on a joint that no contact can move.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.cones import TouchingModel, cone_edges, left_over
from stc.validate.contact_meter import can_touch
from stc.validate.contact_nodes import Node, nodes_of, pose
from stc.validate.equalities import Equalities

if TYPE_CHECKING:
    from collections.abc import Mapping

    from stc.validate.metrics import FloatArray
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup


def beyond_contacts(setup: Setup, motion: Replay) -> float | None:
    """The largest part of the solved contact forces that no contact can supply, as a share of the largest of them.

    Moments are divided by the moment of that force at the longest lever arm that a contact has about the joint.  Nodes
    at which nothing touches, bodies that touch nothing, and forces that hold a joint at its limit are left to the
    replay.

    Args:
        setup: the motion.
        motion: its replay, which gives the positions of the joints that are not tied.

    Returns:
        The share; None if there is no contact to compare with.
    """
    if not len(setup.contact) or not can_touch(setup.compiled):
        return None
    fit = ContactFit(setup)
    found = [one for node in nodes_of(setup, motion) if (one := fit.asked(node)) is not None]
    largest = fit.largest()
    if not found or not largest > 0.0:
        return None
    levers = np.maximum(np.max([reach for _, _, reach in found], axis=0), fit.least_levers())
    return max(left_over(edges / levers[:, None], force / (levers * largest)) for force, edges, _ in found)


class ContactFit:
    """The contact forces at each node, and the forces that the model's contacts can supply."""

    def __init__(self, setup: Setup) -> None:
        self._setup, self._touching = setup, TouchingModel(setup)
        self._model, self.data = self._touching.model, self._touching.data
        self._equalities = Equalities(setup.model())

    def largest(self) -> float:
        """The largest solved force in N; if all lines are moments, the largest of them divided by the model's
        extent.
        """
        size = float(self._model.stat.extent)
        found = []
        for column, (line, channel) in enumerate(
            zip(self._setup.contact.lines, self._setup.contact.channels)
        ):
            dof = self._setup.contact.where.dofs[column]
            turns = line.path[-1][0] == "m" if dof < 0 else self._touching.turns[dof]
            sides = [channel.before, channel.after, *([] if channel.mid is None else [channel.mid])]
            found.append((turns, max(float(np.abs(side).max(initial=0.0)) for side in sides)))
        forces = [value for turns, value in found if not turns]
        return max(forces) if any(forces) else max(value for _, value in found) / size

    def least_levers(self) -> FloatArray:
        """(nv,) the smallest lever of each coordinate that counts: 1 where it slides, a length in m where it turns."""
        return self._touching.least_levers()

    def asked(self, node: Node) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """The required force (nv,), the edges of the cones (nv, k), the longest lever arms (nv,); None if nothing
        touches.
        """
        if not pose(self._setup, self._model, self.data, node):
            return None
        edges, _, reach = self.edges(widened=limits.FRICTION_MISSING if node.ends_in_a_jump else 0.0)
        return self.force(node), np.array([*edges, *self.free()]).reshape(-1, self._model.nv).T, reach

    def force(self, node: Node) -> FloatArray:
        """(nv,) the generalised force of the contact lines, averaged over a step that ends in a jump, in the present
        pose.
        """
        self._setup.contact.apply(self._model, self.data, node.lasting)
        return self.data.qfrc_applied.copy()

    def free(self) -> list[FloatArray]:
        """The generalised forces (nv,) that are not limited in this pose, each with its opposite."""
        free = [
            self._direction(column) for column in range(len(self._setup.contact)) if self._is_free(column)
        ]
        free += list(self._equalities.directions(self.data.qpos.copy()).T)
        return [*free, *(-one for one in free)]

    def edges(
        self, slid: Mapping[int, FloatArray] | None = None, widened: float = 0.0
    ) -> tuple[list[FloatArray], list[int], FloatArray]:
        """The edges of all contacts' cones in this pose: see :func:`stc.validate.cones.cone_edges`."""
        return cone_edges(self._model, self.data, slid, widened)

    def _is_free(self, column: int) -> bool:
        """Whether the force of a line is not limited here: at a limit of its joint, or on a body that touches
        nothing.
        """
        joint = self._touching.joints.get(column)
        if joint is not None:
            return bool(self._model.jnt_limited[joint])
        return self._touching.is_in_the_air(column)

    def _direction(self, column: int) -> FloatArray:
        """(nv,) the generalised force of a unit force along a contact line."""
        self._setup.contact.apply(self._model, self.data, np.eye(len(self._setup.contact))[column])
        return self.data.qfrc_applied.copy()
