"""Filmstrips and videos of a motion.

A filmstrip shows the motion at equal intervals of time, tile by tile.  A video shows it frame by frame; short
motions are slowed down, and the caption gives the factor.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.atomic import replacing
from stc.errors import UsageError
from stc.records import dataclass
from stc.validate import limits
from stc.validate.metrics import FloatArray
from stc.validate.pictures import PictureError
from stc.validate.pictures.motion import paths, simulated_at, solved_at
from stc.validate.pictures.scenery import picture_model
from stc.validate.pictures.stage import Image, Stage, Trail

if TYPE_CHECKING:
    from stc.validate.replay import Replay
    from stc.validate.setup import Setup

#: Kinds of picture by the ending of the file: still images and videos.
STILLS = (".png", ".jpg", ".jpeg")
VIDEOS = (".webp", ".gif", ".mp4")

#: A video of a motion is slowed down until it lasts about so long, in seconds, but not below real time.
_SHORTEST = 2.0

#: Slow motion is one of these shares of real time.
_SPEEDS = (1.0, 0.5, 0.25, 0.2, 0.1, 0.05, 0.02, 0.01)

#: The last image of a video stays for this time, in seconds, before it starts again.
_PAUSE = 0.8

#: Of more images than this, shadows are drawn with so many pixels at most: they take half of the time.
_FEW, _SHADOWS = 16, 2048

#: Colours of paths: solved, simulated.
_SOLVED, _SIMULATED = (0.98, 0.62, 0.16, 0.9), (0.25, 0.75, 0.95, 0.9)

#: Width of the solved path, in pixels, where a simulated one lies on it, and how far that is lifted from it.
_BROAD, _LIFT = 6.0, 3e-3

#: So many positions of a motion are kept within the image.
_FRAMED = 25

#: Colour of the simulated path there. It is opaque, and so drawn before the translucent one, which would hide it.
#: MuJoCo draws what is opaque once for each light that casts a shadow and adds it up: the treble is blue too.
_ON_TOP = (0.08, 0.37, 0.48, 1.0)

#: Opacity of the solved motion where it stands behind a simulated one.
_GHOST = 0.35


@dataclass(frozen=True, slots=True)
class Look:
    """The settings of pictures.

    Attributes:
        width: of an image, or of a filmstrip's tile, in pixels.
        height: of the same.
        camera: one of the model's cameras; None takes the usual one.
        rate: images per second of a video.
        speed: share of real time at which a video runs; None chooses.
        tiles: number of tiles of a filmstrip.
        columns: columns of a filmstrip; None chooses.
        captions: whether the time is written into the images.
    """

    width: int = 640
    height: int = 480
    camera: str | None = None
    rate: int = 30
    speed: float | None = None
    tiles: int = 6
    columns: int | None = None
    captions: bool = True


def draw(
    setup: Setup,
    path: str | os.PathLike[str],
    look: Look | None = None,
    motion: Replay | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Render a motion into a file: a filmstrip or a video, depending on the suffix.

    Args:
        setup: the motion and its model.
        path: the file; its suffix is one of :data:`STILLS` or :data:`VIDEOS`.
        look: the settings.
        motion: a replay to show, the solved motion then being its ghost; None shows the solved motion.
        progress: called after each image with the number of images done and the total.

    Raises:
        UsageError: another suffix, or a picture that is too large.
        ModelError: there is no such camera.
        PictureError: there is no OpenGL, or no encoder for the video.
        OSError: the file cannot be written.
    """
    target, look = Path(path), look or Look()
    suffix = target.suffix.lower()
    if suffix not in (*STILLS, *VIDEOS):
        raise UsageError(
            f"cannot tell what {target.name!r} should be: {', '.join(STILLS)} are filmstrips, "
            f"{', '.join(VIDEOS)} videos"
        )
    if suffix in STILLS:
        strip = filmstrip(setup, look, motion, progress)
        with replacing(target) as temporary:
            strip.save(temporary)
        return
    if suffix == ".mp4":
        _require_av()
    require_film(look, setup.solution.duration, suffix)
    write = _write_mp4 if suffix == ".mp4" else _write_animation
    with replacing(target) as temporary:
        write(temporary, film(setup, look, motion, progress), look)


