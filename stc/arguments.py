"""Arguments of functions that users call: what is given is what it should be, or a message says which is not."""

from __future__ import annotations

import os

from stc.errors import UsageError

__all__ = ["number", "path", "whole"]


def number(value: object, name: str) -> float:
    """A number, of whatever kind.

    Args:
        name: what the message calls the argument.

    Raises:
        UsageError: it is none; text is none either.
    """
    try:
        if not isinstance(value, str | bytes):
            return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        pass
    raise UsageError(f"{name} must be a number, not {value!r}")


def whole(value: object, name: str) -> int:
    """As :func:`number`, for counts.

    Raises:
        UsageError: it is no whole number.
    """
    found = number(value, name)
    if not found.is_integer():
        raise UsageError(f"{name} must be a whole number, not {value}")
    return int(found)


def path(value: object, name: str) -> str:
    """The path of a file.

    Raises:
        UsageError: it is none.
    """
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    raise UsageError(f"{name} must be a path, not {value!r}")
