"""Flags under `option` of a model that switch elements off."""

from __future__ import annotations

from dataclasses import replace

from stc.mechanism.mechanism import Mechanism

#: What ``constraint="disable"`` switches off together.
_CONSTRAINTS = frozenset(("equality", "frictionloss", "limit", "contact"))


def in_effect(mechanism: Mechanism) -> Mechanism:
    """A model without the elements that its flags switch off: limits of joints and tendons, the clamping of controls,
    equality constraints, dry friction, actuators. Gravity, springs and dampers are checked where their forces are
    built.
    """
    disabled = mechanism.options.disabled
    if "constraint" in disabled:
        disabled |= _CONSTRAINTS
    joints, tendons = mechanism.joints, mechanism.tendons
    actuators, equalities = mechanism.actuators, mechanism.equalities
    if "limit" in disabled:
        joints = tuple([replace(one, limited=False) for one in joints])
        tendons = tuple([replace(one, limited=False) for one in tendons])
    if "frictionloss" in disabled:
        joints = tuple([replace(one, frictionloss=0.0) for one in joints])
        tendons = tuple([replace(one, frictionloss=0.0) for one in tendons])
    if "equality" in disabled:
        equalities = tuple([replace(one, active=False) for one in equalities])
    if "clampctrl" in disabled:
        actuators = tuple([replace(one, control_ranges=(None,) * len(one.controls)) for one in actuators])
    if "actuation" in disabled:
        actuators = tuple([replace(one, enabled=False) for one in actuators])
    return replace(
        mechanism,
        joints=joints,
        tendons=tendons,
        actuators=actuators,
        equalities=equalities,
        options=replace(mechanism.options, disabled=disabled),
    )
