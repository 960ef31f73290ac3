"""A file is written as a whole or not at all."""

from __future__ import annotations

import errno
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
