"""Motions on the ground: MuJoCo's contact solver supplies the forces of the solution's ``contact`` lines.

Such a motion is measured by the error of the base, as a share of the travel of each of its slides, by the error of
every other joint in its own unit, and by all errors at the end.  The base is the set of slides that no actuator
drives.  A body that stands on a foot is an unstable inverted pendulum, so that after a landing an open-loop replay is
also judged by its last frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.contact_meter import can_touch
from stc.validate.grips import grips
from stc.validate.metrics import FloatArray, Metric, root_mean_square
from stc.validate.ties import Coordinate
from stc.validate.transmissions import driven_dofs

if TYPE_CHECKING:
    from stc.validate.contact_forces import ContactForces
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup
    from stc.validate.ties import Tie

#: So many geoms of one friction are named in a note.
_NAMED = 4


def travelled(setup: Setup) -> float:
    """The travel of the base in m: the largest distance between two places of its path, with a lower limit."""
    ways = [np.ptp(tie.line.value.before) for tie in _parts(setup)[0]]
    return max(limits.LEAST_WAY, float(np.hypot.reduce([0.0, *ways])))


def contact_metrics(
    name: str, setup: Setup, motion: Replay, forces: Sequence[ContactForces] = ()
) -> list[Metric]:
    """The errors of a replay on the ground: of the base, if there is one, and of every other tied joint.

    Args:
        name: name of the replay, ``open-loop`` or ``tracked``.
        setup: the motion.
        motion: the simulation.
        forces: the contact forces, which determine the direction of the ground.
    """
    base, others = _parts(setup)
    tracked = name == "tracked"
    extent = setup.reference.extent
    rows: list[tuple[str, FloatArray, str, float, float]] = []
    if base:
        most = limits.CONTACT_TRACKED_BASE if tracked else limits.CONTACT_BASE
        share = _base_share(setup, base, motion, forces, limits.CONTACT_HEIGHT / most)
        rows.append(("base", share, "of travel", most, limits.CONTACT_END_BASE))
    for tie, distance in zip(others, _distances(others, motion.positions)):
        allowed = limits.CONTACT_TRACKED_JOINTS if tracked else limits.CONTACT_JOINTS
        most, at_end = (
            limits.of_extent(by_unit[tie.unit], limits.CONTACT_SHARE, extent, limits.CONTACT_FLOOR)
            for by_unit in (allowed, limits.CONTACT_END_JOINTS)
        )
        rows.append((f"joint {tie.name}", distance, tie.unit, most, at_end))
    found = []
    for subject, distance, unit, limit, at_end in rows:
        found.append(Metric(f"{name} error on the ground, RMS", subject, _rms(distance), unit, limit))
        if not tracked:
            last = float(distance[-1]) if np.all(np.isfinite(distance)) else np.inf
            found.append(Metric(f"{name} error on the ground, at the end", subject, last, unit, at_end))
    return found


def _base_share(
    setup: Setup, base: list[Coordinate], motion: Replay, forces: Sequence[ContactForces], height: float
) -> FloatArray:
    """(n+1,) distance of the base from its solved position, each slide as a share of its travel (maximum less minimum).

    A long way along the ground excuses no gap between the two, so that the error along the contacts' normals is
    measured against ``height`` as well.  What slides with friction bounces on stiff ground, and so does the friction:
    its slides count as ones that go so far at least.

    Args:
        setup: the motion.
        base: its slides.
        motion: the simulated motion.
        forces: of the contacts.
        height: in m.
    """
    axes = _axes(setup, base)
    sliding = any(one.slides.any() for one in forces)
    ways = [np.ptp([tie.line.value.before, tie.line.value.after]) for tie in base]
    least = height if sliding else limits.LEAST_WAY
    errors = _distances(base, motion.positions)
    share = np.linalg.norm(errors / np.maximum(ways, least)[:, None], axis=0)
    across = [
        np.abs(np.sum((errors.T @ axes) * np.nan_to_num(one.normal), axis=1)) / height for one in forces
    ]
    return np.maximum.reduce([share, *across])


def _axes(setup: Setup, slides: list[Coordinate]) -> FloatArray:
    """(k, 3) where slides go, in the world, where the motion starts."""
    import mujoco

    data = mujoco.MjData(setup.compiled)
    setup.reference.put(data, setup.reference.at("after", 0)[:2])
    mujoco.mj_kinematics(setup.compiled, data)
    return np.array([tie.direction(data) for tie in slides])


def ground_distances(setup: Setup, positions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Distance of many replays from the solved motion, coordinate by coordinate.

    Args:
        setup: the motion.
        positions: (samples, n+1, nq) of the replays at the frames.

    Returns:
        (samples, k, n+1) of the base's sliding joints in m, of the joints that motors turn in rad, and of all others,
        each in its unit.  Where the motion is not one on the ground: of all sliding joints, of all hinges, of none.
    """
    base: Sequence[Tie]
    if len(setup.contact):
        base, others = _parts(setup)
        driven = driven_dofs(setup)
        turned = [tie for tie in others if tie.unit == "rad" and driven.intersection(tie.velocities)]
        rest = [tie for tie in others if tie not in turned]
    else:
        base = [tie for tie in setup.ties if tie.unit == "m"]
        turned, rest = [tie for tie in setup.ties if tie.unit == "rad"], []
    return _distances(base, positions), _distances(turned, positions), _distances(rest, positions)


