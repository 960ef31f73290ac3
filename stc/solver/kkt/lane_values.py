"""The values that pivots of segments are planned from: one size for each entry of all stages of a kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.solver.kkt.lane_program import Kind
from stc.solver.kkt.segments import Segmentation
from stc.solver.nlp import Floats

__all__ = ["SAMPLE", "middle", "reliable", "sizes_of"]

#: Stages of a kind whose entries are looked at.
SAMPLE = 32
#: Entries that are below this share of their mean somewhere count this much: they are no pivots there.
VANISHING = 1e-6
UNRELIABLE = 1e-4


def sizes_of(
    found: Segmentation, kind: Kind, number: int, values: Floats, diagonal: Floats
) -> tuple[Floats, Floats]:
    """Sizes of the entries, in the order of the codes, and of the diagonal, (own,), of a kind of that number.

    Args:
        values: of all couplings, scaled, (E,).
        diagonal: of all unknowns, scaled, (N,).
    """
    lanes_of = [group.stages for group in found.groups if group.kind == number]
    stages = distinct(np.concatenate([stages.reshape(-1) for stages in lanes_of]))
    members = np.flatnonzero(np.isin(found.edge_stage, stages))
    place, values = np.searchsorted(found.codes[number], found.edge_code[members]), values[members]
    chosen = stages[:: -(-stages.size // SAMPLE)]
    sampled = np.isin(found.edge_stage[members], chosen)
    entries = middle(place[sampled], values[sampled], found.codes[number].size)
    least = np.full(entries.size, np.inf)
    np.minimum.at(least, place, np.abs(values))
    unknowns = found.stages.order[found.stages.pointers[chosen][:, None] + np.arange(kind.own)]
    own_place = np.broadcast_to(np.arange(kind.own), unknowns.shape).reshape(-1)
    own = middle(own_place, diagonal[unknowns.reshape(-1)], kind.own)
    return reliable(entries, least), own


def reliable(entries: Floats, least: Floats) -> Floats:
    """Sizes to plan for, given the least magnitudes anywhere."""
    return np.where(least < VANISHING * np.abs(entries), UNRELIABLE * entries, entries)


def middle(place: NDArray[np.integer], values: Floats, count: int) -> Floats:
    """Geometric means of magnitudes by place, (count,), with the sign that most have."""
    many = np.maximum(np.bincount(place, minlength=count), 1)
    logs = np.bincount(place, np.log(np.maximum(np.abs(values), 1e-12)), count) / many
    size = np.where(logs < -27.0, 0.0, np.exp(logs))
    return np.copysign(size, np.bincount(place, np.sign(values), count))
