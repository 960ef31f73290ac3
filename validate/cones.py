"""The friction cones of the model's contacts in a pose, as generalised forces along their edges.

Each contact pushes, within its friction, and gives only the moments that its ``condim`` allows.  The same holds for the
impulses of a contact at a jump of the velocities.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.contact_meter import contact_jacobian, touchable, touching, welded

if TYPE_CHECKING:
    from collections.abc import Mapping

    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: Edges of a friction cone in space.  It is the one around the round cone, 0.1 % wider at most.
_EDGES = 64

#: The shortest lever that counts, as a share of the model's extent.
_LEVER = 1e-2

#: Below this share of the larger one, a direction across a contact is one in which nothing moves.
_FLAT = 1e-9


class TouchingModel:
    """The model with all possible contacts enabled, and the places at which the ``contact`` lines of a motion act on
    it.

    Attributes:
        model: the model.
        data: its state.
        joints: the joints of lines on joints, by the lines' numbers.
        wholes: the bodies that move with the bodies of the other lines, by the lines' numbers.
        turns: (nv,) whether a coordinate is an angle.
    """

    def __init__(self, setup: Setup) -> None:
        import mujoco

        self.model = model = touchable(setup.model())
        self.data = mujoco.MjData(model)
        slides, free = (
            model.jnt_type == int(kind) for kind in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_FREE)
        )
        #: Of a free joint's coordinates the first three slide.
        first = np.arange(model.nv) < model.jnt_dofadr[model.dof_jntid] + 3
        self.turns = ~slides[model.dof_jntid] & ~(free[model.dof_jntid] & first)
        self.joints: dict[int, int] = {}
        self.wholes = {}
        where = setup.contact.where
        for column, (place, dof) in enumerate(zip(where.places, where.dofs)):
            if place is None:
                self.joints[column] = int(model.dof_jntid[dof])
            else:
                self.wholes[column] = welded(model, place.body)

    def is_in_the_air(self, column: int) -> bool:
        """Whether the body of a line touches nothing in this pose."""
        return not any(touching(self.model, self.data, self.wholes[column]))

    def least_levers(self) -> FloatArray:
        """(nv,) a lower bound on the lever arm of each coordinate: 1 for a slide, a length in m for a rotation."""
        return np.where(self.turns, _LEVER * float(self.model.stat.extent), 1.0)


def cone_edges(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    slid: Mapping[int, FloatArray] | None = None,
    widened: float = 0.0,
) -> tuple[list[FloatArray], list[int], FloatArray]:
    """The edges of all contacts' cones in a pose.

    Args:
        model, data: the simulation in that pose, its contacts found.
        slid: (k, 3) the edges of contacts that slide, by their numbers, along their axes.
        widened: the additional friction of the contacts, as a share.

    Returns:
        The generalised force (nv,) of each per unit of its normal force; the contact that each belongs to; the longest
        levers (nv,).
    """
    found, owners, reach = [], [], np.zeros(model.nv)
    for number, contact in enumerate(data.contact):
        if contact.dist > contact.includemargin or min(contact.geom) < 0:
            continue
        axes = np.array(contact.frame).reshape(3, 3)
        moves, turns = (axes @ part for part in contact_jacobian(model, data, number))
        reach = np.maximum(reach, np.abs(moves).max(axis=0))
        # Of a <pair> the two directions across the normal may have friction of their own.
        slips, (spin, *roll) = np.split((1.0 + widened) * np.array(contact.friction), [2])
        forces = moves[0] + _around(slips[:, None] * moves[1:]) if contact.dim > 1 else moves[:1]
        if slid is not None and number in slid:
            forces = slid[number] @ moves
        # A moment about each axis that the contact has friction about, as if there were no other friction.
        for axis, share in enumerate((spin, *roll)[: {4: 1, 6: 3}.get(int(contact.dim), 0)]):
            moment = share * turns[axis]
            forces = np.concatenate([forces + moment, forces - moment])
        found += list(forces)
        owners += [number] * len(forces)
    return found, owners, reach


def _around(across: FloatArray) -> FloatArray:
    """(k, nv) corners of a polygon around the friction of a contact, exact for motions in a plane.

    Args:
        across: (2, nv) generalised force of the friction along either axis across its normal.
    """
    _, sizes, ways = np.linalg.svd(across, full_matrices=False)
    # A model with one coordinate has one way across.
    if len(sizes) < 2 or sizes[1] <= _FLAT * sizes[0]:
        return np.array([sizes[0] * ways[0], -sizes[0] * ways[0]])
    angles = 2.0 * np.pi * np.arange(_EDGES) / _EDGES
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) @ across / np.cos(np.pi / _EDGES)


def left_over(edges: FloatArray, force: FloatArray) -> float:
    """The largest entry of the part of a generalised force (nv,) that no nonnegative combination of columns (nv, k)
    can give.
    """
    from scipy.optimize import nnls

    lengths = np.linalg.norm(edges, axis=0)
    edges = edges[:, lengths > 0.0] / lengths[lengths > 0.0]
    if not edges.shape[1] or not force.any():
        return float(np.abs(force).max(initial=0.0))
    return float(np.abs(edges @ nnls(edges, force)[0] - force).max())
