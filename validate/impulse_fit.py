"""Whether the contact points of the model can give the impulses of a motion, with their moments.

What :mod:`stc.validate.contact_cones` asks of forces, at the frames where velocities jump: the generalised impulse of
all ``contact`` lines is fitted by what presses within its friction where the model touches in that pose.  A joint at a
stop of its range gets an impulse away from it, and so does a tendon.  Inside the motion the replay judges bodies that
touch nothing; at its first and last frame no replay goes through the jump, and what touches nothing gives nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.contact import can_touch
from stc.validate.contact_meter import TOUCHES, contact_jacobian, touchable, touching, welded
from stc.validate.equalities import Equalities

if TYPE_CHECKING:
    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: Impulses below this share of the momentum are rounding: their form says nothing.
LEAST_IMPULSE = limits.IMPULSE_CONE

#: Edges of a friction cone in space.  It is the one around the round cone, 0.1 % wider at most.
_EDGES = 64

#: The shortest lever that counts, as a share of the model's extent.
_LEVER = 1e-2

#: Below this share of the larger one, a direction across a contact is one in which nothing moves.
_FLAT = 1e-9


class ImpulseFit:
    """Frame by frame which part of an impulse no contact point gives."""

    def __init__(self, setup: Setup) -> None:
        import mujoco

        self._setup, self._model = setup, touchable(setup.model())
        self._model.tendon_margin[:] = np.maximum(self._model.tendon_margin, TOUCHES)
        self._data = mujoco.MjData(self._model)
        self._equalities = Equalities(setup.model())
        model, lines = self._model, setup.contact.lines
        slides, free = (
            model.jnt_type == int(kind) for kind in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_FREE)
        )
        #: Of a free joint's coordinates the first three slide.
        first = np.arange(model.nv) < model.jnt_dofadr[model.dof_jntid] + 3
        turns = ~slides[model.dof_jntid] & ~(free[model.dof_jntid] & first)
        self._least_levers = np.where(turns, _LEVER * float(model.stat.extent), 1.0)
        self._joints = {
            column: int(model.joint(line.path[1]).id)
            for column, line in enumerate(lines)
            if line.path[0] == "joint"
        }
        self._wholes = {
            column: welded(model, self._body(*line.path[:2]))
            for column, line in enumerate(lines)
            if column not in self._joints
        }
        self._stops = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
        #: Where no geom can touch another, that is told by itself.
        self._tells = bool(lines) and (can_touch(setup.compiled) or not self._wholes)

    def _body(self, kind: str, name: str) -> int:
        if kind == "body":
            return int(self._model.body(name).id)
        return int(self._model.site_bodyid[self._model.site(name).id])

    def beyond(
        self, frame: int, position: FloatArray, impulse: FloatArray, directions: FloatArray
    ) -> float | None:
        """The largest part of an impulse that no contact point gives, as a share of the impulse.

        Moments are shares of that at the longest lever that a contact has about the joint.

        Args:
            frame: at which it acts.
            position: (nq,) of the model.
            impulse: (nv,) the generalised impulse of all ``contact`` lines.
            directions: (nv, lines) that of a unit impulse along each of them.

        Returns:
            The share; None where nothing tells, as what touches nothing is left to the replay.
        """
        import mujoco

        if not self._tells:
            return None
        model, data = self._model, self._data
        data.qpos[:] = position
        mujoco.mj_fwdPosition(model, data)
        edges, reach = _edges(model, data)
        stopped = self._from_stops(position, directions) + self._from_tendons()
        inside = 0 < frame < self._setup.solution.n
        if inside and not edges and not stopped:
            return None
        free = list(self._equalities.directions(position).T)
        if inside:
            free += [directions[:, column] for column in self._wholes if self._is_in_the_air(column)]
        columns = np.array([*edges, *stopped, *free, *(-one for one in free)]).reshape(-1, model.nv).T
        levers = np.maximum(reach, self._least_levers)
        size = float(np.abs(impulse / levers).max(initial=0.0))
        return left_over(columns / levers[:, None], impulse / (levers * size)) if size > 0.0 else 0.0

    def _is_in_the_air(self, column: int) -> bool:
        return not any(touching(self._model, self._data, self._wholes[column]))

    def _from_stops(self, position: FloatArray, directions: FloatArray) -> list[FloatArray]:
        """(nv,) what pushes the joints of the lines away from the ends of their ranges that they stand at."""
        found: list[FloatArray] = []
        for column, joint in self._joints.items():
            if not (self._stops and self._model.jnt_limited[joint]):
                continue
            value = float(position[self._model.jnt_qposadr[joint]])
            lower, upper = (float(bound) for bound in self._model.jnt_range[joint])
            if value - lower <= TOUCHES:
                found.append(directions[:, column])
            if upper - value <= TOUCHES:
                found.append(-directions[:, column])
        return found

    def _from_tendons(self) -> list[FloatArray]:
        """(nv,) what tendons at an end of their range give: a rope that is taut pulls."""
        import mujoco

        model, data = self._model, self._data
        rows = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON))
        found = np.zeros((len(rows), model.nv))
        for row, force in zip(rows, found):
            mujoco.mj_mulJacTVec(model, data, force, np.eye(data.nefc)[row])
        return list(found)


def left_over(edges: FloatArray, impulse: FloatArray) -> float:
    """The largest entry of a vector (nv,) that no sum of the columns (nv, k), none taken away, gives."""
    from scipy.optimize import nnls

    lengths = np.linalg.norm(edges, axis=0)
    edges = edges[:, lengths > 0.0] / lengths[lengths > 0.0]
    if not edges.shape[1] or not impulse.any():
        return float(np.abs(impulse).max(initial=0.0))
    return float(np.abs(edges @ nnls(edges, impulse)[0] - impulse).max())


def _edges(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[list[FloatArray], FloatArray]:
    """The generalised impulses (nv,) of the edges of all contacts' cones, and the longest levers (nv,)."""
    found: list[FloatArray] = []
    reach = np.zeros(model.nv)
    for number, contact in enumerate(data.contact):
        if contact.dist > TOUCHES or min(contact.geom) < 0:
            continue
        axes = np.array(contact.frame).reshape(3, 3)
        moves, turns = (axes @ part for part in contact_jacobian(model, data, number))
        reach = np.maximum(reach, np.abs(moves).max(axis=0))
        # Of a <pair> the two directions across the normal may have friction of their own.
        slips, (spin, *roll) = np.split(np.array(contact.friction), [2])
        edges = moves[0] + _around(slips[:, None] * moves[1:]) if contact.dim > 1 else moves[:1]
        # A moment about each axis that the contact has friction about, as if there were no other friction.
        for axis, share in enumerate((spin, *roll)[: {4: 1, 6: 3}.get(int(contact.dim), 0)]):
            moment = share * turns[axis]
            edges = np.concatenate([edges + moment, edges - moment])
        found += list(edges)
    return found, reach


def _around(across: FloatArray) -> FloatArray:
    """(k, nv) corners around all that the friction of a contact gives, exactly where it moves in a plane only.

    Args:
        across: (2, nv) generalised impulse of the friction along either axis across its normal.
    """
    _, sizes, ways = np.linalg.svd(across, full_matrices=False)
    # A model with one coordinate has one way across.
    if len(sizes) < 2 or sizes[1] <= _FLAT * sizes[0]:
        return np.array([sizes[0] * ways[0], -sizes[0] * ways[0]])
    angles = 2.0 * np.pi * np.arange(_EDGES) / _EDGES
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) @ across / np.cos(np.pi / _EDGES)
