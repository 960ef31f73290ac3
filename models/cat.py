"""A cat of 4 kg in two halves: a free chest, loins that bend and twist against it, legs that spread, and a tail.

The x axis is ahead, y to the left, z up.  At all joints zero it stands with straight legs.  The waist bends a cat's
way: far to both sides, up and down, and twists less.  Every body weighs what its geoms weigh.
"""

from __future__ import annotations

from stc.models import stage
from stc.models.description import Description
from stc.models.mjcf import Element, document, element, hinge, material
from stc.models.robots import defaults, drawn, motor, part

TORQUES = {"bend": 8.0, "sway": 8.0, "twist": 4.0, "tail_y": 0.6, "tail_z": 0.6, "legs": 3.0}
"""What each motor can give, N m; `legs` for each of the four."""

MATERIALS = [
    material("fur", (0.42, 0.40, 0.42), 0.2, 0.2),
    material("stripe", (0.22, 0.21, 0.23), 0.2, 0.2),
    material("cream", (0.93, 0.88, 0.80), 0.2, 0.2),
    material("eye", (0.65, 0.85, 0.25), 1.0, 1.0),
    material("nose", (0.85, 0.45, 0.45), 0.5, 0.5),
]


def _leg(name: str, ahead: float, aside: float) -> Element:
    return element(
        "body",
        hinge(name, axis=(0.0, 1.0, 0.0), range=(-1.8, 1.8)),
        part("capsule", "fur", 0.18, fromto=(0.0, 0.0, -0.01, 0.0, 0.0, -0.13), size=(0.016,), name=name),
        part(
            "sphere", "cream", 0.04, pos=(0.006, 0.0, -0.15), size=(0.020,), name=name.replace("leg", "paw")
        ),
        name=name,
        pos=(ahead, 0.045 * aside, -0.03),
    )


def _cat() -> Element:
    tail = element(
        "body",
        hinge("tail_y", axis=(0.0, 1.0, 0.0), range=(-1.4, 1.4)),
        hinge("tail_z", axis=(0.0, 0.0, 1.0), range=(-1.4, 1.4)),
        part("capsule", "stripe", 0.10, fromto=(-0.01, 0.0, 0.0, -0.24, 0.0, 0.0), size=(0.013,)),
        drawn("sphere", "cream", pos=(-0.25, 0.0, 0.0), size=(0.015,)),
        name="tail",
        pos=(-0.17, 0.0, 0.02),
    )
    loins = element(
        "body",
        hinge("sway", axis=(0.0, 0.0, 1.0), range=(-1.6, 1.6)),
        hinge("bend", axis=(0.0, 1.0, 0.0), range=(-1.6, 1.6)),
        hinge("twist", axis=(1.0, 0.0, 0.0), range=(-1.0, 1.0)),
        part("capsule", "fur", 1.35, fromto=(-0.02, 0.0, 0.0, -0.13, 0.0, 0.0), size=(0.058,), name="loins"),
        drawn("cylinder", "stripe", pos=(-0.05, 0.0, 0.0), size=(0.0587, 0.010), euler=(0.0, 1.5707963, 0.0)),
        drawn("cylinder", "stripe", pos=(-0.10, 0.0, 0.0), size=(0.0587, 0.010), euler=(0.0, 1.5707963, 0.0)),
        _leg("leg_rear_left", -0.13, 1.0),
        _leg("leg_rear_right", -0.13, -1.0),
        tail,
        name="loins",
        pos=(-0.03, 0.0, 0.0),
    )
    return element(
        "body",
        element("freejoint", name="root"),
        part("capsule", "fur", 1.25, fromto=(0.10, 0.0, 0.0, 0.02, 0.0, 0.0), size=(0.060,), name="chest"),
        part("sphere", "fur", 0.45, pos=(0.20, 0.0, 0.055), size=(0.050,)),
        drawn("cylinder", "stripe", pos=(0.06, 0.0, 0.0), size=(0.0607, 0.010), euler=(0.0, 1.5707963, 0.0)),
        drawn("ellipsoid", "cream", pos=(0.235, 0.0, 0.040), size=(0.026, 0.026, 0.020)),
        drawn("sphere", "nose", pos=(0.259, 0.0, 0.045), size=(0.006,)),
        *(drawn("sphere", "eye", pos=(0.240, 0.020 * side, 0.068), size=(0.009,)) for side in (1.0, -1.0)),
        *(
            drawn("ellipsoid", "fur", pos=(0.190, 0.030 * side, 0.105), size=(0.012, 0.014, 0.026))
            for side in (1.0, -1.0)
        ),
        _leg("leg_front_left", 0.10, 1.0),
        _leg("leg_front_right", 0.10, -1.0),
        loins,
        name="chest",
        pos=(0.0, 0.0, 0.20),
    )


def describe() -> Description:
    """The cat as ``cat.xml``."""
    names = ["sway", "bend", "twist", "tail_y", "tail_z"]
    names += [f"leg_{end}_{side}" for end in ("front", "rear") for side in ("left", "right")]
    motors = []
    for name in names:
        most = TORQUES["legs" if name.startswith("leg") else name]
        motors.append(motor(name, most))
    world = element(
        "worldbody",
        stage.sun(),
        stage.lamp((0.9, -1.6, 3.0), (-0.28, 0.50, -0.82)),
        stage.camera("side", (0.0, -2.6, 1.1), (0.0, 1.0, 0.0), 50.0),
        stage.camera("portrait", (1.1, -1.3, 0.75), (-0.62, 0.76, -0.25), 38.0),
        stage.floor(),
        _cat(),
    )
    text = document(
        "cat",
        "A cat in two halves, which can turn over in the air.\n"
        "Written by `python -m stc.models.build` from models/cat.py: change that file and run it again.",
        element("compiler", angle="radian", autolimits=True),
        stage.options(1e-3),
        *stage.picture((0.0, 0.0, 0.9), 1.8),
        defaults(0.0005, 0.005),
        element("asset", *stage.assets(), *MATERIALS),
        world,
        element("actuator", *motors),
    )
    return Description("cat", {}, {"cat.xml": text}, {})
