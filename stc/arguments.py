"""Checks of the arguments of public functions; an invalid argument raises an error with a clear message."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from stc.errors import UsageError

__all__ = ["number", "numbers", "path", "same_file", "spare", "whole"]


def number(value: object, name: str) -> float:
    """An argument that must be a number.

    Args:
        name: name of the argument in the message.

    Raises:
        UsageError: it is not a number (text is not accepted either).
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
        UsageError: it is not a whole number.
    """
    found = number(value, name)
    if not found.is_integer():
        raise UsageError(f"{name} must be a whole number, not {value}")
    return int(found)


def path(value: object, name: str) -> str:
    """An argument that must be the path of a file.

    Raises:
        UsageError: it is none.
    """
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    raise UsageError(f"{name} must be a path, not {value!r}")


def same_file(one: str | os.PathLike[str], other: str | os.PathLike[str]) -> bool:
    """Whether two paths name the same existing file, also through links and different spellings."""
    try:
        return Path(one).samefile(other)
    except OSError:
        return False


def spare(
    target: str | os.PathLike[str], inputs: Iterable[tuple[str | os.PathLike[str], str]], option: str = ""
) -> None:
    """Refuse to overwrite an input file.

    Args:
        target: the file to write.
        inputs: input files, each with its description, such as ``the solution``.
        option: the option that named the target.

    Raises:
        UsageError: the target is one of them.
    """
    for known, what in inputs:
        if same_file(target, known):
            prefix = f"{option} " if option else ""
            raise UsageError(
                f"{prefix}{os.fspath(target)}: this would overwrite {what}",
                "choose another file name",
            )


def numbers(given: Mapping[str, object]) -> dict[str, float]:
    """The values of constants that the caller gives.

    Raises:
        UsageError: one that is not a number.
    """
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise UsageError(f"constants are numbers by name, not {given!r}")
    found = {}
    for name, value in given.items():
        try:
            found[name] = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise UsageError(f"the constant `{name}` needs a number, not {value!r}") from None
    return found
