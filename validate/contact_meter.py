"""The contacts of a model: where they touch the bodies of the ``contact`` lines, and their forces over time.

MuJoCo's contacts act in bursts: a body that slides on stiff ground leaves it repeatedly by a fraction of a millimetre,
so that a force at an instant means little although its mean is right.  The meter integrates the force on each body
through a replay, with the weights of the integrator's stages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from stc.validate.grips import grips
from stc.validate.rotations import cross

if TYPE_CHECKING:
    from collections.abc import Iterator

    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

    #: The contacts of an instant: (c, 6) each one's force and torque along its own axes, (c, 9) these axes row by row,
    #: (c, 2) its geoms, (c, 3) its place; and (b, 3) the origins of the bodies.
    _Contacts: TypeAlias = tuple[FloatArray, FloatArray, np.ndarray, FloatArray, FloatArray]

#: Geoms that are nearer than this to where they push on one another, in m, touch in a solved pose.
TOUCHES = 1e-3
#: So many instants of a replay are integrated at once.
_TOGETHER = 512


def welded(model: mujoco.MjModel, body: int) -> set[int]:
    """The bodies that are welded to a body, including itself; for a body that is fixed to the world, only itself."""
    whole = int(model.body_weldid[body])
    return {int(one) for one in np.flatnonzero(model.body_weldid == whole)} if whole else {body}


def touchable(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same model with contacts found :data:`TOUCHES` before they push, so that rounding does not decide.

    The margins of two geoms add up; contacts push within them.
    """
    model.geom_margin[:] += 0.5 * TOUCHES
    model.pair_margin[:] += TOUCHES
    return model


def can_touch(model: mujoco.MjModel) -> bool:
    """Whether any two geoms of a model can come into contact, in any pose."""
    import mujoco

    flags = mujoco.mjtDisableBit
    if model.opt.disableflags & int(flags.mjDSBL_CONTACT):
        return False
    if model.npair:
        return True
    types, affinities = model.geom_contype, model.geom_conaffinity
    meets = (types[:, None] & affinities[None, :]) | (types[None, :] & affinities[:, None])
    # What is welded together does not touch, nor does a body the one that it hangs on, the world excepted.
    welded = model.body_weldid[model.geom_bodyid]
    apart = welded[:, None] != welded[None, :]
    if not model.opt.disableflags & int(flags.mjDSBL_FILTERPARENT):
        parents = model.body_weldid[model.body_parentid[welded]]
        hangs = (parents[:, None] == welded[None, :]) & (welded[None, :] != 0)
        apart &= ~(hangs | hangs.T)
    return bool(np.any((meets != 0) & apart))


def touching(
    model: mujoco.MjModel, data: mujoco.MjData, bodies: set[int]
) -> Iterator[tuple[int, FloatArray, float]]:
    """The contacts of some bodies.

    Yields:
        The contact's number; (3, 3) its axes, row by row, the first pressing on the bodies; its sliding
            friction, the larger one where a <pair> has two.
    """
    for number in range(data.ncon):
        contact = data.contact[number]
        if contact.dist > contact.includemargin:
            continue
        # The first axis points from the first geom to the second.
        for geom, sign in ((contact.geom[0], -1.0), (contact.geom[1], 1.0)):
            if geom >= 0 and int(model.geom_bodyid[geom]) in bodies:
                axes = sign * np.array(contact.frame).reshape(3, 3)
                yield number, axes, float(contact.friction[:2].max()) if contact.dim > 1 else 0.0


def contact_jacobian(
    model: mujoco.MjModel, data: mujoco.MjData, number: int
) -> tuple[FloatArray, FloatArray]:
    """(3, nv) velocity, or angular velocity, of a contact's second geom relative to its first, at the contact point."""
    import mujoco

    contact = data.contact[number]
    moves, turns = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for geom, sign in ((contact.geom[0], -1.0), (contact.geom[1], 1.0)):
        if geom < 0:  # of a flex
            continue
        move, turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, move, turn, contact.pos, int(model.geom_bodyid[geom]))
        moves += sign * move
        turns += sign * turn
    return moves, turns


def contact_velocity(model: mujoco.MjModel, data: mujoco.MjData, number: int) -> FloatArray:
    """(3,) in m/s, along the world's axes."""
    return contact_jacobian(model, data, number)[0] @ data.qvel


