"""Equations that wait for the next stage, where the variables of a stage and of those before it are too few for them.

    variables    u0   x1 u1   x2 u2   ...        x0 is given; x has two components, u one
    equations      x1 = f   x2 = f               one of the first two waits for x1

A chain takes all unknowns of a stage out of the window before it comes to the next one (see
stc.solver.kkt.chain_elimination).  A motion that starts from a given state has more equations between its first two
states than it has controls there, so that some pivot would be zero in any order.  Which ones are too many is a matter
of the pattern: those that are left over where each is given a variable of its own (a maximum matching, by augmenting
paths: H. W. Kuhn, The Hungarian method for the assignment problem, Naval Research Logistics Quarterly 2, 1955).

Where some are too many, all those wait that would have to take a control, that is, a variable which no other stage
knows of.  Controls can bring a motion to a state that is given some stages later, but hardly: pivots would be as small
as powers of the step (with a double pendulum on a cart, 120 steps: 6e-13 instead of 3e-4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.solver.kkt.couplings import Couplings, sort_by_key

__all__ = ["postponed"]

Int32s = NDArray[np.int32]

#: What a variable is to those: known to other stages, by an equation that couples with these, or a control.
ORDINARY, CONTROL = 1, 2


def postponed(
    couplings: Couplings,
    stage: Int32s,
    border: Int32s,
    held: NDArray[np.bool_] | None,
    equations: NDArray[np.bool_] | None,
    parts: tuple[int, ...] = (),
) -> Int32s:
    """The stage of each unknown, (N,), where equations that are too many for their own are of the next one.

    It is ``stage`` itself where there are none, or where a stage would be left without unknowns.

    Args:
        stage: of each unknown, (N,): couplings are with the one that is gone through next, or in it.
        border: unknowns that couple with many stages.
        held: variables that never move, (n,).
        equations: rows that have nothing on the diagonal, (m,), or None where there are none.
        parts: how many stages come from either end (see stc.solver.kkt.folding), or none.
    """
    if equations is None:
        return stage
    n, m = couplings.n, couplings.m
    stages = int(stage.max()) + 1
    inner = np.ones(n + m, dtype=bool)
    inner[border] = False
    free = inner[:n] if held is None else inner[:n] & ~held
    waits = inner & np.concatenate([np.zeros(n, dtype=bool), equations])
    own = np.flatnonzero(waits[couplings.first] & free[couplings.second])  # of J: the row comes first
    row, variable = couplings.first[own] - n, couplings.second[own]
    order, pointers = sort_by_key(row, m)
    after = np.minimum(np.arange(1, stages + 1), stages - 1).astype(np.int32)
    if parts:
        after[parts[0] - 1] = stages - 1
    ahead, known = np.zeros(m, dtype=bool), np.zeros(n, dtype=bool)
    ahead[row[stage[variable] != stage[n + row]]] = True
    known[variable[ahead[row]]] = True
    pattern = (
        *sort_by_key(stage[:n], stages), *sort_by_key(stage[n:], stages), waits[n:].astype(np.int32), pointers,
        variable[order],
    )  # fmt: skip
    for uses in (np.full(n, ORDINARY), np.where(known, ORDINARY, CONTROL)):
        result = stage.copy()
        available, seen = np.zeros((2, n), dtype=np.int32)
        _postpone(
            n, stages, after, *pattern, uses.astype(np.int32), result, available, seen, np.full(n, -1, dtype=np.int32),
            *np.zeros((5, m), dtype=np.int32),
        )  # fmt: skip
        if np.all(result == stage) or np.bincount(result, minlength=stages).min() == 0:
            return stage
    return result


#: Move rows to the next stage, one stage after the other.
_postpone = function("arranging_postpone")
