"""The panel, with a stand-in for Dear ImGui that presses what the test says."""

from types import SimpleNamespace

import pytest
from viewer.motions import push

from stc.viewer.panel import Panel
from stc.viewer.passive import press
from stc.viewer.player import Player
from stc.viewer.tweaks import session_for


class Hands:
    """Answers as Dear ImGui does; ``moves`` are the new values of widgets by label, buttons among them."""

    Cond = SimpleNamespace(Always=1)
    Col = SimpleNamespace(Text=0)

    def __init__(self, **moves):
        self.moves = moves
        self.texts, self.seen, self.tips = [], [], []

    def _answer(self, label, value):
        self.seen.append(label)
        return (True, self.moves[label]) if label in self.moves else (False, value)

    def GetIO(self):
        return SimpleNamespace(DisplaySize=SimpleNamespace(x=1280.0, y=860.0))

    def Vec2(self, *numbers):
        return numbers

    Vec4 = Vec2

    def Begin(self, *_):
        return True, True

    def Button(self, label, *_):
        return self._answer(label, False)[0]

    def RadioButton(self, label, _):
        return self._answer(label, False)[0]

    def Checkbox(self, label, value):
        return self._answer(label, value)

    def SliderFloat(self, label, value, low, high, form):
        assert low <= high
        return self._answer(label, value)

    def InputDouble(self, label, value, *_):
        self.last = label
        return self._answer(label, value)

    def IsItemDeactivatedAfterEdit(self):
        return self.last in self.moves

    def Combo(self, label, chosen, names):
        assert 0 <= chosen < len(names)
        return self._answer(label, chosen)

    def CollapsingHeader(self, _):
        return True

    def TextWrapped(self, text):
        self.texts.append(text)

    def TextColored(self, _, text):
        self.texts.append(text)

    def SetItemTooltip(self, text):
        self.tips.append(text)

    def __getattr__(self, name):  # what only lays out
        return lambda *_: None


@pytest.fixture
def player():
    made = Player.of(push())
    made.tweaks = session_for(push())
    yield made
    made.close()


def built(player, panel=None, **moves):
    hands = Hands(**moves)
    (panel or Panel(player)).build_gui(hands, player.frame())
    return hands


def test_time_is_played_dragged_and_stepped(player):
    built(player, pause=True)
    assert not player.timeline.playing
    built(player, play=True)
    built(player, time=0.25)
    assert player.timeline.now == 0.25 and not player.timeline.playing
    built(player, **{">": True})
    assert player.timeline.now == pytest.approx(0.25 + 0.5 / 8)
    built(player, **{"|<": True}, loop=False, speed=3)
    assert player.timeline.now == 0.0 and not player.timeline.loop and player.timeline.speed == 0.1


def test_what_is_shown_is_switched(player):
    moves = {
        "solved motion, as the ghost": False,
        "aside": 0.2,
        "tracked": True,
        "solved forces and torques": False,
        "MuJoCo's contact forces": False,
        "paths and frames": False,
    }
    built(player, **moves)
    shown = player.options
    assert (shown.ghost, shown.aside, shown.tracked) == (False, 0.2, True)
    assert not (shown.forces or shown.contacts or shown.paths)
    built(player, **{"open loop": True, "MuJoCo's physics, as the body": False})
    assert not shown.tracked and not shown.physics


def test_a_slider_solves_again(player):
    hands = built(player)
    assert {"T", "m", "d", "n"} <= set(hands.seen) and "m, how far" in hands.tips
    built(player, d=0.4000000059604645)
    assert player.tweaks.wait(20.0) and player.tweaks.solution.constants["d"] == 0.4
    assert any("solved in" in text for text in built(player).texts)


def test_a_number_is_typed_before_it_counts(player):
    panel = Panel(player)
    built(player, panel, n=16.0)
    assert player.tweaks.wait(20.0) and player.tweaks.solution.n == 16


def test_a_refusal_is_told_and_taken_back(player):
    built(player, d=30.0)
    assert player.tweaks.wait(20.0)
    hands = built(player, **{"back to the motion on show": True})
    assert any("kept: d = 0.3" in text for text in hands.texts)
    assert not player.tweaks.refused


def test_the_motion_on_show_is_saved(player):
    panel = Panel(player, lambda: "saved as x.npz")
    built(player, panel, **{"save this motion": True})
    assert "saved as x.npz" in built(player, panel).texts


def test_a_watched_solve_is_stopped(player):
    stopped = []
    player.live = SimpleNamespace(
        running=True,
        stopping=False,
        error=None,
        solution=None,
        record=None,
        generation=0,
        iterate=None,
        stop=lambda: stopped.append(1),
    )
    hands = built(player, **{"stop and keep the best": True})
    assert stopped and "getting ready" in hands.texts
    player.live = None


def test_keys_do_the_same_where_there_is_no_panel(player):
    press(player, ord(" "))
    assert not player.timeline.playing
    press(player, 262)
    assert player.timeline.now == pytest.approx(0.5 / 8)
    press(player, 264)
    assert player.timeline.speed == 0.5
    press(player, ord("E"))
    press(player, ord("O"))
    assert not player.timeline.loop and player.options.tracked
    press(player, ord("B"))
    assert player.options.aside == 0.0
    press(player, ord("X"))  # nothing is being solved: nothing happens
