"""``@native``: a typed subset of Python, compiled to machine code.

    @native(fast=True)
    def axpy(n: i64, a: f64, x: f64s, y: f64s) -> None:
        for k in range(n):
            y[k] += a * x[k]

**Types.** ``f64``, ``i64`` scalars; ``f64s``, ``i32s``, ``i64s`` one-dimensional C-contiguous arrays, passed
as pointers (lengths are arguments of their own).  The type of a local is that of its first assignment.

**Statements.** Assignment (tuples too), augmented and annotated assignment, ``if``, ``while``, ``for`` over
``range``, ``break``, ``continue``, ``else`` on loops, ``return``.

**Expressions.** ``+ - * /``, ``// %`` of integers (divisor not zero), ``& | ^`` of integers, ``**`` with a
constant whole exponent, comparisons, ``and or not`` of conditions, ``a if c else b``, ``x[k]`` (``k >= 0``,
unchecked), views ``x[k:]``, ``min max abs float int``, the functions of :mod:`stc.codegen.native_math`
and the vectors of :mod:`stc.codegen.native_vector`, module-level numeric constants, and other compiled functions
of any module.

All functions of one Python module are compiled at the first call of one of them, into one object that is kept
on disk.  Arrays written by a call must not overlap its other arrays.  Arithmetic is IEEE, as written;
``fused=True`` lets the compiler fuse multiply-adds, ``fast=True`` reorder sums as well (nan and infinity keep their
meaning).  What is reordered waits less, but not every product is part of a multiply-add then.  With either, ``min`` and
``max`` give nan where an argument is nan.
``inline=True`` copies the body into every caller; ``small=True`` is for code outside inner loops: it compiles
three times faster, to a third of the size, and runs slower.  Loops that copy or clear become calls of the C library,
which is fast for thousands of bytes, but takes longer than the work for a few dozen; with ``short=True`` they stay
loops.  ``shared=True`` is for functions that make prepared calls
(:func:`stc.codegen.calls.invoke`), which may write to their arrays.  Without LLVM, or with ``STC_BACKEND=python``, the
same functions run as plain Python.  The interpreter lock is released while compiled code runs.
"""

from __future__ import annotations

import ctypes
import functools
import linecache
import threading
from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar, overload

import numpy as np

from stc.codegen import engine
from stc.codegen.calls import Bound
from stc.codegen.native_math import (
    ceil,
    copysign,
    count_bits,
    exp,
    fabs,
    floor,
    inf,
    isfinite,
    isnan,
    log,
    nan,
    sqrt,
)
from stc.codegen.native_types import (
    DTYPES,
    NativeError,
    Signature,
    Type,
    f64,
    f64s,
    i32s,
    i64,
    i64s,
    signature_of,
)

__all__ = [
    "Bound",
    "BoundFunction",
    "NativeError",
    "NativeFunction",
    "ceil",
    "copysign",
    "count_bits",
    "exp",
    "f64",
    "f64s",
    "fabs",
    "floor",
    "i32s",
    "i64",
    "i64s",
    "inf",
    "isfinite",
    "isnan",
    "log",
    "nan",
    "native",
    "native_source",
    "sqrt",
]

P = ParamSpec("P")
R = TypeVar("R")

_CTYPES: dict[Type, Any] = {Type.F64: ctypes.c_double, Type.I64: ctypes.c_int64, Type.NONE: None}
#: So many calls are prepared one by one: that takes a tenth of the time it takes to make a function for all later ones.
FEW_CALLS = 8
#: Functions by their module and name.
registry: dict[str, dict[str, NativeFunction[..., Any]]] = {}
_lock = threading.RLock()
_one_byte: Callable[[Any], Any] = ctypes.c_char.from_buffer
_address_of = ctypes.addressof


def array_address(array: Any, dtype: np.dtype[Any], what: str) -> int:
    """Address of an array's first element, checked: one-dimensional, C-contiguous, of the given type.

    Raises:
        NativeError: it is not.
    """
    try:
        if array.dtype is dtype and array.ndim == 1:
            # cheaper than array.ctypes.data; it refuses what is not contiguous
            return _address_of(_one_byte(array))
    except (AttributeError, TypeError, ValueError):  # no array, or one that is read-only or empty
        pass
    if not isinstance(array, np.ndarray):
        raise NativeError(f"{what} must be a {dtype} array, not {type(array).__name__}")
    if array.dtype != dtype or array.ndim != 1 or not array.flags.c_contiguous:
        raise NativeError(
            f"{what} must be a one-dimensional C-contiguous array of {dtype}, "
            f"not {array.dtype} of shape {array.shape}, strides {array.strides}"
        )
    return int(array.ctypes.data)


