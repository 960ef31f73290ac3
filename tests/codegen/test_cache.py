"""The object cache: damage, concurrent writers, unwritable directories, its size."""

from __future__ import annotations

import multiprocessing
import os
import time
from pathlib import Path

import pytest

from stc.codegen import cache


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache directory."""
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path / "objects"))
    return tmp_path / "objects"


def test_what_is_stored_is_loaded(folder: Path) -> None:
    key = cache.key_of("a", "b")
    assert cache.load(key) is None
    assert cache.store(key, b"machine code")
    assert cache.load(key) == b"machine code"
    assert [path.suffix for path in folder.iterdir()] == [".stco"]


def test_keys_keep_their_parts_apart() -> None:
    assert cache.key_of("ab", "c") != cache.key_of("a", "bc")
    assert cache.key_of("a") != cache.key_of("a", "")
    assert cache.key_of("a", "b") == cache.key_of("a", "b")


@pytest.mark.parametrize("damage", ["flip", "cut", "empty", "header", "text"])
def test_damage_is_as_good_as_absence(folder: Path, damage: str) -> None:
    key = cache.key_of("damaged")
    cache.store(key, bytes(range(256)) * 10)
    (path,) = folder.iterdir()
    content = bytearray(path.read_bytes())
    if damage == "flip":
        content[-7] ^= 1
    elif damage == "cut":
        del content[-100:]
    elif damage == "empty":
        content.clear()
    elif damage == "header":
        content[0] ^= 1
    else:
        content[:] = b"not an object"
    path.write_bytes(content)
    assert cache.load(key) is None
    assert cache.store(key, b"again")
    assert cache.load(key) == b"again"


def test_unusable_directories_are_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path / "file"))
    assert not cache.store(cache.key_of("x"), b"code")
    assert cache.load(cache.key_of("x")) is None
    cache.prune(0)


def test_failed_write_leaves_nothing_behind(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path, target: Path) -> Path:
        raise PermissionError(str(target))

    monkeypatch.setattr(Path, "replace", refuse)
    assert not cache.store(cache.key_of("x"), b"code")
    assert list(folder.iterdir()) == []


def test_directory_follows_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("STC_CACHE_DIR", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.directory() == tmp_path / "stc"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache.directory() == tmp_path / "home" / ".cache" / "stc"
    monkeypatch.setattr("sys.platform", "darwin")
    assert cache.directory() == tmp_path / "home" / "Library" / "Caches" / "stc"
    monkeypatch.setattr("sys.platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert cache.directory() == tmp_path / "local" / "stc"


def test_nobody_home(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("STC_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr(Path, "home", homeless)
    assert cache.directory() is None
    assert not cache.store(cache.key_of("x"), b"code")
    assert cache.load(cache.key_of("x")) is None
    cache.prune(0)


def test_least_recently_used_objects_go_first(folder: Path) -> None:
    keys = [cache.key_of(str(k)) for k in range(4)]
    for age, key in enumerate(keys):
        cache.store(key, bytes(1000))
        os.utime(folder / f"{key}.stco", (time.time() - 1000 + age,) * 2)
    assert cache.load(keys[0]) is not None  # now the most recently used
    cache.prune(2500)
    assert [cache.load(key) is not None for key in keys] == [True, False, False, True]


def test_stale_temporary_files_go_too(folder: Path) -> None:
    cache.store(cache.key_of("x"), b"code")
    old, new = folder / "new-old.tmp", folder / "new-new.tmp"
    old.write_bytes(b"half")
    new.write_bytes(b"half")
    os.utime(old, (time.time() - 7200,) * 2)
    cache.prune(1 << 30)
    assert not old.exists()
    assert new.exists()


def _write_many(folder: str, seed: int) -> None:
    os.environ["STC_CACHE_DIR"] = folder
    for k in range(60):
        key = cache.key_of(str(k % 5))
        cache.store(key, bytes([k % 5]) * 20000)
        content = cache.load(key)
        if content is not None and content != bytes([k % 5]) * 20000:
            os._exit(1)


def test_concurrent_writers(folder: Path) -> None:
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write_many, args=(str(folder), seed)) for seed in range(2)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0, 0]
    assert len(list(folder.iterdir())) == 5
