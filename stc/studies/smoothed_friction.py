"""Dry friction that a spec smooths: a force that grows with the velocity from zero to a constant.

Optimisers want smooth forces, so dry friction is written ``F*tanh(50*v)``, ``F*v/sqrt(v^2 + eps)`` and the like.  At
unit velocity, where terms are compared, such a force looks like damping.  At high speeds a force
that depends on the velocity v of one joint is ``F + d*v + c*v^2``, whatever function smooths F; the constant is F.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.studies.dry_friction import Slid
from stc.studies.spec_equations import State
from stc.studies.taking_apart import Sample
from stc.studies.terms import DAMPING, Difference
from stc.validate.model_equations import ModelEquations

FloatArray = NDArray[np.float64]

__all__ = ["Smoothed", "smoothed_friction"]

#: Speeds to begin with, m/s or rad/s; the lower ones are for what has no value at the higher ones.
_SPEEDS = (1e4, 1e2, 10.0)
#: What is left at twice the highest speed, as a share of the largest part there, where the three terms say it all.
_LEFT = 1e-6
#: Friction below this share of what damping and drag give at unit velocity counts as none.
_NONE = 1e-6
#: Where there is less than half of the friction at so slow a motion, it is smoothed.
_SLOW = 1e-7
#: From that share of itself on the friction counts as whole.
_WHOLE = 0.99
#: Friction, damping and drag of spec and model that differ by less than this share are the same.
_SAME = 1e-4

Evaluated = Callable[[State], Sample | None]


@dataclass(frozen=True, slots=True)
class Smoothed:
    """The smoothed dry friction of a joint.

    Attributes:
        joint: its name; unit: ``m`` or ``rad``.
        friction, damping, drag: those of the spec, N or N m, and per m/s or rad/s and its square.
        given, damped: friction and damping of the model.
        speed: speed from which friction has 99 % of its full value.
        slid: sliding direction along the motion, 1 or -1; 0 if it slides in both or that is not known.
    """

    joint: str
    unit: str
    friction: float
    damping: float
    drag: float
    given: float
    damped: float
    speed: float
    slid: float

    @property
    def explains_all(self) -> bool:
        """Whether nothing else that depends on the joint's velocity differs."""
        return self._damping_agrees and not self._has_drag

    @property
    def _damping_agrees(self) -> bool:
        return abs(self.damping - self.damped) <= _SAME * max(
            abs(self.damping), abs(self.damped), self.friction
        )

    @property
    def _has_drag(self) -> bool:
        return abs(self.drag) > _SAME * self.friction

    def __str__(self) -> str:
        model = f"{self.given:.4g} at any speed" if self.given else "none"
        text = (
            f"joint {self.joint}: dry friction is smoothed in the spec: {self.friction:.4g} above "
            f"{self.speed:.2g} {self.unit}/s and less below, model {model}"
        )
        if self._damping_agrees:
            text += f"; the damping is right, {self.damping:.4g}"
        else:
            text += f"; damping by {self.joint}': spec {self.damping:.4g}, model {self.damped:.4g}"
        return (
            f"{text}; drag by {self.joint}'^2: spec {self.drag:.4g}, model none" if self._has_drag else text
        )

    @property
    def step(self) -> str:
        """Advice on how to correct the spec."""
        if not self.given:
            return (
                f"remove the smoothed dry friction of joint {self.joint} from the spec, or give the model that "
                "friction (frictionloss) and state it by the direction in which the joint slides"
            )
        if self.slid:
            way = "forwards" if self.slid > 0 else "backwards"
            return (
                f"joint {self.joint} slides {way} throughout: write a constant dry friction, {self.given:.4g} against "
                "its velocity, in place of the smoothed term, which is too small at low speeds"
            )
        return (
            f"write a constant dry friction of joint {self.joint}, {self.given:.4g} against its velocity, under range "
            "headers that divide the motion where the joint reverses, in place of the smoothed term, which is too "
            "small at low speeds"
        )


