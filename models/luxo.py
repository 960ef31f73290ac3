"""The lamp: one description of its solids, from which come meshes, inertias, MJCF and the specs' constants.

The lamp moves in the plane of x (forward) and z (up).  A base carries a lower arm at the hip, this an upper arm
at the elbow, this the head at the neck; angles are relative to the body before and positive about +y, forward.
The base's frame has its origin at the middle of the sole; each other body's frame stands at its joint, with z
along the body.  Springs there are none: what holds the lamp up are its motors.

Weight and looks are two things.  Four plain solids weigh: a box, two rods, a turned head.  What is seen follows
them closely but adds what a lamp needs to look like one: forks, axles, a hollow shade, a bulb.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, sin

import trimesh
from trimesh import creation

from stc.models import stage
from stc.models.description import Description, Measure
from stc.models.mjcf import Element, document, element, hinge, inertial, material, meshes, motors, seen, slide
from stc.models.shapes import ball, knob, lathe, pin, rod, slab, together
from stc.models.solids import Inertia, Solid, inertia_of

BASE = (0.20, 0.16, 0.03)
"""Length, width and height of the base, m; the hip is in the middle of its upper face."""

ARM, ARM_RADIUS = 0.28, 0.012
"""Length of each arm from joint to joint and radius of the rod that weighs as much, m."""

HEAD = ((0.0, -0.04), (0.03, -0.04), (0.035, 0.02), (0.09, 0.12), (0.0, 0.12))
"""The head's outline: radius against height along its axis from the neck, m."""

MASSES = (1.0, 0.25, 0.25, 0.6)
"""Base, lower arm, upper arm, head, kg."""

STANDING = (1.5, 1.0)
"""Elbow and neck of the standing pose, rad; its hip puts the centre of mass above the middle of the sole."""

RANGES = {"hip": (-1.4, 1.4), "elbow": (0.15, 2.6), "neck": (-0.5, 2.4)}
"""Where each joint may move, rad: the lower arm stays off the base, the shade off the upper arm."""

FRICTION = 0.66
"""Of sole and floor: a tenth more than what motions may count on, so that rounding does not start a slip."""

STIFF = (0.0002, 1.0)
"""MuJoCo's `solref` of sole and floor: a contact that settles within two time steps, critically damped."""


@dataclass(frozen=True, slots=True)
class Bodies:
    """Mass properties of the four bodies, each in its own frame."""

    base: Inertia
    lower: Inertia
    upper: Inertia
    head: Inertia


def bodies() -> Bodies:
    """Weigh the four solids."""
    arm = rod(ARM_RADIUS, (0.0, 0.0, -ARM / 2), (0.0, 0.0, ARM / 2))
    middle = (0.0, 0.0, ARM / 2)
    return Bodies(
        base=inertia_of([Solid(creation.box(BASE), MASSES[0], (0.0, 0.0, BASE[2] / 2))]),
        lower=inertia_of([Solid(arm, MASSES[1], middle)]),
        upper=inertia_of([Solid(arm, MASSES[2], middle)]),
        head=inertia_of([Solid(lathe(HEAD), MASSES[3])]),
    )


def measures(found: Bodies) -> dict[str, Measure]:
    """The constants of the specs, by the names they have there."""
    hip = standing_hip(found)
    table = {
        "m0": (found.base.mass, "kg", "mass of the base"),
        "m1": (found.lower.mass, "kg", "mass of the lower arm"),
        "m2": (found.upper.mass, "kg", "mass of the upper arm"),
        "m3": (found.head.mass, "kg", "mass of the head"),
        "I0": (found.base.moments[1], "kg m^2", "moment of inertia of the base about its centre of mass"),
        "I1": (
            found.lower.moments[1],
            "kg m^2",
            "moment of inertia of the lower arm about its centre of mass",
        ),
        "I2": (
            found.upper.moments[1],
            "kg m^2",
            "moment of inertia of the upper arm about its centre of mass",
        ),
        "I3": (found.head.moments[1], "kg m^2", "moment of inertia of the head about its centre of mass"),
        "d0": (found.base.centre[2], "m", "from the sole to the base's centre of mass"),
        "d1": (found.lower.centre[2], "m", "from the hip to the lower arm's centre of mass"),
        "d2": (found.upper.centre[2], "m", "from the elbow to the upper arm's centre of mass"),
        "d3": (found.head.centre[2], "m", "from the neck to the head's centre of mass"),
        "lb": (BASE[2], "m", "from the sole to the hip"),
        "l1": (ARM, "m", "from the hip to the elbow"),
        "l2": (ARM, "m", "from the elbow to the neck"),
        "foot": (BASE[0] / 2, "m", "from the middle of the sole to heel and toe"),
        "mouth": (HEAD[3][1], "m", "from the neck to the plane of the shade's rim"),
        "rim": (HEAD[3][0], "m", "radius of the rim"),
        "back": (-HEAD[0][1], "m", "from the neck to the head's back"),
        "A1": (hip, "rad", "standing pose: hip, with the centre of mass above the sole's middle"),
        "A2": (STANDING[0], "rad", "standing pose: elbow"),
        "A3": (STANDING[1], "rad", "standing pose: neck"),
    }
    for index, (joint, (lower, upper)) in enumerate(RANGES.items(), start=1):
        table[f"lower{index}"] = (lower, "rad", f"range of the {joint}, from")
        table[f"upper{index}"] = (upper, "rad", f"range of the {joint}, to")
    return {name: Measure(value, unit, meaning) for name, (value, unit, meaning) in table.items()}


