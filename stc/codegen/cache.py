"""Object code on disk, found again by content hash.

Any number of processes may read and write at once: a file appears complete or not at all (temporary file,
then :func:`os.replace`), carries a checksum, and is treated as absent when that does not match.  A directory
that cannot be written costs nothing but the time to compile again.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
import tempfile
from pathlib import Path

_MAGIC = b"stc-object-1\n"
_SUFFIX = ".stco"
#: Least recently used objects are deleted when their sum exceeds this many bytes.
SIZE_LIMIT = 512 * 1024 * 1024


def directory() -> Path:
    """Where objects live: ``STC_CACHE_DIR``, else the platform's cache directory for this user."""
    chosen = os.environ.get("STC_CACHE_DIR")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or os.path.expanduser(r"~\AppData\Local")
    elif sys.platform == "darwin":
        base = os.path.expanduser("~/Library/Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or ""
        if not os.path.isabs(base):  # the XDG specification: relative paths are to be ignored
            base = os.path.expanduser("~/.cache")
    return Path(base) / "stc"


def key_of(*parts: str) -> str:
    """Hash of everything the object depends on; parts are kept apart, so ("ab", "c") is not ("a", "bc")."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode()
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def load(key: str) -> bytes | None:
    """Object code stored under ``key``; None when absent, unreadable or damaged."""
    path = directory() / (key + _SUFFIX)
    try:
        content = path.read_bytes()
    except OSError:
        return None
    header = len(_MAGIC) + 32
    code = content[header:]
    if content[: len(_MAGIC)] != _MAGIC or hashlib.sha256(code).digest() != content[len(_MAGIC) : header]:
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # most recently used
    return code


def store(key: str, code: bytes) -> bool:
    """Store object code; returns whether it could be written."""
    folder = directory()
    temporary: str | None = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=folder, prefix="new-", suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            file.write(_MAGIC + hashlib.sha256(code).digest() + code)
        os.replace(temporary, folder / (key + _SUFFIX))
    except OSError:
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
        return False
    prune(SIZE_LIMIT)
    return True


def prune(limit: int) -> None:
    """Delete least recently used objects until at most ``limit`` bytes remain; never raises."""
    entries: list[tuple[float, int, str]] = []
    try:
        with os.scandir(directory()) as listing:
            for entry in listing:
                if entry.name.endswith(_SUFFIX):
                    with contextlib.suppress(OSError):
                        status = entry.stat()
                        entries.append((status.st_mtime, status.st_size, entry.path))
    except OSError:
        return
    excess = sum(size for _, size, _ in entries) - limit
    if excess <= 0:
        return
    for _, size, path in sorted(entries):
        with contextlib.suppress(OSError):
            os.unlink(path)
        excess -= size
        if excess <= 0:
            return
