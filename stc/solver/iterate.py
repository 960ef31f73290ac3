"""One primal-dual point and the quantities that follow from it."""

from __future__ import annotations

from stc.records import dataclass
from stc.solver.nlp import Floats

__all__ = ["Iterate"]

ARRAYS = ("w", "y", "z", "r", "gradient", "jac", "hess", "gap", "c", "dual")


@dataclass(slots=True)
class Iterate:
    """A point of the barrier iteration.  Its arrays may be kept: others may look at them, but not hold on to them.

    Attributes:
        w: variables and slacks, (n + m,).
        y: row multipliers, (m,).
        z: gap multipliers, (gaps,), positive.
        f, r: objective and rows (m,).
        gradient, jac, hess: derivatives at ``(x, y)``.
        gap: distances to the bounds, (gaps,).
        c: ``r - s``, (m,).
        theta: 1-norm of ``c``.
        dual: gradient of the Lagrangian without the gaps' multipliers: ``(grad f + J^T y, -y)``, (n + m,).
    """

    w: Floats
    y: Floats
    z: Floats
    f: float
    r: Floats
    gap: Floats
    c: Floats
    theta: float
    gradient: Floats
    jac: Floats
    hess: Floats
    dual: Floats

    def snapshot(self) -> Iterate:
        """A copy with arrays of its own."""
        return Iterate(f=self.f, theta=self.theta, **{name: getattr(self, name).copy() for name in ARRAYS})

    def become(self, other: Iterate) -> None:
        """Take over every quantity of another iterate, copied."""
        self.f, self.theta = other.f, other.theta
        for name in ARRAYS:
            getattr(self, name)[:] = getattr(other, name)
