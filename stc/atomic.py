"""Files that are whole or not there: written beside their place, then moved to it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path to write to, beside ``path`` and with its suffix; what is there in the end becomes the file ``path``.

    A reader sees the old file or the new one, never a part. When the block is left by an exception, Ctrl-C among
    them, the old file stays as it was, and where there was none there is none.

    Raises:
        OSError: the file cannot be written; its ``filename`` is the one that was asked for.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.stem}.{os.getpid()}.tmp{target.suffix}")
    _unfinished.add(temporary)
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
    """Remove the files that are not whole yet, for a process that ends while others of its threads write them."""
    for temporary in tuple(_unfinished):
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
