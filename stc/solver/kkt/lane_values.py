"""The values that pivots of segments are planned from: one size for each entry of all stages of a kind."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.lane_program import Kind
from stc.solver.kkt.segments import Segmentation
from stc.solver.nlp import Floats

__all__ = ["SAMPLE", "middle", "reliable", "sizes_of"]

#: Stages of a kind whose entries are looked at.
SAMPLE = 32
#: Smaller magnitudes count as this much, and a geometric mean near it as nothing.
TINY = 1e-12
NOTHING = -27.0
#: Entries that are below this share of their mean somewhere count this much: they are no pivots there.
VANISHING = 1e-6
UNRELIABLE = 1e-4

#: For each code the least magnitude anywhere, and in chosen stages the sum of logarithms, that of signs, how many.
_note_entries = function("lane_state_note_entries")


def sizes_of(
    found: Segmentation, kinds: list[Kind], couplings: Couplings, source: NDArray[np.int32], given: Floats,
    scale: Floats, diagonal: Floats,
) -> list[tuple[Floats, Floats]]:  # fmt: skip
    """Sizes of the entries, in the order of the codes, and of the diagonal, (own,), of each kind.

    Args:
        source: which of the numbers ``given`` each coupling is, (E,) or more.
        scale: of all unknowns, (N,) or more.
        diagonal: of all unknowns, scaled, (N,).
    """
    stages = found.stages.pointers.size - 1
    kind_of, chosen = np.full(stages, -1, dtype=np.int32), np.zeros(stages, dtype=np.int32)
    for group in found.groups:
        kind_of[group.stages.reshape(-1)] = group.kind
    samples = []
    for number in range(len(kinds)):
        own = np.flatnonzero(kind_of == number)
        samples.append(own[:: -(-own.size // SAMPLE)])
        chosen[samples[-1]] = 1
    begins = np.cumsum([0, *(codes.size for codes in found.codes)])
    count = int(begins[-1])
    least = np.full(count, np.inf)
    logs, signs, many = np.zeros(count), np.zeros(count), np.zeros(count)
    _note_entries(
        couplings.first.size, found.edge_stage, found.edge_code, kind_of, chosen, begins, np.concatenate(found.codes),
        source, couplings.first, couplings.second, given, scale, least, logs, signs, many,
    )  # fmt: skip
    entries = reliable(_mean(logs, signs, many), least)
    sizes = []
    for kind, sample, begin, end in zip(kinds, samples, begins[:-1], begins[1:], strict=True):
        unknowns = found.stages.order[found.stages.pointers[sample][:, None] + np.arange(kind.own)]
        place = np.broadcast_to(np.arange(kind.own), unknowns.shape).reshape(-1)
        sizes.append((entries[begin:end], middle(place, diagonal[unknowns.reshape(-1)], kind.own)))
    return sizes


def reliable(entries: Floats, least: Floats) -> Floats:
    """Sizes to plan for, given the least magnitudes anywhere."""
    return np.where(least < VANISHING * np.abs(entries), UNRELIABLE * entries, entries)


def middle(place: NDArray[np.integer], values: Floats, count: int) -> Floats:
    """Geometric means of magnitudes by place, (count,), with the sign that most have."""
    logs = np.bincount(place, np.log(np.maximum(np.abs(values), TINY)), count)
    return _mean(logs, np.bincount(place, np.sign(values), count), np.bincount(place, minlength=count))


def _mean(logs: NDArray[Any], signs: NDArray[Any], many: NDArray[Any]) -> Floats:
    logs = logs / np.maximum(many, 1)
    return np.copysign(np.where(logs < NOTHING, 0.0, np.exp(logs)), signs)
