"""Reading the text of a spec from a file."""

from __future__ import annotations

import os
from pathlib import Path

from stc.errors import Source, UsageError


def read_source(path: str | os.PathLike[str]) -> Source:
    """The text of a file, UTF-8 (with or without a byte order mark).

    Raises:
        UsageError: the file is missing, unreadable or no UTF-8 text.
    """
    name = os.fspath(path)
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise UsageError(f"there is no file `{name}`") from None
    except IsADirectoryError:
        raise UsageError(f"`{name}` is a directory, not a spec") from None
    except (OSError, ValueError) as error:
        raise UsageError(f"`{name}` cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise UsageError(f"`{name}` is not UTF-8 text (line {line})") from None
    return Source(name, text.replace("\r\n", "\n"), name)


def source_of_text(text: str, name: str = "<text>") -> Source:
    """A source for a spec that is given as a string."""
    return Source(name, text)
