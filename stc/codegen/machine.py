"""What this machine can do, and what tells it and its compiler from others, found without loading the compiler.

LLVM names the processor and its features; asking it means loading it, which takes longer than a small solve.  Where
Linux lists the processor's features and an installed llvmlite tells its version in a file, that is enough to find
machine code that was made before.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from stc.records import dataclass

#: Lines of /proc/cpuinfo that LLVM's answer can depend on; the others are clock rates and the like.
_TELLING = (b"vendor_id", b"cpu family", b"model", b"stepping", b"flags")

#: Features that LLVM and Linux call differently; ``_`` is a dot for LLVM.
_OTHERWISE = {"pni": "sse3", "abm": "lzcnt", "lahf_lm": "sahf", "bmi1": "bmi"}


@dataclass(frozen=True, slots=True)
class Machine:
    """The machine that this process runs on.

    Attributes:
        architecture: as target triples begin.
        features: of the processor, as LLVM calls them, or, where it knows none of the kind, as Linux does.
        identity: differs wherever LLVM's description of the machine may, or LLVM.
    """

    architecture: str
    features: frozenset[str]
    identity: str


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


def compiler() -> tuple[str, tuple[int, ...]] | None:
    """What tells the installed llvmlite, which brings its LLVM along, from others, and its version; None without."""
    from importlib.util import find_spec

    try:
        found = find_spec("llvmlite")
    except (ImportError, ValueError):
        return None
    if found is None or not found.origin:
        return None
    try:
        text = (Path(found.origin).parent / "_version.py").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    for line in text.splitlines():
        name, _, value = line.partition("=")
        parts = value.strip().strip("\"'").split(".")[:2]
        if name.strip() == "version_version" and all(part.isdecimal() for part in parts):
            return f"{found.origin}\n{text}", tuple(map(int, parts))
    return None


def features_of(described: str) -> frozenset[str]:
    """The features that a processor's description lists, as LLVM calls them."""
    lists = [line.partition(":")[2].split() for line in described.splitlines() if line.startswith("flags")]
    return frozenset(_OTHERWISE.get(name, name.replace("_", ".")) for names in lists for name in names)


def known(oldest: tuple[int, ...]) -> Machine | None:
    """A description of this machine that needs no call of LLVM.

    Returns None if the processor is unknown, or if LLVM is missing or older than ``oldest``: then LLVM has to be asked.
    """
    described, installed = processor(), compiler()
    if described is None or installed is None or installed[1] < oldest:
        return None
    return Machine("x86_64", features_of(described), f"{described}\n{installed[0]}")
