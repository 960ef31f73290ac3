"""The command ``stc steer``: a spec steered by hand in a browser."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stc.bundled import is_solution
from stc.cli import console
from stc.cli.options import SolveOptions
from stc.cli.statuses import GOOD
from stc.errors import UsageError

if TYPE_CHECKING:
    from stc.steering.server import Server


def steer(
    spec: str, options: SolveOptions, port: int | None, output: str | None, *, native: bool = False
) -> int:
    """Serve the page, or open a window, until Ctrl-C.

    Raises:
        UsageError: a port that cannot be listened on, a file that is not to be written over, nothing to steer.
        UnsolvedError: the spec has no motion to begin with.
        DisplayError: there is no display for a window.
    """
    from stc.pipeline import read_source
    from stc.viewer.addresses import LOOPBACK, require_address

    if is_solution(spec):
        raise UsageError(
            f"`{spec}` is a solution, and what is steered is a spec",
            "name the spec that it was solved from; `stc view` shows a solution",
        )
    if native:
        from stc.viewer.windows import require_display

        if port is not None:
            raise UsageError("--port is of the page, and --native opens a window")
        require_display()
    if port is not None:
        if not 0 <= port < 65536:
            raise UsageError(f"--port must lie between 0 and 65535, not {port}")
        require_address(LOOPBACK, port)
    source = read_source(spec)
    target = _target(spec, source.written, output)
    from stc.steering.server import Server
    from stc.steering.session import Session

    server: Server | None = None

    def told() -> None:
        if server is not None:
            server.told()

    session = Session(
        source,
        options.constants,
        target=target,
        told=told,
        method=options.method,
        time_limit=options.time_limit,
    )
    try:
        if native:
            from stc.steering.native import open_window

            open_window(session)
        else:
            server = Server(session)
            asyncio.run(server.run(port, _tell))
    except KeyboardInterrupt:
        pass
    finally:
        session.close()
    if session.changes():
        console.note("what was steered last is not written into the spec")
    return GOOD


def _target(spec: str, text: str, output: str | None) -> Path:
    """The file that is written: that of ``-o``, the spec itself, or for a bundled one a file of its name here."""
    own = Path(spec)
    if output is None and own.is_file():
        return own
    target = Path(output if output is not None else f"{own.stem}.stc")
    if target.exists():
        try:
            same = target.read_text(encoding="utf-8") == text
        except (OSError, UnicodeDecodeError):
            same = False
        if not same:
            raise UsageError(
                f"{target} is there already and holds another text than `{spec}`",
                "name another file with -o, or steer that one",
            )
    if not target.parent.is_dir():
        raise UsageError(f"there is no folder {target.parent} to write {target.name} into")
    return target


def _tell(address: str) -> None:
    print(f"steering at {address} until Ctrl-C", file=sys.stderr, flush=True)
