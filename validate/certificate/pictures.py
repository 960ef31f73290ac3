"""The replay as pictures for a page: an animation and a filmstrip."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.metrics import FloatArray
from stc.validate.pictures.film import path_trails, slow_motion
from stc.validate.pictures.motion import simulated_at, solved_at
from stc.validate.pictures.scenery import picture_model
from stc.validate.pictures.stage import Stage

if TYPE_CHECKING:
    from PIL.Image import Image

    from stc.validate.verdict import Replays

#: Width and height of a picture, and how many make the filmstrip.
SIZE, STRIP = (480, 300), 8

#: Pictures of an animation per second, and fewest and most of them.
_RATE, _FEWEST, _MOST = 20.0, 30, 60

#: Resolution of shadows.
_SHADOWS = 2048

#: How far apart solved and simulated coordinates must be, in m or rad, for the solved motion to be drawn too.
_GHOST_FROM, _GHOST_OPACITY = 1e-3, 0.35


@dataclass(frozen=True, slots=True)
class Pictures:
    """A rendered replay.

    Attributes:
        frames: the pictures, equally spaced in time.
        time: (k,) their times in the motion, in seconds.
        replay: ``open loop`` or ``tracked``.
        ghost: whether the solved motion is drawn beside it, translucent.
        seconds_a_frame: seconds for which an animation shows each picture.
    """

    frames: list[Image]
    time: FloatArray
    replay: str
    ghost: bool
    seconds_a_frame: float

    @property
    def slowness(self) -> float:
        """The factor by which the animation is slower than the motion."""
        length = float(self.time[-1] - self.time[0])
        return self.seconds_a_frame * (len(self.time) - 1) / length if length > 0.0 else 1.0

    def strip(self, count: int = STRIP) -> list[int]:
        """The indices of the frames of a filmstrip: the first, the last and some between."""
        return [int(k) for k in np.unique(np.linspace(0, len(self.frames) - 1, count).round())]

    def animation(self, quality: int = 80) -> bytes:
        """All frames as an animated WebP file in which every frame is complete, so that a page can show single
        frames.
        """
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


def render(replays: Replays, size: tuple[int, int] = SIZE, most: int = _MOST) -> Pictures:
    """Render the replay on which the verdict rests: open loop, or tracked if small errors grow too much.

    Args:
        replays: the simulations.
        size: width and height of a picture, in pixels.
        most: largest number of pictures.

    Raises:
        PictureError: this machine cannot render.
    """
    from PIL import Image

    setup = replays.setup
    growth = replays.growth or 1.0
    steered = replays.tracked is not None and growth >= limits.UNSTABLE_GROWTH
    motion = replays.tracked if steered and replays.tracked is not None else replays.open_loop
    start, end = setup.solution.time[[0, -1]]
    length = float(end - start) / slow_motion(float(end - start))
    count = int(np.clip(round(_RATE * length), min(_FEWEST, most), most))
    times = np.linspace(start, end, count)
    simulated, solved = simulated_at(motion, times), solved_at(setup, times)
    ghost = bool(np.max(np.abs(simulated - solved), initial=0.0) > _GHOST_FROM)
    trails = path_trails(setup, motion, both=ghost)
    some = solved[np.unique(np.linspace(0, count - 1, 25).astype(np.intp))]
    frames = []
    model = picture_model(setup)
    # Most of this is rendered in software, where fine shadows take most of the time and hardly show at this size.
    model.vis.quality.shadowsize = min(int(model.vis.quality.shadowsize), _SHADOWS)
    with Stage(model, *size, frame=some) as stage:
        for k in range(count):
            ghosts = [(solved[k], _GHOST_OPACITY)] if ghost else []
            frames.append(Image.fromarray(stage.render(simulated[k], ghosts, trails)))
    name = "tracked" if motion is replays.tracked else "open loop"
    return Pictures(frames, times, name, ghost, length / (count - 1))
