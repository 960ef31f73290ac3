"""The transcriptions as data: difference stencils, links between derivatives, quadrature weights.

Central differences replace a derivative by the derivative of the polynomial through neighbouring frames
(Fornberg 1988).  The collocation methods carry derivatives as unknowns and tie them by linear links (Kelly
2017, sections 3 and 4, in separated form)::

    trapezoidal      x[i+1] - x[i] = h/2 (x'[i] + x'[i+1])
    hermite-simpson  x[i+1] - x[i] = h/6 (x'[i] + 4 x'[m] + x'[i+1])
                     x[m] = (x[i] + x[i+1])/2 + h/8 (x'[i] - x'[i+1])
    stepping         x[i+1] - x[i] = h x'[i+1]

The last is the implicit rule of Euler, of first order.  The right end of a step determines the rule of the step: an
impact within one is a large force in it, and momentum is balanced without asking when the impact was (Stewart and
Trinkle 1996; as a transcription Posa, Cantu and Tedrake 2014).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from stc.problem import VariableRef
from stc.symbolic.expr import ONE, ZERO, Expr, num, sum_of, sym
from stc.transcription.grid import AFTER, BEFORE, Grid, IntArray, Nodes

HALF = Fraction(1, 2)


def stencil_reach(order: int) -> int:
    """The frames that the shortest symmetric second-order stencil of a derivative needs on either side."""
    return (order + 1) // 2


def stencil_weights(order: int, positions: Sequence[Expr]) -> list[Expr]:
    """Weights of the derivative at 0 of the polynomial through points at ``positions`` (Fornberg 1988).

    Args:
        order: of the derivative, below ``len(positions)``.
        positions: times relative to where the derivative is taken, any expressions (numbers fold).
    """
    count = len(positions)
    weights = [[ZERO] * count for _ in range(order + 1)]
    weights[0][0] = ONE
    product_before: Expr = ONE
    for i in range(1, count):
        product: Expr = ONE
        for j in range(i):
            gap = positions[i] - positions[j]
            product = product * gap
            if j == i - 1:
                for k in range(min(i, order), -1, -1):
                    lower = weights[k - 1][i - 1] * float(k) if k else ZERO
                    weights[k][i] = (product_before / product) * (
                        lower - positions[i - 1] * weights[k][i - 1]
                    )
            for k in range(min(i, order), -1, -1):
                lower = weights[k - 1][j] * float(k) if k else ZERO
                weights[k][j] = (positions[i] * weights[k][j] - lower) / gap
        product_before = product
    return weights[order]


def difference(ref: VariableRef, offsets: Sequence[int], steps: Sequence[Expr]) -> Expr:
    """The derivative ``ref`` as a difference of the variable's values at ``offsets`` frames from its own.

    Args:
        offsets: consecutive whole numbers, in rising order.
        steps: the ``len(offsets) - 1`` steps between them.
    """
    if all(h is steps[0] for h in steps):
        points = [num(float(o)) for o in offsets]
        scale = ONE / steps[0] ** float(ref.order)
    else:
        start = offsets.index(0)
        points = [ZERO] * len(offsets)
        for k in range(start + 1, len(offsets)):
            points[k] = points[k - 1] + steps[k - 1]
        for k in range(start - 1, -1, -1):
            points[k] = points[k + 1] - steps[k]
        scale = ONE
    weights = stencil_weights(ref.order, points)
    values = [
        sym(VariableRef(ref.name, 0, ref.scale, ref.shift + offset, ref.side)) * weight
        for offset, weight in zip(offsets, weights, strict=True)
    ]
    return sum_of(values) * scale


def links(method: str, name: str, order: int, h: Expr) -> list[Expr]:
    """The equations (= 0) between derivative ``order`` of a variable and the next one over a step of length h.

    They stand on the step's node: for hermite-simpson its midpoint, else the frame before the step.
    """
    if method == "stepping":
        x0, x1 = _at(name, order, Fraction(0)), _at(name, order, Fraction(1))
        return [x1 - x0 - h * _at(name, order + 1, Fraction(1))]
    if method == "trapezoidal":
        x0, x1 = _at(name, order, Fraction(0)), _at(name, order, Fraction(1))
        v0, v1 = _at(name, order + 1, Fraction(0)), _at(name, order + 1, Fraction(1))
        return [x1 - x0 - 0.5 * h * (v0 + v1)]
    x0, xm, x1 = (_at(name, order, s) for s in (-HALF, Fraction(0), HALF))
    v0, vm, v1 = (_at(name, order + 1, s) for s in (-HALF, Fraction(0), HALF))
    return [
        x1 - x0 - (h / 6.0) * (v0 + 4.0 * vm + v1),
        xm - 0.5 * (x0 + x1) - (h / 8.0) * (v0 - v1),
    ]


def link_nodes(grid: Grid) -> Nodes:
    """The nodes of the links: one for every step. (n,)"""
    steps = np.arange(grid.n)
    if grid.has_midpoints:
        return Nodes(2 * steps + 1, np.zeros(grid.n, np.int64))
    return Nodes(2 * steps, np.where(grid.jump[:-1], AFTER, 0).astype(np.int64))


def _at(name: str, order: int, shift: Fraction) -> Expr:
    return sym(VariableRef(name, order, Fraction(1), shift))


def sum_weights(nodes: Nodes, first: int, last: int) -> NDArray[np.float64]:
    """The weight of a plain objective term on frames first..last at each of its nodes. (k,)

    It is (e[first] + e[last])/2 and for each step what its quadrature gives: (e[i] + 4 e[mid] + e[i+1])/6 where the
    nodes hold the step's midpoint, else (e[i] + e[i+1])/2.  Without midpoints every frame counts once, the two sides
    of a jump half each where the range passes through.
    """
    if first == last:
        return np.where(nodes.side != 0, 0.5, 1.0)
    number, _, share = quadrature(nodes, first, last)
    at_end = ~nodes.is_midpoint & ((nodes.frame == first) | (nodes.frame == last))
    return np.asarray(np.bincount(number, share, minlength=len(nodes)) + np.where(at_end, 0.5, 0.0))


def quadrature(nodes: Nodes, first: int, last: int) -> tuple[IntArray, IntArray, NDArray[np.float64]]:
    """The method's own quadrature over the time from frame ``first`` to ``last``.

    Simpson's rule in the steps whose midpoint is among the nodes, the trapezoid rule in the others.

    Args:
        nodes: all sides of the frames that a statement on these stands on, and midpoints between them.

    Returns:
        the incidence of steps on nodes: (node number, step, share of the step's length), each (k,).
    """
    frame, middle = nodes.frame, nodes.is_midpoint
    edge = np.full(last - first, 0.5)
    edge[frame[middle] - first] = 1.0 / 6.0
    number = np.arange(len(nodes))
    left = ~middle & (frame > first) & (nodes.side != AFTER)
    right = ~middle & (frame < last) & (nodes.side != BEFORE)
    which = np.concatenate([number[left], number[right], number[middle]])
    step = np.concatenate([frame[left] - 1, frame[right], frame[middle]])
    share = np.concatenate(
        [edge[frame[left] - 1 - first], edge[frame[right] - first], np.full(middle.sum(), 4.0 / 6.0)]
    )
    return which, step, share
