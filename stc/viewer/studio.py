"""MuJoCo Studio's side of the viewer: two plugins around a :class:`stc.viewer.player.Player`.

Studio runs a simulation and a window on two threads that exchange messages.  Here the simulation's plugin gets the
scene from the player and passes it on; the window's plugin shows it and builds the panel.  Studio's own controls of
time (the space bar, its run and pause buttons, its speed) act on the player's timeline.
"""

from __future__ import annotations

import dataclasses
import time

import mujoco
import numpy as np
from mujoco.studio import app as studio_app
from mujoco.studio import messages, plugin, sim
from mujoco.studio.dear_imgui import dear_imgui as imgui

from stc.viewer.geoms import Geoms
from stc.viewer.layout import arrange
from stc.viewer.overlay import Eye, draw
from stc.viewer.panel import Panel
from stc.viewer.player import Frame, Player
from stc.viewer.scene import GROUP

#: Pictures per second, and while a solve needs the processor.
_RATE, _RATE_WHILE_SOLVING = 60.0, 30.0


@dataclasses.dataclass(frozen=True, eq=False)
class FrameSnapshot(messages.Snapshot):
    """The content of a picture; only the newest one is used."""

    frame: Frame


class Stage(plugin.SimPlugin):
    """Puts the player's frames where Studio keeps its simulation; nothing is stepped here."""

    def __init__(self, player: Player) -> None:
        self._player = player
        self._last = time.perf_counter()
        self._scene = player.scene_generation

    @messages.handler
    def on_step(self, event: messages.StepEvent) -> bool:
        player = self._player
        period = 1.0 / (_RATE_WHILE_SOLVING if player.solving else _RATE)
        time.sleep(max(0.001, self._last + period - time.perf_counter()))
        now = time.perf_counter()
        frame = player.frame(now - self._last)
        self._last = now
        if player.scene_generation != self._scene:
            self._scene = player.scene_generation
            self.handle.set_model(player.scene.model)
        player.scene.put(self.handle.data, frame.body, frame.ghost, frame.offset)
        self.handle.send_to_viewer(FrameSnapshot(frame))
        return True

    @messages.handler
    def on_load_model(self, event: messages.LoadModelEvent) -> bool:
        # A file dropped onto the window or Studio's reload button: the motion's own model stays.
        return True

    @messages.handler
    def on_step_control(self, event: messages.StepControlSnapshot) -> bool:
        timeline = self._player.timeline
        playing = event.pause_state == sim.PauseState.UNPAUSED
        if playing != timeline.playing:
            timeline.toggle()
        timeline.speed = event.speed / 100.0
        return True

    @messages.handler
    def on_reset(self, event: messages.ResetEvent) -> bool:
        self._player.timeline.seek(self._player.timeline.start)
        return True

    @messages.handler
    def on_state(self, event: messages.StateEvent) -> bool:
        return True  # a recorded motion is not pushed about

    @messages.handler
    def on_perturb(self, event: messages.PerturbSnapshot) -> bool:
        return True


class Window(plugin.ViewerPlugin):
    """Shows frames and the panel.

    Attributes:
        shown: generation of the motion in the last picture that was drawn.
        drawn_at: when that was, by ``time.perf_counter``.
    """

    def __init__(self, player: Player, panel: Panel, flat: bool) -> None:
        """Prepare.

        Args:
            player: what is shown.
            panel: the panel.
            flat: draw shapes over the picture and not into the scene; see :mod:`stc.viewer.overlay`.
        """
        self._player, self._panel, self._flat = player, panel, flat
        self._frame: Frame | None = None
        self._geoms = Geoms()
        self._app: studio_app.App | None = None
        self._size = (0.0, 0.0)
        self._looked: tuple[float, ...] | None = None
        self.shown, self.drawn_at = -1, 0.0

    @messages.handler
    def on_app(self, event: studio_app.plugins.InitEvent) -> None:
        self._app = event.app

    @messages.handler
    def on_frame(self, snapshot: FrameSnapshot) -> None:
        self._frame = snapshot.frame

    @messages.handler(priority=0)  # after Studio's own, which takes its default view
    def on_post_model(self, event: messages.PostModelEvent) -> None:
        self._look()

    def _look(self) -> None:
        """Point the camera at the motion, in the part of the window that the panel leaves free."""
        view, camera, size = self._player.scene.view, self.viewer.camera, imgui.GetIO().DisplaySize
        self._size = (size.x, size.y)
        if view is not None and min(self._size) > 0.0 and self.viewer.model.nq == self._player.scene.model.nq:
            camera.lookat[:], camera.distance = view.placed(size.x, size.y, arrange(size.x, size.y)[1])
            camera.azimuth, camera.elevation = view.azimuth, view.elevation
            self._looked = _place(camera)

    @messages.handler(priority=0)
    def on_update(self, event: messages.UpdateEvent) -> None:
        options, timeline = self._player.options, self._player.timeline
        size = imgui.GetIO().DisplaySize
        if (size.x, size.y) != self._size and self._looked in (None, _place(self.viewer.camera)):
            self._look()  # nobody has moved the camera: it follows the window's size
        if self._frame is not None:
            if not self._flat:
                self.viewer.extra_geoms[:] = self._geoms.of(self._frame.shapes)
            if self._frame.generation != self.shown:
                self.shown, self.drawn_at = self._frame.generation, time.perf_counter()
        self.viewer.vis_options.geomgroup[GROUP] = options.ghost
        if self._app is not None:
            state = self._app.step_control_state
            state.set_pause_state(
                sim.PauseState.UNPAUSED if timeline.playing else sim.PauseState.NORMAL_PAUSED
            )
            state.set_speed(100.0 * timeline.speed)
        if not imgui.GetIO().WantCaptureKeyboard:
            step = self._player.frame_step
            if imgui.IsKeyPressed(imgui.Key.LeftArrow):
                timeline.step(-step)
            if imgui.IsKeyPressed(imgui.Key.RightArrow):
                timeline.step(step)

    @messages.handler
    def on_build_gui(self, event: messages.BuildGuiEvent) -> None:
        if self._flat and self._frame is not None:
            camera = mujoco.mjv_camera2GLCamera(self.viewer.model, self.viewer.data, self.viewer.camera)
            size = imgui.GetIO().DisplaySize
            eye = Eye.of(camera, size.x, size.y)
            # In some scenes Studio 4.0.0 does not show the first list of a picture: a point outside is no loss.
            imgui.GetBackgroundDrawList().AddCircleFilled(imgui.Vec2(-9.0, -9.0), 1.0, 0)
            imgui.GetBackgroundDrawList().AddLine(
                imgui.Vec2(-9.0, -9.0), imgui.Vec2(-8.0, -8.0), 0x01000000, 1.0
            )
            draw(imgui.GetForegroundDrawList(), imgui.Vec2, eye, self._frame.shapes)
        self._panel.build_gui(imgui, self._frame)


def _place(camera: mujoco.MjvCamera) -> tuple[float, ...]:
    """The position of a camera, in the single precision in which a browser sends it back."""
    places = [*camera.lookat, camera.distance, camera.azimuth, camera.elevation]
    return tuple(np.array(places, dtype=np.float32).tolist())


def plugins(player: Player, panel: Panel, flat: bool) -> tuple[list[plugin.Plugin], Window]:
    """The plugins of a window onto a player, Studio's own application among them, and the one that draws.

    Args:
        player: what is shown.
        panel: the panel.
        flat: see :class:`Window`.
    """
    window = Window(player, panel, flat)
    layout = studio_app.Config(show_options=False, show_inspector=False)
    return [studio_app.App(layout), window, Stage(player)], window