def standing_hip(found: Bodies) -> float:
    """The hip angle that brings the centre of mass above the middle of the sole, rad.

    Offset of the centre of mass: along*sin(hip) + across*cos(hip) = 0, with the arms' measures as below.
    """
    elbow, neck = STANDING
    m1, m2, m3 = found.lower.mass, found.upper.mass, found.head.mass
    on_lower = m1 * found.lower.centre[2] + (m2 + m3) * ARM
    on_upper = m2 * found.upper.centre[2] + m3 * ARM
    on_head = m3 * found.head.centre[2]
    along = on_lower + on_upper * cos(elbow) + on_head * cos(elbow + neck)
    across = on_upper * sin(elbow) + on_head * sin(elbow + neck)
    return -atan2(across, along)


LOWER_GAP, UPPER_GAP = 0.022, 0.040
"""Half the distance between the two rods that each arm is seen as, m: the arms pass inside one another."""


def shapes() -> dict[str, trimesh.Trimesh]:
    """What is seen, by name; each in the frame of its body."""
    rail = 0.0065
    return {
        "luxo_base": slab(BASE, corner=0.07, bevel=0.012, at=(0.0, 0.0, 0.0)),
        "luxo_pad": slab((BASE[0] - 0.004, BASE[1] - 0.004, 0.004), 0.068, 0.001, (0.0, 0.0, 0.0)),
        "luxo_turret": lathe([(0.0, 0.028), (0.046, 0.028), (0.045, 0.0305), (0.042, 0.031), (0.0, 0.031)]),
        "luxo_hip": knob(0.022, 2 * LOWER_GAP - 0.012, (0.0, 0.0, BASE[2]), bevel=0.002),
        "luxo_lower": _fork(LOWER_GAP, rail, ends=(0.016, 0.014)),
        "luxo_upper": _fork(UPPER_GAP, rail, ends=(0.016, 0.014)),
        "luxo_axle_lower": _axle(LOWER_GAP),
        "luxo_axle_upper": _axle(UPPER_GAP),
        "luxo_socket": lathe(
            [
                (0.0, -0.040), (0.018, -0.040), (0.026, -0.036), (0.030, -0.028),
                (0.032, 0.000), (0.036, 0.020), (0.034, 0.022), (0.0, 0.022),
            ],
            40,
        ),
        "luxo_shade": lathe(_shade(), 40),
        "luxo_lining": lathe(_lining(), 40),
        "luxo_bulb": together(ball(0.028, (0.0, 0.0, 0.062)), rod(0.014, (0, 0, 0.02), (0, 0, 0.045), 24)),
    }  # fmt: skip


def _fork(gap: float, radius: float, ends: tuple[float, float]) -> trimesh.Trimesh:
    """Two parallel rods with an eye at each end and two cross pieces."""
    parts = []
    for side in (-gap, gap):
        parts.append(rod(radius, (0.0, side, 0.0), (0.0, side, ARM), 16))
        for eye, height in zip(ends, (0.0, ARM), strict=True):
            parts.append(knob(eye, 0.010, (0.0, side, height), bevel=0.0015, sections=24))
    parts += [pin(0.0045, 2 * gap, (0.0, 0.0, share * ARM), 12) for share in (0.3, 0.7)]
    return together(*parts)


def _axle(gap: float) -> trimesh.Trimesh:
    """The pin through a fork's lower end, with a cap on each side."""
    half = gap + 0.008
    caps = [knob(0.010, 0.008, (0.0, side, 0.0), bevel=0.002, sections=24) for side in (-half, half)]
    return together(pin(0.0065, 2 * half, (0.0, 0.0, 0.0), 16), *caps)


