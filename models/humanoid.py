"""A humanoid of 1.5 m and 44 kg: a free pelvis, a waist of three hinges, legs of six and arms of three each.

The world's x axis is ahead, y to the left, z up.  At all joints zero it stands upright with hanging arms and flat feet.
Every body weighs what its geoms weigh, as drawn; what is drawn besides weighs nothing.  Names of the two sides begin
with `left_` and `right_`, and their axes are mirror images where they lie along x or z.
"""

from __future__ import annotations

from math import cos

from stc.models import stage
from stc.models.description import Description
from stc.models.mjcf import Element, Value, document, element, hinge, material
from stc.models.robots import defaults, drawn, motor, part

THIGH, SHIN, ANKLE = 0.38, 0.38, 0.07
"""Hip to knee, knee to ankle, ankle to sole, m."""
HIP = 0.09
"""From the middle of the pelvis to a hip, aside, m."""
SOLE = (0.10, 0.045, 0.015)
"""Half lengths of a foot's box, m; its middle is `AHEAD` of the ankle."""
AHEAD = 0.035
KNEE = 0.5
"""Of the slightly bent legs in the keyframe `stand`, rad; hip and ankle take half of it each."""
TORQUES = {
    "waist_z": 80.0, "waist_y": 150.0, "waist_x": 100.0,
    "hip_x": 120.0, "hip_z": 80.0, "hip_y": 180.0, "knee": 200.0, "ankle_y": 120.0, "ankle_x": 60.0,
    "shoulder_y": 50.0, "shoulder_x": 50.0, "elbow": 40.0,
}  # fmt: skip
"""What each motor can give, N m."""

_TOUCHING: dict[str, Value] = {"friction": (0.9, 0.01, 0.0001), "solref": (0.0004, 1.0)}

MATERIALS = [
    material("suit", (0.20, 0.42, 0.62), 0.4, 0.4),
    material("panel", (0.90, 0.91, 0.93), 0.6, 0.6),
    material("dark", (0.12, 0.13, 0.16), 0.4, 0.4),
    material("accent", (0.95, 0.58, 0.15), 0.7, 0.7),
    material("visor", (0.05, 0.08, 0.12), 1.0, 1.0),
]


def _leg(side: str, aside: float) -> Element:
    sole = element(
        "geom",
        name=f"{side}_sole",
        class_="foot",
        type="box",
        material="dark",
        mass=0.8,
        pos=(AHEAD, 0.0, SOLE[2] - ANKLE),
        size=SOLE,
    )
    foot = element(
        "body",
        hinge(f"{side}_ankle_y", axis=(0.0, 1.0, 0.0), range=(-0.9, 0.9)),
        hinge(f"{side}_ankle_x", axis=(1.0, 0.0, 0.0), range=(-0.5, 0.5)),
        sole,
        drawn("capsule", "panel", fromto=(0.0, 0.0, -0.02, 0.09, 0.0, -0.037), size=(0.030,)),
        name=f"{side}_foot",
        pos=(0.0, 0.0, -SHIN),
    )
    shin = element(
        "body",
        hinge(f"{side}_knee", axis=(0.0, 1.0, 0.0), range=(0.02, 2.4)),
        part("capsule", "suit", 2.4, fromto=(0.0, 0.0, -0.03, 0.0, 0.0, -SHIN + 0.03), size=(0.042,)),
        drawn("sphere", "accent", pos=(0.012, 0.0, 0.0), size=(0.048,)),
        drawn("capsule", "panel", fromto=(0.03, 0.0, -0.09, 0.025, 0.0, -0.27), size=(0.025,)),
        foot,
        name=f"{side}_shin",
        pos=(0.0, 0.0, -THIGH),
    )
    return element(
        "body",
        hinge(f"{side}_hip_x", axis=(1.0, 0.0, 0.0), range=(-0.7, 0.7)),
        hinge(f"{side}_hip_z", axis=(0.0, 0.0, 1.0), range=(-0.8, 0.8)),
        hinge(f"{side}_hip_y", axis=(0.0, 1.0, 0.0), range=(-2.2, 0.7)),
        part("capsule", "suit", 4.2, fromto=(0.0, 0.0, -0.02, 0.0, 0.0, -THIGH + 0.03), size=(0.058,)),
        drawn("sphere", "dark", size=(0.062,)),
        shin,
        name=f"{side}_thigh",
        pos=(0.0, HIP * aside, -0.03),
    )


