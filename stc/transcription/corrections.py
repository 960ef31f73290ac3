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
    """The terms added to the links of steps.

    Args:
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
            correction = corrections[int(number)]
            for key, share in correction.shares.items():
                gradients = [_at(share, shift, correction.unknowns) for shift in PLACES[method]]
                mean = mul(num(1 / len(gradients)), sum_of(gradients))
                added[key] = add(added[key], mean) if key in added else mean
        yield added, nodes[steps]


def _at(share: Expr, shift: Fraction, unknowns: Sequence[str]) -> Expr:
    """A term with the gradient at another place of the step; the unknowns stay at the links' own node."""
    keys = [key for key in symbols(share) if isinstance(key, VariableRef) and key.name not in unknowns]
    return substitute(share, {key: sym(replace(key, shift=shift)) for key in keys})
