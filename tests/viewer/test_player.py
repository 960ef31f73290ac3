"""What is to be seen, the constants that are turned, the solve that is watched."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from viewer.motions import PUSH, push

from stc.errors import UsageError
from stc.pipeline import load
from stc.solution import read
from stc.solution_origin import model_of
from stc.viewer import report
from stc.viewer.constants import constants_of, slider_range
from stc.viewer.live import LiveSolve
from stc.viewer.player import Options, Player
from stc.viewer.tweaks import TweakSession, session_for


@pytest.fixture
def player():
    made = Player.of(push())
    yield made
    made.close()


def wait_until(true, seconds=20.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come about in time"
        time.sleep(0.005)


def test_the_solved_motion_comes_first_and_the_physics_as_it_arrives(player):
    player.tweaks = SimpleNamespace(unsettled=True, generation=0, close=lambda: None)
    player.timeline.seek(0.4)
    first = player.frame()
    # While something is being solved the replay waits.
    assert not first.simulated and np.array_equal(first.body.qpos, first.ghost.qpos)
    player.tweaks.unsettled = False
    player.timeline.seek(0.0)
    assert player.recording.wait(20.0)
    frame = player.frame(0.1)
    assert frame.simulated and frame.time == pytest.approx(0.1)
    assert frame.body.qpos[0] == pytest.approx(player.solution.at(frame.body.time)["x"], abs=1e-5)
    assert report.simulation(player, frame) == "simulated"


def test_what_is_switched_off_is_not_shown(player):
    player.frame()
    player.recording.wait(20.0)
    everything = len(player.frame().shapes)
    player.options = Options(forces=False, contacts=False, paths=False)
    assert everything > 0 and not player.frame().shapes
    player.options = Options(physics=False)
    frame = player.frame()
    assert not frame.simulated and report.simulation(player, frame) == "switched off"


def test_open_loop_or_tracked_at_a_switch(player):
    player.frame()
    open_loop = player.recording
    player.options.tracked = True
    player.frame()
    tracked = player.recording
    assert tracked is not open_loop and tracked.wait(20.0) and tracked.tracked
    assert f"held by {tracked.law}" in report.simulation(player, player.frame())
    player.options.tracked = False
    assert player.recording is open_loop


def test_constants_are_listed_with_what_the_spec_says_of_them():
    found = {constant.name: constant for constant in constants_of(model_of(push()), push())}
    assert list(found) == ["T", "m", "d", "n"]  # h follows from others; n shapes the program and comes last
    assert found["d"].note == "m, how far" and found["m"].note == ""
    assert found["T"].note == "s" and (found["T"].low, found["T"].high) == (0.0, 1.0)
    assert found["n"].structural and not found["d"].structural
    assert slider_range(-2.0) == (-4.0, 0.0) and slider_range(0.0) == (-1.0, 1.0)


def test_turning_a_constant_shows_the_new_motion(player):
    player.tweaks = session_for(push())
    player.frame()
    player.tweaks.turn(d=0.4)
    assert player.tweaks.wait(20.0)
    frame = player.frame()
    assert frame.generation == 1 and player.solution["x"][-1] == pytest.approx(0.4)
    assert player.tweaks.outcome.status == "optimal" and not player.tweaks.refused
    assert player.tweaks.wanted("d") == 0.4
    # The physics is that of the new motion.
    assert player.recording.wait(20.0)
    player.timeline.seek(1.0)
    assert player.frame().body.qpos[0] == pytest.approx(0.4, abs=1e-5)


def test_a_duration_and_a_number_of_frames_can_be_turned(player):
    player.tweaks = session_for(push())
    player.timeline.seek(0.25)
    player.tweaks.turn(T=1.0)
    player.tweaks.wait(20.0)
    assert player.frame().time == 0.5 and player.timeline.end == 1.0
    player.tweaks.turn(n=16)
    player.tweaks.wait(20.0)
    player.frame()
    assert player.solution.n == 16 and player.solution.constants["T"] == 1.0


def test_a_solve_that_fails_keeps_the_motion_and_says_why(player):
    player.tweaks = session_for(push())
    player.frame()
    player.tweaks.turn(d=30.0)  # not with 40 N on 1 kg in half a second
    assert player.tweaks.wait(20.0)
    frame = player.frame()
    assert frame.generation == 0 and player.solution is push()
    assert player.tweaks.refused and player.tweaks.wanted("d") == 30.0
    text = report.refusal(player.tweaks)
    assert "no motion for d = 30: infeasible" in text and "kept: d = 0.3" in text
    player.tweaks.give_up()
    assert not player.tweaks.refused and player.tweaks.wanted("d") == 0.3


def test_a_mistake_in_a_wish_is_told_and_the_session_goes_on(player):
    player.tweaks = session_for(push())
    player.tweaks.turn(n=-3)
    assert player.tweaks.wait(20.0)
    assert player.tweaks.outcome.status == "error" and player.tweaks.outcome.message
    assert "n = -3" in report.refusal(player.tweaks)
    player.tweaks.give_up()
    player.tweaks.turn(d=0.35)
    assert player.tweaks.wait(20.0) and player.tweaks.outcome.status == "optimal"


def test_the_newest_wish_counts():
    """While one is worked on, further ones replace each other; constants not turned keep their values."""
    began, go_on = threading.Event(), threading.Event()
    start = push()

    class Slow:
        constants, overrides = start.constants, start.overrides
        asked = []

        def resolve(self, constants, **limits):
            self.asked.append(dict(constants))
            began.set()
            go_on.wait(10.0)
            return start.resolve(constants=constants)

    session = TweakSession(Slow(), [])
    session.turn(d=0.31)
    assert began.wait(10.0) and session.busy
    for value in (0.32, 0.33, 0.34):
        session.turn(d=value)
    session.turn(m=1.1)
    go_on.set()
    assert session.wait(20.0)
    session.close()
    assert Slow.asked == [{"d": 0.31}] and session.generation == 2
    assert session.solution.constants["d"] == 0.34 and session.solution.constants["m"] == 1.1


def test_a_solution_from_a_file_can_be_turned(tmp_path):
    push().save(tmp_path / "push.npz")
    session = session_for(read(tmp_path / "push.npz"))
    session.turn(m=2.0)
    assert session.wait(30.0) and session.outcome.status == "optimal"
    session.close()


def test_a_watched_solve_shows_its_iterates_and_hands_over_its_solution():
    kept = []
    live = LiveSolve(load("segment_swing"), keep=kept.append)
    live.start()
    assert live.wait_for_motion(30.0) and live.wait(60.0)
    assert live.error is None and live.solution.status == "optimal" and kept == [live.solution]
    assert live.iterate is live.solution and live.generation >= 2
    assert "ended optimal" in report.progress(live)
    assert live.record.x is None  # the solver's own array is not kept


def test_an_iterate_is_the_motion_at_the_solvers_point():
    model, seen = load(PUSH), []

    def look(record):
        seen.append((record.objective, model.reached(record)))

    solution = model.solve(callback=look)
    assert seen[-1][1].status == "interrupted"
    assert np.allclose(seen[-1][1]["x"], solution["x"], atol=1e-6)
    assert seen[-1][1].replay[0].name == "x" and seen[-1][0] == pytest.approx(solution.objective)


def test_a_watched_solve_can_be_stopped_and_its_best_is_told_honestly(player):
    held = threading.Event()

    class Watched(LiveSolve):
        def _look(self, record):
            stop = super()._look(record)
            if record.iteration == 2:
                held.set()
                wait_until(lambda: self.stopping)
                return True
            return stop

    live = Watched(load("segment_swing"))
    live.start()
    assert held.wait(30.0) and live.running
    player.live = live
    live.stop()
    assert live.wait(30.0)
    assert live.solution.status == "interrupted" and "ended interrupted" in report.progress(live)


def test_a_player_follows_a_live_solve_and_then_offers_its_constants():
    live = LiveSolve(load(PUSH))
    live.start()
    live.wait(30.0)
    player = Player.of(live.iterate)
    player.live = live
    player.frame()
    assert player.solution is live.solution and player.tweaks is not None
    player.tweaks.turn(d=0.2)
    player.tweaks.wait(20.0)
    player.frame()
    assert player.solution["x"][-1] == pytest.approx(0.2)
    assert report.summary(player).startswith("text: optimal")
    player.close()


def test_a_live_solve_that_cannot_start_carries_its_error():
    live = LiveSolve(load(PUSH), constants={"nonsense": 1.0})
    live.start()
    assert live.wait(30.0) and isinstance(live.error, UsageError)
    assert "nonsense" in report.progress(live)
