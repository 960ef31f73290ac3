"""A gymnast of 62 kg in the plane of x and z, below a high bar: torso, arms, thighs, shins and feet.

The x axis is ahead, z up.  At all joints zero the body is straight with the arms overhead and the feet flat.  Both
arms, and both legs, move as one: their joints' motors are those of both sides.  Every body weighs what its geoms weigh.
"""

from __future__ import annotations

from math import cos, pi

from stc.models import stage
from stc.models.description import Description
from stc.models.mjcf import Element, document, element, hinge, material, slide
from stc.models.robots import defaults, drawn, motor, part

TORSO, ARM, THIGH, SHIN, ANKLE = 0.52, 0.60, 0.41, 0.40, 0.07
"""Hip to shoulder, shoulder to grip, hip to knee, knee to ankle, ankle to sole, m."""

BAR = 2.75
"""Height of the bar, m."""

SOLE = (0.11, 0.10, 0.015)
"""Half lengths of the box of both feet, m; its middle is `AHEAD` of the ankle."""
AHEAD = 0.04

KNEE = 0.4
"""Of the slightly bent legs in the keyframe `stand`, rad; hip and ankle take half of it each."""

TORQUES = {"shoulder": 220.0, "hip": 480.0, "knee": 540.0, "ankle": 320.0}
"""What the motors of both sides can give together, N m; the legs catch a fall from a high bar."""

_TOUCHING = {"friction": (0.9, 0.01, 0.0001), "solref": (0.0004, 1.0)}

MATERIALS = [
    material("skin", (0.87, 0.68, 0.55), 0.2, 0.2),
    material("suit", (0.62, 0.12, 0.20), 0.4, 0.4),
    material("white", (0.93, 0.93, 0.92), 0.2, 0.2),
    material("hair", (0.16, 0.10, 0.07), 0.2, 0.2),
    material("steel", (0.74, 0.76, 0.79), 0.9, 0.8),
    material("mat", (0.16, 0.34, 0.55), 0.1, 0.1),
]


def _pair(finish: str, mass: float, length: float, size: float, aside: tuple[float, float]) -> list[Element]:
    """Two limbs beside one another along z, up where the length is positive, each with its share of the mass."""
    near, far = aside
    return [
        part(
            "capsule",
            finish,
            0.5 * mass,
            fromto=(0.0, side * near, 0.05 * length, 0.0, side * far, 0.92 * length),
            size=(size,),
        )
        for side in (1.0, -1.0)
    ]


def _gymnast() -> Element:
    foot = element(
        "body",
        hinge("ankle", axis=(0.0, 1.0, 0.0), range=(-0.9, 1.1)),
        element(
            "geom",
            name="sole",
            class_="foot",
            type="box",
            mass=2.0,
            pos=(AHEAD, 0.0, SOLE[2] - ANKLE),
            size=SOLE,
        ),
        *(
            drawn(
                "capsule",
                "white",
                fromto=(-0.03, side * 0.07, -0.04, 0.12, side * 0.07, -0.048),
                size=(0.022,),
            )
            for side in (1.0, -1.0)
        ),
        name="feet",
        pos=(0.0, 0.0, -SHIN),
    )
    shins = element(
        "body",
        hinge("knee", axis=(0.0, 1.0, 0.0), range=(0.0, 2.4)),
        *_pair("white", 6.0, -SHIN, 0.042, (0.075, 0.07)),
        foot,
        name="shins",
        pos=(0.0, 0.0, -THIGH),
    )
    thighs = element(
        "body",
        hinge("hip", axis=(0.0, 1.0, 0.0), range=(-2.4, 0.5)),
        *_pair("white", 15.0, -THIGH, 0.062, (0.085, 0.075)),
        shins,
        name="thighs",
    )
    arms = element(
        "body",
        hinge("shoulder", axis=(0.0, 1.0, 0.0), range=(-0.3, 3.4)),
        *_pair("skin", 6.5, ARM, 0.036, (0.17, 0.20)),
        *(drawn("sphere", "white", pos=(0.0, side * 0.20, ARM), size=(0.042,)) for side in (1.0, -1.0)),
        element("site", name="grip", pos=(0.0, 0.0, ARM), size=(0.005,), rgba=(0.0, 0.0, 0.0, 0.0)),
        name="arms",
        pos=(0.0, 0.0, TORSO),
    )
    return element(
        "body",
        slide("x", axis=(1.0, 0.0, 0.0)),
        slide("z", axis=(0.0, 0.0, 1.0)),
        hinge("pitch", axis=(0.0, 1.0, 0.0)),
        part("capsule", "suit", 14.0, fromto=(0.0, -0.07, 0.40, 0.0, 0.07, 0.40), size=(0.105,)),
        part("capsule", "suit", 8.0, fromto=(0.0, -0.03, 0.20, 0.0, 0.03, 0.20), size=(0.092,)),
        part("capsule", "white", 6.5, fromto=(0.0, -0.05, 0.02, 0.0, 0.05, 0.02), size=(0.090,)),
        part("sphere", "skin", 4.0, pos=(0.03, 0.0, 0.68), size=(0.090,)),
        drawn("ellipsoid", "hair", pos=(0.008, 0.0, 0.712), size=(0.090, 0.088, 0.078)),
        drawn("capsule", "skin", fromto=(0.0, 0.0, 0.48, 0.01, 0.0, 0.60), size=(0.045,)),
        *(drawn("sphere", "suit", pos=(0.0, side * 0.165, TORSO), size=(0.052,)) for side in (1.0, -1.0)),
        arms,
        thighs,
        name="torso",
    )


