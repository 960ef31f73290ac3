"""Messages of a command that has no result, on standard error and in JSON if requested."""

from __future__ import annotations

import sys
from contextlib import suppress

from stc.cli import guard, record
from stc.cli.statuses import BAD
from stc.errors import EvaluationError, SpecError, StcError

#: Said where the time limit ends a command that has not begun to solve.
BEFORE_THE_SOLVE = (
    "the time limit was reached before the solve began, so that there is nothing to save: reading a spec, deriving its "
    "equations and compiling them count as well; raise --time-limit"
)


def ended(status: str) -> int:
    """End a command without a result; returns its exit status."""
    guard.settle()
    say_ended(status)
    return BAD


def say_ended(status: str) -> None:
    """Print that a command was ended without a result."""
    words = {"time_limit": BEFORE_THE_SOLVE}
    say("--json" in sys.argv, status, words.get(status, status))


def report(as_json: bool, status: str, message: str, code: int, error: StcError | None = None) -> int:
    """Print an error on standard error and, if requested, a JSON object on standard output."""
    guard.settle()
    say(as_json, status, message, error)
    return code


def say(as_json: bool, status: str, message: str, error: StcError | None = None) -> None:
    """Print an error, as :func:`report` does."""
    has_place = isinstance(error, SpecError | EvaluationError)
    text = message if has_place or message.startswith("stc ") else f"stc: {message}"
    print(text, file=sys.stderr)
    if as_json:
        with suppress(OSError):  # where standard output is what failed, it is told of above
            record.put(record.of_failure(status, message, error))
