"""An arm of seven hinges on a pedestal that holds a ball beside a post.

At all joints zero it stands straight up.  From the pedestal outwards it turns about its own length and bends by turns;
a positive bend is towards the x axis, where the post stands.  Every body weighs what its geoms weigh, and what is drawn
besides weighs nothing; nothing touches anything, so that a spec has to say what may not meet.
"""

from __future__ import annotations

from math import pi

from stc.models import stage
from stc.models.description import Description
from stc.models.mjcf import Element, document, element, hinge, material
from stc.models.robots import defaults, drawn, motor, part

SHOULDER, UPPER, FOREARM, HAND = 0.36, 0.34, 0.32, 0.20
"""Floor to shoulder, shoulder to elbow, elbow to wrist, wrist to the middle of the ball, m."""

POST, POST_RADIUS, POST_HEIGHT = 0.50, 0.05, 1.1
"""Of the post: how far before the pedestal it stands, radius and height, m."""

BALL_RADIUS, BALL_MASS = 0.06, 3.0
"""Of the ball, m and kg."""

TORQUES = {
    "shoulder_z": 80.0, "shoulder_y": 110.0, "upper_z": 60.0, "elbow": 70.0,
    "forearm_z": 25.0, "wrist": 25.0, "hand_z": 10.0,
}  # fmt: skip
"""What each motor can give, N m, from the pedestal outwards."""

_TURN, _BEND = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
_ACROSS = (0.5 * pi, 0.0, 0.0)

MATERIALS = [
    material("enamel", (0.90, 0.91, 0.92), 0.8, 0.7),
    material("cap", (0.20, 0.23, 0.28), 0.6, 0.6),
    material("ring", (0.95, 0.55, 0.12), 0.7, 0.7),
    material("iron", (0.27, 0.29, 0.33), 0.4, 0.4),
    material("brass", (0.85, 0.66, 0.30), 0.9, 0.8),
    material("post", (0.30, 0.52, 0.62), 0.5, 0.5),
]


def _ring(radius: float, height: float) -> Element:
    """A coloured band around a link."""
    return drawn("cylinder", "ring", pos=(0.0, 0.0, height), size=(radius, 0.006))


def _joint(radius: float, half: float) -> list[Element]:
    """The housing of a bend: a drum across the arm with a cap at each side."""
    return [
        drawn("cylinder", "enamel", size=(radius, half), euler=_ACROSS),
        drawn("cylinder", "cap", size=(0.72 * radius, half + 0.006), euler=_ACROSS),
    ]


def _link(length: float, radii: tuple[float, float], mass: float) -> list[Element]:
    """A link along z from one bend to the middle of its length, and how it looks."""
    lower, upper = radii
    return [
        part("capsule", "enamel", mass, fromto=(0.0, 0.0, 0.0, 0.0, 0.0, 0.5 * length), size=(lower,)),
        _ring(upper + 0.006, 0.5 * length + lower + 0.002),
    ]


def _place(name: str) -> Element:
    return element("site", name=name, size=(0.005,), rgba=(0.0, 0.0, 0.0, 0.0))


