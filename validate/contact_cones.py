"""Whether the contacts of the model can give the solved forces at all, with their moments.

At every frame the generalised force of all ``contact`` lines is fitted by what the contact points in the solved pose
can give: each a force that presses, within its friction, and no moment but what its ``condim`` allows.  A foot whose
centre of pressure lies outside its sole is found by that, and a force on a joint that no contact moves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.contact import can_touch
from stc.validate.contact_meter import TOUCHES, contact_jacobian, touchable, touching, welded
from stc.validate.equalities import Equalities

if TYPE_CHECKING:
    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: Edges of a friction cone.  It is the one around the round cone, 0.1 % wider at most.
_EDGES = 64

#: The shortest lever that counts, as a share of the model's extent.
_LEVER = 1e-2


def beyond_contacts(setup: Setup, positions: FloatArray) -> float | None:
    """The largest part of the solved contact forces that no contact gives, as a share of the largest of them.

    Moments are shares of that force's at the longest lever that a contact has about the joint.  Frames at which nothing
    is touched are left to the replay, and so are bodies that touch nothing, and what holds a joint at its limit.

    Args:
        setup: the motion.
        positions: (n+1, nq) of its replay, which stand for the joints that are not tied.

    Returns:
        The share; None where no contact tells.
    """
    if not len(setup.contact) or not can_touch(setup.compiled):
        return None
    fit = _Fit(setup)
    frames = []
    for frame, position in enumerate(positions):
        if np.all(np.isfinite(position)):
            found = fit.frame(frame, position)
            if found is not None:
                frames.append(found)
    largest = fit.largest()
    if not frames or not largest > 0.0:
        return None
    levers = np.maximum(np.max([reach for _, _, reach in frames], axis=0), fit.least_levers())
    return max(_left_over(edges / levers[:, None], force / (levers * largest)) for force, edges, _ in frames)


def _left_over(edges: FloatArray, force: FloatArray) -> float:
    """The largest entry of a force (nv,) that no sum of the columns (nv, k), none taken away, gives."""
    from scipy.optimize import nnls

    lengths = np.linalg.norm(edges, axis=0)
    edges = edges[:, lengths > 0.0] / lengths[lengths > 0.0]
    if not edges.shape[1] or not force.any():
        return float(np.abs(force).max(initial=0.0))
    return float(np.abs(edges @ nnls(edges, force)[0] - force).max())


class _Fit:
    """Frame by frame what the contact lines ask for and what contacts give."""

    def __init__(self, setup: Setup) -> None:
        import mujoco

        self._setup, self._model = setup, touchable(setup.model())
        self._data = mujoco.MjData(self._model)
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
            found.append((turns, float(np.abs(channel.after).max(initial=0.0))))
        forces = [value for turns, value in found if not turns]
        return max(forces) if any(forces) else max(value for _, value in found) / size

    def least_levers(self) -> FloatArray:
        """(nv,) the smallest lever of each coordinate that counts: 1 where it slides, a length in m where it turns."""
        return np.where(self._turns, _LEVER * float(self._model.stat.extent), 1.0)

    def frame(self, frame: int, position: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """What is asked for (nv,), what is given (nv, k), the longest levers (nv,); None where nothing is touched."""
        import mujoco

        model, data, setup = self._model, self._data, self._setup
        part = "after" if frame < setup.solution.n else "before"
        data.qpos[:] = position
        setup.reference.put(data, setup.reference.at(part, frame)[:2])
        pose = data.qpos.copy()
        mujoco.mj_fwdPosition(model, data)
        if not any(contact.dist <= TOUCHES for contact in data.contact):
            return None
        setup.contact.apply(model, data, setup.contact.at(part, frame))
        force = data.qfrc_applied.copy()
        edges, reach = self._edges()
        free = [self._direction(column) for column in range(len(setup.contact)) if self._is_free(column)]
        free += list(self._equalities.directions(pose).T)
        return force, np.array([*edges, *free, *(-one for one in free)]).reshape(-1, model.nv).T, reach

    def _edges(self) -> tuple[list[FloatArray], FloatArray]:
        """The generalised forces (nv,) of the edges of all contacts' cones, and the longest levers (nv,)."""
        model, data = self._model, self._data
        angles = 2.0 * np.pi * np.arange(_EDGES) / _EDGES
        around = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / _EDGES)
        found, reach = [], np.zeros(model.nv)
        for number, contact in enumerate(data.contact):
            if contact.dist > TOUCHES or min(contact.geom) < 0:
                continue
            axes = np.array(contact.frame).reshape(3, 3)
            moves, turns = (axes @ part for part in contact_jacobian(model, data, number))
            reach = np.maximum(reach, np.abs(moves).max(axis=0))
            slip, spin, *roll = (contact.friction[k] for k in (0, 2, 3, 4))
            forces = moves[0] + slip * around @ moves[1:] if contact.dim > 1 else moves[:1]
            # A moment about each axis that the contact has friction about, as if there were no other friction.
            for axis, share in enumerate((spin, *roll)[: {4: 1, 6: 3}.get(int(contact.dim), 0)]):
                moment = share * turns[axis]
                forces = np.concatenate([forces + moment, forces - moment])
            found += list(forces)
        return found, reach

    def _is_free(self, column: int) -> bool:
        """Whether a line may be anything here: at a limit of its joint, or on a body that touches nothing."""
        if column in self._joints:
            return bool(self._model.jnt_limited[self._joints[column]])
        return not any(touching(self._model, self._data, self._wholes[column]))

    def _direction(self, column: int) -> FloatArray:
        """(nv,) the generalised force of a unit force along a contact line."""
        self._setup.contact.apply(self._model, self._data, np.eye(len(self._setup.contact))[column])
        return self._data.qfrc_applied.copy()
