"""Advice on the contact forces of a motion that fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.certificate.advice import FRICTION_STEP
from stc.validate.contact import missing_contacts
from stc.validate.contact_drift import slips
from stc.validate.contact_meter import touchable, touching, welded
from stc.validate.contact_nodes import nodes_of, pose, press_and_friction
from stc.validate.grips import grips

if TYPE_CHECKING:
    from stc.validate.contact_drift import Slip
    from stc.validate.contact_forces import ContactForces
    from stc.validate.verdict import Replays

#: Of the largest value of a line, so much at least is a force that something has to give.
_ACTS = 1e-3
#: Contacts with a larger time constant than this, in s, give way visibly at a landing.
_SOFT = 5e-3
#: What gives the force of a hand that holds on.
_GRIP = (
    '; if it is a hand that holds on, add `<connect site1="..." site2="..." active="false"/>` to the model, between '
    "this site and one of what it holds"
)
#: From this share of the model's friction on, forces that differ a little from the solved ones make a contact slip.
_FULL = 0.8


def causes(replays: Replays) -> list[str]:
    """Advice for contact lines whose force nothing in the model supplies."""
    # The components of the force at one place are one finding.
    places = [line.rpartition(".")[0] if line.count(".") > 1 else line for line in given_by_nothing(replays)]
    return [
        f"contact {place} acts where nothing touches, so that nothing in the model supplies its force: use an `apply` "
        "line for a force that needs no contact, or add a geom that touches there, or the joint limit that gives the "
        "force" + (_GRIP if place.startswith("site.") else "")
        for place in dict.fromkeys(places)
    ]


def friction_steps(replays: Replays) -> list[str]:
    """Advice for bodies that slide with another friction than the model's, with both values."""
    return [step for one in replays.ground if (step := _friction(one))]


def given_by_nothing(replays: Replays) -> list[str]:
    """Contact lines whose body touches nothing while they act; grips, and lines on joints with a limit or tendon, are
    left out.
    """
    import mujoco

    setup = replays.setup
    model, nodes = touchable(setup.model()), nodes_of(setup, replays.open_loop)
    data, found = mujoco.MjData(model), []
    if not nodes or missing_contacts(setup):  # which is said by itself
        return []
    values = np.abs([node.forces for node in nodes])
    where = setup.contact.where
    held = {site for grip in grips(setup) for site in grip.sites}
    for column, line in enumerate(setup.contact.lines):
        force, place = values[:, column], where.places[column]
        # What holds a joint may be a rope, too.
        stops = place is None and (
            model.jnt_limited[model.dof_jntid[where.dofs[column]]] or model.tendon_limited.any()
        )
        gripped = place is not None and place.kind == "site" and place.index in held
        if not force.any() or stops or gripped:
            continue
        bodies = [] if place is None else [place.body]

        def touches(row: int, bodies: list[int] = bodies) -> bool:
            pose(setup, model, data, nodes[row], bodies)
            if bodies:
                return any(touching(model, data, welded(model, bodies[0])))
            return any(contact.dist <= contact.includemargin for contact in data.contact)

        if not any(touches(int(row)) for row in np.flatnonzero(force > _ACTS * force.max())):
            found.append(line.name)
    return found


def _friction(one: ContactForces) -> str:
    """Advice on a body that slides with another friction than the model's; "" for other bodies."""
    if one.sliding is None or one.sliding.way_without <= limits.SLID_WITHOUT_FRICTION:
        return ""
    seen, at = one.judged, one.sliding.slides & ~one.sliding.right
    press, across = press_and_friction(seen.force, seen.normal)
    known = at & (press > 0.0)
    if not known.any():
        return ""
    stated, model = np.median(across[known] / press[known]), np.median(seen.friction[known])
    return f"{FRICTION_STEP}; body {one.body} has {stated:.3g} times its normal force, its contacts have {model:.3g}"


def soft_step(replays: Replays) -> str:
    """Advice on a model whose contacts are softer than a landing is short, or whose equality constraints give way; ""
    for other models.
    """
    model = replays.setup.compiled
    holds = model.eq_active0 != 0
    holds[[grip.equality for grip in grips(replays.setup)]] = True
    touches = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    soft = {
        "contacts": model.geom_solref[touches if replays.ground else [], 0],
        "equality constraints": model.eq_solref[holds, 0],
    }
    slowest = {what: float(times.max(initial=0.0)) for what, times in soft.items()}
    told = [what for what, time in slowest.items() if time > _SOFT]
    if not told:
        return ""
    more = " set option.impratio = 100;" if replays.ground else ""
    return (
        f"make the model's {' and '.join(told)} stiffer, which give way with a time constant of up to "
        f"{max(slowest.values()):g} s: the line `set option.solref.time = 0.0005;{more}` under replay: does that"
    )


def slip_steps(replays: Replays) -> list[str]:
    """Advice on the contact that slips first in the replay, if the solved forces left it hardly any friction."""
    motion = replays.tracked or replays.open_loop
    for slip in slips(replays.setup, motion, replays.ground):
        used = max((_used(one, slip) for one in replays.ground if one.body == slip.body), default=0.0)
        if used < _FULL:
            continue
        return [
            f"{slip.name} slips in the replay from t = {replays.setup.solution.time[slip.frame]:.3g} s, where the "
            f"solved forces use {100.0 * used:.2g} % of the model's friction: leave it more to spare, by a smaller "
            "`friction` in the spec or a larger one in the model"
        ]
    return []


def _used(one: ContactForces, slip: Slip) -> float:
    """The largest share of the model's friction that the solved forces of a body use until it slips."""
    seen, time = one.judged, one.time
    press, across = press_and_friction(seen.force, seen.normal)
    most = press * seen.friction
    at = (seen.time >= time[slip.first]) & (seen.time <= time[slip.frame]) & (most > 0.0)
    return float(np.max(across[at] / most[at], initial=0.0))


def contact_steps(replays: Replays) -> list[str]:
    """Advice on the contacts of the model if their forces differ from the solved ones."""
    return [
        f"body {one.body} slides diagonally to the axes of the model's friction cone, a pyramid, which brakes along "
        "one "
        'of its axes: give the model <option cone="elliptic"/>, whose friction opposes the velocity'
        for one in replays.ground
        if one.sliding is not None and one.sliding.off_axes
    ]
