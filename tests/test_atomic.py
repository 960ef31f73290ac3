"""A file is written as a whole or not at all."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from stc.atomic import replacing


def test_what_was_written_takes_the_place_of_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "motion.csv"
    target.write_text("old")
    with replacing(target) as temporary:
        assert temporary.suffix == ".csv"  # by which libraries tell what to write
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("stopped", [KeyboardInterrupt, MemoryError, ValueError])
def test_a_write_that_is_stopped_leaves_what_was_there(stopped: type[BaseException], tmp_path: Path) -> None:
    kept, fresh = tmp_path / "kept.csv", tmp_path / "fresh.csv"
    kept.write_text("old")

    def stop(target: Path) -> None:
        with replacing(target) as temporary:
            temporary.write_text("half")
            raise stopped

    for target in (kept, fresh):
        with pytest.raises(stopped):
            stop(target)
    assert kept.read_text() == "old"
    assert list(tmp_path.iterdir()) == [kept]


def test_a_folder_that_is_missing_is_told_with_the_name_asked_for(tmp_path: Path) -> None:
    target = tmp_path / "nowhere" / "motion.csv"
    with pytest.raises(FileNotFoundError) as caught, replacing(target) as temporary:
        temporary.write_text("never")
    assert caught.value.filename == str(target)


class LibraryError(OSError):
    """A library's own, whose name cannot be set."""

    filename = property(lambda self: None)


@pytest.mark.parametrize("kind", [OSError, LibraryError])
def test_a_full_disk_is_told_with_the_name_asked_for(tmp_path: Path, kind: type[OSError]) -> None:
    target = tmp_path / "motion.mp4"
    with pytest.raises(OSError) as caught, replacing(target):
        raise kind(errno.ENOSPC, "No space left on device")
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(target))
    assert not list(tmp_path.iterdir())


def _process_that_is_gone() -> int:
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()
    return done.pid


def test_what_a_killed_process_left_is_swept_up_when_something_is_saved_next(tmp_path: Path) -> None:
    target = tmp_path / "motion.npz"
    kill = (
        "import os, signal\nfrom stc.atomic import replacing\n"
        f"with replacing({str(target)!r}) as temporary:\n"
        "    temporary.write_text('half')\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", kill], check=False)
    assert [path.suffix for path in tmp_path.iterdir()] == [".npz"] and not target.exists()
    with replacing(target) as temporary:
        temporary.write_text("whole")
    assert list(tmp_path.iterdir()) == [target]


def test_only_own_files_of_processes_that_are_gone_are_swept_up(tmp_path: Path) -> None:
    gone, here = _process_that_is_gone(), os.getpid()
    with replacing(tmp_path / "a.npz") as temporary:
        temporary.write_text("")
        where = temporary.name.split("-")[1].split(".")[0]
    kept = [
        f".b.{here}-{where}.tmp.npz",  # another thread's
        f".b.{os.getppid()}-{where}.tmp.npz",  # another process's
        f".b.{gone}-{int(where, 16) ^ 1:08x}.tmp.npz",  # another machine's
        f".b.{gone}.tmp.npz",
        f"b.{gone}-{where}.tmp.npz",
        "a.npz",
    ]
    for name in [*kept, f".b.{gone}-{where}.tmp.npz"]:
        (tmp_path / name).write_text("")
    with replacing(tmp_path / "a.npz") as temporary:
        temporary.write_text("")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(kept)