def missing_contacts(setup: Setup) -> list[Metric]:
    """A failed measurement if no two geoms can touch although forces act on bodies that nothing grips; otherwise
    nothing.
    """
    gripped = {site for grip in grips(setup) for site in grip.sites}
    if can_touch(setup.compiled) or all(
        place is None or (place.kind == "site" and place.index in gripped)
        for place in setup.contact.where.places
    ):
        return []
    return [Metric("contacts that the model can have", "pairs of geoms", 0.0, "", 1.0, at_least=True)]


def friction_note(setup: Setup) -> str:
    """A note on the friction of the model's contacts, for the report."""
    import mujoco

    model = setup.compiled
    if missing_contacts(setup):
        return (
            "no geom of the model can touch another, so that nothing supplies the forces of the `contact` lines; "
            "state forces that need no contact with `apply` lines"
        )
    named: dict[float, list[str]] = {}
    for geom in np.flatnonzero(model.geom_contype | model.geom_conaffinity).tolist():
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"geom {geom}"
        named.setdefault(float(model.geom_friction[geom, 0]), []).append(name)
    parts = []
    for friction, names in named.items():
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        parts.append(f"{friction:.4g} ({', '.join(names[:_NAMED])}{more})")
    of_all = f"; their friction is {', '.join(parts)}" if parts else ""
    return f"MuJoCo's own contacts give every ground force{of_all}"


def _parts(setup: Setup) -> tuple[list[Coordinate], list[Tie]]:
    """The base, which slides and is not driven, and all other tied joints."""
    driven = driven_dofs(setup)
    base: list[Coordinate] = []
    others: list[Tie] = []
    for tie in setup.ties:
        if isinstance(tie, Coordinate) and tie.unit == "m" and tie.velocity not in driven:
            base.append(tie)
        else:
            others.append(tie)
    return base, others


def _distances(ties: Sequence[Tie], positions: FloatArray) -> FloatArray:
    """(..., k, n+1) distance of each of k ties from the solved motion, of replays (..., n+1, nq)."""
    found = [tie.distances(positions) for tie in ties]
    if not found:
        return np.zeros((*positions.shape[:-2], 0, positions.shape[-2]))
    return np.stack(found, axis=-2)


def _rms(values: FloatArray) -> float:
    return root_mean_square(np.abs(values)) if np.all(np.isfinite(values)) else np.inf
