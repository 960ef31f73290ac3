"""MuJoCo's passive viewer: the motion without a panel, if Studio is not available.

Keys replace the panel; see :data:`KEYS`.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from stc.viewer.geoms import fill_geom
from stc.viewer.layout import Rectangle
from stc.viewer.player import Player
from stc.viewer.report import simulation, summary
from stc.viewer.scene import GROUP
from stc.viewer.windows import require_display, restore_flags

if TYPE_CHECKING:
    import mujoco

_RATE = 60.0

#: Proportion of the window, which does not tell its size before it is open.
_PICTURE = 1.2, 1.0

#: Codes of keys as GLFW has them.
_RIGHT, _LEFT, _DOWN, _UP = 262, 263, 264, 265

KEYS = (
    "space: play or pause   left, right: one frame   up, down: speed   E: endless   "
    "O: open loop or tracked   B: ghost aside   X: stop a watched solve"
)
#: Letters among these; the viewer switches parts of its pictures by the same ones.
_LETTERS = "EOBX"


def press(player: Player, key: int) -> None:
    """Carry out the action of a key.

    Args:
        player: what it acts on.
        key: its code in GLFW.
    """
    timeline, options = player.timeline, player.options
    if key == ord(" "):
        timeline.toggle()
    elif key in (_LEFT, _RIGHT):
        timeline.step(player.frame_step if key == _RIGHT else -player.frame_step)
    elif key in (_UP, _DOWN):
        timeline.faster(1 if key == _UP else -1)
    elif key == ord("E"):
        timeline.loop = not timeline.loop
    elif key == ord("O"):
        options.tracked = not options.tracked
    elif key == ord("B"):
        options.aside = 0.0 if options.aside else 0.5 * player.motion.extent
    elif key == ord("X") and player.live is not None:
        player.live.stop()


def open_passive(player: Player) -> None:
    """Show a player in MuJoCo's passive viewer until that is closed.

    Raises:
        DisplayError: there is no display.
    """
    require_display()
    import mujoco
    import mujoco.viewer

    print(KEYS)
    generation = -1
    while generation != player.scene_generation:
        # Another model, where a constant changes what is seen, takes another window.
        generation = player.scene_generation
        data = mujoco.MjData(player.scene.model)
        with mujoco.viewer.launch_passive(
            player.scene.model,
            data,
            key_callback=lambda key: press(player, key),
            show_left_ui=False,
            show_right_ui=False,
        ) as window:
            with window.lock():
                _look(window, player)
            _run(window, data, player, generation)


def _run(window: Any, data: mujoco.MjData, player: Player, generation: int) -> None:
    last = time.perf_counter()
    while window.is_running() and player.scene_generation == generation:
        time.sleep(max(0.001, last + 1.0 / _RATE - time.perf_counter()))
        now = time.perf_counter()
        try:
            draw(window, data, player, now - last)
        except KeyboardInterrupt:
            live = player.live
            if live is None or not live.running or live.stopping:
                return
            live.stop()
        last = now


def draw(window: Any, data: mujoco.MjData, player: Player, seconds: float) -> None:
    """Let ``seconds`` pass and hand the next picture to a window of ``mujoco.viewer``."""
    import mujoco

    frame = player.frame(seconds)
    with window.lock():
        player.scene.put(data, frame.body, frame.ghost, frame.offset)
        mujoco.mj_forward(player.scene.model, data)
        restore_flags(window.opt.flags, _LETTERS)
        window.opt.geomgroup[GROUP] = player.options.ghost
        scene = window.user_scn
        scene.ngeom = min(len(frame.shapes), scene.maxgeom)
        for k, shape in enumerate(frame.shapes[: scene.ngeom]):
            fill_geom(scene.geoms[k], shape)
    window.set_texts(
        (
            mujoco.mjtFontScale.mjFONTSCALE_150,
            mujoco.mjtGridPos.mjGRID_TOPLEFT,
            summary(player),
            simulation(player, frame),
        )
    )
    window.sync()


def _look(window: Any, player: Player) -> None:
    view = player.scene.view
    if view is not None:
        width, height = _PICTURE
        window.cam.lookat[:], window.cam.distance = view.placed(
            width, height, Rectangle(0.0, 0.0, width, height)
        )
        window.cam.azimuth, window.cam.elevation = view.azimuth, view.elevation
