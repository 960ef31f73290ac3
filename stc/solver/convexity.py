"""Detects programs whose feasible set is convex. For these a local minimum of the violation is a global one."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from stc.solver.nlp import NLP


@runtime_checkable
class Bending(Protocol):
    """A problem that knows which way its rows bend."""

    def row_bends(self) -> NDArray[np.int8]:
        """1 for each row that is a convex function of the variables, -1 for a concave one, 0 for neither; (m,)."""


def is_convex(nlp: NLP) -> bool:
    """Whether the points that meet all bounds are known to be a convex set, whose violation is a convex function.

    That is so where every row is linear, convex without a lower bound, or concave without an upper one (S. Boyd and
    L. Vandenberghe, Convex Optimization, 2004, section 4.2).  Stationary points of the violation are its minima then.
    """
    if np.all(nlp.row_linear):
        return True
    if np.any(~nlp.row_linear & (nlp.row_lower == nlp.row_upper)) or not isinstance(nlp, Bending):
        return False
    bends = nlp.row_bends()
    upper = np.isposinf(nlp.row_upper) | (bends > 0)
    lower = np.isneginf(nlp.row_lower) | (bends < 0)
    return bool(np.all(nlp.row_linear | (upper & lower)))
