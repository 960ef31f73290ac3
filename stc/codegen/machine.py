"""What tells this machine and its compiler from others, found without loading the compiler.

LLVM names the processor and its features; asking it means loading it, which takes longer than a small solve.  So its
answer is kept on disk (:func:`stc.codegen.engine.host`) under what this module finds in two small files: the kernel's
list of the processor's features, and the version file of llvmlite.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

#: Lines of /proc/cpuinfo that LLVM's answer can depend on; the others are clock rates and the like.
_TELLING = (b"vendor_id", b"cpu family", b"model", b"stepping", b"flags")


def processor() -> str | None:
    """Description of the first processor; None where Linux does not give it in the x86 form."""
    if sys.platform != "linux" or os.uname().machine != "x86_64":
        return None
    try:
        with Path("/proc/cpuinfo").open("rb", buffering=0) as file:
            text = file.read(16384)
    except OSError:
        return None
    lines = text.split(b"\n\n")[0].splitlines()
    telling = [line for line in lines if line.startswith(_TELLING)]
    return b"\n".join(telling).decode(errors="replace") if any(b"flags" in line for line in telling) else None


def compiler() -> str | None:
    """Place and version of llvmlite, which brings its LLVM along; None where it is not installed."""
    from importlib.util import find_spec

    try:
        found = find_spec("llvmlite")
    except (ImportError, ValueError):
        return None
    if found is None or not found.origin:
        return None
    try:
        version = (Path(found.origin).parent / "_version.py").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    return f"{found.origin}\n{version}"


def identity() -> str | None:
    """Text that differs wherever LLVM's description of the machine may; None where that is not known."""
    parts = processor(), compiler()
    return None if None in parts else "\n".join(map(str, parts))
