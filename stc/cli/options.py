"""The options of the commands, and checks that the option parser cannot make."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from stc.bundled import SOLUTION_SUFFIXES, is_solution
from stc.cli.inputs import names_a_constant, number
from stc.cli.searches import Search, search_options
from stc.errors import UsageError
from stc.records import dataclass, field


@dataclass(frozen=True, slots=True)
class SolveOptions:
    """The user's options of one solve; None leaves the choice to the spec or the solver."""

    constants: dict[str, float]
    method: str | None = None
    max_iterations: int | None = None
    time_limit: float | None = None
    tolerance: float | None = None
    warm_start: Path | None = None
    output: Path | None = None
    optimizer: str | None = None
    explain: bool = False
    search: Search = field(default_factory=Search)
    profile: bool = False
    direct: bool = False
    threads: int | None = None


def solve_options(
    settings: Sequence[str] | None = None,
    method: str | None = None,
    max_iterations: int | None = None,
    time_limit: float | None = None,
    tolerance: float | None = None,
    warm_start: str | None = None,
    output: str | None = None,
    optimizer: str | None = None,
    explain: bool = False,
    profile: bool = False,
    direct: bool = False,
    threads: int | None = None,
    **searching: Any,
) -> SolveOptions:
    """Check the options of one solve, and of the search around it, before any work is done.

    Raises:
        UsageError: an invalid value, or a file that is missing or cannot be written.
    """
    if method is not None:
        from stc.trajectory import require_method

        require_method(method)
    if max_iterations is not None and max_iterations < 0:
        raise UsageError(f"--max-iterations must be at least 0, not {max_iterations}")
    if time_limit is not None and not time_limit > 0:
        raise UsageError(f"--time-limit must be a positive number of seconds, not {time_limit:g}")
    if tolerance is not None:
        from stc.solver.options import check_tolerance

        check_tolerance(tolerance, "--tolerance")
    if threads is not None and threads < 1:
        raise UsageError(f"--threads must be at least 1, not {threads}")
    if optimizer is not None:
        from stc.optimizers import optimizer_of

        optimizer_of(optimizer)
    if profile and optimizer not in (None, "sqp"):
        raise UsageError(f"--profile works with the optimizer sqp, not with {optimizer}")
    search = search_options(warm_start, **searching)
    if profile and search.workers > 1:
        raise UsageError("--profile measures this process and cannot be used with --workers")
    given = constants(settings)
    if search.walk is not None and search.walk.name in given:
        raise UsageError(f"--set and --continue both give values to {search.walk.name}: give one of them")
    return SolveOptions(
        given,
        method,
        max_iterations,
        time_limit,
        tolerance,
        None if warm_start is None else existing_solution(warm_start, "--warm-start"),
        None if output is None else writable_solution(output),
        optimizer,
        explain,
        search,
        profile,
        direct,
        threads,
    )


def constants(settings: Sequence[str] | None) -> dict[str, float]:
    """The constants given with ``--set``; of two values for one name the later one wins.

    Raises:
        UsageError: no ``name=value``, or a value that is not a number.
    """
    found: dict[str, float] = {}
    for setting in settings or ():
        name, equals, value = setting.partition("=")
        name = name.strip()
        if not equals or not names_a_constant(name) or not value.strip():
            raise UsageError(
                f"--set wants NAME=VALUE, not `{setting}`", "for example: --set g=1.62 --set h=1/30"
            )
        found[name] = number(value, f"--set {setting}")
    return found


def existing_solution(name: str, option: str = "") -> Path:
    """The path of an existing solution file.

    Raises:
        UsageError: it is missing, or of another kind.
    """
    path = Path(name)
    prefix = f"{option}: " if option else ""
    if not is_solution(name):
        raise UsageError(
            f"{prefix}`{name}` is not a solution: those are {' or '.join(SOLUTION_SUFFIXES)} files"
        )
    if not path.is_file():
        raise UsageError(f"{prefix}there is no file `{name}`")
    return path


def writable_page(name: str) -> Path:
    """The path for a certificate.

    Raises:
        UsageError: the suffix is not ``.html``, or the path is a folder.
    """
    path = Path(name)
    if path.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"--report {name}: a certificate is a page: *.html")
    return ready_to_write(path, "--report")


def writable_solution(name: str) -> Path:
    """The path for a solution; missing folders are created.

    Raises:
        UsageError: the suffix is unknown, or something is in the way.
    """
    path = Path(name)
    if not is_solution(name):
        raise UsageError(
            f"-o {name}: a solution is saved as {' or '.join('*' + s for s in SOLUTION_SUFFIXES)}"
        )
    return ready_to_write(path)


def ready_to_write(path: Path, option: str = "-o", tell: bool = True) -> Path:
    """Check a path that an option names; missing folders are created, with a note.

    Raises:
        UsageError: something is in the way.
    """
    if path.is_dir():
        raise UsageError(f"{option} {path}: that is a folder")
    try:
        if not path.parent.is_dir():
            path.parent.mkdir(parents=True, exist_ok=True)
            if tell:
                print(f"note: made the folder {path.parent}", file=sys.stderr)
    except OSError as error:
        raise UsageError(f"{option} {path}: {error.strerror or error}") from None
    if not os.access(path.parent, os.W_OK):
        raise UsageError(f"{option} {path}: nothing can be written to the folder `{path.parent}`")
    return path