class ContactMeter:
    """Integrates the forces that contacts exert on the bodies of the ``contact`` lines.

    Attributes:
        columns: per body and component (``fx`` ... ``mz``) its contact lines.  Bodies that are welded together count as
            one.  Torques are left out for a body with forces away from its origin, or on several of its bodies, since
            these forces have lever arms.
        impulses: per body (n, 6) the impulse in N s and its moment about the body's origin in N m s, along the world's
            axes, during each frame step.
    """

    def __init__(self, setup: Setup) -> None:
        model = setup.compiled
        self.columns: dict[int, dict[str, list[int]]] = {}
        armed = set()
        for column, (line, place) in enumerate(zip(setup.contact.lines, setup.contact.where.places)):
            if place is None:
                continue
            body = next((known for known in self.columns if place.body in welded(model, known)), place.body)
            self.columns.setdefault(body, {}).setdefault(line.path[-1], []).append(column)
            if not place.at_origin or place.body != body:
                armed.add(body)
        for body in armed:
            self.columns[body] = {part: lines for part, lines in self.columns[body].items() if part[0] == "f"}
        #: Per body which geoms are its own, 1 or 0; the last one stands for the -1 of what is no geom.
        self._own = {
            body: np.append(np.isin(model.geom_bodyid, list(welded(model, body))), False).astype(float)
            for body in self.columns
        }
        self._bodies = np.array(list(self._own), dtype=np.intp)
        self._grips = grips(setup)
        self._impulses = {body: np.zeros((setup.solution.n, 6)) for body in self.columns}
        #: What has been added and not yet integrated: the frame step, the time in s, and the contacts.
        self._added: list[tuple[int, float, _Contacts]] = []

    @property
    def impulses(self) -> dict[int, FloatArray]:
        """Per body (n, 6) the impulses during each frame step, of all that has been added."""
        self._integrate()
        return self._impulses

    def add(self, frame: int, model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> None:
        """Add the present contact forces, acting for some time of a frame step."""
        if data.ncon:
            # NumPy takes as long for the contacts of one instant as for those of a hundred.
            self._added.append((frame, seconds, self._contacts(model, data)))
            if len(self._added) == _TOGETHER:
                self._integrate()
        if self._grips:
            for body, wrench in self._of_grips(model, data):
                self._impulses[body][frame] += seconds * wrench

    def wrenches(self, model: mujoco.MjModel, data: mujoco.MjData) -> dict[int, FloatArray]:
        """Per body (6,) force and torque about its origin, along the world's axes, of all its contacts and grips."""
        contacts = self._contacts(model, data)
        found = {body: wrenches.sum(axis=0) for body, wrenches in self._each([contacts])}
        for body, wrench in self._of_grips(model, data):
            found[body] += wrench
        return found

    def _contacts(self, model: mujoco.MjModel, data: mujoco.MjData) -> _Contacts:
        """The contacts of the present instant, copied."""
        import mujoco

        contacts, forces = data.contact, np.zeros((data.ncon, 6))
        for number, force in enumerate(forces):
            mujoco.mj_contactForce(model, data, number, force)
        # MuJoCo's arrays are views of what the next step changes.
        views = contacts.frame, contacts.geom, contacts.pos
        axes, geoms, places = (view.copy() for view in views)
        return forces, axes, geoms, places, data.xpos[self._bodies]

    def _each(self, contacts: list[_Contacts]) -> Iterator[tuple[int, FloatArray]]:
        """Per body (c, 6) what each contact of some instants exerts on it, as a force and a torque about its origin."""
        local, frames, geoms, places, _ = map(np.concatenate, zip(*contacts))
        counts = [len(one[0]) for one in contacts]
        origins = np.repeat([one[4] for one in contacts], counts, axis=0)
        both = np.einsum("cpi,cij->cpj", local.reshape(-1, 2, 3), frames.reshape(-1, 3, 3))
        forces, torques = both[:, 0], both[:, 1]
        for index, (body, own) in enumerate(self._own.items()):
            # The force is the one on the second geom; one inside the body itself counts twice, and cancels.
            share = (own[geoms[:, 1]] - own[geoms[:, 0]])[:, None]
            moments = torques + cross(places - origins[:, index], forces)
            yield body, np.hstack([share * forces, share * moments])

    def _integrate(self) -> None:
        """Add to the impulses what waits for it."""
        if not self._added:
            return
        counts = [len(contacts[0]) for _, _, contacts in self._added]
        frames = np.repeat([frame for frame, _, _ in self._added], counts)
        seconds = np.repeat([time for _, time, _ in self._added], counts)[:, None]
        for body, wrenches in self._each([contacts for _, _, contacts in self._added]):
            np.add.at(self._impulses[body], frames, seconds * wrenches)
        self._added.clear()

    def _of_grips(self, model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[int, FloatArray]]:
        """The bodies that grips hold, each with the (6,) present force and torque about its origin of one of them."""
        for grip in self._grips:
            force = grip.force(data)
            for site, given in zip(grip.sites, (force, -force)):
                for body in welded(model, int(model.site_bodyid[site])) & self._own.keys():
                    yield body, np.append(given, cross(data.site_xpos[site] - data.xpos[body], given))
