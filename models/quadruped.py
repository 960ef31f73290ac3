"""A quadruped of the size of a small dog: a free trunk, four legs of three motors each, and feet of rubber balls.

Lengths and masses are those of common robots of this size; every body weighs what its geoms weigh, and what is drawn
besides weighs nothing.  The world's x axis is ahead, y to the left, z up.  At all joints zero the legs hang straight
down.
"""

from __future__ import annotations

from math import cos

from stc.models import stage
from stc.models.description import Description
from stc.models.mjcf import Element, Value, document, element, hinge, material
from stc.models.robots import defaults, drawn, motor

HALF_LENGTH, HALF_WIDTH = 0.19, 0.047
"""From the middle of the trunk to its hips, ahead and to the side, m."""
THIGH, CALF = 0.213, 0.213
"""Lengths of the leg's two parts, from joint to joint and to the middle of the foot, m."""
OFFSET = 0.08
"""From the hip's axis to the plane of the leg, m."""
FOOT = 0.02
"""Radius of a foot, m."""
HIP_ANGLE, KNEE_ANGLE = 0.8, -1.6
"""Of all legs in the keyframe `stand`, rad."""
TORQUES = {"abduction": 24.0, "hip": 24.0, "knee": 36.0}
"""What each motor can give, N m."""
LEGS = {"FL": (1.0, 1.0), "FR": (1.0, -1.0), "RL": (-1.0, 1.0), "RR": (-1.0, -1.0)}
"""Front and rear, left and right: direction of each leg from the middle."""

#: Hard contact that a replay can follow; friction a little above what specs ask for.
_TOUCHING: dict[str, Value] = {"friction": (0.8, 0.005, 0.0001), "solref": (0.0004, 1.0)}

MATERIALS = [
    material("shell", (0.90, 0.55, 0.14), 0.7, 0.7),
    material("frame", (0.16, 0.18, 0.22), 0.5, 0.5),
    material("joint", (0.72, 0.74, 0.78), 0.9, 0.7),
    material("rubber", (0.07, 0.07, 0.08), 0.2, 0.2),
    material("crate", (0.62, 0.48, 0.34), 0.2, 0.2),
    material("glass", (0.35, 0.75, 0.95), 1.0, 1.0),
]


def _leg(name: str, ahead: float, aside: float) -> Element:
    calf = element(
        "body",
        hinge(f"{name}_knee", axis=(0.0, 1.0, 0.0), range=(-2.7, -0.8)),
        element(
            "geom",
            name=f"{name}_calf",
            class_="part",
            type="capsule",
            material="frame",
            mass=0.16,
            fromto=(0.0, 0.0, 0.0, 0.0, 0.0, -CALF + FOOT),
            size=(0.012,),
        ),
        element(
            "geom",
            name=f"{name}_foot",
            class_="foot",
            type="sphere",
            material="rubber",
            mass=0.06,
            pos=(0.0, 0.0, -CALF),
            size=(FOOT,),
        ),
        drawn("cylinder", "joint", size=(0.026, 0.022), euler=(1.5707963, 0.0, 0.0)),
        name=f"{name}_calf",
        pos=(0.0, 0.0, -THIGH),
    )
    thigh = element(
        "body",
        hinge(f"{name}_hip", axis=(0.0, 1.0, 0.0), range=(-1.5, 3.0)),
        element(
            "geom",
            name=f"{name}_thigh",
            class_="part",
            type="capsule",
            material="shell",
            mass=1.0,
            fromto=(0.0, 0.0, -0.01, 0.0, 0.0, -THIGH + 0.02),
            size=(0.024,),
        ),
        drawn("cylinder", "frame", size=(0.042, 0.026), euler=(1.5707963, 0.0, 0.0)),
        drawn("cylinder", "joint", size=(0.018, 0.030), euler=(1.5707963, 0.0, 0.0)),
        calf,
        name=f"{name}_thigh",
        pos=(0.0, OFFSET * aside, 0.0),
    )
    return element(
        "body",
        hinge(f"{name}_abduction", axis=(1.0, 0.0, 0.0), range=(-0.8, 0.8)),
        element(
            "geom",
            class_="part",
            type="cylinder",
            material="frame",
            mass=0.6,
            size=(0.040, 0.034),
            euler=(0.0, 1.5707963, 0.0),
        ),
        thigh,
        name=f"{name}_shoulder",
        pos=(HALF_LENGTH * ahead, HALF_WIDTH * aside, 0.0),
    )


