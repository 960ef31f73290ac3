"""Jumps of velocity, which need an impulse.

A jump of velocity by dv needs the generalised impulse M dv.  Actuators and applied forces are finite and give none;
impulses come from the contacts that the spec names.  It is an error if no combination of these can give the impulse,
or if the impulse pulls or lies outside the friction cones of the model's contacts at that place.  This part is found
by a nonnegative least-squares fit with the edges of the cones.

:mod:`stc.validate.impulse_fit` checks whether contact points exist and can give the impulse with its moments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.contact_meter import touchable, touching, welded
from stc.validate.dynamics import SmoothDynamics
from stc.validate.impulse_fit import LEAST_IMPULSE, ImpulseFit

if TYPE_CHECKING:
    from stc.validate.metrics import FloatArray
    from stc.validate.places import Place
    from stc.validate.setup import Setup

#: Of a force and a torque, the components of the force.
_FORCES = (0, 1, 2)

#: Edges of a friction cone in space.
_EDGES = 16

#: A normal with less than this in the axes of the contact lines presses along none of them.
_FLAT = 0.5


@dataclass(frozen=True, slots=True)
class VelocityJumps:
    """The unexplained parts of the velocity jumps of a motion.

    Attributes:
        frames: the frames at which a velocity jumps.
        residual: (k,) per tied degree of freedom, largest impulse in kg m/s or kg m^2/s that no contact can give.
        scale: largest generalised momentum at these frames.
        outside: largest impulse in the same units that the named contacts can give only by pulling or beyond the
            model's friction; None if the model touches nothing in these places.
        unfounded: largest part of an impulse, as a share of it, that no contact point can give; None if not known.
    """

    frames: list[int]
    residual: FloatArray
    scale: float
    outside: float | None
    unfounded: float | None = None

    @property
    def share(self) -> FloatArray:
        """(k,) the residuals as a share of the scale."""
        return self.residual / self.scale if self.scale > 0.0 else self.residual

    @property
    def outside_share(self) -> float | None:
        """The impulse outside the cones as a share of the scale."""
        if self.outside is None:
            return None
        return self.outside / self.scale if self.scale > 0.0 else self.outside


def velocity_jumps(setup: Setup) -> VelocityJumps | None:
    """The velocity jumps of a motion; None if there are none or a joint is not tied.

    Frames 0 and n are included, since a periodic motion may jump there.
    """
    frames = jumping_frames(setup)
    if not frames or not setup.all_tied:
        return None
    reference = setup.reference
    dynamics = SmoothDynamics(setup.model(contacts=False))
    places, fit = _Places(setup), ImpulseFit(setup)
    shares: list[tuple[float, float]] = []
    worst, scale = np.zeros(setup.compiled.nv), 0.0
    outside: float | None = None
    position = dynamics.data.qpos.copy()
    for frame in frames:
        before, after = reference.at("before", frame), reference.at("after", frame)
        position[reference.positions] = after[0]
        dynamics.put(position)
        mass = dynamics.mass_matrix()
        old, new = np.zeros(len(worst)), np.zeros(len(worst))
        old[reference.velocities], new[reference.velocities] = before[1], after[1]
        impulse = mass @ (new - old)
        directions = _directions(setup, dynamics)
        if directions.shape[1]:
            given = directions @ np.linalg.lstsq(directions, impulse, rcond=None)[0]
            cones = places.cones(position, directions)
            if cones is not None:
                # What contacts cannot give at all is told by the residual, and not told again.
                outside = max(outside or 0.0, _left_over(cones, given))
            share = fit.beyond(frame, position, given, directions)
            if share is not None:
                shares.append((float(np.abs(given).max()), share))
            impulse = impulse - given
        worst = np.maximum(worst, np.abs(impulse))
        scale = max(scale, float(np.abs(mass @ old).max()), float(np.abs(mass @ new).max()))
    # The form of an impulse that is nothing but rounding says nothing.
    told = [share if size > LEAST_IMPULSE * scale else 0.0 for size, share in shares]
    return VelocityJumps(frames, worst[reference.velocities], scale, outside, max(told, default=None))


def jumping_frames(setup: Setup) -> list[int]:
    """The frames at which the velocity of a tied joint jumps."""
    jump = np.zeros(setup.solution.n + 1, dtype=bool)
    for rate in (channel for tie in setup.ties for channel in tie.channels(1)):
        jump |= np.abs(rate.after - rate.before) > 1e-12 * max(1.0, float(np.abs(rate.before).max()))
    return [int(k) for k in np.flatnonzero(jump)]


def _left_over(cones: FloatArray, impulse: FloatArray) -> float:
    """The largest entry of the part of a generalised impulse (nv,) that no nonnegative combination of columns (nv, k)
    gives.
    """
    from scipy.optimize import nnls

    size = float(np.abs(impulse).max(initial=0.0))
    if not size > 0.0 or not cones.shape[1]:
        return size
    # Edges of one length: rounding is a share of them, whatever the units.
    lengths = np.linalg.norm(cones, axis=0)
    edges = cones[:, lengths > 0.0] / lengths[lengths > 0.0]
    shares = nnls(edges, impulse / size)[0]
    return float(np.abs(edges @ shares * size - impulse).max())


class _Places:
    """The contacts of the bodies of the ``contact`` lines along the motion, with their normals.

    The cone of a contact has :data:`_EDGES` edges and encloses the round cone, so that no impulse within the friction
    is outside; along the axes of the contact lines in a plane it is exact.
    """

    def __init__(self, setup: Setup) -> None:
        import mujoco

        self._model = touchable(setup.model())
        self._data = mujoco.MjData(self._model)
        #: Per place of the lines by axis the line; lines that are no force there give either way.
        self._forces: dict[Place, dict[int, int]] = {}
        self._others: list[int] = []
        where = setup.contact.where
        for column, (place, part) in enumerate(zip(where.places, where.parts)):
            if place is None or part not in _FORCES:
                self._others.append(column)
            else:
                self._forces.setdefault(place, {})[part] = column

    def cones(self, position: FloatArray, directions: FloatArray) -> FloatArray | None:
        """The generalised impulses (nv, k) of the edges of all cones; None if nothing touches.

        Args:
            position: (nq,) of the model.
            directions: (nv, lines) generalised impulse of a unit impulse along each contact line.
        """
        import mujoco

        self._data.qpos[:] = position
        mujoco.mj_fwdPosition(self._model, self._data)
        free = [directions[:, column] for column in self._others]
        columns, touched = [*free, *(-one for one in free)], False
        for place, parts in self._forces.items():
            along = np.zeros((directions.shape[0], 3))
            for axis, column in parts.items():
                along[:, axis] = directions[:, column]
            edges = self._edges(place.body, sorted(parts))
            touched = touched or bool(edges)
            # A body that touches nothing here is judged by what the replay does.
            columns += [along @ edge for edge in edges or [*np.eye(3), *-np.eye(3)]]
        return np.array(columns).T if touched else None

    def _edges(self, body: int, axes: list[int]) -> list[FloatArray]:
        """Edges of the cones of all contacts of a body, in the axes of its lines."""
        found = []
        for _, frame, friction in touching(self._model, self._data, welded(self._model, body)):
            found += _cone(frame[0], friction, axes)
        return found


def _cone(normal: FloatArray, friction: float, axes: list[int]) -> list[FloatArray]:
    """Edges of a friction cone: two in a plane that contains the normal, many in three dimensions, the normal without
    friction.
    """
    absent = [axis for axis in range(3) if axis not in axes]
    # No line speaks of these axes: the impulse has nothing along them.
    flat = np.array(normal)
    flat[absent] = 0.0
    if np.linalg.norm(flat) < _FLAT:
        return []
    flat /= np.linalg.norm(flat)
    basis = np.linalg.svd(np.vstack([flat, np.eye(3)[absent]]))[2][1 + len(absent) :]
    if friction == 0.0 or not len(basis):
        return [flat]
    if len(basis) == 1:
        return [flat + sign * friction * basis[0] for sign in (1.0, -1.0)]
    angles = 2.0 * np.pi * np.arange(_EDGES) / _EDGES
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ basis
    return [flat + friction / np.cos(np.pi / _EDGES) * way for way in around]


def _directions(setup: Setup, dynamics: SmoothDynamics) -> FloatArray:
    """(nv, k) generalised impulse of a unit impulse along each contact line, in the present position."""
    found = []
    for one in np.eye(len(setup.contact)):
        setup.contact.apply(dynamics.model, dynamics.data, one)
        found.append(dynamics.data.qfrc_applied.copy())
    return np.array(found).T if found else np.zeros((dynamics.model.nv, 0))
