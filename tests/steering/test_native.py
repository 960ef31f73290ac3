"""Balls in MuJoCo's viewer: what a watcher moves there is dragged, without a window."""

from contextlib import nullcontext

import mujoco
import numpy as np
import pytest

from stc.pipeline import read_source
from stc.steering.native import Balls, draw, model_with_balls
from stc.steering.session import Session


class Window:
    """What ``mujoco.viewer.launch_passive`` gives, as far as it is used."""

    def __init__(self):
        self.texts = None
        self.opt = mujoco.MjvOption()

    def lock(self):
        return nullcontext()

    def set_texts(self, texts):
        self.texts = texts

    def sync(self):
        pass


@pytest.fixture
def steered():
    session = Session(read_source("luxo_poses"))
    model = model_with_balls(session)
    yield session, model, mujoco.MjData(model), Balls(session)
    session.close()


def test_a_ball_that_is_moved_drags_its_handle(steered):
    session, model, data, balls = steered
    assert model.nq == session.shown().compiled.nq
    handles = list(session.handles.values())
    index = next(k for k, one in enumerate(handles) if one.frame == 60 and "A3" in one.knobs)
    balls.frame = 60
    balls.look(data, 0.0, 0.0)
    begin = session.points()[handles[index].key]
    assert np.allclose(data.mocap_pos[index], begin)
    hidden = next(k for k, one in enumerate(handles) if one.frame == 0)
    assert data.mocap_pos[hidden, 2] < -100.0
    for k in range(5):  # the watcher moves it
        data.mocap_pos[index] = begin + np.array([0.004, 0.0, -0.004]) * (k + 1)
        balls.look(data, 0.01 * k, 0.01)
        assert np.allclose(data.mocap_pos[index], begin + np.array([0.004, 0.0, -0.004]) * (k + 1))
        assert balls.held is handles[index]
    assert session.wait()
    balls.look(data, 1.0, 0.01)  # and has let it go
    assert balls.held is None
    balls.look(data, 1.1, 0.01)
    assert np.allclose(session.points()[handles[index].key], begin + [0.02, 0.0, -0.02], atol=2e-4)
    assert np.allclose(data.mocap_pos[index], session.points()[handles[index].key])
    balls.press(ord("Z"))
    balls.look(data, 1.2, 0.01)
    assert np.allclose(data.mocap_pos[index], begin)


def test_the_body_is_shown_where_the_motion_has_it(steered):
    session, model, data, balls = steered
    window = Window()
    balls.timeline.seek(float(session.solution.time[-1]))
    balls.timeline.playing = False
    draw(window, model, data, balls, 0.0)
    last = [session.solution[name][-1] for name in ("a1", "a2", "a3")]
    assert np.allclose(data.qpos, last, atol=1e-9)
    assert window.texts[2] == "solved"
    # The viewer has its own meaning of this key, the islands of constraints, and switches them on.
    window.opt.flags[mujoco.mjtVisFlag.mjVIS_ISLAND] = 1
    draw(window, model, data, balls, 0.0)
    assert np.array_equal(window.opt.flags, mujoco.MjvOption().flags)
    balls.press(ord("N"))
    assert balls.frame in (0, 60)
