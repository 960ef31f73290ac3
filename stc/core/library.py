"""The core's shared library, loaded: what ``calls.h`` declares.

There is one library for each instruction set (``stc/core/processor.h``); the best that the processor has is taken.
What else is in it is called through :mod:`stc.core.functions`.
"""

from __future__ import annotations

import ctypes
import functools
import os
import sys

from stc.errors import StcError

__all__ = ["Pool", "instructions", "library"]

FOLDER = os.path.dirname(__file__)  # noqa: PTH120 (making a Path takes as long as loading a library)
SUFFIX = {"win32": "dll", "darwin": "dylib"}.get(sys.platform, "so")
REBUILD = "python stc/core/compiling.py makes it anew, as does pip install"


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
