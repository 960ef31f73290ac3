"""Equations of motion from a Lagrangian: the expressions d/dt (dL/dq') - dL/dq.

*Points.*  A Lagrangian is mostly written in terms of positions of bodies, w(q, t), and their velocities w'.  The
Euler-Lagrange expressions change like a covector from one set of coordinates to another (Lanczos, The Variational
Principles of Mechanics, 4th ed., V.1): with L held as a function of the velocities w' of points besides q and q',

    d/dt (dL/dq') - dL/dq  =  [d/dt (dL/dq') - dL/dq, w' held]  +  sum over points of  d/dt (dL/dw') * dw/dq

since d(w')/dq' = dw/dq and d/dt (dw/dq) = d(w')/dq.  So each point's momentum is differentiated on its own, where
it is simple (m*x''), and one reverse sweep along the points' positions adds up what acts on each coordinate.  Written
out for the coordinates instead, every momentum holds every velocity times every arm, and terms appear twice only to
cancel: for a chain of n bodies n^2 operations and more in place of n.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from stc.records import dataclass
from stc.symbolic.differentiate import adjoints
from stc.symbolic.node import ONE, ZERO, Expr, add, neg


@dataclass(frozen=True, slots=True)
class Variation:
    """The results for one coordinate q: ``momentum`` dL/dq', ``row`` d/dt (dL/dq') - dL/dq."""

    momentum: Expr
    row: Expr


def euler_lagrange(
    lagrangian: Expr,
    coordinates: Sequence[tuple[Expr, Expr]],
    points: Mapping[Expr, Expr],
    rate: Callable[[Expr], Expr],
) -> list[Variation]:
    """The momenta and the Euler-Lagrange expressions of a Lagrangian.

    Args:
        lagrangian: L, of coordinates, their first time derivatives, and the time.
        coordinates: the symbols of q and of q' for each coordinate.
        points: from time derivatives w' that may occur in L to the differentiated symbols: functions w of
            coordinates and time alone.  The result's value does not depend on them, only its operations do.
        rate: gives the total time derivative of an expression.
    """
    speeds = frozenset(speed for _, speed in coordinates)
    held = speeds | points.keys()
    by_speed = adjoints([(lagrangian, ONE)], held)
    of_points = [(points[node], p) for node, p in by_speed.items() if node in points]
    positions = frozenset(position for position, _ in coordinates)
    momenta = adjoints(of_points, positions)
    forces = adjoints([*((w, rate(p)) for w, p in of_points), (lagrangian, neg(ONE))], positions | held)
    found = []
    for position, speed in coordinates:
        own = by_speed.get(speed, ZERO)
        momentum = add(own, momenta.get(position, ZERO))
        found.append(Variation(momentum, add(rate(own), forces.get(position, ZERO))))
    return found
