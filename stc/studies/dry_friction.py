"""Dry friction among the differences of a spec's equations of motion from its model's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.studies.terms import STATIC, Difference
from stc.validate.model_equations import ModelEquations

FloatArray = NDArray[np.float64]

#: What differs less than this share of the friction from position to position is the same at all of them.
_SAME = 1e-8


def dry_friction_named(
    found: Sequence[Difference], spec: FloatArray, model: FloatArray, mechanics: ModelEquations
) -> list[Difference]:
    """Differences, those of static forces called dry friction where that may be: the same at all positions.

    Args:
        found: differences of all terms.
        spec: (S, k) static forces at S positions according to the spec, with dry friction as it states that.
        model: (S, k) according to the model, with dry friction as it is sliding.
        mechanics: the model.
    """
    start, named = np.zeros(len(mechanics.joints)), []
    ways = [np.abs(mechanics.friction(start, one)) for one in np.eye(len(mechanics.dry))]
    for one in found:
        row = mechanics.joints.index(one.joint)
        gap = spec[:, row] - model[:, row]
        most = float(sum(way[row] for way in ways))
        if one.kind == STATIC and most > 0.0 and float(np.ptp(gap)) <= _SAME * most:
            slides = float(mechanics.friction(start, mechanics.sliding)[row])
            stated = float(gap.mean()) + slides
            given = slides or most * float(np.sign(stated))
            one = replace(one, term="dry friction", spec=stated, model=given)
        named.append(one)
    return named
