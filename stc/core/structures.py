"""Structures of the core (``API_STRUCT`` in ``stc/core/native.h``), to be filled from Python.

iterate = structure("iterate")     # a class, whose fields are those of the declaration in C
point = iterate(w=w, y=y)          # arrays are checked and kept alive, other fields are 0
point.f = 0.5                      # numbers can be read and changed at any time
point.set(z=z)                     # arrays as well
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import DTYPES, array_address
from stc.core.library import library

__all__ = ["Structure", "structure"]

_TYPES: dict[str, Any] = {"i": ctypes.c_int64, "d": ctypes.c_double}


class Structure(ctypes.Structure):
    """A structure of the core; pointers are set by keyword, and what they point to lives as long.

    Attributes
    ----------
    kinds : of the fields: ``d`` or ``i`` for a number, ``D``, ``I`` or ``L`` for an array, ``S`` for a structure.
    """

    kinds: ClassVar[dict[str, str]]

    def __init__(self, **values: Any) -> None:
        super().__init__()
        self._kept: dict[str, Any] = {}
        self.set(**values)

    def set(self, **values: Any) -> None:
        """Set fields.

        Raises
        ------
        ArgumentError : an array is of another type.
        """
        for name, value in values.items():
            kind = self.kinds[name]
            if kind in DTYPES:
                self._kept[name] = value
                value = array_address(value, DTYPES[kind], name)
            elif kind == "S":
                self._kept[name] = value
                value = ctypes.addressof(value)
            setattr(self, name, value)

    def array_of(self, name: str) -> NDArray[np.float64]:
        """A number of the structure, seen as an array, (1,)."""
        return np.frombuffer(memoryview(self).cast("B"), np.float64, 1, getattr(type(self), name).offset)


@functools.cache
def structure(name: str) -> type[Structure]:
    """The structure that is called so in C."""
    told = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library(), f"{name}_fields"))).decode()
    kinds = dict(field.split() for field in told.split(","))
    fields = [(field, _TYPES.get(kind, ctypes.c_void_p)) for field, kind in kinds.items()]
    return type(name, (Structure,), {"_fields_": fields, "kinds": kinds})
