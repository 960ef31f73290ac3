"""What the models of robots and animals share: geoms that weigh, geoms that are looked at, feet, joints and motors."""

from __future__ import annotations

from collections.abc import Mapping

from stc.models import stage
from stc.models.mjcf import Element, Value, element


def part(kind: str, finish: str, mass: float, **attributes: Value) -> Element:
    """A geom that weighs, in kg, and touches nothing."""
    return element("geom", class_="part", type=kind, material=finish, mass=mass, **attributes)


def drawn(kind: str, finish: str, **attributes: Value) -> Element:
    """A geom that is drawn and touches nothing."""
    return element("geom", class_="drawn", type=kind, material=finish, **attributes)


def defaults(armature: float, damping: float, touching: Mapping[str, Value] | None = None) -> Element:
    """The classes of geoms, and what all joints have.

    Args:
        armature: kg m^2.
        damping: N m s/rad.
        touching: friction and stiffness of feet, where there are any.
    """
    made = stage.defaults()
    made.extend(
        [
            element("joint", armature=armature, damping=damping),
            element("default", element("geom", contype=0.0, conaffinity=0.0), class_="part"),
            element(
                "default", element("geom", contype=0.0, conaffinity=0.0, mass=0.0, group=1.0), class_="drawn"
            ),
        ]
    )
    if touching is not None:
        made.append(
            element("default", element("geom", contype=1.0, conaffinity=0.0, **touching), class_="foot")
        )
    return made


def motor(joint: str, most: float) -> Element:
    """A motor at a joint, of the joint's name, whose control is its torque in N m, up to ``most`` either way."""
    return element("motor", name=joint, joint=joint, gear=1.0, ctrlrange=(-most, most))
