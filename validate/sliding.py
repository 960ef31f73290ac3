"""Whether a sliding body has its full friction: Coulomb's, against the sliding velocity of each contact point.

A standing contact may have any force inside the friction cone.  A sliding contact has no such freedom: its friction is
the full friction of the normal force, against the velocity.  It has a single ray instead of a cone, and the solved
forces of a node are fitted with these rays and cones.  The fit covers contacts that share a force, points of a
rotating body that slide in different directions, and a rolling wheel, which does not slide.  MuJoCo's pyramidal cone
has its friction along the axis that slides faster, which is accepted as well.  A contact of ``condim`` 4 or 6 that
turns while it slides divides its elliptic cone between friction and moments, which is accepted as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.contact_cones import ContactFit
from stc.validate.contact_meter import contact_jacobian, welded
from stc.validate.contact_nodes import Node, pose, step_integrals

if TYPE_CHECKING:
    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: A contact slides that moves faster than this, in m/s ...
_SLIDES = 1e-3

#: ... and than this share of what the joints' speeds would make without cancelling one another: where a point is held
#: by several joints, as that of a wheel that rolls, its speed is zero up to the truncation error of the steps.
_CANCELLED = 5e-3

#: Of the largest force on a body, so much at least takes part: what only comes near the ground does not slide on it.
_PRESSED = 1e-3


@dataclass(frozen=True, slots=True)
class Sliding:
    """The sliding of a body at m nodes.

    Attributes:
        slides: (m,) whether it slides with friction, a force acting.
        swings: (m,) whether its velocity there is as large, but alternates from node to node.
        missing: (m,) the part of the solved force that differs from sliding friction, as a share of its friction.
        way_without: the distance that it slides with another force than its friction, in m.
        off_axes: whether the model's cone is a pyramid whose friction differs from Coulomb's in the sliding direction.
    """

    slides: np.ndarray
    swings: np.ndarray
    missing: FloatArray
    way_without: float
    off_axes: bool

    @property
    def right(self) -> np.ndarray:
        """(m,) whether it slides and has its full friction."""
        return self.slides & (self.missing <= limits.FRICTION_MISSING)


def sliding(
    setup: Setup, model: mujoco.MjModel, nodes: list[Node], forces: dict[int, FloatArray]
) -> dict[int, Sliding]:
    """The sliding of bodies at the nodes of a motion.

    Args:
        setup: the motion.
        model: its model, which detects contacts a little before they touch.
        nodes: the nodes of the motion.
        forces: per body (m, 3) the solved force on it.
    """
    fit, found = ContactFit(setup), {}
    largest, levers, integrals = fit.largest(), fit.least_levers(), step_integrals(setup, nodes)
    for body, force in forces.items():
        size = np.linalg.norm(force, axis=1)
        velocity, whole, missing = np.zeros((len(nodes), 3)), np.zeros(len(nodes)), np.zeros(len(nodes))
        differ = np.zeros(len(nodes), dtype=bool)
        for row in np.flatnonzero(size > _PRESSED * size.max(initial=0.0)):
            pose(setup, model, fit.data, nodes[row], [body])
            moving = _moving(model, fit.data, welded(model, body))
            if moving:
                fastest = max(moving.values(), key=lambda one: float(np.linalg.norm(one.velocity)))
                velocity[row], whole[row] = fastest.velocity, fastest.whole
            fast = {number: one for number, one in moving.items() if one.fast}
            if fast:
                missing[row] = _missing(fit, nodes[row], fast, levers, largest)
                differ[row] = any(_differ(one.rays) for one in fast.values())
        # Where a point is held at the nodes alone its velocity may swing from one to the next: it goes nowhere.
        way = np.linalg.norm(integrals @ velocity, axis=1)
        goes = way > np.maximum(_SLIDES * integrals.sum(axis=1), _CANCELLED * (integrals @ whole))
        speed = np.linalg.norm(velocity, axis=1)
        fast = speed > np.maximum(_SLIDES, _CANCELLED * whole)
        slides = fast & np.any(integrals[goes] > 0.0, axis=0)
        wrong = integrals @ (speed * (slides & (missing > limits.FRICTION_MISSING)))
        shares = wrong / np.maximum(integrals @ speed, np.finfo(float).tiny)
        way_without, off_axes = float(way[goes] @ shares[goes]), bool(np.any(differ & slides))
        found[body] = Sliding(slides, fast & ~slides, missing, way_without, off_axes)
    return found


@dataclass(frozen=True, slots=True)
class _Moving:
    """A moving contact with friction: its tangential velocity (3,) along the world's axes, and its possible forces.

    Attributes:
        velocity: in m/s.
        whole: the sum of the magnitudes of the joints' contributions to it, in m/s.
        rays: (k, 3) edges of the possible sliding forces, along the contact's own axes.
        turning: (nv,) generalised force per unit normal force if it turns as well; None without such friction.
    """

    velocity: FloatArray
    whole: float
    rays: FloatArray
    turning: FloatArray | None

    @property
    def fast(self) -> bool:
        """Whether the contact slides, judged by this instant alone."""
        return float(np.linalg.norm(self.velocity)) > max(_SLIDES, _CANCELLED * self.whole)


def _moving(model: mujoco.MjModel, data: mujoco.MjData, bodies: set[int]) -> dict[int, _Moving]:
    """The contacts of some bodies that have friction and are not quite at rest, by their numbers."""
    import mujoco

    pyramidal = model.opt.cone == int(mujoco.mjtCone.mjCONE_PYRAMIDAL)
    found = {}
    for number, contact in enumerate(data.contact):
        own = [geom >= 0 and int(model.geom_bodyid[geom]) in bodies for geom in contact.geom]
        friction = np.array(contact.friction[:2])
        if (
            contact.dist > contact.includemargin
            or contact.dim < 2
            or not any(own)
            or not np.all(friction > 0.0)
        ):
            continue
        tangents = np.array(contact.frame).reshape(3, 3)[1:]
        moves, turns = contact_jacobian(model, data, number)
        across = tangents @ moves
        velocity = across @ data.qvel
        if velocity.any():
            whole = float(np.linalg.norm(np.abs(across) @ np.abs(data.qvel)))
            rays = _rays(friction, velocity, pyramidal)
            turning = None if pyramidal else _turning(contact, moves, turns, data.qvel)
            found[number] = _Moving(velocity @ tangents, whole, rays, turning)
    return found


def _turning(
    contact: mujoco.MjContact, moves: FloatArray, turns: FloatArray, rate: FloatArray
) -> FloatArray | None:
    """(nv,) the generalised force per unit normal force of a contact with friction about axes as well; None without it.

    As in :func:`_rays`, it is the force that dissipates most power, in as many directions as the ``condim`` has.
    """
    if contact.dim < 4:
        return None
    axes = np.array(contact.frame).reshape(3, 3)
    normal, *ways = np.concatenate([axes @ moves, axes @ turns])[: contact.dim]
    friction = np.array(contact.friction[: contact.dim - 1])
    velocity = np.array(ways) @ rate
    return np.asarray(normal - _most_power(friction, velocity) @ np.array(ways))


def _most_power(friction: FloatArray, velocity: FloatArray) -> FloatArray:
    """(k,) the force of a round friction cone, per unit of normal force, that dissipates most power at a velocity (k,).

    It is zero if no direction of the velocity has friction.
    """
    size = float(np.linalg.norm(friction * velocity))
    return friction**2 * velocity / size if size > 0.0 else np.zeros_like(velocity)


def _rays(friction: FloatArray, velocity: FloatArray, pyramidal: bool) -> FloatArray:
    """(k, 3) the possible forces of a sliding contact, per unit of its normal force, along its axes.

    Args:
        friction: (2,) coefficients along the tangents.
        velocity: (2,) of the second geom along them, in m/s.
        pyramidal: whether the cone is one.
    """
    # Most power is lost: on the ellipse of the frictions where its normal is the velocity ...
    found = [[1.0, *-_most_power(friction, velocity)]]
    if pyramidal:  # ... on the pyramid at a corner.
        axis = int(np.argmax(friction * np.abs(velocity)))
        found.append([1.0, *(-friction * np.sign(velocity) * (np.arange(2) == axis))])
    return np.array(found)


def _differ(rays: FloatArray) -> bool:
    """Whether the possible forces (k, 3) of a sliding contact differ from one another."""
    spread = float(np.linalg.norm(np.ptp(rays[:, 1:], axis=0)))
    return spread > limits.FRICTION_MISSING * float(np.linalg.norm(rays[0, 1:]))


def _missing(
    fit: ContactFit, node: Node, fast: dict[int, _Moving], levers: FloatArray, largest: float
) -> float:
    """The part of the solved forces that sliding friction does not explain but cones would, as a share of the
    friction.
    """
    from scipy.optimize import nnls

    edges, owners, reach = fit.edges({number: one.rays for number, one in fast.items()})
    turning = {number: one.turning for number, one in fast.items() if one.turning is not None}
    edges, owners = [*edges, *turning.values()], [*owners, *turning]
    levers = np.maximum(levers, reach)
    force, free = fit.force(node) / (levers * largest), fit.free()

    def fitted(given: list[FloatArray]) -> tuple[float, FloatArray]:
        columns = np.array([*given, *free]).T / levers[:, None]
        lengths = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
        shares = nnls(columns / lengths, force)[0]
        return float(np.abs(columns / lengths @ shares - force).max()), shares / lengths

    left, shares = fitted(edges)
    slips = np.array([float(np.linalg.norm(fast[k].rays[0, 1:])) if k in fast else 0.0 for k in owners])
    friction = float(shares[: len(slips)] @ slips)
    return max(left - fitted(fit.edges()[0])[0], 0.0) / max(friction, _PRESSED)