class BoundFunction(Bound):
    """A prepared call of a compiled function, its scalar arguments known by name.

    ``bound.set("alpha", 0.5)`` changes one between calls, as does ``bound.floats[k] = 0.5`` with
    ``k = bound.position("alpha")`` (``bound.integers`` for ``i64``).
    """

    signature: Signature

    def position(self, name: str) -> int:
        """Position of a parameter in the cells."""
        return self.signature.names.index(name)

    def set(self, name: str, value: float) -> None:
        """Change a scalar argument."""
        position = self.position(name)
        type_ = self.signature.types[position]
        if type_ is Type.F64:
            self.floats[position] = value
        elif type_ is Type.I64:
            self.integers[position] = int(value)
        else:
            raise NativeError(f"{name} is an array; bind again to change it")


class NativeFunction(Generic[P, R]):
    """A function of the compiled subset; call it like the Python function it was."""

    def __init__(
        self,
        function: Callable[P, R],
        *,
        fast: bool = False,
        fused: bool = False,
        inline: bool = False,
        small: bool = False,
        short: bool = False,
        shared: bool = False,
    ) -> None:
        self.__name__ = function.__name__
        functools.update_wrapper(self, function)
        self.function = function
        #: Of its arithmetic, for LLVM.
        self.flags = " contract reassoc nsz" if fast else " contract" * fused
        self.inline = inline
        self.small = small
        self.short = short
        self.shared = shared
        self.signature = signature_of(function)
        self._call: Callable[..., Any] | None = None
        self._packed: Callable[..., Any] | None = None
        self._python: Callable[..., Any] | None = None
        self._object: engine.LoadedObject | None = None
        self._symbol = ""
        self._single_calls = 0
        if self.is_global:
            registry.setdefault(function.__module__, {})[function.__qualname__] = self

    def __repr__(self) -> str:
        return f"<native {self.function.__module__}.{self.function.__qualname__}>"

    def described(self) -> str:
        """What its code depends on besides its source and what that names."""
        return (
            f"{self!r} line {self.function.__code__.co_firstlineno} "
            f"flags={self.flags} inline={self.inline} small={self.small} short={self.short} shared={self.shared}"
        )

    @property
    def is_global(self) -> bool:
        """Whether it is defined in no other function."""
        return "<locals>" not in self.function.__qualname__

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run, with checked arguments.

        Raises:
            NativeError: a wrong argument; on first use, code outside the subset.
        """
        call = self._call
        if call is None:
            if not kwargs and self._single_calls < FEW_CALLS and len(args) == len(self.signature.names):
                self.prepare()
                if self.is_compiled:
                    self._single_calls += 1
                    return self.bind(*args)()
            call = self._prepare()
        return call(*args, **kwargs)

    def bind(self, *args: Any) -> BoundFunction:
        """Prepare a call once to make it often: arrays are addressed and kept alive, scalars stay settable.

        Raises:
            NativeError: a wrong argument; on first use, code outside the subset.
        """
        self.prepare()
        arrays, integers, floats = self._arguments
        if len(args) != len(self.signature.names):
            raise NativeError(
                f"{self.__name__}() takes {len(self.signature.names)} arguments, not {len(args)}"
            )
        addresses = [0] * len(args)
        for position, dtype, what in arrays:
            addresses[position] = array_address(args[position], dtype, what)
        if self._object is not None:
            if self._packed is None:
                entry = self._object.address(self._symbol + ".packed")
                self._packed = ctypes.CFUNCTYPE(_CTYPES[self.signature.result], ctypes.c_void_p)(entry)
            bound = BoundFunction.of_native(self._packed, addresses, (args, self._object))
        else:
            cells: list[Any] = []
            bound = BoundFunction.of_python(self._from_cells, (cells, args))
            bound.allocate(addresses)
            cells.extend((bound.integers, bound.floats))
        bound.signature = self.signature
        for position in integers:
            bound.integers[position] = args[position]
        for position in floats:
            bound.floats[position] = args[position]
        return bound

    @functools.cached_property
    def _arguments(self) -> tuple[list[tuple[int, np.dtype[Any], str]], list[int], list[int]]:
        """Positions of the arrays, with their type and what to call them, of the integers, and of the floats."""
        kinds = list(enumerate(self.signature.types))
        arrays = [
            (k, DTYPES[kind], f"{self.__name__}(): {self.signature.names[k]}")
            for k, kind in kinds
            if kind.is_array
        ]
        integers, floats = ([k for k, kind in kinds if kind is wanted] for wanted in (Type.I64, Type.F64))
        return arrays, integers, floats

    def _from_cells(self, cells: list[Any], args: tuple[Any, ...]) -> Any:
        """A prepared call without machine code."""
        integers, floats = cells
        values = [
            floats[k] if type_ is Type.F64 else integers[k] if type_ is Type.I64 else args[k]
            for k, type_ in enumerate(self.signature.types)
        ]
        return self.python(*values)

    def prepare(self) -> None:
        """Compile this function's module now, or load it: for a thread that works while others wait for input.

        Raises:
            NativeError: code outside the subset.
        """
        if not self.is_compiled:
            with _lock:
                if not self.is_compiled and engine.llvm_wanted():
                    from stc.codegen.native_units import compile_unit  # which needs this module first

                    compile_unit(self)

    @property
    def is_compiled(self) -> bool:
        """Whether machine code is at hand."""
        return self._object is not None

    @property
    def python(self) -> Callable[..., Any]:
        """The function as plain Python with the machine's arithmetic (functions it calls run as usual)."""
        if self._python is None:
            from stc.codegen.native_python import plain_python
            from stc.codegen.native_units import definition_of

            self._python = plain_python(self.function, definition_of(self.function))
        return self._python

    def _prepare(self) -> Callable[..., Any]:
        with _lock:
            self.prepare()
            if self._call is None and self._object is not None:
                kinds = [_CTYPES.get(type_, ctypes.c_void_p) for type_ in self.signature.types]
                prototype = ctypes.CFUNCTYPE(_CTYPES[self.signature.result], *kinds)
                self._call = self._checked(prototype(self._object.address(self._symbol)), convert=True)
            elif self._call is None:
                self._call = self._checked(self.python, convert=False)
            return self._call

    def install(self, loaded: engine.LoadedObject, symbol: str) -> None:
        """Adopt machine code; the ways to call it are made when they are first used, since most never are."""
        self._symbol, self._object = symbol, loaded  # in this order: other threads ask for the object

    def _checked(self, entry: Callable[..., Any], *, convert: bool) -> Callable[..., Any]:
        """Wrap an entry in a function with this one's parameters that checks the arrays."""
        names: dict[str, Any] = {"_entry": entry, "_address": array_address}
        passed, checks = [], []
        for name, type_ in zip(self.signature.names, self.signature.types, strict=True):
            if not type_.is_array:
                passed.append(name)
                continue
            names[f"_dtype_{name}"] = DTYPES[type_]
            check = f"_address({name}, _dtype_{name}, {f'{self.__name__}(): {name}'!r})"
            passed.append(check if convert else name)
            checks.append(check)
        before = "" if convert else "; ".join(checks) + "\n    " if checks else ""
        text = (
            f"def call({', '.join(self.signature.names)}):\n    {before}return _entry({', '.join(passed)})\n"
        )
        exec(text, names)
        return names["call"]


