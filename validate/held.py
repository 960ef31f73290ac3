"""Contacts and grips in the linearised motion, and the effect of external forces on small deviations.

If a body presses on another, rigid contact keeps the touching material points from moving relative to one another; if
it slides, contact keeps them from separating.  A small deviation of the motion changes the contact forces accordingly.
With the mass matrix M, the points' Jacobian J and the step h, the map of one step without contacts,

    deviation of velocities' = A deviation + B change of control,

is followed by the impulse M^-1 J^T l that restores J times the deviation of positions to its value before the step.
(This value is the displacement of the points relative to one another: a foot that came down beside its place stays
there.) The contacts, with their places and axes, are MuJoCo's own in the solved pose; the solved forces decide whether
a contact presses.

Forces with a fixed direction in the world rotate relative to a body that turns, and their points move with the body.
The resulting change of the generalised forces is added by finite differences of :meth:`Attachments.apply`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.contact_meter import ContactMeter, contact_velocity, touchable, touching, welded
from stc.validate.grips import grips

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stc.validate.forces import OuterForces
    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: Of the largest solved force on any body, a body is pressed on by so much at least.
_PRESSED = 1e-6

#: What moves faster than this against what it touches, in m/s, slides.
_SLIDES = 1e-3

#: Directions that the contacts hold twice are told by this share of the largest.
_SAME = 1e-9

#: How far coordinates are moved, in m or rad, for finite differences.
_MOVED = 1e-6


@dataclass(frozen=True, slots=True)
class Touching:
    """Two material points in contact.

    Attributes:
        bodies: their bodies.
        points: (2, 3) their positions in their bodies' frames, in m.
        axes: (k, 3) the directions, in the world, in which they may not move against one another.
    """

    bodies: tuple[int, int]
    points: FloatArray
    axes: FloatArray


class Holding:
    """The active contacts of a motion, and the external forces on it, as parts of linear maps."""

    def __init__(self, setup: Setup, forces: OuterForces, held: bool = True) -> None:
        """Prepare for a motion.

        Args:
            setup: the motion and its model.
            forces: all external forces, including those of contacts.
            held: whether its contacts hold.
        """
        import mujoco

        self._model = touchable(setup.model())
        self._data = mujoco.MjData(self._model)
        self._setup, self._forces = setup, forces
        #: Per body of a contact line the bodies welded to it, and the lines that speak of it.
        self._bodies = [
            (welded(self._model, body), sorted({line for lines in parts.values() for line in lines}))
            for body, parts in ContactMeter(setup).columns.items()
            if held
        ]
        self._grips = grips(setup) if held else []
        largest = max((np.abs([c.before, c.after]).max() for c in setup.contact.channels), default=0.0)
        self._least = _PRESSED * float(largest)

    def add(
        self,
        frame: int,
        maps: tuple[FloatArray, FloatArray],
        positions: Sequence[FloatArray],
        velocity: FloatArray,
        step: float,
        forces: FloatArray,
        pressing: FloatArray,
    ) -> None:
        """Add the effect of contacts and external forces to the maps of one step, in place.

        Args:
            frame: the frame step that contains the step.
            maps: (2 nv, 2 nv) for deviations and (2 nv, m) for changes of control, by an Euler step.
            positions: (nq,) at the start, the middle and the end of the step.
            velocity: (nv,) in the middle.
            step: duration in s.
            forces: (k,) the external forces in the middle.
            pressing: (c,) the contact forces among them.
        """
        state, control = maps
        nv, middle = self._model.nv, positions[1]
        mass = self._mass_matrix(middle, step)
        if np.any(forces):
            change = step * np.linalg.solve(mass, self._stiffness(middle, forces))
            state[:nv, :nv] += step * change
            state[nv:, :nv] += change
        held = [*self._touching(middle, velocity, pressing), *self._gripped(frame)]
        if not held:
            return
        before, there, after = (self._jacobian(position, held) for position in positions)
        across = np.linalg.solve(mass, there.T)
        impulse = across @ np.linalg.pinv(there @ across, rcond=_SAME, hermitian=True) / step
        moved = -after @ state[:nv]
        moved[:, :nv] += before
        for found, stop in ((state, impulse @ moved), (control, -impulse @ after @ control[:nv])):
            found[:nv] += step * stop
            found[nv:] += stop

    def _touching(self, position: FloatArray, velocity: FloatArray, pressing: FloatArray) -> list[Touching]:
        """The active contacts in a state (nq,), (nv,) of the model with values ``pressing`` (k,) of the contact
        lines.
        """
        import mujoco

        model, data = self._model, self._data
        pressed = [bodies for bodies, lines in self._bodies if np.abs(pressing[lines]).max() > self._least]
        if not pressed:
            return []
        data.qpos[:], data.qvel[:] = position, velocity
        mujoco.mj_fwdPosition(model, data)
        found = []
        for number, axes, friction in touching(model, data, set().union(*pressed)):
            contact = data.contact[number]
            slides = np.linalg.norm(axes[1:] @ contact_velocity(model, data, number)) > _SLIDES
            first, second = (int(model.geom_bodyid[geom]) for geom in contact.geom)
            points = [
                data.xmat[body].reshape(3, 3).T @ (contact.pos - data.xpos[body]) for body in (first, second)
            ]
            held = axes if friction > 0.0 and not slides else axes[:1]
            found.append(Touching((first, second), np.array(points), held))
        return found

    def _gripped(self, frame: int) -> list[Touching]:
        """The sites that are held together in a frame step."""
        model = self._model
        return [
            Touching(
                (int(model.site_bodyid[grip.sites[0]]), int(model.site_bodyid[grip.sites[1]])),
                model.site_pos[list(grip.sites)],
                np.eye(3),
            )
            for grip in self._grips
            if grip.on[frame]
        ]

    def _jacobian(self, position: FloatArray, held: list[Touching]) -> FloatArray:
        """(r, nv) the relative velocity, along their axes, of points that touch in some pose, in this pose."""
        import mujoco

        model, data = self._model, self._data
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        rows = []
        for one in held:
            moves = np.zeros((3, model.nv))
            for body, point, sign in zip(one.bodies, one.points, (-1.0, 1.0)):
                move = np.zeros((3, model.nv))
                at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point
                mujoco.mj_jac(model, data, move, None, at, body)
                moves += sign * move
            rows.append(one.axes @ moves)
        return np.concatenate(rows)

    def _mass_matrix(self, position: FloatArray, step: float) -> FloatArray:
        """(nv, nv) the inertia of an Euler step of some length, in which dampers act implicitly."""
        import mujoco

        model, data, found = self._model, self._data, np.zeros((self._model.nv, self._model.nv))
        data.qpos[:] = position
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fullM(model, data, found)
        return found + step * np.diag(model.dof_damping)

    def _stiffness(self, position: FloatArray, forces: FloatArray) -> FloatArray:
        """(nv, nv) derivative of the generalised force of external forces (k,) with respect to the positions."""
        import mujoco

        model, data = self._model, self._data
        found = np.zeros((model.nv + 1, model.nv))
        for force, way in zip(found, np.concatenate([np.zeros((1, model.nv)), _MOVED * np.eye(model.nv)])):
            data.qpos[:] = position
            mujoco.mj_integratePos(model, data.qpos, way, 1.0)
            self._forces.apply(model, data, forces)
            force[:] = data.qfrc_applied
        return (found[1:] - found[0]).T / _MOVED
