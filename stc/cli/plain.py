"""An ordinary ``stc solve``, read without the option parser.

Importing the parser's library takes as long as solving a small spec.  Command lines that are read here have the same
meaning; all others (another command, help, a mistake, a value that looks like an option) are left to the parser.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

#: Options that take a value, with the parameter of :func:`solve` that they set and what reads their text.
VALUES: dict[str, tuple[str, Callable[[str], Any]]] = {
    "--method": ("method", str),
    "--max-iterations": ("max_iterations", int),
    "--time-limit": ("time_limit", float),
    "--tolerance": ("tolerance", float),
    "--optimizer": ("optimizer", str),
    "--warm-start": ("warm_start", str),
    "--guess-from": ("guess_from", str),
    "--continue": ("walk", str),
    "--starts": ("starts", int),
    "--seed": ("seed", int),
    "--workers": ("workers", int),
    "--refine": ("refine", float),
    "--threads": ("threads", int),
    "-o": ("output", str),
    "--output": ("output", str),
}
#: The option that may be given several times.
SETTING = "--set"
FLAGS = {"--explain": "explain", "--direct": "direct", "--profile": "profile", "--json": "json"}

Arguments = dict[str, Any]


def read(words: Sequence[str]) -> Arguments | None:
    """The options of an ordinary ``stc solve``; None for command lines that are left to the parser.

    That is ``spec``, ``json`` where it is wanted, and arguments of :func:`stc.cli.options.solve_options`.

    Args:
        words: those after ``stc``.
    """
    if not words or words[0] != "solve":
        return None
    found: Arguments = {}
    settings: list[str] = []
    rest = iter(words[1:])
    for word in rest:
        if not word.startswith("-"):
            if "spec" in found:
                return None
            found["spec"] = word
        elif word in FLAGS:
            found[FLAGS[word]] = True
        else:
            name, equals, value = word.partition("=")
            if (name not in VALUES and name != SETTING) or (equals and not name.startswith("--")):
                return None
            if not equals:
                value = next(rest, "-")
            if not value or value.startswith("-"):
                return None
            if name == SETTING:
                settings.append(value)
                continue
            parameter, reader = VALUES[name]
            try:
                found[parameter] = reader(value)
            except ValueError:
                return None
    if settings:
        found["settings"] = settings
    return found if "spec" in found else None