@overload
def native(function: Callable[P, R], /) -> NativeFunction[P, R]: ...
@overload
def native(
    *,
    fast: bool = False,
    fused: bool = False,
    inline: bool = False,
    small: bool = False,
    short: bool = False,
    shared: bool = False,
) -> Callable[[Callable[P, R]], NativeFunction[P, R]]: ...


def native(
    function: Callable[..., Any] | None = None,
    /,
    *,
    fast: bool = False,
    fused: bool = False,
    inline: bool = False,
    small: bool = False,
    short: bool = False,
    shared: bool = False,
) -> Any:
    """Compile a function of the subset (see the module's documentation) at its first call.

    Args:
        fast: fuse multiply-adds and reorder sums; nan and infinity keep their meaning.
        fused: fuse multiply-adds only.
        inline: copy the body into every compiled caller.
        small: compile quickly and compactly, for code that is not in an inner loop.
        short: its loops are short ones, which copy and clear in place.
        shared: what it calls may write to its arrays.

    Raises:
        NativeError: a parameter without a type of the subset.
    """
    if function is not None:
        return NativeFunction(function)
    return lambda inner: NativeFunction(
        inner, fast=fast, fused=fused, inline=inline, small=small, short=short, shared=shared
    )


def native_source(text: str, name: str) -> dict[str, Any]:
    """Execute generated source (with its imports) whose ``@native`` functions can then be compiled.

    Args:
        text: Python source.
        name: a name for messages and for the functions' module; texts that differ need names that differ.

    Returns:
        The module's global names.
    """
    filename = f"<{name}>"
    linecache.cache[filename] = (len(text), None, text.splitlines(keepends=True), filename)
    registry.pop(filename, None)
    names: dict[str, Any] = {"__name__": filename, "__builtins__": __builtins__}
    exec(compile(text, filename, "exec"), names)
    return names
