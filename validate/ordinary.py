"""Models of ordinary size, and very large ones, which are first compiled in a separate process that can be stopped.

A few characters of a model can require hours of work: a height field of 10^10 cells, ten million copies of a body.
MuJoCo cannot be interrupted while it compiles.  Therefore the files of a model are examined first; a very large model
is compiled in a separate process, with a limit of time and memory, before it is compiled here.
"""

from __future__ import annotations

import math
import os
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from stc import models

#: Bytes of all files of an ordinary model's text, and of each mesh or picture that it names.
_MOST_TEXT, _MOST_FILE = 4_000_000, 50_000_000

#: Copies, knots and vertices that an ordinary model has made for it; cells of a height field or a picture; the largest
#: number of a table's rows or columns under `size`.
_MOST_COPIES, _MOST_CELLS, _MOST_ROWS = 2_000, 10_000_000, 100_000

#: Elements within each other; MuJoCo itself refuses some hundreds.
_DEEPEST = 500

#: Seconds and bytes that compiling a model may take.
TIME, MEMORY = 20.0, 4 << 30

#: What the process does: the limit of memory, then the model; what MuJoCo says of it goes to standard output.
_TRIAL = """
import os, sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)  # should the one that waits be gone
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
except (ImportError, ValueError, OSError):
    pass
import mujoco
from stc.model_source import opened
try:
    mujoco.MjData(opened(sys.argv[1]).model)
except MemoryError:
    sys.exit(3)
except Exception as error:
    sys.stdout.buffer.write(str(error).encode("utf-8", "replace"))
    sys.exit(4)
"""


def refusal(path: Path) -> str:
    """Why a model cannot be compiled within limits; "" if it can, or if there is no indication."""
    if is_ordinary(path):
        return ""
    command = [sys.executable, "-c", _TRIAL, os.fspath(path.resolve()), str(MEMORY), str(math.ceil(2 * TIME))]
    environment = {**os.environ, "MUJOCO_GL": "off"}
    try:
        with tempfile.TemporaryDirectory() as folder:  # where MuJoCo leaves its log
            tried = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=TIME,
                env=environment,
                cwd=folder,
                check=False,
            )
    except subprocess.TimeoutExpired:
        return f"to compile it takes MuJoCo more than {TIME:g} s; make its numbers of copies, cells or rows smaller"
    except OSError:  # no process can be started
        return ""
    said = " ".join(tried.stdout.decode("utf-8", "replace").split())
    if (
        tried.returncode == 3 or "allocate" in said or "unknown exception" in said
    ):  # of C++, which has no memory left
        return f"it takes more than {MEMORY >> 30} GB of memory; make its numbers of copies, cells or rows smaller"
    if tried.returncode == 4:
        return said
    if tried.returncode:
        last = tried.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
        return " ".join(["MuJoCo ends the process that compiles it", *(f"({line})" for line in last)])
    return ""


def is_ordinary(path: Path) -> bool:
    """Whether no element of a model's files requires unusual work; False if that is not known."""
    with suppress(OSError):
        if path.resolve().is_relative_to(Path(models.__file__).resolve().parent):
            return True
    try:
        return _usual(path)
    except (OSError, ValueError, ET.ParseError, struct.error, RecursionError):
        return False


def _usual(path: Path) -> bool:
    waiting, seen, text, copies = [path], {path}, 0, 0
    while waiting:
        file = waiting.pop()
        text += file.stat().st_size
        if text > _MOST_TEXT:
            return False
        for element, copied in _with_copies(ET.fromstring(file.read_bytes())):
            if element.tag in ("include", "model") and "file" in element.attrib:
                included = path.parent / element.attrib["file"]
                if included not in seen:
                    seen.add(included)
                    waiting.append(included)
            copies += copied if copied > 1 else 0
            if copies > _MOST_COPIES or not _small(element, path.parent):
                return False
    return True


def _with_copies(root: ET.Element) -> Iterator[tuple[ET.Element, int]]:
    """All elements, each with the number of its copies.

    Raises:
        ValueError: a count that is not a plain number, or a nesting of elements that MuJoCo refuses.
    """
    waiting = [(root, 1, 0)]
    while waiting:
        element, copies, depth = waiting.pop()
        if depth > _DEEPEST:
            raise ValueError("nested too deep")
        if element.tag in ("replicate", "composite", "flexcomp") and "count" in element.attrib:
            copies *= math.prod(max(1, int(word)) for word in element.attrib["count"].split())
        yield element, copies
        waiting += [(inner, copies, depth + 1) for inner in element]


def _small(element: ET.Element, folder: Path) -> bool:
    """Whether an element does not require an unusual number of cells, rows or bytes."""
    given = element.attrib
    if element.tag == "size":
        if any(int(value) > _MOST_ROWS for key, value in given.items() if key != "memory"):
            return False
    cells = [int(given[key]) for key in ("nrow", "ncol", "width", "height", "nsample") if key in given]
    if math.prod(cells) > _MOST_CELLS:
        return False
    if element.tag == "mesh" and "builtin" in given:
        return False
    named = folder / given.get("file", "")
    if "file" not in given or not named.is_file():
        return True
    if named.stat().st_size > _MOST_FILE:
        return False
    with named.open("rb") as stream:
        head = stream.read(24)
    if head.startswith(b"\x89PNG"):
        return math.prod(struct.unpack(">II", head[16:24])) <= _MOST_CELLS
    return True
