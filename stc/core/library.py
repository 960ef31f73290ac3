"""The core's shared library, loaded: its structs and functions as ``kkt.h`` and ``calls.h`` declare them."""

from __future__ import annotations

import ctypes
import functools
import os
import sys
from pathlib import Path

from stc.errors import StcError

__all__ = ["Arrays", "Facts", "Options", "Pattern", "Pool", "is_there", "library"]

FOLDER = Path(__file__).parent
LIBRARY = FOLDER / f"libkkt.{ {'win32': 'dll', 'darwin': 'dylib'}.get(sys.platform, 'so') }"
REBUILD = "python stc/core/compiling.py makes it anew, as does pip install"
_int32s = ctypes.c_void_p
_doubles = ctypes.c_void_p


class Pattern(ctypes.Structure):
    """See ``kkt_pattern``."""

    _fields_ = [
        ("n", ctypes.c_int32),
        ("m", ctypes.c_int32),
        ("hess_count", ctypes.c_int64),
        ("jac_count", ctypes.c_int64),
        ("hess_rows", _int32s),
        ("hess_cols", _int32s),
        ("jac_rows", _int32s),
        ("jac_cols", _int32s),
        ("stage", _int32s),
    ]


class Arrays(ctypes.Structure):
    """See ``kkt_arrays``."""

    _fields_ = [
        (name, _doubles)
        for name in (
            "hess", "jac", "primal", "dual", "rhs", "second_rhs", "solution", "second_solution", "report",
            "accuracy", "inertia",
        )
    ]  # fmt: skip


class Options(ctypes.Structure):
    """See ``kkt_options``."""

    _fields_ = [
        ("threshold", ctypes.c_double),
        ("certain", ctypes.c_double),
        ("fine", ctypes.c_double),
        ("refinements", ctypes.c_int64),
        ("replan", ctypes.c_int64),
    ]


class Facts(ctypes.Structure):
    """See ``kkt_facts``."""

    _fields_ = [
        (name, ctypes.c_int64)
        for name in (
            "factorizations", "plans", "fronts", "entries", "planned", "operations", "delayed", "pairs",
            "replaced",
        )
    ]  # fmt: skip


class Pool(ctypes.Structure):
    """See ``pool``."""

    _fields_ = [("offered", ctypes.c_void_p)] + [
        (name, ctypes.c_int64) for name in ("active", "alive", "offers", "allowed")
    ]


@functools.cache
def is_there() -> bool:
    """Whether the library was compiled when the package was installed."""
    return LIBRARY.exists()


@functools.cache
def library() -> ctypes.CDLL:
    """The library, its functions typed.

    Raises
    ------
    StcError : it cannot be loaded, or was compiled from other sources than those that are there.
    """
    try:
        loaded = ctypes.CDLL(str(LIBRARY))
    except OSError as error:
        raise StcError(f"the numerical core cannot be loaded ({error}): {REBUILD}") from None
    loaded.kkt_sources.restype = ctypes.c_char_p
    if _may_be_stale():
        from stc.core.compiling import digest_of_sources

        if loaded.kkt_sources().decode() != digest_of_sources():
            raise StcError(f"the numerical core ({LIBRARY}) is older than its sources: {REBUILD}")
    call, pool = ctypes.c_void_p, ctypes.POINTER(Pool)
    for name, result, arguments in (
        ("kkt_new", ctypes.c_void_p, [ctypes.POINTER(Pattern), ctypes.POINTER(Arrays)]),
        ("kkt_free", None, [ctypes.c_void_p]),
        ("kkt_options_of", ctypes.POINTER(Options), [ctypes.c_void_p]),
        ("kkt_facts_of", ctypes.POINTER(Facts), [ctypes.c_void_p]),
        ("kkt_refactor", ctypes.c_int64, [call]),
        ("kkt_solve", ctypes.c_int64, [call]),
        ("kkt_solve_both", ctypes.c_int64, [call]),
        ("kkt_instructions", ctypes.c_char_p, []),
        ("kkt_use", ctypes.c_int, [ctypes.c_char_p]),
        ("chain_run", ctypes.c_int64, [call]),
        ("job_run", ctypes.c_int64, [call]),
        ("tape_run", ctypes.c_int64, [call]),
        ("tape_instructions", ctypes.c_char_p, []),
        ("pool_new", pool, []),
        ("copy_block", call, [call, call, ctypes.c_size_t]),
    ):
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    if sys.platform != "win32":
        for function in (loaded.pool_serve, loaded.pool_stop):
            function.restype, function.argtypes = None, [pool]
    return loaded


def _may_be_stale() -> bool:
    """Whether a source has been written since the library was: never of an installed package, which has none."""
    compiled = LIBRARY.stat().st_mtime_ns
    with os.scandir(FOLDER) as entries:
        return any(
            entry.stat().st_mtime_ns > compiled
            for entry in entries
            if entry.name.endswith((".c", ".h")) or entry.name == "compiling.py"
        )