def _around() -> list[Element]:
    """The bar on its posts, and the mat."""
    posts = [
        drawn("capsule", "steel", fromto=(0.0, side * 1.2, 0.0, 0.0, side * 1.2, BAR), size=(0.025,))
        for side in (1.0, -1.0)
    ]
    return [
        element("site", name="bar", pos=(0.0, 0.0, BAR), size=(0.005,), rgba=(0.0, 0.0, 0.0, 0.0)),
        element(
            "geom",
            name="bar",
            class_="drawn",
            type="capsule",
            material="steel",
            fromto=(0.0, -1.2, BAR, 0.0, 1.2, BAR),
            size=(0.014,),
        ),
        *posts,
        drawn("box", "mat", pos=(1.5, 0.0, 0.0005), size=(2.5, 0.9, 0.0005)),
    ]


def describe() -> Description:
    """The gymnast as ``gymnast.xml``."""
    motors = [motor(name, most) for name, most in TORQUES.items()]
    reach, leg, bent = TORSO + ARM, (THIGH + SHIN) * cos(KNEE / 2) + ANKLE, (-KNEE / 2, KNEE, -KNEE / 2)
    keys = [
        element("key", name="stand", qpos=(0.0, leg, 0.0, pi - 0.1, *bent)),
        element("key", name="hang", qpos=(0.0, BAR - reach, 0.0, 0.0, 0.0, 0.0, 0.0)),
        element("key", name="handstand", qpos=(0.0, BAR + reach, pi, 0.0, 0.0, 0.0, 0.0)),
    ]
    world = element(
        "worldbody",
        stage.sun(),
        stage.lamp((1.8, -2.6, 4.5), (-0.30, 0.50, -0.82)),
        stage.camera("side", (0.9, -6.5, 2.2), (0.0, 1.0, -0.03), 42.0),
        stage.camera("portrait", (4.2, -5.0, 2.6), (-0.62, 0.76, -0.12), 42.0),
        stage.floor(0.0, conaffinity=1.0, **_TOUCHING),
        *_around(),
        _gymnast(),
    )
    text = document(
        "gymnast",
        "A gymnast in the plane, and a high bar.\n"
        "Written by `python -m stc.models.build` from models/gymnast.py: change that file and run it again.",
        element("compiler", angle="radian", autolimits=True),
        stage.options(1e-4, impratio=100.0, cone="elliptic"),
        *stage.picture((0.6, 0.0, 1.6), 3.0),
        defaults(0.02, 0.2, {"group": 3.0, **_TOUCHING}),
        element("asset", *stage.assets(), *MATERIALS),
        world,
        # Hands that hold the bar: on in a replay while they do.
        element(
            "equality",
            element(
                "connect",
                name="hands",
                site1="grip",
                site2="bar",
                active=False,
                solref=_TOUCHING["solref"],
            ),
        ),
        element("actuator", *motors),
        element("keyframe", *keys),
    )
    return Description("gymnast", {}, {"gymnast.xml": text}, {})
