"""Hashes of source files: of what is in them, whether or not they are remembered."""

from __future__ import annotations

import os
import time
from hashlib import blake2b
from pathlib import Path

import pytest

from stc.codegen import cache, sources


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """A cache of its own, and the files that are read."""
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path / "cache"))
    read: list[Path] = []
    original = Path.read_bytes

    def noted(path: Path) -> bytes:
        if path.suffix == ".py":
            read.append(path)
        return original(path)

    monkeypatch.setattr(Path, "read_bytes", noted)
    return read


def new_process(keep: bool = True) -> None:
    """What a process does at its end, and another one knows at its beginning."""
    if keep:
        for memory in sources._memories.values():
            if memory.known:
                memory.keep()
    sources._memories.clear()


def settled(path: Path) -> None:
    """As if the file had been written long ago, by what can be set."""
    past = time.time() - 1000.0
    os.utime(path, (past, past))


def hash_of(text: str) -> str:
    return blake2b(text.encode(), digest_size=32).hexdigest()


def test_a_file_that_stays_what_it_is_is_read_once(
    tmp_path: Path, own_cache: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sources, "SETTLED", -1)
    path = tmp_path / "a.py"
    path.write_text("x = 1\n")
    for _ in range(3):
        assert sources.digest_of(str(path)) == hash_of("x = 1\n")
        new_process()
    assert own_cache == [path]


def test_a_file_that_changes_is_read_again(
    tmp_path: Path, own_cache: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where its size and the time at which it was written are as before."""
    monkeypatch.setattr(sources, "SETTLED", -1)
    path = tmp_path / "a.py"
    path.write_text("x = 1\n")
    settled(path)
    before = path.stat()
    sources.digest_of(str(path))
    new_process()
    time.sleep(0.05)  # a tick of the clock that the system writes
    path.write_text("x = 2\n")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = path.stat()
    assert (before.st_mtime_ns, before.st_size) == (after.st_mtime_ns, after.st_size)
    assert sources.digest_of(str(path)) == hash_of("x = 2\n")


def test_what_was_written_a_moment_ago_is_not_remembered(tmp_path: Path, own_cache: list[Path]) -> None:
    path = tmp_path / "a.py"
    path.write_text("x = 1\n")
    settled(path)  # the change of the time is itself one
    for _ in range(2):
        assert sources.digest_of(str(path)) == hash_of("x = 1\n")
        new_process()
    assert own_cache == [path, path]


@pytest.mark.parametrize("kept", [b"nonsense", b"", b"i\x01\x00\x00\x00"])
def test_a_memory_of_another_kind_is_left_aside(tmp_path: Path, kept: bytes) -> None:
    cache.store(sources._key(), kept)
    path = tmp_path / "a.py"
    path.write_text("x = 1\n")
    sources._memories.clear()
    assert sources.digest_of(str(path)) == hash_of("x = 1\n")


def test_only_so_many_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "SETTLED", -1)
    monkeypatch.setattr(sources, "MOST", 3)
    paths = [tmp_path / f"{name}.py" for name in "abcde"]
    for path in paths:
        path.write_text(f"# {path.name}\n")
        sources.digest_of(str(path))
    new_process()
    assert list(sources._memory().known) == [str(path) for path in paths[-3:]]


def test_a_file_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="none"):
        sources.digest_of(str(tmp_path / "none.py"))
