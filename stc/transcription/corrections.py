"""Links that give way to what is held.

A foot that stands is a row for its place and one for its velocity at every frame, and one for its acceleration at every
node.  The accelerations follow from the forces of the foot, and the method's links make velocities and positions of
them, so that these would be known twice.  The two differ by the discretisation error: all rows together would have no
solution, and without those of places and velocities a foot would drift by what the steps' errors add up to.

So the links hold along the motions that the foot leaves free.  Across, each step has unknowns of its own, and to the
links are added the gradients in the middle of the step, times these::

    q1 - q0 - h/6 (v0 + 4 vm + v1) + Jm^T g = 0,    J = dc/dq of what is held, c(q) = 0 at both frames
    v1 - v0 - h/6 (a0 + 4 am + a1) + Jm^T k = 0,    J v = 0 at both frames

This projects each step onto what is held, as in the stabilised form of Gear, Leimkuhler and Gupta (1985) and in the
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
from stc.symbolic.expr import Expr, add, mul, num, substitute, sum_of, sym, symbols
from stc.transcription.grid import Nodes
from stc.transcription.lower import groups

#: From the node of a step's links to where its gradients are taken, in frames.
PLACES = {
    "stepping": (Fraction(0), Fraction(1)),
    "trapezoidal": (Fraction(0), Fraction(1)),
    "hermite-simpson": (Fraction(0),),
}


def corrections_on(
    corrections: Sequence[Correction], nodes: Nodes, method: str
) -> Iterator[tuple[Mapping[tuple[str, int], Expr], Nodes]]:
    """What is added to the links of steps.

    Args:
        nodes: those of the links, one for each step.

    Yields:
        By variable and order what is added, and the nodes that it is for.
    """
    if not corrections:
        yield {}, nodes
        return
    active = np.array([(c.range.first <= nodes.frame) & (nodes.frame < c.range.last) for c in corrections])
    for which, steps in groups(active.astype(np.int64)):
        added: dict[tuple[str, int], Expr] = {}
        for number in np.flatnonzero(which):
            correction = corrections[int(number)]
            for key, share in correction.shares.items():
                gradients = [_at(share, shift, correction.unknowns) for shift in PLACES[method]]
                mean = mul(num(1 / len(gradients)), sum_of(gradients))
                added[key] = add(added[key], mean) if key in added else mean
        yield added, nodes[steps]


def _at(share: Expr, shift: Fraction, unknowns: Sequence[str]) -> Expr:
    """A share with the gradient of another place of the step; the unknowns stay at the links' own node."""
    keys = [key for key in symbols(share) if isinstance(key, VariableRef) and key.name not in unknowns]
    return substitute(share, {key: sym(replace(key, shift=shift)) for key in keys})
