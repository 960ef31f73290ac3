"""Files that are written completely or not at all: written under another name, then renamed."""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

#: How a temporary file is called: after its target, the process that writes it, and where that process runs.
_TEMPORARY = re.compile(r"\..*\.(\d+)-([0-9a-f]{8})\.tmp(?:\.[^.]*)?", re.DOTALL)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A context that yields a temporary path beside ``path``, with the same suffix; at its end the temporary file
    becomes ``path``.

    A reader sees the old or the new file, never a partial one.  If the block raises an exception, including Ctrl-C,
    the old file, or its absence, is unchanged.  Temporary files that killed processes left in the folder are removed.

    Raises:
        OSError: the file cannot be written; its ``filename`` is ``path``.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.stem}.{os.getpid()}-{_where()}.tmp{target.suffix}")
    _unfinished.add(temporary)
    _sweep(target.parent)
    try:
        yield temporary
        with temporary.open("r+b") as stream:
            os.fsync(stream.fileno())
        temporary.replace(target)
    except OSError as error:
        # A full disk tells no name, and nobody asked for that of the temporary file.
        if error.errno is None or error.filename not in (None, str(temporary)):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(target)) from error
    finally:
        with suppress(OSError):  # where nothing can be written, nothing was
            temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


#: The temporary files that this process is writing.
_unfinished: set[Path] = set()


def is_writing() -> bool:
    """Whether this process is writing such a file."""
    return bool(_unfinished)


def give_up() -> None:
    """Remove the temporary files of this process, when it ends while other threads are writing them."""
    for temporary in tuple(_unfinished):
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@cache
def _where() -> str:
    """Eight hexadecimal digits that identify the machine, or the container, whose processes are visible."""
    seen = os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")
    with suppress(OSError):
        seen += f" {Path('/proc/self/ns/pid').stat().st_ino}"
    return f"{zlib.crc32(os.fsencode(seen)):08x}"


def _sweep(folder: Path) -> None:
    """Remove the temporary files in a folder whose process on this machine no longer exists."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            named = _TEMPORARY.fullmatch(entry.name) if entry.name.startswith(".") else None
            if named and named[2] == _where() and not _runs(int(named[1])):
                with suppress(OSError):  # another process has swept it up
                    Path(entry.path).unlink()


def _runs(process: int) -> bool:
    """Whether a process with this id exists; True if that is not known."""
    if os.name == "nt":  # where asking would end it
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # another user's
        return True
    return True
