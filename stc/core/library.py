"""The core's shared library, loaded: the structs and functions that ``kkt.h`` and ``calls.h`` declare.

There is one library for each instruction set (``stc/core/processor.h``); the best that the processor has is taken.
What else is in it is called through :mod:`stc.core.functions`.
"""

from __future__ import annotations

import ctypes
import functools
import os
import sys

from stc.errors import StcError

__all__ = ["Arrays", "Facts", "Options", "Pattern", "Pool", "instructions", "library"]

FOLDER = os.path.dirname(__file__)  # noqa: PTH120 (making a Path takes as long as loading a library)
SUFFIX = {"win32": "dll", "darwin": "dylib"}.get(sys.platform, "so")
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
        ("stale", ctypes.c_double),
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


def _loaded(kind: str) -> ctypes.CDLL:
    """The library for one instruction set.

    Raises
    ------
    StcError : it cannot be loaded.
    """
    try:
        return ctypes.CDLL(f"{FOLDER}/libcore_{kind}.{SUFFIX}")
    except OSError as error:
        raise StcError(f"the numerical core cannot be loaded ({error}): {REBUILD}") from None


@functools.cache
def instructions() -> str:
    """The best instruction set of this processor: ``baseline``, ``avx2`` or ``avx512``."""
    best = _loaded("baseline").core_best_instructions
    best.restype = ctypes.c_char_p
    return str(best().decode())


@functools.cache
def library(kind: str | None = None) -> ctypes.CDLL:
    """The library, its functions typed.

    Parameters
    ----------
    kind : the instruction set, which the processor must have; the best one by default.

    Raises
    ------
    StcError : it cannot be loaded, or was compiled from other sources than those that are there.
    """
    loaded = _loaded(kind or instructions())
    loaded.core_sources.restype = ctypes.c_char_p
    if _may_be_stale(loaded._name):
        from stc.core.compiling import digest_of_sources

        if loaded.core_sources().decode() != digest_of_sources():
            raise StcError(f"the numerical core ({loaded._name}) is older than its sources: {REBUILD}")
    call, pool = ctypes.c_void_p, ctypes.POINTER(Pool)
    for name, result, arguments in (
        ("kkt_new", ctypes.c_void_p, [ctypes.POINTER(Pattern), ctypes.POINTER(Arrays)]),
        ("kkt_free", None, [ctypes.c_void_p]),
        ("kkt_restart", None, [ctypes.c_void_p]),
        ("kkt_options_of", ctypes.POINTER(Options), [ctypes.c_void_p]),
        ("kkt_facts_of", ctypes.POINTER(Facts), [ctypes.c_void_p]),
        ("kkt_refactor", ctypes.c_int64, [call]),
        ("kkt_attempt", ctypes.c_int64, [call]),
        ("kkt_solve", ctypes.c_int64, [call]),
        ("kkt_solve_both", ctypes.c_int64, [call]),
        ("chain_run", ctypes.c_int64, [call]),
        ("job_run", ctypes.c_int64, [call]),
        ("tape_run", ctypes.c_int64, [call]),
        ("tape_instructions", ctypes.c_char_p, []),
        ("pool_new", pool, []),
        ("tape_functions", call, []),
    ):
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    if sys.platform != "win32":
        for function in (loaded.pool_serve, loaded.pool_stop):
            function.restype, function.argtypes = None, [pool]
    return loaded


def _may_be_stale(library: str) -> bool:
    """Whether a source has been written since a library was: never of an installed package, which has none."""
    compiled = os.stat(library).st_mtime_ns  # noqa: PTH116
    folders = [FOLDER]
    for folder in folders:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.endswith((".c", ".h")) or entry.name == "compiling.py":
                    if entry.stat().st_mtime_ns > compiled:
                        return True
                elif "." not in entry.name and not entry.name.startswith("_"):
                    folders.append(entry.path)
    return False
