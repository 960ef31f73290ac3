"""The commands ``stc plot`` and ``stc render``."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from stc.arguments import spare
from stc.cli import jobs, record
from stc.cli.live import validating
from stc.cli.options import SolveOptions, ready_to_write
from stc.cli.statuses import GOOD
from stc.errors import UsageError
from stc.terminal_text import unfiltered

if TYPE_CHECKING:
    from stc.cli.outcome import Outcome
    from stc.solution import Solution
    from stc.validate.pictures.film import Look

#: Motions that can be rendered.
_MOTIONS = ("solved", "replayed", "tracked")


def plot(target: str, output: str, options: SolveOptions, *, force: bool, as_json: bool) -> int:
    """Draw a motion over time: its joints and forces, solved and replayed, or its variables without a model."""
    from stc.validate.model import model_inputs
    from stc.validate.pictures.plot import PLOTS, save_plot
    from stc.validate.pictures.variables import save_variables
    from stc.validate.verdict import open_setup, run_replays

    file = _writable(output, PLOTS)
    outcome, motion = _motion(target, options, force, as_json, "")
    if outcome.solution.model is None:
        save_variables(outcome.solution, file)
    else:
        setup = open_setup(motion, force=force)
        spare(file, model_inputs(setup.path), "-o")
        with validating(outcome.solution.name):
            replays = run_replays(setup)
        save_plot(replays, file)
    return _done(outcome.solution, file, as_json)


def render(
    target: str, output: str, look: Look, show: str, options: SolveOptions, *, force: bool, as_json: bool
) -> int:
    """Render a motion as a filmstrip or a video."""
    from stc.validate.model import model_inputs
    from stc.validate.pictures.film import STILLS, VIDEOS, draw, require_filmstrip
    from stc.validate.verdict import open_setup, run_replays

    if show not in _MOTIONS:
        raise UsageError(f"--show must be one of {', '.join(_MOTIONS)}, not `{show}`")
    file = _writable(output, (*STILLS, *VIDEOS))
    if file.suffix.lower() in STILLS:
        require_filmstrip(look)
    needs = "there are no bodies to render", "`stc plot` draws its variables over time"
    setup = open_setup(_motion(target, options, force, as_json, *needs)[1], force=force)
    spare(file, model_inputs(setup.path), "-o")
    motion = None
    if show != "solved":
        with validating(setup.solution.name):
            replays = run_replays(setup, tracked=show == "tracked")
        motion = replays.tracked if show == "tracked" else replays.open_loop
        if motion is None:
            raise UsageError(f"{setup.solution.name} cannot be tracked: no actuator moves a single joint")
    with _Counter() as counter:
        draw(setup, file, look, motion, counter)
    return _done(setup.solution, file, as_json)


def look(size: str, camera: str | None, rate: int, speed: float | None, tiles: int) -> Look:
    """The settings of pictures from the options.

    Raises:
        UsageError: an invalid value.
    """
    from stc.validate.pictures.film import Look

    width, _, height = size.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and 16 <= min(int(width), int(height))):
        raise UsageError(f"--size wants WIDTHxHEIGHT in pixels, such as 960x720, not `{size}`")
    if max(int(width), int(height)) > 8192:
        raise UsageError(f"--size {size}: images are at most 8192 pixels wide and high")
    if rate < 1 or tiles < 1:
        raise UsageError("--rate and --tiles must be at least 1")
    if speed is not None and not speed > 0.0:
        raise UsageError(f"--speed must be positive, not {speed:g}")
    return Look(int(width), int(height), camera, rate, speed, tiles)


def _motion(
    target: str, options: SolveOptions, force: bool, as_json: bool, *needs: str
) -> tuple[Outcome, Solution | Path]:
    """The motion to draw; ``needs`` as for :func:`stc.cli.jobs.to_show`."""
    outcome, motion = jobs.to_show(target, options, as_json, *needs)
    jobs.require_optimal(outcome.solution, "drawn", force)
    return outcome, motion


def _done(solution: Solution, file: Path, as_json: bool) -> int:
    if as_json:
        record.write({**record.of_solution(solution), "picture": str(file)})
    else:
        print(f"{file} written")
    return GOOD


def _writable(name: str, endings: tuple[str, ...]) -> Path:
    """The path for a picture; missing folders are created.

    Raises:
        UsageError: another ending, or something is in the way.
    """
    path = Path(name)
    if path.suffix.lower() not in endings:
        raise UsageError(f"-o {name}: this picture is saved as {', '.join(endings)}")
    return ready_to_write(path)


class _Counter:
    """A line that counts rendered images, on a terminal only."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()
        self._last = 0.0

    def __enter__(self) -> _Counter:
        return self

    def __call__(self, done: int, total: int) -> None:
        if self._shown and (done == total or time.monotonic() - self._last > 0.2):
            self._last = time.monotonic()
            print(f"\r{done} of {total} images", end="", file=unfiltered(sys.stderr), flush=True)

    def __exit__(self, *_: object) -> None:
        if self._shown and self._last:
            print("\r" + " " * 40 + "\r", end="", file=unfiltered(sys.stderr), flush=True)
