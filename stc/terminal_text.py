"""Text for a terminal with control characters made visible."""

from __future__ import annotations

import re
from typing import Any, TextIO

#: Characters that a terminal acts on or that hide or turn around what stands beside them: controls but for the line
#: end and the tabulator, marks of direction, separators of lines that are none here, halves of characters (what Python
#: makes of bytes in a file name that are no text).
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)


def _spelled(found: re.Match[str]) -> str:
    code = ord(found[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def visible(text: str) -> str:
    """The text with every control or invisible character written as in ``\x1b``."""
    return _UNSEEN.sub(_spelled, text) if not text.isprintable() else text


class VisibleStream:
    """A stream for people: writes text to another stream after :func:`visible`.

    All other methods are those of the other stream.
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write the text to the stream; returns the number of its characters, all of them."""
        self.stream.write(visible(text))
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Write each of the lines."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def unfiltered(stream: Any) -> Any:
    """The unfiltered stream, for intended terminal controls."""
    return stream.stream if isinstance(stream, VisibleStream) else stream
