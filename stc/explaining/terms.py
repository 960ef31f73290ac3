"""The terms that an objective may contain, each with its name and integrand; their weights are identified."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from stc.language.model.scope import coordinates_of, path_of
from stc.mechanism.mechanism import Mechanism
from stc.records import dataclass

if TYPE_CHECKING:
    from stc.explaining.recording import Recording

__all__ = ["LANDING", "Term", "terms_of"]

#: A body that turns by less than this, in rad, does not lean.
LEANING = 0.1
#: Which of a joint's coordinates turn it.
_TURNING = {"free": (3, 7), "ball": (0, 4), "hinge": (0, 1)}
#: The speed of touchdown is an option of contacts, and no integral.
LANDING = "landing"


@dataclass(frozen=True, slots=True)
class Term:
    """A term of an objective.

    Attributes
    ----------
    name
        What it is called, in messages and in the constant that weighs it.
    words
        What a motion has little of that is good in it.
    integrand
        In the language; nothing for what is an option of contacts.
    """

    name: str
    words: str
    integrand: str = ""


def terms_of(recording: Recording, lands: bool) -> list[Term]:
    """The terms that a model has.

    Parameters
    ----------
    recording
        A motion of the model.
    lands
        Whether something comes down on the floor in it.
    """
    return list(_terms(recording, lands))


def _terms(recording: Recording, lands: bool) -> Iterator[Term]:
    mechanism = recording.mechanism
    if mechanism.actuators:
        yield Term("effort", "squared forces and torques of the motors", "effort")
        yield Term("power", "squared power of the motors", "power^2")
        yield Term("rates", "changes of the motors' controls", "actuator.*'^2")
    yield Term("speed", "squared speeds of the joints", "joint.*'^2")
    yield Term("acceleration", "squared accelerations of the joints", "joint.*''^2")
    centre = " + ".join(f"com.v{axis}'^2" for axis in "xyz")
    yield Term("centre", "squared acceleration of the centre of mass", centre)
    trunk = _trunk(mechanism)
    if trunk and _leans(recording):
        yield Term("upright", f"leaning of {trunk} from upright", f"1 - {path_of('body', trunk)}.zaxis.z")
    pose = _pose(recording)
    if pose:
        yield Term("pose", "distance from the mean pose", pose)
    if lands:
        yield Term(LANDING, "squared speed of what touches down")


def _trunk(mechanism: Mechanism) -> str:
    """The body that carries all others and may turn freely; nothing where there is none."""
    for joint in mechanism.joints:
        body = mechanism.bodies[joint.body]
        if body.parent == 0 and joint.kind in ("free", "ball"):
            return body.name
        if body.parent == 0 and joint.kind == "hinge" and len(body.joints) > 1:
            return body.name
    return ""


def _leans(recording: Recording) -> bool:
    """Whether the root leans visibly: of a motion that does not, any weight of leaning makes an optimum."""
    for joint in recording.mechanism.joints:
        if recording.mechanism.bodies[joint.body].parent == 0 and joint.kind != "slide":
            turning = recording.positions[:, joint.qpos :][:, slice(*_TURNING[joint.kind])]
            return bool(np.ptp(turning, axis=0).max() > LEANING)
    return False


def _pose(recording: Recording) -> str:
    """The squared distance of the inner joints from their means, as text of the language."""
    parts = []
    for joint in recording.mechanism.joints:
        if recording.mechanism.bodies[joint.body].parent and joint.kind in ("hinge", "slide"):
            mean = float(recording.positions[:, joint.qpos].mean())
            parts.append(f"({coordinates_of(joint).positions[0]} - {_signed(mean)})^2")
    return " + ".join(parts)


def _signed(value: float) -> str:
    """A number as it stands behind a minus."""
    return f"{value:.3g}" if value >= 0 else f"({value:.3g})"