_BELL = (
    (0.0330, 0.012), (0.0385, 0.026), (0.0490, 0.047),
    (0.0640, 0.074), (0.0780, 0.099), (0.0875, 0.116),
)  # fmt: skip
"""Outline of the shade, from the socket to below the rim."""

_THICKNESS = 0.0016


def _shade() -> list[tuple[float, float]]:
    """The shade's outer skin, with a rolled rim: up along the outline, back along a parallel one."""
    rim = [(0.0900, 0.1165), (0.0912, 0.1183), (0.0900, 0.1200), (0.0875, 0.1200)]
    inner = [(radius - _THICKNESS / 2, height) for radius, height in reversed(_BELL)]
    return [*_BELL, *rim, *inner, _BELL[0]]


def _lining() -> list[tuple[float, float]]:
    """The white inside of the shade."""
    outer = [(radius - _THICKNESS / 2, height) for radius, height in _BELL]
    inner = [(radius - _THICKNESS, height + 0.0004) for radius, height in reversed(_BELL)]
    return [*outer, *inner, outer[0]]


MATERIALS = [
    material("enamel", (0.80, 0.20, 0.11), 0.9, 0.85, reflectance=0.05),
    material("lining", (0.98, 0.94, 0.86), 0.3, 0.3, emission=0.45),
    material("bulb", (1.0, 0.93, 0.74), 0.2, 0.2, emission=1.0),
    material("steel", (0.74, 0.76, 0.79), 0.9, 0.8),
    material("brass", (0.85, 0.66, 0.30), 0.9, 0.8),
    material("rubber", (0.08, 0.08, 0.09), 0.1, 0.1),
    material("step", (0.36, 0.40, 0.46), 0.2, 0.2),
]


def lamp(
    found: Bodies, *base_joints: Element, swivels: tuple[Element, ...] = (), limited: bool = False
) -> Element:
    """The tree of bodies; without ``base_joints`` the base is fixed to the floor.

    Args:
        swivels: joints between base and lower arm below the hip.
        limited: whether the joints' ranges bound them.
    """
    axis = (0.0, 1.0, 0.0)
    head = element(
        "body",
        inertial(found.head),
        hinge("neck", axis=axis, range=RANGES["neck"], limited=limited),
        seen("luxo_axle_upper", "brass"),
        seen("luxo_socket", "enamel"),
        seen("luxo_shade", "enamel"),
        seen("luxo_lining", "lining"),
        seen("luxo_bulb", "bulb"),
        element("site", name="mouth", pos=(0.0, 0.0, HEAD[3][1]), size=(0.004,), rgba=(1.0, 0.9, 0.6, 0.0)),
        element("site", name="head_centre", pos=found.head.centre, size=(0.004,), rgba=(1.0, 0.9, 0.6, 0.0)),
        element(
            "light",
            name="bulb",
            type="spot",
            pos=(0.0, 0.0, 0.095),
            dir=(0.0, 0.0, 1.0),
            cutoff=58.0,
            exponent=2.0,
            diffuse=(1.9, 1.55, 1.0),
            specular=(0.3, 0.26, 0.18),
            attenuation=(1.0, 0.0, 0.35),
            castshadow=True,
        ),
        name="head",
        pos=(0.0, 0.0, ARM),
    )
    upper = element(
        "body",
        inertial(found.upper),
        hinge("elbow", axis=axis, range=RANGES["elbow"], limited=limited),
        seen("luxo_upper", "steel"),
        seen("luxo_axle_upper", "brass"),
        head,
        name="upper_arm",
        pos=(0.0, 0.0, ARM),
    )
    lower = element(
        "body",
        inertial(found.lower),
        *swivels,
        hinge("hip", axis=axis, range=RANGES["hip"], limited=limited),
        seen("luxo_lower", "steel"),
        seen("luxo_axle_lower", "brass"),
        upper,
        name="lower_arm",
        pos=(0.0, 0.0, BASE[2]),
    )
    return element(
        "body",
        inertial(found.base),
        *base_joints,
        element(
            "geom",
            class_="touching",
            name="foot",
            type="box",
            pos=(0.0, 0.0, BASE[2] / 2),
            size=tuple(length / 2 for length in BASE),
            friction=(FRICTION, 0.005, 0.0001),
            solref=STIFF,
        ),
        seen("luxo_base", "enamel"),
        seen("luxo_pad", "rubber"),
        seen("luxo_turret", "brass"),
        seen("luxo_hip", "steel"),
        element("site", name="heel", pos=(-BASE[0] / 2, 0.0, 0.0), size=(0.004,), rgba=(1.0, 0.9, 0.6, 0.0)),
        element("site", name="toe", pos=(BASE[0] / 2, 0.0, 0.0), size=(0.004,), rgba=(1.0, 0.9, 0.6, 0.0)),
        lower,
        name="base",
    )