def smoothed_friction(
    found: Sequence[Difference],
    sample: Sample,
    rows: Sequence[int],
    maps: FloatArray,
    at: Evaluated,
    mechanics: ModelEquations,
    slid: Sequence[Slid],
) -> tuple[list[Smoothed], list[Difference]]:
    """The joints whose difference in damping is smoothed dry friction, and the differences that this does not explain.

    Args:
        found: differences of all terms.
        sample: states at which both sides have values; their positions are used.
        rows: which of the spec's equations.
        maps: (S, k, k) how velocities of the coordinates give those of the joints.
        at: spec and model at other states.
        mechanics: the model.
        slid: which way each thing with dry friction slides on the motion; empty where that is not known.
    """
    smoothed, rest = [], list(found)
    for j, joint in enumerate(mechanics.joints):
        own = f"damping by {joint}'"
        if not any(one.joint == joint and one.kind == DAMPING and one.term == own for one in found):
            continue
        one = _of_joint(_Joint(j, sample, rows, np.asarray(np.linalg.inv(maps), float), at), mechanics, slid)
        if one is not None:
            smoothed.append(one)
            rest = [d for d in rest if d.joint != joint or d.term not in (own, "dry friction")]
    return smoothed, rest


@dataclass(frozen=True, slots=True)
class _Joint:
    """One joint moving alone at the positions of a sample."""

    number: int
    sample: Sample
    rows: Sequence[int]
    back: FloatArray
    at: Evaluated

    def forces(self, speed: float) -> tuple[float, float] | None:
        """The odd part of the force on the joint at a velocity, of the spec and of the model; None without a value.

        The spec's rows may be written any way: their accelerations and the model's mass matrix give the force.
        """
        j, sides = self.number, []
        for sign in (1.0, -1.0):
            v = self.back[:, :, j] * (sign * speed)
            with np.errstate(all="ignore"):
                found = self.at(State(self.sample.state.x, v, np.zeros_like(self.sample.state.z)))
            if found is None or len(found.q) < len(self.sample.q):
                return None
            rows = found.matrix[:, self.rows]
            try:
                spec = found.mass @ np.linalg.solve(rows, found.offset[:, self.rows, None])
            except np.linalg.LinAlgError:
                return None
            sides.append((spec[:, j, 0], (found.bias - found.force)[:, j]))
        odd = [0.5 * (ahead - behind) for ahead, behind in zip(*sides, strict=True)]
        return float(np.median(odd[0])), float(np.median(odd[1]))


def _of_joint(joint: _Joint, mechanics: ModelEquations, slid: Sequence[Slid]) -> Smoothed | None:
    sliding = mechanics.sliding.copy()
    mechanics.sliding[:] = 0.0
    try:
        fitted = next((fit for speed in _SPEEDS if (fit := _fit(joint, speed)) is not None), None)
        if fitted is None:
            return None
        (friction, damping, drag), damped = fitted
        if not friction > _NONE * max(abs(damping), abs(drag)):
            return None
        slow = joint.forces(_SLOW)
        if slow is None or not abs(slow[0]) < 0.5 * friction:
            return None
        speed = _whole_from(joint, friction, damping, drag)
    finally:
        mechanics.sliding[:] = sliding
    name = f"joint {mechanics.joints[joint.number]}"
    at = mechanics.sliders.index(name) if name in mechanics.sliders else -1
    given = float(mechanics.dry[at]) if at >= 0 else 0.0
    way = slid[at].way if at >= 0 and len(slid) > at else 0.0
    unit = mechanics.units[joint.number]
    return Smoothed(mechanics.joints[joint.number], unit, friction, damping, drag, given, damped, speed, way)


def _fit(joint: _Joint, speed: float) -> tuple[FloatArray, float] | None:
    """Friction, damping and drag of the spec, and the model's damping, from high speeds; None where they do not fit."""
    speeds = speed * np.array([1.0, 2.0, 4.0, 8.0])
    values = [joint.forces(float(one)) for one in speeds]
    if any(one is None or not np.isfinite(one).all() for one in values):
        return None
    spec, model = np.array(values).T
    powers = speeds[:, None] ** np.arange(3)
    fit = np.linalg.solve(powers[:3], spec[:3])
    parts = powers[3] * fit
    # Of three terms that are exact at three speeds the friction is what rounding of the others leaves.
    certain = abs(fit[0]) > 1e-12 * float(np.abs(parts).max())
    if not certain or abs(float(parts.sum()) - spec[3]) > _LEFT * float(np.abs(parts).max()):
        return None
    return fit, float(np.linalg.solve(powers[:3], model[:3])[1])


def _whole_from(joint: _Joint, friction: float, damping: float, drag: float) -> float:
    """The speed from which friction has 99 % of its full value."""
    low, high = np.log(_SLOW), np.log(_SPEEDS[0])
    for _ in range(40):
        speed = float(np.exp(0.5 * (low + high)))
        values = joint.forces(speed)
        if values is not None and values[0] - damping * speed - drag * speed**2 >= _WHOLE * friction:
            high = np.log(speed)
        else:
            low = np.log(speed)
    return float(np.exp(high))
