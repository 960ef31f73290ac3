"""The command ``stc view``: a motion in one of MuJoCo's windows."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stc.bundled import is_solution
from stc.cli import console, jobs
from stc.cli.inputs import load
from stc.cli.options import SolveOptions, writable_solution
from stc.cli.statuses import BAD, GOOD
from stc.errors import OWN_MODEL, StcError, UsageError
from stc.records import dataclass

if TYPE_CHECKING:
    from stc.solution import Solution
    from stc.viewer.player import Player


@dataclass(frozen=True, slots=True)
class Window:
    """The window of a motion.

    Attributes:
        web: whether it is shown in a browser.
        host: address on which the page is served.
        port: port of the page; 0 takes the first free one from 8080 on.
        tracked: show MuJoCo's run with feedback first.
        speed: share of real time.
    """

    web: bool = False
    host: str | None = None
    port: int | None = None
    tracked: bool = False
    speed: float = 1.0


def view(target: str, options: SolveOptions, window: Window, *, live: bool) -> int:
    """Show a saved motion, or the solution of a spec; with ``live`` during the solve.

    Raises:
        UsageError: options that do not go together, an address that cannot be listened on.
        DisplayError: there is nothing to open a window on.
    """
    _check(target, window, live)
    if live:
        return _live(target, options, window)
    outcome, motion = jobs.to_show(
        target, options, False, "there are no bodies to show", "`stc plot` draws its variables over time"
    )
    if not is_solution(target):
        outcome.show()
    if outcome.solution.status != "optimal":
        console.note(f"the solve ended {outcome.solution.status}: the motion shown is not a solution")
    beside = [motion.parent] if isinstance(motion, Path) else []
    player = _player(outcome.solution, beside, window)
    from stc.viewer.tweaks import session_for

    try:
        player.tweaks = session_for(outcome.solution)
    except StcError as error:
        console.note(f"constants cannot be changed: {error}")
    _open(player, window, options.output)
    return GOOD if outcome.solution.status == "optimal" else BAD


def _check(target: str, window: Window, live: bool) -> None:
    """Refuse options that contradict each other, and a window that cannot be opened, before anything is solved.

    Raises:
        UsageError: with the option, or with what is missing.
    """
    from stc.viewer.addresses import LOOPBACK, is_loopback, require_address
    from stc.viewer.windows import require_display, studio_is_there

    if live and is_solution(target):
        raise UsageError(f"--live shows a solve, and `{target}` is solved already")
    if not window.speed > 0.0:
        raise UsageError(f"--speed must be positive, not {window.speed:g}")
    if not window.web:
        for option, value in (("--host", window.host), ("--port", window.port)):
            if value is not None:
                raise UsageError(f"{option} can only be used with --web")
        require_display()
        return
    if not studio_is_there():
        raise UsageError("--web needs MuJoCo's Studio, which is missing here", "pip install mujoco-studio")
    if window.port is not None and not 0 <= window.port < 65536:
        raise UsageError(f"--port must lie between 0 and 65535, not {window.port}")
    host = window.host or LOOPBACK
    require_address(host, window.port or 0)
    if not is_loopback(host):
        console.note(
            f"the page is served on {host}, without any authentication or encryption: whoever reaches it can watch, "
            "turn and stop this, and see its messages"
        )


def _live(target: str, options: SolveOptions, window: Window) -> int:
    """Show a solve in progress, and save its result."""
    from stc.cli.keeping import keep_inputs, keep_optimal
    from stc.optimizers import DEFAULT
    from stc.viewer.live import LiveSolve

    model = load(target, options.constants)
    if model.problem(options.method).model is None:
        raise UsageError(
            f"{model.name} has no `replay:` section that names a model to show it with",
            OWN_MODEL,
        )
    file = options.output or writable_solution(f"{model.name}.npz")
    keep_inputs(file, model)

    def keep(solution: Solution) -> None:
        keep_optimal(file, solution.status)
        solution.save(file)

    solve = LiveSolve(
        model,
        keep=keep,
        method=options.method,
        tolerance=options.tolerance,
        max_iterations=options.max_iterations,
        time_limit=options.time_limit,
        warm_start=options.warm_start,
        optimizer=options.optimizer or DEFAULT,
    )
    solve.start()
    try:
        solve.wait_for_motion()
        if solve.iterate is not None:
            player = _player(solve.iterate, [], window)
            player.live = solve
            _open(player, window, options.output)
    finally:
        solve.stop()
    solve.wait()
    if solve.error is not None:
        raise solve.error
    assert solve.solution is not None
    console.show_solution(solve.solution, file)
    return GOOD if solve.solution.status == "optimal" else BAD


def _player(solution: Solution, beside: list[Path], window: Window) -> Player:
    from stc.viewer.player import Player

    player = Player.of(solution, beside)
    player.options.tracked = window.tracked
    player.timeline.speed = window.speed
    return player


def _open(player: Player, window: Window, output: Path | None) -> None:
    """Open the window and stay until it is closed."""
    from stc.viewer import addresses, windows
    from stc.viewer.panel import Panel

    def save() -> str:
        path = output or Path(f"{player.solution.name}.npz")
        try:
            player.solution.save(path)
        except OSError as error:
            return f"{path}: {error.strerror or error}"
        return f"saved as {path}"

    panel, title = Panel(player, save), f"stc: {player.solution.name}"
    try:
        if window.web:
            windows.open_web(player, panel, title, window.host or addresses.LOOPBACK, window.port or 0, _tell)
        elif windows.desktop_is_there():
            windows.open_desktop(player, panel, title)
        else:
            console.note("MuJoCo's Studio is missing here: this is its passive viewer, without the panel")
            from stc.viewer.passive import open_passive

            open_passive(player)
    except KeyboardInterrupt:
        pass  # Ctrl-C closes the window
    finally:
        player.close()


def _tell(address: str) -> None:
    print(f"showing on {address} until Ctrl-C", file=sys.stderr, flush=True)
