"""Entries of several steps loaded at once by eight segments, where they follow one another in memory.

The method and its code are in ``stc/core/staged/lane_runs.c``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function

__all__ = ["LISTED", "RUN", "are_worthwhile", "bring_entries", "runs_of"]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]

#: The entries of RUN steps in a row that follow one another in memory, as kernels leave them, are brought at once. How
#: many there are is listed first: entries whose runs begin with step 0, 1, 2 and 3 in all lanes; then pairs of entries
#: that take turns in memory, whose runs are half as many steps and begin with step 0 and 1; then others. After these
#: numbers come the entries.
RUN = 4
SINGLE = RUN + RUN // 2
LISTED = SINGLE + 1
#: Runs of entries are brought at once where a step has so many of them that their lines leave the memory next to a
#: processor before the next step, and all together take so many bytes that they leave its own; entries that make no
#: runs are this share of all at most.
MANY_ENTRIES = 64
NOT_NEAR = 2**20
MOST_SINGLE = 0.25


def are_worthwhile(entries: int, given: int) -> bool:
    """Whether to look for runs of a stage's ``entries``, of all those ``given``."""
    return entries >= MANY_ENTRIES and 8 * given >= NOT_NEAR


def runs_of(sources: Int32s) -> Int32s | None:
    """Entries of several steps that are brought at once (see ``RUN``); None where few of them can be.

    Args:
        sources: where each step's entries are in memory, (steps, entries, LANES).
    """
    entries = sources.shape[1]
    ahead = np.diff(sources, axis=0)
    phase = _phase((ahead == 1).all(axis=2), RUN)
    of_pair = _phase((ahead == 2).all(axis=2), RUN // 2)
    first_of = {sources[0, e].tobytes(): e for e in np.flatnonzero((phase < 0) & (of_pair >= 0))}
    partner = np.full(entries, -1)
    for e in first_of.values():
        other = first_of.get((sources[0, e] + 1).tobytes(), -1)
        if (
            other >= 0
            and partner[e] < 0
            and partner[other] < 0
            and np.array_equal(sources[:, other], sources[:, e] + 1)
        ):
            partner[e], partner[other] = other, e
    single = np.flatnonzero((phase < 0) & (partner < 0))
    if single.size > MOST_SINGLE * entries:
        return None
    # In the order of memory; of a pair, the first one leads.
    by_place = np.argsort(sources[0, :, 0], kind="stable")
    in_fours = [by_place[phase[by_place] == k] for k in range(RUN)]
    paired = by_place[partner[by_place] >= 0]
    leads = paired[sources[0, paired, 0] < sources[0, partner[paired], 0]]
    in_twos = [leads[of_pair[leads] == k] for k in range(RUN // 2)]
    counts = [part.size for part in (*in_fours, *in_twos, single)]
    pairs = [np.stack([part, partner[part]], axis=1).reshape(-1) for part in in_twos]
    return np.concatenate([counts, *in_fours, *pairs, single]).astype(np.int32)


def _phase(follows: NDArray[np.bool_], length: int) -> Int64s:
    """With which step the runs of each entry begin, each of ``length`` steps, or -1, (entries,).

    Args:
        follows: whether an entry of a step is followed in memory by that of the next one, (steps - 1, entries).
    """
    steps = len(follows) + 1
    phase = np.full(follows.shape[1], -1)
    for begin in range(length):
        whole = (steps - begin) // length * length
        inside = np.arange(begin, begin + whole).reshape(-1, length)[:, :-1].reshape(-1)
        phase[(phase < 0) & follows[inside].all(axis=0)] = begin
    return phase


#: Bring the entries of a step, and of the next ones as far as they follow in memory, to ``ring``.
bring_entries = function("lane_runs_bring_entries")
