"""Object code on disk, found again by content hash.

Any number of processes may read and write at once: a file appears complete or not at all (temporary file,
then :func:`os.replace`), carries a checksum, and is treated as absent when that does not match.  A directory
that cannot be written costs nothing but the time to compile again.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from hashlib import blake2b
from pathlib import Path

_MAGIC = b"stc-object-2\n"
SUFFIX = ".stco"
_TEMPORARY = ".tmp"
#: Least recently used objects are deleted when their sum exceeds this many bytes.
SIZE_LIMIT = 512 * 1024 * 1024


def directory() -> Path | None:
    """Where objects live: ``STC_CACHE_DIR``, else the user's cache directory; None without a home."""
    chosen = os.environ.get("STC_CACHE_DIR")
    if chosen:
        return Path(chosen)
    base: Path | None = None
    try:
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA")
            base = Path(local) if local else Path.home() / "AppData" / "Local"
        elif sys.platform == "darwin":
            base = Path.home() / "Library" / "Caches"
        else:
            base = Path(os.environ.get("XDG_CACHE_HOME") or "")
            if not base.is_absolute():  # the XDG specification: relative paths are to be ignored
                base = Path.home() / ".cache"
    except RuntimeError:  # no home directory
        return None
    return base / "stc"


def key_of(*parts: str) -> str:
    """Hash of everything the object depends on; parts are kept apart, so ("ab", "c") is not ("a", "bc")."""
    digest = blake2b(digest_size=32)
    for part in parts:
        data = part.encode()
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def load(key: str) -> bytes | None:
    """Object code stored under ``key``; None when absent, unreadable or damaged."""
    folder = directory()
    if folder is None:
        return None
    path = f"{folder}/{key}{SUFFIX}"
    try:
        with open(path, "rb", buffering=0) as file:  # noqa: PTH123 (Path.read_bytes takes three times as long)
            content = file.read()
    except OSError:
        return None
    header = len(_MAGIC) + 32
    code = content[header:]
    if content[:header] != _MAGIC + blake2b(code, digest_size=32).digest():
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # most recently used
    return code


def store(key: str, code: bytes) -> bool:
    """Store object code; returns whether it could be written."""
    import tempfile  # takes longer to import than to find what is kept

    folder, temporary = directory(), None
    if folder is None:
        return False
    try:
        # Machine code is executed as it is read: nobody else may write here.
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=folder, prefix="new-", suffix=_TEMPORARY)
        temporary = Path(name)
        with os.fdopen(handle, "wb") as file:
            file.write(_MAGIC + blake2b(code, digest_size=32).digest() + code)
        temporary.replace(folder / (key + SUFFIX))
    except OSError:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink()
        return False
    prune(SIZE_LIMIT)
    return True


def prune(limit: int) -> None:
    """Delete least recently used objects until at most ``limit`` bytes remain; never raises.

    Temporary files that a writer left behind when it died are deleted too, once they are an hour old.
    """
    folder = directory()
    if folder is None:
        return
    entries: list[tuple[float, int, str]] = []  # a Path takes long to make, and few are deleted
    try:
        with os.scandir(folder) as listing:
            for entry in listing:
                with contextlib.suppress(OSError):
                    status = entry.stat()
                    if entry.name.endswith(SUFFIX):
                        entries.append((status.st_mtime, status.st_size, entry.path))
                    elif entry.name.endswith(_TEMPORARY) and time.time() - status.st_mtime > 3600.0:
                        Path(entry.path).unlink()
    except OSError:
        return
    excess = sum(size for _, size, _ in entries) - limit
    for _, size, path in sorted(entries):
        if excess <= 0:
            return
        with contextlib.suppress(OSError):
            Path(path).unlink()
        excess -= size
