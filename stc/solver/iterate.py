"""One primal-dual point and the quantities that follow from it."""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.formulation import Formulation
from stc.solver.nlp import Floats

__all__ = ["Iterate", "evaluate"]

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

    @property
    def is_finite(self) -> bool:
        """Whether functions and derivatives are defined here."""
        total = self.f + self.theta + self.dual.sum() + self.jac.sum() + self.hess.sum()
        return bool(np.isfinite(total))

    def snapshot(self) -> Iterate:
        """A copy with arrays of its own."""
        return Iterate(f=self.f, theta=self.theta, **{name: getattr(self, name).copy() for name in ARRAYS})

    def become(self, other: Iterate) -> None:
        """Take over every quantity of another iterate, copied."""
        self.f, self.theta = other.f, other.theta
        for name in ARRAYS:
            getattr(self, name)[:] = getattr(other, name)


def evaluate(form: Formulation, w: Floats, y: Floats, z: Floats) -> Iterate:
    """Every quantity at ``(w, y, z)``; check ``is_finite`` of the result where functions may be undefined."""
    f, r = form.values(w[: form.n])
    c = form.residual(r, w)
    gradient, jac, hess = form.derivatives(w[: form.n], y)
    dual = np.empty(form.size)
    np.add(gradient, form.transpose_times(jac, y), out=dual[: form.n])
    np.negative(y, out=dual[form.n :])
    if not form.all_moving:
        dual[~form.moving] = 0.0
    return Iterate(w, y, z, f, r, form.gap(w), c, float(np.abs(c).sum()), gradient, jac, hess, dual)
