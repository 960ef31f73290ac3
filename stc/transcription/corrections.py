"""Relaxation of the links for held contacts and equalities.

A standing foot has a row for its position and one for its velocity at every frame, and one for its acceleration at
every node.  The accelerations determine velocities and positions through the method's links as well, up to the
discretisation error.  All rows together would therefore have no solution, and without those of positions and
velocities a foot would drift by the accumulated error.

Therefore the links hold only along the directions in which the foot can move.  In the other directions each step has
additional unknowns, multiplied by the gradients in the middle of the step and added to the links::

    q1 - q0 - h/6 (v0 + 4 vm + v1) + Jm^T g = 0,    J = dc/dq of the constraints, c(q) = 0 at both frames
    v1 - v0 - h/6 (a0 + 4 am + a1) + Jm^T k = 0,    J v = 0 at both frames

This projects each step onto the constraints, as in the stabilised form of Gear, Leimkuhler and Gupta (1985) and in the
constrained collocation of Posa, Kuindersma and Tedrake (2016).  g and k are as small as the method's error in one step,
so that the method keeps its order, and the direction of the projection matters little.  The gradients in the middle are
the same forwards and backwards in time.  Where there are no midpoints, the mean of those at both ends stands for them.
With midpoints that mean would join every coordinate at both ends in every link: a factorisation of a quadruped's KKT
matrix would take 2.3 times the operations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from stc.problem import Correction, VariableRef
from stc.symbolic.expr import Expr, add, mul, num, reachable, substitute, sum_of, sym
from stc.transcription.grid import Nodes
from stc.transcription.lower import groups

#: From the node of a step's links to where its gradients are taken, in frames.
PLACES = {
    "stepping": (Fraction(0), Fraction(1)),
    "trapezoidal": (Fraction(0), Fraction(1)),
    "hermite-simpson": (Fraction(0),),
}


#: By variable and order of the link: the terms added to it.
Added = Mapping[tuple[str, int], Expr]


def of_steps(corrections: Sequence[Correction], method: str) -> list[Added]:
    """The terms that each correction adds to the links of a step, with gradients where the method has them.

    The unknowns stay at the links' own node.
    """
    if not corrections:
        return []
    unknowns = {name for correction in corrections for name in correction.unknowns}
    shares = [share for correction in corrections for share in correction.shares.values()]
    keys = [node.payload for node in reachable(shares) if node.op == "sym"]
    moving = [key for key in keys if isinstance(key, VariableRef) and key.name not in unknowns]
    places = []
    for shift in PLACES[method]:
        moved = {key: replace(key, shift=shift) for key in moving}
        changes = {key: sym(other) for key, other in moved.items() if other != key}
        places.append((changes, dict[Expr, Expr]()))

    def mean(share: Expr) -> Expr:
        gradients = [substitute(share, *place) if place[0] else share for place in places]
        return mul(num(1 / len(gradients)), sum_of(gradients))

    return [{key: mean(share) for key, share in correction.shares.items()} for correction in corrections]


def corrections_on(
    corrections: Sequence[Correction], terms: Sequence[Added], nodes: Nodes
) -> Iterator[tuple[Added, Nodes]]:
    """The terms added to the links of steps.

    Args:
        terms: of each correction, from :func:`of_steps`.
        nodes: nodes of the links, one for each step.

    Yields:
        The added terms by variable and order, and their nodes.
    """
    if not corrections:
        yield {}, nodes
        return
    active = np.array([(c.range.first <= nodes.frame) & (nodes.frame < c.range.last) for c in corrections])
    for which, steps in groups(active.astype(np.int64)):
        added: dict[tuple[str, int], Expr] = {}
        for number in np.flatnonzero(which):
            for key, term in terms[int(number)].items():
                added[key] = add(added[key], term) if key in added else term
        yield added, nodes[steps]