def _arm() -> Element:
    hand = element(
        "body",
        hinge("hand_z", axis=_TURN, range=(-2.9, 2.9)),
        part("cylinder", "cap", 0.3, pos=(0.0, 0.0, 0.085), size=(0.034, 0.018)),
        drawn("cylinder", "ring", pos=(0.0, 0.0, 0.107), size=(0.036, 0.004)),
        *(
            drawn("capsule", "iron", fromto=(0.0, side * 0.028, 0.11, 0.0, side * 0.064, HAND), size=(0.008,))
            for side in (1.0, -1.0)
        ),
        element(
            "geom",
            name="ball",
            class_="part",
            type="sphere",
            material="brass",
            mass=BALL_MASS,
            pos=(0.0, 0.0, HAND),
            size=(BALL_RADIUS,),
        ),
        name="hand",
    )
    wrist = element(
        "body",
        hinge("wrist", axis=_BEND, range=(-2.1, 2.1)),
        *_joint(0.042, 0.042),
        part("capsule", "enamel", 1.0, fromto=(0.0, 0.0, 0.0, 0.0, 0.0, 0.045), size=(0.034,)),
        _place("wrist"),
        hand,
        name="wrist",
        pos=(0.0, 0.0, FOREARM),
    )
    forearm = element(
        "body",
        hinge("forearm_z", axis=_TURN, range=(-2.9, 2.9)),
        part("capsule", "enamel", 1.4, fromto=(0.0, 0.0, 0.17, 0.0, 0.0, FOREARM), size=(0.038,)),
        element(
            "site", name="forearm", pos=(0.0, 0.0, 0.5 * FOREARM), size=(0.005,), rgba=(0.0, 0.0, 0.0, 0.0)
        ),
        wrist,
        name="forearm",
    )
    elbow = element(
        "body",
        hinge("elbow", axis=_BEND, range=(-2.3, 2.3)),
        *_joint(0.056, 0.056),
        *_link(0.20, (0.046, 0.038), 1.8),
        _place("elbow"),
        forearm,
        name="elbow",
        pos=(0.0, 0.0, UPPER),
    )
    upper = element(
        "body",
        hinge("upper_z", axis=_TURN, range=(-2.9, 2.9)),
        part("capsule", "enamel", 2.2, fromto=(0.0, 0.0, 0.19, 0.0, 0.0, UPPER), size=(0.048,)),
        elbow,
        name="upper_arm",
    )
    shoulder = element(
        "body",
        hinge("shoulder_y", axis=_BEND, range=(-2.0, 2.0)),
        *_joint(0.068, 0.068),
        *_link(0.20, (0.056, 0.048), 2.8),
        upper,
        name="shoulder",
        pos=(0.0, 0.0, 0.16),
    )
    return element(
        "body",
        hinge("shoulder_z", axis=_TURN, range=(-2.9, 2.9)),
        part("capsule", "enamel", 3.0, fromto=(0.0, 0.0, 0.06, 0.0, 0.0, 0.15), size=(0.062,)),
        _ring(0.069, 0.02),
        shoulder,
        name="column",
        pos=(0.0, 0.0, SHOULDER - 0.16),
    )


def _around() -> list[Element]:
    """What stands around the arm: its pedestal, and the post in its way."""
    return [
        drawn("cylinder", "iron", pos=(0.0, 0.0, 0.012), size=(0.17, 0.012)),
        drawn("cylinder", "cap", pos=(0.0, 0.0, 0.11), size=(0.075, 0.10)),
        element(
            "geom", name="post", class_="drawn", type="cylinder", material="post",
            pos=(POST, 0.0, 0.5 * POST_HEIGHT), size=(POST_RADIUS, 0.5 * POST_HEIGHT),
        ),
        drawn("sphere", "post", pos=(POST, 0.0, POST_HEIGHT), size=(POST_RADIUS,)),
        drawn("cylinder", "iron", pos=(POST, 0.0, 0.008), size=(0.11, 0.008)),
    ]  # fmt: skip


def _beside(name: str, turn: float) -> Element:
    """The ball low beside the post, the hand hanging down."""
    return element("key", name=name, qpos=(turn, 0.6, 0.0, 1.25, 0.0, pi - 1.85, 0.0))


def describe() -> Description:
    """The arm as ``arm7.xml``."""
    motors = [motor(name, most) for name, most in TORQUES.items()]
    world = element(
        "worldbody",
        stage.sun(),
        stage.lamp((0.9, -1.2, 2.6), (-0.28, 0.42, -0.86)),
        stage.camera("side", (0.25, -2.6, 0.9), (0.0, 1.0, -0.14), 36.0),
        stage.camera("portrait", (2.0, -1.5, 1.3), (-0.78, 0.60, -0.32), 36.0),
        stage.floor(),
        *_around(),
        _arm(),
    )
    text = document(
        "arm7",
        "An arm with seven motors that holds a ball beside a post.\n"
        "Written by `python -m stc.models.build` from models/arm7.py: change that file and run it again.",
        element("compiler", angle="radian", autolimits=True),
        stage.options(1e-3),
        *stage.picture((0.2, 0.0, 0.5), 1.4),
        defaults(0.05, 0.5),
        element("asset", *stage.assets(), *MATERIALS),
        world,
        element("actuator", *motors),
        element("keyframe", _beside("left", 0.9), _beside("right", -0.9)),
    )
    return Description("arm7", {}, {"arm7.xml": text}, {})
