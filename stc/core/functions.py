"""Functions of the core (``stc/core/native.h``), to be called from Python.

    copy = function("point_copy")
    call = copy.bind(n, x, y)          # prepared once ...
    call()                             # ... to be made often: about 0.1 microseconds more than the work
    copy(n, x, y)                      # both at once

What such a function takes is told by the library itself, and so by its declaration in a header: ``double`` and
``int64_t`` are numbers, pointers are one-dimensional C-contiguous arrays of ``float64``, ``int32`` or ``int64``, whose
types are checked and whose lengths are arguments of their own, or structures (``stc.core.structures``).  The
interpreter lock is released meanwhile.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any

import numpy as np

from stc.core.calls import Bound
from stc.core.library import library

__all__ = ["ArgumentError", "BoundFunction", "Function", "function"]

DTYPES: dict[str, np.dtype[Any]] = {
    "D": np.dtype(np.float64),
    "I": np.dtype(np.int32),
    "L": np.dtype(np.int64),
}
_RESULTS = {"v": None, "i": ctypes.c_int64, "d": ctypes.c_double}
_ENTRIES = {kind: ctypes.CFUNCTYPE(result, ctypes.c_void_p) for kind, result in _RESULTS.items()}
_one_byte: Any = ctypes.c_char.from_buffer
_address_of = ctypes.addressof


class ArgumentError(TypeError):
    """A function of the core is called with arguments that it cannot take."""


def array_address(array: Any, dtype: np.dtype[Any], what: str) -> int:
    """Address of an array's first element, checked: one-dimensional, C-contiguous, of the given type.

    Raises
    ------
    ArgumentError : it is not.
    """
    try:
        if array.dtype is dtype and array.ndim == 1:
            # cheaper than array.ctypes.data; it refuses what is not contiguous
            return _address_of(_one_byte(array))
    except (AttributeError, TypeError, ValueError):  # no array, or one that is read-only or empty
        pass
    if not isinstance(array, np.ndarray):
        raise ArgumentError(f"{what} must be a {dtype} array, not {type(array).__name__}")
    if array.dtype != dtype or array.ndim != 1 or not array.flags.c_contiguous:
        raise ArgumentError(
            f"{what} must be a one-dimensional C-contiguous array of {dtype}, "
            f"not {array.dtype} of shape {array.shape}, strides {array.strides}"
        )
    return int(array.ctypes.data)


class BoundFunction(Bound):
    """A prepared call of a function of the core, its scalar arguments known by name.

    ``bound.set("alpha", 0.5)`` changes one between calls, as does ``bound.floats[k] = 0.5`` with
    ``k = bound.position("alpha")`` (``bound.integers`` for whole numbers).
    """

    function: Function

    def position(self, name: str) -> int:
        """Position of a parameter in the cells."""
        return self.function.names.index(name)

    def set(self, name: str, value: float) -> None:
        """Change a scalar argument.

        Raises
        ------
        ArgumentError : it is an array.
        """
        position = self.position(name)
        kind = self.function.kinds[position]
        if kind == "d":
            self.floats[position] = value
        elif kind == "i":
            self.integers[position] = int(value)
        else:
            raise ArgumentError(f"{name} is an array; bind again to change it")


class Function:
    """A function of the core, found in the library when it is first used.

    Attributes
    ----------
    name : in C.
    names, kinds : of the parameters; a kind is ``d`` or ``i`` for a number, ``D``, ``I`` or ``L`` for an array,
        ``S`` for a structure.
    """

    def __init__(self, name: str, kind: str | None = None) -> None:
        self.name = name
        self._instructions = kind

    def __repr__(self) -> str:
        return f"<{self.name} of the core>"

    def __getattr__(self, name: str) -> Any:
        """What the library tells, once it is asked for."""
        if name.startswith("__"):
            raise AttributeError(name)
        self._find()
        return self.__dict__[name]

    def _find(self) -> None:
        loaded = library(self._instructions)
        signature = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(loaded, f"{self.name}_signature")))
        result, *parameters = signature.decode().split(",")
        pairs = [parameter.split() for parameter in parameters if parameter]
        self.names, self.kinds = [name for name, _ in pairs], [kind for _, kind in pairs]
        self._entry = _ENTRIES[result]((f"{self.name}_cells", loaded))
        self._arrays = [
            (k, DTYPES[kind], f"{self.name}(): {name}")
            for k, (name, kind) in enumerate(pairs)
            if kind in DTYPES
        ]
        self._structures = [k for k, kind in enumerate(self.kinds) if kind == "S"]
        self._integers, self._floats = (
            [k for k, kind in enumerate(self.kinds) if kind == wanted] for wanted in "id"
        )

    def bind(self, *args: Any) -> BoundFunction:
        """Prepare a call once to make it often: arrays are addressed and kept alive, scalars stay settable.

        Raises
        ------
        ArgumentError : a wrong argument.
        """
        if len(args) != len(self.names):
            raise ArgumentError(f"{self.name}() takes {len(self.names)} arguments, not {len(args)}")
        cells = [0] * len(args)
        for position, dtype, what in self._arrays:
            cells[position] = array_address(args[position], dtype, what)
        for position in self._structures:
            if not isinstance(args[position], ctypes.Structure):
                raise ArgumentError(f"{self.name}(): {self.names[position]} must be a structure of the core")
            cells[position] = _address_of(args[position])
        bound = BoundFunction.of_native(self._entry, cells, args)
        bound.function = self
        for position in self._integers:
            bound.integers[position] = args[position]
        if self._floats:
            floats = bound.floats
            for position in self._floats:
                floats[position] = args[position]
        return bound

    def __call__(self, *args: Any) -> Any:
        """Make a call.

        Raises
        ------
        ArgumentError : a wrong argument.
        """
        return self.bind(*args)()


@functools.cache
def function(name: str) -> Function:
    """The function of the core that is called so in C."""
    return Function(name)
