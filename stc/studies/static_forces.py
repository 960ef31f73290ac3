"""The static force that differs: gravity, or one that the spec passes to the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.studies.taking_apart import Tables, static_words
from stc.studies.terms import STATIC, TOGETHER, Difference
from stc.validate.model_equations import ModelEquations

FloatArray = NDArray[np.float64]

#: A difference is that of one force where it is the same multiple of it at all positions, to this share: differences
#: count from 1e-9 of what they are found in, which is exact to 1e-16 or so.
_SAME = 1e-6

#: What is smaller than this share of the largest force is none: rounding.
_NONE = 1e-12


@dataclass(frozen=True, slots=True)
class _Part:
    """One of the forces, (S, k); ``sign`` is that with which it stands on the left side of the equations."""

    words: str
    force: FloatArray
    sign: float


def static_forces_named(
    found: Sequence[Difference], tables: Tables, gap: FloatArray, mechanics: ModelEquations
) -> list[Difference]:
    """Differences, with those of static forces named after the force that differs, if there are several.

    A force explains a difference if it is the same multiple of it at all positions, and no other force is.  Otherwise
    all acting forces are named.

    Args:
        found: differences of all terms, dry friction named.
        tables: the tables that contain these differences.
        gap: (S, k) spec's less model's in the column without accelerations.
        mechanics: the model.
    """
    parts, shapes = _parts(tables, mechanics), np.array([mechanics.gravities(q) for q in tables.base.q])
    size = max(float(np.abs(part.force).max()) for part in parts)
    named = []
    for one in found:
        row = mechanics.joints.index(one.joint)
        acting = [part for part in parts if float(np.abs(part.force[:, row]).max()) > _NONE * size]
        column = one.kind in (STATIC, TOGETHER) and one.term == tables.terms[len(mechanics.joints)].words
        handed = [part for part in acting if part.sign < 0.0]
        if column and (handed or not tables.at_rest):
            # Where the model has no gravity along a joint the spec may state some.
            gravity = parts[0] not in acting and _multiple(gap[:, row], shapes[:, row])
            one = _named(one, gap[:, row], row, acting, gravity)
        named.append(one)
    return named


def _named(one: Difference, gap: FloatArray, row: int, acting: Sequence[_Part], gravity: bool) -> Difference:
    """A difference with the name of the force that has its shape; ``gravity`` if other forces could have it as well."""
    fitting = [part for part in acting if _multiple(gap, part.force[:, row, None])]
    if len(fitting) == 1 and not gravity:
        (part,), at = fitting, int(np.argmax(np.abs(gap)))
        model = float(part.force[at, row])
        return replace(one, term=part.words, spec=model + part.sign * float(gap[at]), model=model)
    if one.kind == TOGETHER:
        return one
    names = dict.fromkeys([one.term, *(part.words for part in acting if part.sign < 0.0)])
    return replace(one, term=" or ".join(names))


def _multiple(gap: FloatArray, forces: FloatArray) -> bool:
    """Whether a difference (S,) is a multiple of a force, (S, 1), or a sum of multiples of several, (S, f)."""
    factors = np.linalg.lstsq(forces, gap, rcond=None)[0]
    return bool(np.abs(gap - forces @ factors).max() <= _SAME * np.abs(gap).max())


def _parts(tables: Tables, mechanics: ModelEquations) -> list[_Part]:
    """The terms of the model's side in the column without accelerations, gravity and springs first."""
    base, k = tables.base, len(mechanics.joints)
    still, friction = np.zeros_like(base.q), np.zeros_like(base.q)
    for s, (q, qd) in enumerate(zip(base.q, base.qd)):
        still[s] = mechanics.bias(q, np.zeros(k)) - mechanics.friction(q, mechanics.sliding)
        friction[s] = mechanics.friction(q, mechanics.sliding, qd)
    found = [_Part(static_words(mechanics), still, 1.0)]
    if not tables.at_rest:
        found.append(_Part("velocity products and damping", base.bias - friction - still, 1.0))
    count = len(mechanics.actuators)
    lines = [f"actuator {name}" for name in mechanics.actuators] + list(mechanics.outer)

    def forces(values: FloatArray) -> FloatArray:
        at = zip(base.q, base.qd, values)
        return np.array([mechanics.force(q, qd, line[:count], line[count:]) for q, qd, line in at])

    for index, line in enumerate(lines):
        without = base.lines.copy()
        without[:, index] = 0.0
        found.append(_Part(f"force of {line}", base.force - forces(without), -1.0))
    found.append(_Part("what actuators give at control 0", forces(np.zeros_like(base.lines)), -1.0))
    return found
