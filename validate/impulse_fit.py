"""Whether the contact points of the model can give the impulses of a motion, with their moments.

This is the check of :mod:`stc.validate.contact_cones` at the frames where velocities jump: the generalised impulse of
all ``contact`` lines is fitted by impulses at the contact points in that pose, which push within their friction.  A
joint at an end of its range may get an impulse away from it, and so may a tendon.  Inside the motion the replay judges
bodies that touch nothing; at its first and last frame no replay crosses the jump, and a body that touches nothing can
give no impulse.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.cones import TouchingModel, cone_edges, left_over
from stc.validate.contact_meter import TOUCHES, can_touch
from stc.validate.equalities import Equalities, constraint_rows

if TYPE_CHECKING:
    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: Impulses below this share of the momentum are rounding: their form says nothing.
LEAST_IMPULSE = limits.IMPULSE_CONE


class ImpulseFit:
    """The part of the impulse at each frame that no contact point can give."""

    def __init__(self, setup: Setup) -> None:
        import mujoco

        self._setup, self._touching = setup, TouchingModel(setup)
        margin = self._touching.model.tendon_margin
        margin[:] = np.maximum(margin, TOUCHES)
        self._equalities = Equalities(setup.model())
        model = self._touching.model
        self._stops = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
        #: Where no geom can touch another, that is told by itself.
        self._tells = bool(setup.contact.lines) and (can_touch(setup.compiled) or not self._touching.wholes)

    def beyond(
        self, frame: int, position: FloatArray, impulse: FloatArray, directions: FloatArray
    ) -> float | None:
        """The largest part of an impulse that no contact point can give, as a share of the impulse.

        Moments are shares of that at the longest lever that a contact has about the joint.

        Args:
            frame: the frame of the impulse.
            position: (nq,) of the model.
            impulse: (nv,) the generalised impulse of all ``contact`` lines.
            directions: (nv, lines) that of a unit impulse along each of them.

        Returns:
            The share; None if it is not known, because bodies that touch nothing are left to the replay.
        """
        import mujoco

        if not self._tells:
            return None
        there = self._touching
        model, data = there.model, there.data
        data.qpos[:] = position
        mujoco.mj_fwdPosition(model, data)
        edges, _, reach = cone_edges(model, data)
        stopped = self._from_stops(position, directions) + self._from_tendons()
        inside = 0 < frame < self._setup.solution.n
        if inside and not edges and not stopped:
            return None
        free = list(self._equalities.directions(position).T)
        if inside:
            free += [directions[:, column] for column in there.wholes if there.is_in_the_air(column)]
        columns = np.array([*edges, *stopped, *free, *(-one for one in free)]).reshape(-1, model.nv).T
        levers = np.maximum(reach, there.least_levers())
        size = float(np.abs(impulse / levers).max(initial=0.0))
        return left_over(columns / levers[:, None], impulse / (levers * size)) if size > 0.0 else 0.0

    def _from_stops(self, position: FloatArray, directions: FloatArray) -> list[FloatArray]:
        """(nv,) the impulses of joints at an end of their range, away from that end."""
        found: list[FloatArray] = []
        model = self._touching.model
        for column, joint in self._touching.joints.items():
            if not (self._stops and model.jnt_limited[joint]):
                continue
            value = float(position[model.jnt_qposadr[joint]])
            lower, upper = (float(bound) for bound in model.jnt_range[joint])
            if value - lower <= TOUCHES:
                found.append(directions[:, column])
            if upper - value <= TOUCHES:
                found.append(-directions[:, column])
        return found

    def _from_tendons(self) -> list[FloatArray]:
        """(nv,) the impulses of tendons at an end of their range: a taut rope pulls."""
        import mujoco

        model, data = self._touching.model, self._touching.data
        rows = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON))
        return list(constraint_rows(model, data, rows))
