"""The command line of a process: start, run the command, turn errors into messages, and end."""

from __future__ import annotations

import atexit
import gc
import math
import os
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from itertools import zip_longest
from typing import NoReturn, TextIO, cast

from stc import deadline
from stc.cli import guard, statuses
from stc.cli.messages import ended, report, say_ended
from stc.cli.statuses import BAD, GOOD, MISTAKE
from stc.errors import EndedError, SpecError, StcError, UnsolvedError
from stc.memory import stay_within_memory
from stc.terminal_text import VisibleStream

__all__ = ["main", "run"]

#: What the parser of options makes of Ctrl-C, which it catches; no command ends with this status.
_CAUGHT_INTERRUPT = 130

#: So many mistakes of a spec are shown.
MOST_MISTAKES = 20

#: New objects between two searches for unreachable cycles.  Python's own 700 mean hundreds of searches during a
#: start, which find nothing: 10 ms.
_COLLECT_EVERY = 100_000

#: Who decides how many threads NumPy's products of matrices take; none are large here, and to start the threads takes
#: as much processor time as a short solve.
_MATRIX_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")


def main() -> NoReturn:
    """The console script: run the command line of this process and exit."""
    statuses.owns_process = True
    gc.set_threshold(_COLLECT_EVERY, 20, 20)
    stay_within_memory()
    _stand_in_for_closed_streams()
    if not any(name in os.environ for name in _MATRIX_THREADS):  # NumPy is not imported yet
        os.environ[_MATRIX_THREADS[0]] = "1"
    if sys.argv[1:2] != ["view"]:  # its window is open until somebody closes it, and Ctrl-C does
        guard.start(ended, say_ended)
    _leave(run(sys.argv[1:]))


def _obey_limit(arguments: Sequence[str]) -> None:
    """Start the limit of a command with ``--time-limit`` before imports and other options are read.

    An invalid limit is refused when the options are read.
    """
    if arguments[:1] in (["view"], ["new"]):  # whose limits are for each of their solves
        return
    for word, after in zip_longest(arguments, arguments[1:], fillvalue=""):
        name, equals, value = word.partition("=")
        if name == "--time-limit":
            with suppress(ValueError):
                seconds = float(value if equals else after)
                if seconds > 0.0:
                    guard.limit(
                        seconds, deadline.process_began() if statuses.owns_process else time.perf_counter()
                    )


def _stand_in_for_closed_streams() -> None:
    """Replace standard streams that were closed before the start (``stc solve hop >&-``) by streams that discard
    output.

    Python has None there, and files that are opened would get their descriptors, including the file of the solution.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))


def _leave(status: int) -> NoReturn:
    """End the process without destroying every object, which would take a fifth of a short solve.

    Functions registered for exit are run, and threads that Python would wait for are waited for.
    """
    if any(not t.daemon and t is not threading.main_thread() for t in threading.enumerate()):
        sys.exit(status)
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:  # nobody reads any more
        pass
    os._exit(status)


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit status; no exception is raised.

    Args:
        arguments: the words after ``stc``.
    """
    statuses.ended_by = 0
    deadline.begin(math.inf)
    _obey_limit(arguments)
    streams = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, VisibleStream(stream)) for stream in streams)
    try:
        status = _carried_out(arguments)
        guard.settle()
    finally:
        sys.stdout, sys.stderr = streams
    return statuses.of_process(status)


def _carried_out(arguments: Sequence[str]) -> int:
    as_json = "--json" in arguments
    try:
        from stc.cli import plain

        told = plain.read(arguments)
        if told is not None:
            from stc.cli.jobs import solve
            from stc.cli.options import solve_options

            spec, json = told.pop("spec"), told.pop("json", False)
            status = solve(spec, solve_options(**told), as_json=json)
        else:
            from stc.cli.app import app_for

            status = app_for(arguments)(args=list(arguments), prog_name="stc", standalone_mode=False)
            if status == _CAUGHT_INTERRUPT:
                raise KeyboardInterrupt
        sys.stdout.flush()
        return status if isinstance(status, int) else GOOD
    except BrokenPipeError:
        # The reader has left (`stc list | head -1`).  Python would complain again when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BAD
    except KeyboardInterrupt:
        return report(as_json, "interrupted", "interrupted", BAD)
    except SystemExit as exit_:
        return exit_.code if isinstance(exit_.code, int) else BAD
    except EndedError as error:
        return report(as_json, error.status, str(error), BAD)
    except SpecError as error:
        return report(as_json, "error", _mistakes(error), MISTAKE, error)
    except UnsolvedError as error:
        if error.status == "interrupted":
            return report(as_json, "interrupted", "interrupted", BAD)
        return report(as_json, error.status, str(error), BAD, error)
    except StcError as error:
        return report(as_json, "error", str(error), MISTAKE, error)
    except RecursionError:
        return report(
            as_json,
            "error",
            "expressions are nested too deep: use fewer definitions within definitions",
            MISTAKE,
        )
    except MemoryError:
        return report(as_json, "failed", _NO_MEMORY, BAD)
    except OSError as error:
        if error.errno is None:
            return _unexpected(as_json, error)
        where = f"{error.filename}: " if error.filename is not None else ""
        return report(as_json, "error", f"{where}{error.strerror or error}", MISTAKE)
    except Exception as error:
        # Wrong usage of a command: the parser has several classes for it, which all know how to say so.
        if hasattr(error, "format_message"):
            return report(as_json, "error", _usage(error), MISTAKE)
        if isinstance(error, ImportError) and "failed to map segment" in str(error):  # the loader says so
            return report(as_json, "failed", _NO_MEMORY, BAD)
        if type(error).__module__.partition(".")[0] == "mujoco":  # which is not imported for its exceptions
            return report(as_json, "failed", f"MuJoCo failed: {' '.join(str(error).split())}", BAD)
        return _unexpected(as_json, error)


_NO_MEMORY = "there is not enough memory for this: use fewer frames, samples or workers"


def _mistakes(error: SpecError) -> str:
    """The mistakes of a spec, up to a maximum number, with a remark if the file may not be a spec."""
    text = error.shown(MOST_MISTAKES)
    span = error.diagnostics[0].span if error.diagnostics else None
    if len(error.diagnostics) > MOST_MISTAKES and span is not None and span.source.path is not None:
        if not span.source.path.endswith(".stc"):
            text += (
                f"\n`{span.source.name}` may not be a spec: specs are .stc files; `stc new NAME` writes one"
            )
    return text


def _usage(error: Exception) -> str:
    """The message of the option parser, with a pointer to the help of the command."""
    context = getattr(error, "ctx", None)
    message = error.format_message()  # type: ignore[attr-defined]
    command = context.command_path if context is not None else "stc"
    return f"{message}\n  `{command} --help` lists its arguments and options"


def _unexpected(as_json: bool, error: Exception) -> int:
    """A defect of the program itself: one line, and the traceback only on request."""
    if os.environ.get("STC_DEBUG"):
        import traceback

        traceback.print_exc()
    what = " ".join(f"{type(error).__name__}: {error}".split())
    return report(
        as_json,
        "failed",
        f"stc itself failed ({what}). Please report it with the spec and the command; "
        "with STC_DEBUG=1 it shows where.",
        BAD,
    )
