"""Linear systems by conjugate gradients, using products with the matrix only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stc.records import dataclass
from stc.solver.nlp import Floats
from stc.solver.products import inner, norm

__all__ = ["Answer", "conjugate_gradients"]

Product = Callable[[Floats], Floats]


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of conjugate gradients.

    Attributes:
        x: the last iterate; of a singular consistent system, without a preconditioner, the shortest solution.
        residual: length of the residual, relative to the right-hand side.
        iterations: products with the matrix.
        indefinite: True when a direction of negative curvature ended it.
    """

    x: Floats
    residual: float
    iterations: int
    indefinite: bool


def conjugate_gradients(
    product: Product,
    rhs: Floats,
    tolerance: float,
    diagonal: Floats | None = None,
    check: Callable[[], None] | None = None,
) -> Answer:
    """Solve ``A x = rhs`` for a symmetric positive (semi)definite A.

    M. R. Hestenes and E. Stiefel, Methods of conjugate gradients for solving linear systems, 1952.

    Args:
        product: v to A v.
        rhs: (k,).
        tolerance: residual at which to stop, relative to the right-hand side.
        diagonal: (k,) positive preconditioner.
        check: called now and then; may raise to stop.
    """
    x, residual = np.zeros_like(rhs), rhs.copy()
    length = norm(rhs)
    if length == 0.0:
        return Answer(x, 0.0, 0, False)
    best, least = x.copy(), 1.0
    direction = pull = residual if diagonal is None else residual / diagonal
    energy = inner(residual, pull)
    limit = 10 * rhs.size + 100
    for k in range(1, limit + 1):
        image = product(direction)
        curvature = inner(direction, image)
        if curvature <= 0.0:
            noise = 1e-14 * norm(direction) * norm(image)
            return Answer(best, least, k, curvature < -noise)
        step = energy / curvature
        x = x + step * direction
        residual = residual - step * image
        size = norm(residual) / length
        if size < least:
            best, least = x, size
        if size <= tolerance or not np.isfinite(size):
            return Answer(best, least, k, False)
        pull = residual if diagonal is None else residual / diagonal
        before, energy = energy, inner(residual, pull)
        direction = pull + (energy / before) * direction
        if check is not None and k % 64 == 0:
            check()
    return Answer(best, least, limit, False)