def _arm(side: str, aside: float) -> Element:
    lower = element(
        "body",
        hinge(f"{side}_elbow", axis=(0.0, 1.0, 0.0), range=(-2.4, -0.02)),
        part("capsule", "suit", 0.9, fromto=(0.0, 0.0, -0.02, 0.0, 0.0, -0.20), size=(0.030,)),
        part("sphere", "panel", 0.3, pos=(0.0, 0.0, -0.25), size=(0.038,)),
        drawn("sphere", "accent", size=(0.034,)),
        element("site", name=f"{side}_hand", pos=(0.0, 0.0, -0.25), size=(0.005,), rgba=(0.0, 0.0, 0.0, 0.0)),
        name=f"{side}_forearm",
        pos=(0.0, 0.0, -0.24),
    )
    return element(
        "body",
        hinge(f"{side}_shoulder_y", axis=(0.0, 1.0, 0.0), range=(-3.0, 1.2)),
        hinge(f"{side}_shoulder_x", axis=(1.0, 0.0, 0.0), range=(-0.3, 1.8) if aside > 0 else (-1.8, 0.3)),
        part("capsule", "suit", 1.4, fromto=(0.0, 0.0, -0.02, 0.0, 0.0, -0.21), size=(0.036,)),
        drawn("sphere", "dark", size=(0.046,)),
        lower,
        name=f"{side}_upper_arm",
        pos=(0.0, 0.17 * aside, 0.28),
    )


def _body() -> Element:
    torso = element(
        "body",
        hinge("waist_z", axis=(0.0, 0.0, 1.0), range=(-0.8, 0.8)),
        hinge("waist_y", axis=(0.0, 1.0, 0.0), range=(-0.5, 1.2)),
        hinge("waist_x", axis=(1.0, 0.0, 0.0), range=(-0.5, 0.5)),
        part("capsule", "panel", 9.0, fromto=(0.0, -0.07, 0.22, 0.0, 0.07, 0.22), size=(0.095,)),
        part("capsule", "suit", 4.0, fromto=(0.0, -0.04, 0.09, 0.0, 0.04, 0.09), size=(0.075,)),
        part("sphere", "panel", 3.2, pos=(0.01, 0.0, 0.44), size=(0.085,)),
        drawn("ellipsoid", "visor", pos=(0.052, 0.0, 0.45), size=(0.048, 0.066, 0.040)),
        drawn("capsule", "dark", fromto=(0.0, 0.0, 0.30, 0.0, 0.0, 0.38), size=(0.035,)),
        drawn("box", "accent", pos=(0.088, 0.0, 0.24), size=(0.012, 0.045, 0.018)),
        _arm("left", 1.0),
        _arm("right", -1.0),
        name="torso",
        pos=(0.0, 0.0, 0.07),
    )
    return element(
        "body",
        element("freejoint", name="root"),
        part("capsule", "dark", 5.0, fromto=(0.0, -0.07, 0.0, 0.0, 0.07, 0.0), size=(0.075,)),
        torso,
        _leg("left", 1.0),
        _leg("right", -1.0),
        name="pelvis",
        pos=(0.0, 0.0, 0.03 + THIGH + SHIN + ANKLE),
    )


def _joints() -> list[str]:
    names = ["waist_z", "waist_y", "waist_x"]
    for side in ("left", "right"):
        names += [f"{side}_{part}" for part in ("shoulder_y", "shoulder_x", "elbow")]
    for side in ("left", "right"):
        names += [f"{side}_{part}" for part in ("hip_x", "hip_z", "hip_y", "knee", "ankle_y", "ankle_x")]
    return names


def _stand(knee: float) -> Element:
    """Both legs bent by a knee's angle, the soles level below the hips, elbows a little bent and off the hips."""
    half = 0.5 * knee
    height = 0.03 + (THIGH + SHIN) * cos(half) + ANKLE
    left, right = (0.1, 0.15, -0.4), (0.1, -0.15, -0.4)
    leg = (0.0, 0.0, -half, knee, -half, 0.0)
    return element(
        "key",
        name="stand",
        qpos=(0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *left, *right, *leg, *leg),
    )


def describe() -> Description:
    """The humanoid as ``humanoid.xml``."""
    motors = []
    for name in _joints():
        most = TORQUES[name.removeprefix("left_").removeprefix("right_")]
        motors.append(motor(name, most))
    world = element(
        "worldbody",
        stage.sun(),
        stage.lamp((1.6, -2.2, 3.0), (-0.42, 0.55, -0.72)),
        stage.camera("side", (0.2, -3.6, 1.0), (0.0, 1.0, -0.06), 36.0),
        stage.camera("portrait", (2.1, -2.5, 1.2), (-0.62, 0.76, -0.16), 36.0),
        stage.floor(0.0, conaffinity=1.0, **_TOUCHING),
        _body(),
    )
    text = document(
        "humanoid",
        "A humanoid with 21 motors.\n"
        "Written by `python -m stc.models.build` from models/humanoid.py: change that file and run it again.",
        element("compiler", angle="radian", autolimits=True),
        stage.options(1e-4, impratio=100.0, cone="elliptic"),
        *stage.picture((0.1, 0.0, 0.7), 2.0),
        defaults(0.02, 0.2, _TOUCHING),
        element("asset", *stage.assets(), *MATERIALS),
        world,
        element("actuator", *motors),
        element("keyframe", _stand(KNEE)),
    )
    return Description("humanoid", {}, {"humanoid.xml": text}, {})
