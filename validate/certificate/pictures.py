"""The replay as pictures: a filmstrip and an animation that goes into a page.

MuJoCo renders without a screen, through EGL or OSMesa, whichever the machine has.  Which of them is decided when
MuJoCo is imported, and a graphics library that fails may take its process along.  So another process renders
(:mod:`stc.validate.certificate.render_process`); where it cannot, the page says why and has no pictures.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.errors import StcError
from stc.validate import limits
from stc.validate.certificate.curves import solved_positions
from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    from PIL.Image import Image

    from stc.validate.replay import Replay
    from stc.validate.setup import Setup
    from stc.validate.verdict import Replays

#: Width and height of a picture, and how many make the filmstrip.
SIZE, STRIP = (480, 300), 8

#: Fewest and most pictures of an animation, pictures a second in real time, and the shortest it may last.
_FEWEST, _MOST, _RATE, _SHORTEST = 40, 72, 30.0, 2.4

#: How far apart solved and simulated bodies must be, in m or rad, for the solved ones to be drawn too.
_GHOST = 1e-3

#: How long rendering may take, in seconds.
_PATIENCE = 300.0


class PictureError(StcError):
    """Pictures cannot be rendered on this machine; the message says why."""


@dataclass(frozen=True, slots=True)
class Pictures:
    """A rendered replay.

    Attributes:
        frames: the pictures, equally spaced in time.
        time: (k,) their times in the motion, in seconds.
        replay: ``open loop`` or ``tracked``.
        ghost: whether the solved motion is drawn beside it, translucent.
        seconds_a_frame: how long an animation shows each.
    """

    frames: list[Image]
    time: FloatArray
    replay: str
    ghost: bool
    seconds_a_frame: float

    @property
    def slowness(self) -> float:
        """How many times slower than the motion its animation is."""
        length = float(self.time[-1] - self.time[0])
        return self.seconds_a_frame * (len(self.time) - 1) / length if length > 0.0 else 1.0

    def strip(self, count: int = STRIP) -> list[int]:
        """Which frames make a filmstrip: the first, the last and some between."""
        return [int(k) for k in np.unique(np.linspace(0, len(self.frames) - 1, count).round())]

    def animation(self, quality: int = 80) -> bytes:
        """All frames as an animated WebP file in which every frame is whole."""
        stream = io.BytesIO()
        self.frames[0].save(
            stream,
            "WEBP",
            save_all=True,
            append_images=self.frames[1:],
            duration=round(1000 * self.seconds_a_frame),
            loop=0,
            quality=quality,
            method=3,
            kmin=0,
            kmax=1,
        )
        return stream.getvalue()


def encoded(picture: Image, quality: int = 85) -> bytes:
    """One picture as a WebP file."""
    stream = io.BytesIO()
    picture.save(stream, "WEBP", quality=quality, method=4)
    return stream.getvalue()


def render(replays: Replays) -> Pictures:
    """Render the replay that the verdict goes by: open loop, or tracked where small errors grow too much.

    Raises:
        PictureError: nothing on this machine renders.
    """
    growth = replays.growth or 1.0
    steered = replays.tracked is not None and growth >= limits.UNSTABLE_GROWTH
    motion = replays.tracked if steered and replays.tracked is not None else replays.open_loop
    times, simulated, solved = _states(replays, motion)
    ghost = bool(np.max(np.abs(simulated - solved), initial=0.0) > _GHOST)
    frames = _rendered(replays.setup, simulated, solved if ghost else None)
    length = max(float(times[-1] - times[0]), _SHORTEST)
    name = "tracked" if motion is replays.tracked else "open loop"
    return Pictures(frames, times, name, ghost, length / max(1, len(times) - 1))


def _states(replays: Replays, motion: Replay) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times (k,) and ``qpos`` (k, nq), simulated and solved, of the pictures to make."""
    setup = replays.setup
    good = np.flatnonzero(np.all(np.abs(motion.path) < 1e6, axis=1))
    ends = motion.time[[0, good[-1] if len(good) else 0]]
    count = int(np.clip(round(_RATE * (ends[1] - ends[0])), _FEWEST, _MOST))
    times = np.linspace(ends[0], ends[1], count)
    nearest = np.abs(motion.time[:, None] - times).argmin(axis=0)
    simulated = motion.path[nearest]
    solved = simulated.copy()
    solved[:, setup.reference.positions] = solved_positions(replays, motion.time[nearest])
    return times, simulated, solved


def _rendered(setup: Setup, simulated: FloatArray, solved: FloatArray | None) -> list[Image]:
    """The pictures of some states, from a process of its own."""
    import mujoco
    from PIL import Image

    with tempfile.TemporaryDirectory(prefix="stc-pictures-") as name:
        folder = Path(name)
        mujoco.mj_saveModel(setup.compiled, str(folder / "model.mjb"), None)
        ghost = simulated[:0] if solved is None else solved
        np.savez(folder / "states.npz", simulated=simulated, solved=ghost, size=np.array(SIZE))
        reasons = []
        for platform in _platforms():
            reason = _run(folder, platform)
            if reason is None:
                pixels = np.load(folder / "frames.npy")
                return [Image.fromarray(frame) for frame in pixels]
            reasons.append(reason)
        raise PictureError(f"nothing on this machine renders without a screen: {'; '.join(reasons)}")


def _platforms() -> list[str]:
    """Ways to render, the one the user wants first; "" is MuJoCo's own choice."""
    wanted = os.environ.get("MUJOCO_GL", "")
    if wanted:
        return [wanted]
    return ["egl", "osmesa"] if sys.platform.startswith("linux") else [""]


def _run(folder: Path, platform: str) -> str | None:
    """Let another process render into the folder; what went wrong, or None."""
    environment = dict(os.environ)
    if platform:
        environment["MUJOCO_GL"] = platform
    command = [sys.executable, "-m", "stc.validate.certificate.render_process", str(folder)]
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        return f"{platform or 'rendering'} took more than {_PATIENCE:g} s"
    except OSError as error:
        return str(error)
    if done.returncode == 0 and (folder / "frames.npy").is_file():
        return None
    last = [line.strip() for line in done.stderr.splitlines() if line.strip()][-1:]
    return f"{platform or 'rendering'}: {last[0] if last else f'ended with status {done.returncode}'}"
