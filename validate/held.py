"""Contacts that press, and grips, hold: what they and outer forces make of small deviations along a motion.

Where a body presses on another, rigid contact keeps the material points that touch from moving against one another;
where it slides, it keeps them from parting.  A small deviation of the motion then changes the forces of the contacts so
that this stays true.  With the mass matrix M, the points' Jacobian J and the step h, the map of one step without that,

    deviation of velocities' = A deviation + B change of control,

is followed by the impulse M^-1 J^T l that leaves J times the deviation of positions, which is how far the points have
been moved against one another, as it was before the step: a foot that came down beside its place stands there.  What
touches, where and with which axes, are MuJoCo's own contacts in the solved pose; whether it presses is told by the
solved forces.

Forces that keep their direction in the world turn against a body that turns, and their points move with it: what that
changes in the generalised forces is added too, by finite differences of :meth:`Attachments.apply`.
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
    """Two material points that touch.

    Attributes:
        bodies: those that they are fixed in.
        points: (2, 3) where, in their bodies' frames, in m.
        axes: (k, 3) the directions, in the world, in which they may not move against one another.
    """

    bodies: tuple[int, int]
    points: FloatArray
    axes: FloatArray


class Holding:
    """The contacts of a motion that hold, and the outer forces on it, as parts of linear maps."""

    def __init__(self, setup: Setup, forces: OuterForces, held: bool = True) -> None:
        """Take over a motion.

        Args:
            setup: the motion and its model.
            forces: all that act on it from outside, those of contacts included.
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
        """Add to the maps of one step, in place.

        Args:
            frame: the frame step that it is in.
            maps: (2 nv, 2 nv) of deviations and (2 nv, m) of changes of control, by an Euler step.
            positions: (nq,) where the step begins, in its middle, and where it ends.
            velocity: (nv,) in the middle.
            step: in s.
            forces: (k,) the outer forces in the middle.
            pressing: (c,) those of contacts among them.
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
        """What holds in a state (nq,), (nv,) of the model while the contact lines give ``pressing`` (k,)."""
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
        """(r, nv) how fast points that touch in some pose move against one another along their axes, in this one."""
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
        """(nv, nv) the inertia that an Euler step of some length moves, which takes dampers at its end."""
        import mujoco

        model, data, found = self._model, self._data, np.zeros((self._model.nv, self._model.nv))
        data.qpos[:] = position
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fullM(model, data, found)
        return found + step * np.diag(model.dof_damping)

    def _stiffness(self, position: FloatArray, forces: FloatArray) -> FloatArray:
        """(nv, nv) change of the generalised force of outer forces (k,) with the positions."""
        import mujoco

        model, data = self._model, self._data
        found = np.zeros((model.nv + 1, model.nv))
        for force, way in zip(found, np.concatenate([np.zeros((1, model.nv)), _MOVED * np.eye(model.nv)])):
            data.qpos[:] = position
            mujoco.mj_integratePos(model, data.qpos, way, 1.0)
            self._forces.apply(model, data, forces)
            force[:] = data.qfrc_applied
        return (found[1:] - found[0]).T / _MOVED