def _trunk() -> Element:
    return element(
        "body",
        element("freejoint", name="root"),
        element("geom", class_="part", type="box", material="frame", mass=6.0, size=(0.17, 0.055, 0.045)),
        drawn("capsule", "shell", fromto=(-0.16, 0.0, 0.02, 0.16, 0.0, 0.02), size=(0.056,)),
        drawn("ellipsoid", "shell", pos=(0.245, 0.0, 0.035), size=(0.062, 0.046, 0.040)),
        drawn("ellipsoid", "glass", pos=(0.272, 0.0, 0.045), size=(0.040, 0.036, 0.020)),
        drawn("capsule", "joint", fromto=(-0.10, 0.0, 0.075, 0.10, 0.0, 0.075), size=(0.007,)),
        element("site", name="trunk", size=(0.005,), rgba=(0.0, 0.0, 0.0, 0.0)),
        *(_leg(name, ahead, aside) for name, (ahead, aside) in LEGS.items()),
        name="trunk",
        pos=(0.0, 0.0, THIGH + CALF + FOOT),
    )


def _keyframe(name: str, hip: float, knee: float) -> Element:
    """A stance with all legs alike; the feet under the hips where the knee bends twice as much as the hip."""
    height = THIGH * cos(hip) + CALF * cos(hip + knee) + FOOT
    return element("key", name=name, qpos=(0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0, *((0.0, hip, knee) * 4)))


BOX = (0.5, 0.4, 0.125)
"""Half lengths of the box that it can jump onto, m; it begins `BEFORE` of the world's origin."""
BEFORE = 0.35


def _box() -> Element:
    return element(
        "geom",
        name="box",
        type="box",
        material="crate",
        size=BOX,
        pos=(BEFORE + BOX[0], 0.0, BOX[2]),
        conaffinity=1.0,
        contype=0.0,
        **_TOUCHING,
    )


def describe() -> Description:
    """The quadruped as ``quadruped.xml``, and before a box as ``quadruped_box.xml``."""
    documents = {
        "quadruped.xml": _document("A quadruped with twelve motors."),
        "quadruped_box.xml": _document("A quadruped with twelve motors before a box.", _box()),
    }
    return Description("quadruped", {}, documents, {})


def _document(what: str, *around: Element) -> str:
    motors = [motor(f"{leg}_{name}", most) for leg in LEGS for name, most in TORQUES.items()]
    world = element(
        "worldbody",
        stage.sun(),
        stage.lamp((0.9, -1.6, 2.2), (-0.28, 0.55, -0.80)),
        stage.camera("side", (0.25, -2.2, 0.55), (0.0, 1.0, -0.12), 38.0),
        stage.camera("portrait", (1.3, -1.5, 0.65), (-0.62, 0.76, -0.22), 38.0),
        stage.floor(0.0, conaffinity=1.0, **_TOUCHING),
        *around,
        _trunk(),
    )
    return document(
        "quadruped",
        f"{what}\n"
        "Written by `python -m stc.models.build` from models/quadruped.py: change that file and run it again.",
        element("compiler", angle="radian", autolimits=True),
        stage.options(1e-4, impratio=100.0, cone="elliptic"),
        *stage.picture((0.1, 0.0, 0.25), 1.2),
        defaults(0.005, 0.05, _TOUCHING),
        element("asset", *stage.assets(), *MATERIALS),
        world,
        element("actuator", *motors),
        element("keyframe", _keyframe("stand", HIP_ANGLE, KNEE_ANGLE), _keyframe("crouch", 1.15, -2.3)),
    )
