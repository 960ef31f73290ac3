"""The two-link arm: one description of its solids, from which come meshes, inertias, MJCF and the specs' constants.

A column carries an upper arm at the shoulder, and this a forearm at the elbow; both turn in the plane of x and z.
Angles are counterclockwise for someone who looks along +y: the shoulder's from the x axis, the elbow's from the
upper arm.  Each body's frame stands at its joint, with x along the body.  Gravity points along -z; a spec that sets
it to zero has the arm lying on its side.

What weighs: of the upper arm a rod and the elbow's motor, of the forearm a rod and the ball that it holds.
"""

from __future__ import annotations

from math import pi

import trimesh

from stc.models import stage
from stc.models.description import Description, Measure
from stc.models.mjcf import Element, document, element, hinge, inertial, material, meshes, motors, seen
from stc.models.shapes import ball, knob, lathe, rod, slab, together, turned
from stc.models.solids import Inertia, Solid, inertia_of

UPPER, FOREARM = 0.45, 0.40
"""From shoulder to elbow and from elbow to the middle of the ball, m."""

SHOULDER = 0.95
"""Height of the shoulder above the floor, m; more than the whole arm's length."""

ROD_MASSES, MOTOR_MASS, BALL_MASS = (1.5, 0.9), 0.8, 0.3
"""Of the two rods, of the elbow's motor, of the ball, kg."""

_ROD_RADII, _MOTOR_RADIUS, _MOTOR_WIDTH, _BALL_RADIUS = (0.030, 0.022), 0.050, 0.110, 0.045


def bodies() -> tuple[Inertia, Inertia]:
    """Weigh upper arm and forearm, each in its own frame."""
    upper, forearm = (
        Solid(rod(radius, (-length / 2, 0.0, 0.0), (length / 2, 0.0, 0.0)), mass, (length / 2, 0.0, 0.0))
        for radius, length, mass in zip(_ROD_RADII, (UPPER, FOREARM), ROD_MASSES, strict=True)
    )
    origin = (0.0, 0.0, 0.0)
    motor = Solid(knob(_MOTOR_RADIUS, _MOTOR_WIDTH, origin, 0.004), MOTOR_MASS, (UPPER, 0.0, 0.0))
    held = Solid(ball(_BALL_RADIUS, origin), BALL_MASS, (FOREARM, 0.0, 0.0))
    return inertia_of([upper, motor]), inertia_of([forearm, held])


def measures(upper: Inertia, forearm: Inertia) -> dict[str, Measure]:
    """The constants of the specs, by the names they have there."""
    return {
        "m1": Measure(upper.mass, "kg", "mass of the upper arm with the elbow's motor"),
        "m2": Measure(forearm.mass, "kg", "mass of the forearm with the ball it holds"),
        "I1": Measure(
            upper.moments[1], "kg m^2", "moment of inertia of the upper arm about its centre of mass"
        ),
        "I2": Measure(
            forearm.moments[1], "kg m^2", "moment of inertia of the forearm about its centre of mass"
        ),
        "d1": Measure(upper.centre[0], "m", "from the shoulder to the upper arm's centre of mass"),
        "d2": Measure(forearm.centre[0], "m", "from the elbow to the forearm's centre of mass"),
        "l1": Measure(UPPER, "m", "from the shoulder to the elbow"),
        "l2": Measure(FOREARM, "m", "from the elbow to the middle of the ball"),
    }


