"""The panel: time, display options, the solve in progress, and the adjustable constants.

It is written for Dear ImGui, whose module is passed to it; every button acts on the player.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from stc.viewer.constants import Constant
from stc.viewer.layout import arrange
from stc.viewer.player import Frame, Player
from stc.viewer.report import progress, refusal, simulation, summary
from stc.viewer.timeline import SPEEDS

#: Title of the panel.
TITLE = "stc"

_RED, _GREY = (0.90, 0.25, 0.20, 1.0), (0.50, 0.50, 0.50, 1.0)


class Panel:
    """Builds the panel, frame by frame.

    Attributes:
        note: message about the last action.
    """

    def __init__(self, player: Player, save: Callable[[], str] | None = None) -> None:
        """Prepare.

        Args:
            player: the player that the panel controls.
            save: saves the displayed motion and returns its path; None leaves the button out.
        """
        self._player, self._save = player, save
        self._typed: dict[str, float] = {}
        self._size = (0.0, 0.0)
        self.note = ""

    def build_gui(self, imgui: Any, frame: Frame | None) -> None:
        """Draw the panel of Studio's window for one of its frames."""
        window = imgui.GetIO().DisplaySize
        if (window.x, window.y) != self._size:
            # A browser tells its size once it is there, and a telephone is turned: the panel moves along.
            self._size = (window.x, window.y)
            place, _ = arrange(window.x, window.y)
            imgui.SetNextWindowPos(imgui.Vec2(place.left, place.top), int(imgui.Cond.Always))
            imgui.SetNextWindowSize(imgui.Vec2(place.width, place.height), int(imgui.Cond.Always))
        open_, _ = imgui.Begin(TITLE)
        if open_:
            imgui.TextWrapped(summary(self._player))
            self._live(imgui)
            imgui.SeparatorText("time")
            self._time(imgui)
            imgui.SeparatorText("shown")
            self._shown(imgui, frame)
            if self._player.tweaks is not None:
                imgui.SeparatorText("constants")
                self._constants(imgui)
            if self._save is not None:
                imgui.Separator()
                if imgui.Button("save this motion"):
                    self.note = self._save()
            for text in (self._player.message, self.note):
                if text:
                    imgui.TextWrapped(text)
        imgui.End()

    def _live(self, imgui: Any) -> None:
        live = self._player.live
        if live is None:
            return
        if live.running:
            if imgui.Button("stop and keep the best" if not live.stopping else "stopping ..."):
                live.stop()
        imgui.TextWrapped(progress(live))

    def _time(self, imgui: Any) -> None:
        timeline = self._player.timeline
        if imgui.Button("pause" if timeline.playing else "play", imgui.Vec2(60.0, 0.0)):
            timeline.toggle()
        imgui.SameLine()
        if imgui.Button("|<"):
            timeline.seek(timeline.start)
        for label, step in (("<", -self._player.frame_step), (">", self._player.frame_step)):
            imgui.SameLine()
            if imgui.Button(label):
                timeline.step(step)
        imgui.SameLine()
        _, timeline.loop = imgui.Checkbox("loop", timeline.loop)
        imgui.SetNextItemWidth(-60.0)
        moved, now = imgui.SliderFloat("time", timeline.now, timeline.start, timeline.end, "%.3f s")
        if moved:
            timeline.playing = False
            timeline.seek(float(now))
        names = [f"{100 * speed:g} %" for speed in SPEEDS]
        chosen = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - timeline.speed))
        imgui.SetNextItemWidth(-60.0)
        changed, chosen = imgui.Combo("speed", chosen, names)
        if changed:
            timeline.speed = SPEEDS[chosen]

    def _shown(self, imgui: Any, frame: Frame | None) -> None:
        options = self._player.options
        _, options.ghost = imgui.Checkbox("solved motion, as the ghost", options.ghost)
        imgui.SetNextItemWidth(-60.0)
        reach = max(self._player.motion.extent, abs(options.aside))
        _, options.aside = imgui.SliderFloat("aside", options.aside, -reach, reach, "%.2f m")
        _, options.physics = imgui.Checkbox("MuJoCo's physics, as the body", options.physics)
        imgui.BeginDisabled(not options.physics)
        if imgui.RadioButton("open loop", not options.tracked):
            options.tracked = False
        imgui.SameLine()
        if imgui.RadioButton("tracked", options.tracked):
            options.tracked = True
        imgui.EndDisabled()
        imgui.TextColored(imgui.Vec4(*_GREY), simulation(self._player, frame))
        _, options.forces = imgui.Checkbox("solved forces and torques", options.forces)
        _, options.contacts = imgui.Checkbox("MuJoCo's contact forces", options.contacts)
        _, options.paths = imgui.Checkbox("paths and frames", options.paths)

    def _constants(self, imgui: Any) -> None:
        tweaks = self._player.tweaks
        assert tweaks is not None
        if tweaks.unsettled:
            imgui.TextColored(imgui.Vec4(*_GREY), f"solving: iteration {tweaks.iteration}")
        elif tweaks.refused:
            imgui.PushStyleColor(int(imgui.Col.Text), imgui.Vec4(*_RED))
            imgui.TextWrapped(refusal(tweaks))
            imgui.PopStyleColor()
            if imgui.Button("back to the motion on show"):
                tweaks.give_up()
                self._typed.clear()
        elif tweaks.outcome is not None:
            outcome = tweaks.outcome
            text = f"solved in {1000 * outcome.took:.0f} ms, {outcome.iterations} iterations"
            imgui.TextColored(imgui.Vec4(*_GREY), text)
        else:
            imgui.TextColored(imgui.Vec4(*_GREY), "turn one: it is solved again from here")
        for constant in tweaks.constants:
            if not constant.structural:
                self._slider(imgui, constant)
        structural = [constant for constant in tweaks.constants if constant.structural]
        if structural and imgui.CollapsingHeader("frames and other structure"):
            for constant in structural:
                self._number(imgui, constant)

    def _slider(self, imgui: Any, constant: Constant) -> None:
        tweaks = self._player.tweaks
        assert tweaks is not None
        imgui.SetNextItemWidth(-100.0)
        moved, value = imgui.SliderFloat(
            constant.name, tweaks.wanted(constant.name), constant.low, constant.high, "%.5g"
        )
        if constant.note:
            imgui.SetItemTooltip(constant.note)
        if moved:
            # Dear ImGui holds single precision: what a hand can set has no more digits than these.
            tweaks.turn(**{constant.name: float(f"{value:.6g}")})

    def _number(self, imgui: Any, constant: Constant) -> None:
        tweaks = self._player.tweaks
        assert tweaks is not None
        imgui.SetNextItemWidth(-100.0)
        shown = self._typed.get(constant.name, tweaks.wanted(constant.name))
        changed, value = imgui.InputDouble(constant.name, shown, 1.0, 10.0, "%.6g")
        if constant.note:
            imgui.SetItemTooltip(constant.note)
        if changed:
            self._typed[constant.name] = float(value)
        if imgui.IsItemDeactivatedAfterEdit() and constant.name in self._typed:
            tweaks.turn(**{constant.name: self._typed.pop(constant.name)})