STEP = (0.5, 0.6, 0.25)
"""Length, width and height of the step; its body stands in the middle of its upper face, which specs put into place."""

HURDLE = (0.012, 0.30, 0.008)
"""Length, width and height of the hurdle's bar; its body stands in the middle of the bar's upper face."""


def _step() -> Element:
    """A block whose upper face is another floor."""
    block = element(
        "geom",
        name="step",
        type="box",
        pos=(0.0, 0.0, -STEP[2] / 2),
        size=tuple(length / 2 for length in STEP),
        mass=0.0,
        friction=(FRICTION, 0.005, 0.0001),
        solref=STIFF,
        material="step",
    )
    return element("body", block, name="step", pos=(1.0, 0.0, 0.1))


def _hurdle() -> Element:
    """A bar on two posts that reach into the floor; nothing touches it, for it would fall."""
    length, width, height = HURDLE
    nothing = {"contype": 0.0, "conaffinity": 0.0, "mass": 0.0}
    bar = element(
        "geom",
        **nothing,
        name="hurdle",
        type="box",
        pos=(0.0, 0.0, -height / 2),
        size=(length / 2, width / 2, height / 2),
        material="brass",
    )
    posts = [
        element(
            "geom",
            **nothing,
            type="cylinder",
            pos=(0.0, side * (width / 2 - 0.006), -0.125),
            size=(0.006, 0.117),
            material="steel",
        )
        for side in (-1, 1)
    ]
    return element("body", bar, *posts, name="hurdle", pos=(0.2, 0.0, 0.1))


def scene(name: str, comment: str, standing: Sequence[Element], drives: Element, *more: Element) -> str:
    """The document of a lamp in its room.

    Args:
        standing: the lamp, and before it what else stands there.
        drives: its actuators.
        more: further sections.
    """
    world = element(
        "worldbody",
        stage.sun(),
        stage.camera("side", (0.2, -2.3, 0.42), (0.0, 1.0, -0.05), 25.0),
        stage.camera("portrait", (1.02, -1.36, 0.50), (-0.56, 0.80, -0.15), 27.0),
        stage.floor(contype=1.0, conaffinity=1.0, friction="0.66 0.005 0.0001", solref="0.0002 1"),
        *standing,
    )
    return document(
        name,
        comment,
        element("compiler", angle="radian", meshdir="meshes", autolimits=False),
        stage.options(1e-4, impratio=10.0),
        *stage.picture((0.1, 0.0, 0.3), 0.8),
        stage.defaults(),
        element("asset", *stage.assets(), *MATERIALS, *meshes(shapes())),
        world,
        drives,
        *more,
    )


def _planar(
    name: str, comment: str, found: Bodies, *base_joints: Element, scenery: tuple[Element, ...] = ()
) -> str:
    """The lamp in the plane, its motors without limits."""
    return scene(name, comment, (*scenery, lamp(found, *base_joints)), motors("hip", "elbow", "neck"))


def describe() -> Description:
    """The lamp with its base free, alone or with a step or hurdle, and with its base fixed (``luxo_fixed.xml``)."""
    found = bodies()
    free = (
        slide("x", axis=(1.0, 0.0, 0.0)),
        slide("z", axis=(0.0, 0.0, 1.0)),
        hinge("pitch", axis=(0.0, 1.0, 0.0)),
    )
    written = (
        "Written by `python -m stc.models.build` from models/luxo.py: change that file and run it again."
    )
    return Description(
        name="luxo",
        measures=measures(found),
        documents={
            "luxo.xml": _planar(
                "luxo", f"The lamp, standing free in the x-z plane.\n{written}", found, *free
            ),
            "luxo_step.xml": _planar(
                "luxo_step",
                f"The lamp, standing free, and a step.\n{written}",
                found,
                *free,
                scenery=(_step(),),
            ),
            "luxo_hurdle.xml": _planar(
                "luxo_hurdle",
                f"The lamp, standing free, and a hurdle.\n{written}",
                found,
                *free,
                scenery=(_hurdle(),),
            ),
            "luxo_fixed.xml": _planar("luxo_fixed", f"The lamp with its base fixed.\n{written}", found),
        },
        meshes=shapes(),
    )
