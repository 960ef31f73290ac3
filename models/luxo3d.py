"""The lamp in three dimensions: the lamp of `luxo.py` with a free base, which also turns and leans at its hip.

Joints and motors have limits here, and the keyframe `stand` is the standing pose of the planar lamp.
"""

from __future__ import annotations

from stc.models import luxo
from stc.models.description import Description
from stc.models.mjcf import element, hinge

SWIVELS = {"turn": ((0.0, 0.0, 1.0), 2.0), "lean": ((1.0, 0.0, 0.0), 0.5)}
"""The further joints at the hip, from the base outwards: axis, and how far each turns to either side, rad."""

TORQUE = 15.0
"""What each motor can give, N m."""


def describe() -> Description:
    """The lamp as ``luxo3d.xml``; its meshes are those of the planar lamp."""
    found = luxo.bodies()
    swivels = tuple(
        [hinge(name, axis=axis, range=(-most, most), limited=True) for name, (axis, most) in SWIVELS.items()]
    )
    motors = [
        element("motor", name=name, joint=name, gear=1.0, ctrllimited=True, ctrlrange=(-TORQUE, TORQUE))
        for name in (*SWIVELS, *luxo.RANGES)
    ]
    still = (0.0,) * len(SWIVELS)
    pose = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, *still, luxo.standing_hip(found), *luxo.STANDING)
    text = luxo.scene(
        "luxo3d",
        "The lamp in three dimensions, standing free.\n"
        "Written by `python -m stc.models.build` from models/luxo3d.py: change that file and run it again.",
        [luxo.lamp(found, element("freejoint", name="root"), swivels=swivels, limited=True)],
        element("actuator", *motors),
        element("keyframe", element("key", name="stand", qpos=pose)),
    )
    return Description("luxo3d", {}, {"luxo3d.xml": text}, {})
