"""Types, signatures and the error of the compiled subset of Python (:mod:`stc.codegen.native`)."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.codegen.vector import WIDTH
from stc.records import dataclass

#: Annotations of compiled functions: scalars ...
f64 = float
i64 = int
#: ... and one-dimensional C-contiguous arrays.
f64s = NDArray[np.float64]
i32s = NDArray[np.int32]
i64s = NDArray[np.int64]


class NativeError(TypeError):
    """A compiled function steps outside the subset, or is called with arguments it cannot take."""


class Type(Enum):
    """Type of a value in a compiled function."""

    F64 = "f64"
    I64 = "i64"
    BOOL = "bool"
    NONE = "None"
    F64S = "f64s"
    I32S = "i32s"
    I64S = "i64s"
    F64V = "vector"
    F64W = "vector as wide as registers"

    __hash__ = object.__hash__  # ten times faster than that of an Enum, and members are compared by identity

    @property
    def is_array(self) -> bool:
        """Whether a value is a pointer to elements."""
        return self in _ELEMENT

    @property
    def lanes(self) -> str:
        """How many floats a vector has, as text; empty where a value is none."""
        return _LANES.get(self, "")

    @property
    def ir(self) -> str:
        """LLVM's name of the type of a value in a register."""
        return _IR.get(self, "ptr")

    @property
    def element_ir(self) -> str:
        """LLVM's name of an element in memory (arrays only)."""
        return _ELEMENT[self][0]

    @property
    def element(self) -> Type:
        """Type of an element once loaded (arrays only)."""
        return _ELEMENT[self][1]


_LANES = {Type.F64V: "8", Type.F64W: WIDTH}
_IR = {
    Type.F64: "double",
    Type.I64: "i64",
    Type.BOOL: "i1",
    Type.NONE: "void",
    Type.F64V: "<8 x double>",
    Type.F64W: f"<{WIDTH} x double>",
}
_ELEMENT = {
    Type.F64S: ("double", Type.F64),
    Type.I32S: ("i32", Type.I64),
    Type.I64S: ("i64", Type.I64),
}
DTYPES: dict[Type, np.dtype[Any]] = {
    Type.F64S: np.dtype(np.float64),
    Type.I32S: np.dtype(np.int32),
    Type.I64S: np.dtype(np.int64),
}

_BY_NAME = {kind.value: kind for kind in Type if not kind.lanes} | {"float": Type.F64, "int": Type.I64}
#: Types as most parameters and results have them, of hundreds of functions that are defined when a program starts.
_PLAIN = {kind.value: kind for kind in (Type.F64, Type.I64, Type.F64S, Type.I32S, Type.I64S)}
_PLAIN_RESULTS = {kind.value: kind for kind in (Type.F64, Type.I64, Type.NONE)}
_BY_OBJECT: tuple[tuple[Any, Type], ...] = (
    (float, Type.F64),
    (int, Type.I64),
    (bool, Type.BOOL),
    (None, Type.NONE),
    (f64s, Type.F64S),
    (i32s, Type.I32S),
    (i64s, Type.I64S),
)


def type_of_annotation(annotation: Any) -> Type | None:
    """The type that an annotation (an object, or text under postponed evaluation) stands for."""
    if isinstance(annotation, str):
        return _BY_NAME.get(annotation.strip().rpartition(".")[2])
    for known, kind in _BY_OBJECT:
        if annotation is known or (known is not None and annotation == known):
            return kind
    return None


@dataclass(frozen=True, slots=True)
class Signature:
    """Parameters, in order, and result of a compiled function."""

    names: tuple[str, ...]
    types: tuple[Type, ...]
    result: Type


def location(function: Callable[..., Any], line: int | None = None) -> str:
    """``file:line`` of a function, or of a line in its file."""
    code = function.__code__
    return f"{code.co_filename}:{line or code.co_firstlineno}"


def signature_of(function: Callable[..., Any]) -> Signature:
    """Read a signature from the annotations.

    Raises:
        NativeError: an annotation is missing or is no type of the subset, or the parameters are not plain.
    """
    code = function.__code__
    if code.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS) or code.co_kwonlyargcount:
        raise NativeError(f"{location(function)}: {function.__name__}: only plain parameters can be compiled")
    if function.__defaults__:
        raise NativeError(f"{location(function)}: {function.__name__}: parameters cannot have defaults")
    annotations = function.__annotations__
    names = code.co_varnames[: code.co_argcount]
    if annotations.get("return") in _PLAIN_RESULTS and all(annotations.get(name) in _PLAIN for name in names):
        plain = tuple([_PLAIN[annotations[name]] for name in names])
        return Signature(names, plain, _PLAIN_RESULTS[annotations["return"]])
    types: list[Type] = []
    for name in names:
        kind = type_of_annotation(annotations[name]) if name in annotations else None
        if kind is None or kind in (Type.NONE, Type.BOOL):
            raise NativeError(
                f"{location(function)}: {function.__name__}: parameter {name} needs a type: "
                "f64, i64, f64s, i32s or i64s"
            )
        types.append(kind)
    result = type_of_annotation(annotations["return"]) if "return" in annotations else None
    if result is None or result.is_array or result is Type.BOOL:
        raise NativeError(f"{location(function)}: {function.__name__}: result must be f64, i64 or None")
    return Signature(names, tuple(types), result)