def require_filmstrip(look: Look) -> None:
    """Refuse a filmstrip that is too large, before any work is done.

    Raises:
        UsageError: it has too many tiles, or too many pixels in all.
    """
    most = min(limits.MOST_IMAGES, limits.MOST_STRIP_PIXELS // (look.width * look.height))
    if look.tiles > most:
        raise UsageError(
            f"{look.tiles} tiles of {look.width}x{look.height} pixels are too many for one filmstrip: "
            f"{most} at most",
            "take fewer or smaller ones (--tiles, --size), or a video (.webp, .gif, .mp4)",
        )


def require_film(look: Look, duration: float, suffix: str) -> None:
    """Refuse a video that is too large, before any work is done.

    Args:
        look: how it is to be made.
        duration: of the motion, in seconds.
        suffix: of the file.

    Raises:
        UsageError: it has too many images, or too many pixels where all are encoded together; or speed or rate are
            not positive.
    """
    count = duration / _step(look, duration)
    most = limits.MOST_IMAGES
    if suffix != ".mp4":
        most = min(most, limits.MOST_ANIMATION_PIXELS // (look.width * look.height))
    if not count <= most:
        raise UsageError(
            f"{duration:.4g} s at {look.rate} images per second and {_speed(look, duration):g} of real time are "
            f"{count:.3g} images of {look.width}x{look.height} pixels: a {suffix} has {most} of them at most",
            "choose a lower --rate, a higher --speed or a smaller --size",
        )


def filmstrip(
    setup: Setup,
    look: Look,
    motion: Replay | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Any:
    """The motion at equal intervals, first and last position included, as a Pillow image.  See :func:`draw`."""
    from PIL import Image as Pillow

    require_filmstrip(look)
    count = max(1, look.tiles)
    times = np.linspace(setup.solution.time[0], setup.solution.time[-1], count)
    columns = look.columns or _columns(count)
    rows = -(-count // columns)
    gap = max(2, look.width // 160)
    strip = Pillow.new(
        "RGB",
        (columns * (look.width + gap) - gap, rows * (look.height + gap) - gap),
        (255, 255, 255),
    )
    for k, image in enumerate(_images(setup, look, motion, times, 1.0, progress)):
        strip.paste(
            Pillow.fromarray(image), (k % columns * (look.width + gap), k // columns * (look.height + gap))
        )
    return strip


def _columns(count: int) -> int:
    """Up to four tiles in a row; more are spread over rows of equal length where that is possible."""
    if count <= 4:
        return count
    return next((c for c in (4, 3, 5) if count % c == 0), 4)


def film(
    setup: Setup,
    look: Look,
    motion: Replay | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Image]:
    """The images of a video, (height, width, 3) each.  See :func:`draw`."""
    speed, step = _speed(look, setup.solution.duration), _step(look, setup.solution.duration)
    start, end = setup.solution.time[0], setup.solution.time[-1]
    count = max(2, round((end - start) / step) + 1)
    times = np.minimum(start + step * np.arange(count), end)
    times[-1] = end
    return _images(setup, look, motion, times, speed, progress)


def _speed(look: Look, duration: float) -> float:
    """The share of real time at which a video of a motion of this duration, in seconds, runs."""
    return slow_motion(duration) if look.speed is None else look.speed


def _step(look: Look, duration: float) -> float:
    """Seconds of the motion from one image of a video to the next."""
    speed = _speed(look, duration)
    if not speed > 0.0 or look.rate < 1:
        raise UsageError("speed and rate of a video must be positive")
    return speed / look.rate


def slow_motion(duration: float) -> float:
    """The share of real time at which a motion of this duration, in seconds, is well seen."""
    return next((speed for speed in _SPEEDS if duration / speed >= _SHORTEST), _SPEEDS[-1])


def _images(
    setup: Setup,
    look: Look,
    motion: Replay | None,
    times: FloatArray,
    speed: float,
    progress: Callable[[int, int], None] | None,
) -> Iterator[Image]:
    solved = solved_at(setup, times)
    shown = solved if motion is None else simulated_at(motion, times)
    model = picture_model(setup)
    if len(times) > _FEW:
        model.vis.quality.shadowsize = min(int(model.vis.quality.shadowsize), _SHADOWS)
    with Stage(model, look.width, look.height, look.camera, frame=_framed(setup)) as stage:
        trails = path_trails(setup, motion)
        for k, time in enumerate(times):
            ghosts: Sequence[tuple[FloatArray, float]] = [] if motion is None else [(solved[k], _GHOST)]
            image = stage.render(shown[k], ghosts, trails)
            yield _captioned(image, float(time), speed) if look.captions else image
            if progress is not None:
                progress(k + 1, len(times))


def path_trails(setup: Setup, motion: Replay | None, both: bool = True) -> list[Trail]:
    """The paths of a motion: the solved one wide, so that the simulated one is visible on it.

    Args:
        setup: the motion.
        motion: a replay of it, or None for the solved path alone.
        both: whether the solved path is shown where there is a replay.
    """
    if motion is None:
        return [Trail(points, _SOLVED) for points in paths(setup)]
    if not both:
        return [Trail(points, _SIMULATED) for points in paths(setup, motion)]
    solved = [Trail(points, _SOLVED, _BROAD) for points in paths(setup)]
    return [*solved, *(Trail(points, _ON_TOP, lift=_LIFT) for points in paths(setup, motion))]


def _framed(setup: Setup) -> FloatArray:
    """Positions that must be visible completely: those of the whole motion, whatever is shown."""
    times = np.linspace(setup.solution.time[0], setup.solution.time[-1], _FRAMED)
    return solved_at(setup, times)


def _captioned(image: Image, time: float, speed: float) -> Image:
    """The image with the time in its lower left corner, and the slowness of the motion beside it."""
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    height = image.shape[0]
    picture = Pillow.fromarray(image)
    text = f"{time:.2f} s"
    if speed != 1.0:
        text += f"    {_share(speed)} speed"
    font = ImageFont.load_default(size=max(10, height // 24))
    at = (height // 28, height - height // 28)
    brush = ImageDraw.Draw(picture)
    brush.text(at, text, (255, 255, 255), font, anchor="ls", stroke_width=2, stroke_fill=(40, 40, 48))
    return np.asarray(picture)


def _share(speed: float) -> str:
    whole = 1.0 / speed
    return f"1/{whole:g}" if speed < 1.0 and abs(whole - round(whole)) < 1e-9 else f"{speed:g}x"


# --- files -------------------------------------------------------------------------------------------------


def _write_animation(target: Path, images: Iterator[Image], look: Look) -> None:
    """An animated WebP or GIF that starts over after a pause."""
    from PIL import Image as Pillow

    frames = [Pillow.fromarray(image) for image in images]
    # GIF keeps time in hundredths of a second.
    each = (
        max(20, 10 * round(100 / look.rate)) if target.suffix.lower() == ".gif" else round(1000 / look.rate)
    )
    durations = [each] * (len(frames) - 1) + [each + round(1000 * _PAUSE)]
    more: dict[str, Any] = {"quality": 82, "method": 4} if target.suffix.lower() == ".webp" else {}
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=durations, loop=0, **more)


def _require_av() -> Any:
    try:
        import av
    except ImportError:
        raise PictureError(
            "an .mp4 takes the library PyAV: pip install av\n  .webp and .gif work without it"
        ) from None
    return av


def _write_mp4(target: Path, images: Iterator[Image], look: Look) -> None:
    """H.264, the last image held for a moment."""
    av = _require_av()
    with av.open(str(target), "w") as container:
        stream = container.add_stream("libx264", rate=look.rate)
        # The pixel format shares colours between pairs of pixels: sizes are even.
        stream.width, stream.height = look.width // 2 * 2, look.height // 2 * 2
        stream.pix_fmt, stream.options = "yuv420p", {"crf": "18"}
        last: Image | None = None
        for image in images:
            last = image[: stream.height, : stream.width]
            container.mux(
                stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(last), format="rgb24"))
            )
        for _ in range(round(_PAUSE * look.rate) if last is not None else 0):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(last), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
