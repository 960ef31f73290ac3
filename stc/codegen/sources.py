"""Hashes of source files, which later processes need not read again.

What is kept on disk, machine code above all, is found by the sources that it was made from.  To read and hash a hundred
files takes longer than to load the code.  So each hash is kept as well, with what the system tells of the file: when it
was last written, when anything about it last changed (which nobody can set), its size and its number.  A file that was
written a moment ago is not remembered: it could be written once more without any of these telling.
"""

from __future__ import annotations

import atexit
import contextlib
import marshal
import os
import time
from hashlib import blake2b
from pathlib import Path

from stc.codegen import cache

__all__ = ["digest_of"]

#: Nanoseconds after which a file that is written again is known to have another time.
SETTLED = 2_000_000_000
#: Files that are remembered at most.
MOST = 2000

Stamp = tuple[int, int, int, int]


class _Memory:
    """The hashes kept in one cache.

    Attributes:
        known: of each file, what the system told of it, and the hash.
    """

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self.known: dict[str, tuple[Stamp, str]] = {}
        self._grown = False
        kept = cache.load(_key())
        if kept is not None:
            with contextlib.suppress(ValueError, TypeError, EOFError):  # another version's
                self.known = dict(marshal.loads(kept))

    def add(self, path: str, stamp: Stamp, digest: str) -> None:
        """Remember a file's hash, when the process ends also for others."""
        if not self._grown:
            self._grown = True
            atexit.register(self.keep)
        self.known.pop(path, None)
        self.known[path] = stamp, digest

    def keep(self) -> None:
        """Write what is known, the latest files if there are many."""
        if _folder() == self._folder:
            latest = list(self.known.items())[-MOST:]
            cache.store(_key(), marshal.dumps(dict(latest)))


_memories: dict[str, _Memory] = {}


def digest_of(path: str) -> str:
    """Hash of a file's content.

    Raises:
        OSError: it cannot be read.
    """
    memory = _memory()
    status = os.stat(path)  # noqa: PTH116 (a path's takes twice as long)
    stamp = status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino
    found = memory.known.get(path)
    if found is not None and found[0] == stamp:
        return found[1]
    digest = str(blake2b(Path(path).read_bytes(), digest_size=32).hexdigest())
    if time.time_ns() - max(stamp[:2]) > SETTLED:
        memory.add(path, stamp, digest)
    return digest


def _key() -> str:
    return cache.key_of("hashes of sources")


def _folder() -> str:
    """What tells caches apart."""
    return os.environ.get("STC_CACHE_DIR", "")


def _memory() -> _Memory:
    folder = _folder()
    found = _memories.get(folder)
    if found is None:
        found = _memories[folder] = _Memory(folder)
    return found
