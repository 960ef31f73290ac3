"""Segments of a horizon cut apart, and sewn together by unknowns of their own.

What couples stage i of one segment with stage i + 1 of the next are many unknowns x of the former and few, y, of the
latter.  With s = C x in between, and a multiplier m for that, both sides have as few neighbours as there are y:

    [ .  C^T ] [x]        [ .  C^T         ] [x]
    [ C   .  ] [y]   ->   [ C   .   -1     ] [m]         x in one segment, y in the other, m and s in the seam;
                          [    -1    .   1 ] [s]         m = y, and each seam adds as many positive eigenvalues
                          [          1   . ] [y]         as negative ones.

So the state is held at one end of a segment, the costate at the other, as in partitioned methods for optimal control
(Wright 1990).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.records import dataclass
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.segments import ACROSS, BORDERING, Segmentation

__all__ = ["Kind", "Sewn", "kind_of", "sew"]

Int64s = NDArray[np.int64]


@dataclass(frozen=True)
class Kind:
    """What stages of one kind have in common.

    Attributes:
        own, variables: unknowns of a stage, and how many of them, the first ones, are variables.
        following: places of those in the next stage that it couples with, (F,).
        border: numbers of the unknowns of the border that it couples with, (B,).
    """

    own: int
    variables: int
    following: Int64s
    border: Int64s

    def order(self, steps: int) -> Int64s:
        """Unknowns of a segment, counted step by step: all variables, then all rows."""
        places = np.arange(steps * self.own)
        is_row = places % self.own >= self.variables
        return np.concatenate([places[~is_row], places[is_row]])


def kind_of(found: Segmentation, number: int, n: int) -> Kind:
    """What the stages of a segmentation's kind couple with; unknowns below ``n`` are variables."""
    codes, base, stages = found.codes[number], found.base, found.stages
    types, j = codes // base**2, codes % base
    begin, end = stages.pointers[found.example[number] :][:2]
    variables = int(np.count_nonzero(stages.order[begin:end] < n))
    return Kind(int(end - begin), variables, distinct(j[types == ACROSS]), distinct(j[types == BORDERING]))


@dataclass(frozen=True)
class Sewn:
    """A matrix with seams: their unknowns are numbered behind all others.

    Attributes:
        couplings: its pattern; those in the seams, of the value -1, come last. Those with the segments behind
            them, of the value 1, are left out.
        stage: of each unknown, in an order that has the seams between the segments, (N + added,).
        added: unknowns of all seams, half of them multipliers.
        outside: unknowns outside of segments, increasing.
        before, after: for each group, the unknowns of the seams before its segments, and those of the seams or of the
            stages left out behind them, (following, LANES).
    """

    couplings: Couplings
    stage: Int64s
    added: int
    outside: Int64s
    before: list[Int64s]
    after: list[Int64s]


def sew(couplings: Couplings, found: Segmentation, kinds: list[Kind]) -> Sewn:
    """Put a seam before each segment."""
    stages, size = found.stages, couplings.size
    count = stages.pointers.size - 1
    begins = [group.stages[0, : group.segments] for group in found.groups]
    widths = [
        np.full(own.size, kinds[g.kind].following.size) for own, g in zip(begins, found.groups, strict=True)
    ]
    begin, width = np.concatenate(begins), np.concatenate(widths)
    # Of the seam before each stage, if there is one: where its unknowns begin.
    seam = np.full(count + 1, -1, dtype=np.int64)
    seam[begin] = size + 2 * (np.cumsum(width) - width)
    added = int(2 * width.sum())
    kind_of_stage = np.full(count, -1)
    for group in found.groups:
        kind_of_stage[group.stages[0]] = group.kind
    first, second = couplings.first.copy(), couplings.second.copy()
    behind = np.where(found.edge_stage >= 0, found.edge_stage + 1, count)
    cut = np.flatnonzero((seam[behind] >= 0) & (found.edge_code // found.base**2 == ACROSS))
    which, place = behind[cut], found.edge_code[cut] % found.base
    multiplier = np.empty(cut.size, dtype=first.dtype)
    for number, kind in enumerate(kinds):
        own = kind_of_stage[which] == number
        multiplier[own] = seam[which[own]] + kind.following.size + np.searchsorted(kind.following, place[own])
    ahead = stages.stage[first[cut]] == which
    first[cut] = np.where(ahead, multiplier, first[cut])
    second[cut] = np.where(ahead, second[cut], multiplier)
    states = np.concatenate([seam[b] + np.arange(w) for b, w in zip(begin, width, strict=True)])
    multipliers = states + np.repeat(width, width)
    extended = replace(
        couplings,
        m=couplings.m + added,
        first=np.concatenate([first, multipliers]).astype(np.int32),
        second=np.concatenate([second, states]).astype(np.int32),
    )
    before, after = [], []
    for group in found.groups:
        following = kinds[group.kind].following[:, None]
        places = np.arange(following.size)[:, None]
        next_stage = group.stages[-1] + 1
        before.append(seam[group.stages[0]] + places)
        left_out = stages.order[stages.pointers[next_stage] + following]
        after.append(np.where(seam[next_stage] >= 0, seam[next_stage] + following.size + places, left_out))
    outside = np.concatenate([np.flatnonzero(~found.interior[stages.stage]), np.arange(size, size + added)])
    order = np.concatenate([2 * stages.stage.astype(np.int64), np.repeat(2 * begin - 1, 2 * width)])
    return Sewn(extended, order, added, outside, before, after)
