"""The arrays that come into a KKT system, checked."""

from __future__ import annotations

import numpy as np

from stc.solver.nlp import Floats

__all__ = ["checked_values"]


def checked_values(*arrays: tuple[Floats, int, str]) -> list[Floats]:
    """Contiguous float64 forms of ``(array, size, name)``, without a copy where they already are.

    Raises:
        ValueError: an array does not have its size.
    """
    checked = []
    for array, size, name in arrays:
        if not (isinstance(array, np.ndarray) and array.dtype == np.float64 and array.flags.c_contiguous):
            array = np.ascontiguousarray(array, dtype=np.float64)
        if array.shape != (size,):
            raise ValueError(f"{name} has shape {array.shape}, expected ({size},)")
        checked.append(array)
    return checked