def shapes() -> dict[str, trimesh.Trimesh]:
    """What is seen, by name; each in the frame of its body."""
    cheek = 0.5 * _MOTOR_WIDTH + 0.008
    shaft = [(0.0, 0.0), (0.10, 0.0), (0.10, 0.012), (0.050, 0.05), (0.036, 0.12), (0.036, SHOULDER - 0.02)]
    socket = lathe([(0.0, 0.0), (0.022, 0.0), (0.022, 0.012), (0.03, 0.03), (0.0, 0.03)], 32)
    turned(socket, (0.0, 1.0, 0.0), pi / 2)
    origin = (0.0, 0.0, 0.0)
    return {
        "arm_column": lathe([*shaft, (0.0, SHOULDER - 0.02)], 40).apply_translation((0.0, 0.0, -SHOULDER)),
        "arm_foot": slab((0.44, 0.44, 0.03), 0.12, 0.01, (0.0, 0.0, -SHOULDER)),
        "arm_shoulder": knob(0.062, 2 * cheek, origin, 0.006, 40),
        "arm_upper": together(
            rod(_ROD_RADII[0], (0.04, 0.0, 0.0), (UPPER - 0.02, 0.0, 0.0)),
            knob(0.066, 0.045, origin, 0.004, 40),
        ),
        "arm_motor": knob(_MOTOR_RADIUS, _MOTOR_WIDTH, (UPPER, 0.0, 0.0), 0.004, 40),
        "arm_forearm": together(
            rod(_ROD_RADII[1], (0.03, 0.0, 0.0), (FOREARM - _BALL_RADIUS - 0.004, 0.0, 0.0)),
            knob(0.054, 0.042, origin, 0.004, 40),
            socket.apply_translation((FOREARM - _BALL_RADIUS - 0.02, 0.0, 0.0)),
        ),
        "arm_caps": together(*(knob(0.02, 0.008, (0.0, side, 0.0), 0.002, 28) for side in (-cheek, cheek))),
        "arm_ball": ball(_BALL_RADIUS, (FOREARM, 0.0, 0.0)),
    }


MATERIALS = [
    material("enamel", (0.86, 0.87, 0.88), 0.7, 0.7),
    material("motor", (0.14, 0.16, 0.20), 0.6, 0.6),
    material("iron", (0.27, 0.29, 0.33), 0.4, 0.4),
    material("brass", (0.85, 0.66, 0.30), 0.9, 0.8),
    material("ball", (0.88, 0.30, 0.12), 0.9, 0.9),
]


def _arm(upper: Inertia, forearm: Inertia) -> Element:
    axis = (0.0, -1.0, 0.0)
    lower = element(
        "body",
        inertial(forearm),
        hinge("elbow", axis=axis),
        seen("arm_forearm", "enamel"),
        seen("arm_caps", "brass"),
        seen("arm_ball", "ball"),
        element("site", name="hand", pos=(FOREARM, 0.0, 0.0), size=(0.01,), rgba=(0.0, 0.0, 0.0, 0.0)),
        name="forearm",
        pos=(UPPER, 0.0, 0.0),
    )
    return element(
        "body",
        inertial(upper),
        hinge("shoulder", axis=axis),
        seen("arm_upper", "enamel"),
        seen("arm_motor", "motor"),
        seen("arm_caps", "brass"),
        lower,
        name="upper_arm",
        pos=(0.0, 0.0, SHOULDER),
    )


def describe() -> Description:
    """The arm as ``arm.xml``."""
    upper, forearm = bodies()
    world = element(
        "worldbody",
        stage.sun(),
        stage.lamp((0.9, -1.2, 2.6), (-0.28, 0.42, -0.86)),
        stage.camera("side", (0.2, -3.0, 1.15), (0.0, 1.0, -0.12), 35.0),
        stage.camera("portrait", (1.65, -2.3, 1.35), (-0.56, 0.80, -0.15), 40.0),
        stage.floor(),
        seen("arm_column", "iron", pos=(0.0, 0.0, SHOULDER)),
        seen("arm_foot", "iron", pos=(0.0, 0.0, SHOULDER)),
        seen("arm_shoulder", "motor", pos=(0.0, 0.0, SHOULDER)),
        _arm(upper, forearm),
    )
    text = document(
        "arm",
        "A two-link arm in the x-z plane.\n"
        "Written by `python -m stc.models.build` from models/arm.py: change that file and run it again.",
        element("compiler", angle="radian", meshdir="meshes", autolimits=False),
        stage.options(1e-3),
        *stage.picture((0.1, 0.0, 0.8), 1.6),
        stage.defaults(),
        element("asset", *stage.assets(), *MATERIALS, *meshes(shapes())),
        world,
        motors("shoulder", "elbow"),
    )
    return Description("arm", measures(upper, forearm), {"arm.xml": text}, shapes())
