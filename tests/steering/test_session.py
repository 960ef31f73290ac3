"""A steered spec: what is dragged is where it was dragged, in a solution of the text as it is written."""

import mujoco
import numpy as np
import pytest

from stc.errors import Source, UnsolvedError, UsageError
from stc.pipeline import Model, load, read_source
from stc.steering.session import Session
from stc.validate.setup import prepare


@pytest.fixture
def session():
    made = []

    def make(spec, **options):
        source = spec if isinstance(spec, Source) else read_source(spec)
        made.append(Session(source, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_points_are_those_of_mujoco(session):
    poses = session("luxo_poses")
    handle = next(h for h in poses.handles.values() if h.kind == "pose" and h.frame == 60 and "A3" in h.knobs)
    setup = prepare(load("luxo_poses").solve())
    data = mujoco.MjData(setup.compiled)
    for name, joint in (("a1", "hip"), ("a2", "elbow"), ("a3", "neck")):
        data.joint(joint).qpos[:] = setup.solution[name][60]
    mujoco.mj_forward(setup.compiled, data)
    assert np.allclose(poses.points()[handle.key], data.xipos[handle.body], atol=1e-9)


def test_a_part_of_the_body_is_dragged_and_the_text_says_so(session):
    poses = session("luxo_poses")
    key = next(h.key for h in poses.handles.values() if h.frame == 60 and "A3" in h.knobs)
    before, first = poses.points()[key], poses.solution
    poses.drag(key, before + [0.03, 0.0, -0.05])
    poses.release()
    assert poses.wait()
    assert poses.solution.status == "optimal"
    assert np.allclose(poses.points()[key], before + [0.03, 0.0, -0.05], atol=2e-4)
    fresh = Model(Source("luxo_poses.stc", poses.text())).solve()
    for name in ("a1", "a2", "a3"):
        assert np.allclose(fresh[name], poses.solution[name], atol=1e-5)
    assert poses.undo()
    assert poses.solution is first
    assert poses.text() == read_source("luxo_poses").text
    assert not poses.undo()
    assert poses.redo()
    assert np.allclose(poses.points()[key], before + [0.03, 0.0, -0.05], atol=2e-4)
    assert not poses.redo()


def test_each_gesture_is_undone_by_itself(session):
    jump = session("particle_waypoints")
    for value in (0.6, 0.7):
        jump.turn({"x1": value - 0.05})
        jump.turn({"x1": value})  # the same gesture
        jump.release()
        assert jump.wait()
    assert jump.solution.constants["x1"] == 0.7
    assert jump.undo()
    assert jump.solution.constants["x1"] == 0.6
    assert jump.undo()
    assert jump.solution.constants["x1"] == 0.5
    jump.turn({"x1": 0.55})
    assert not jump.can_redo


def test_waypoints_are_dragged_in_the_plane(session):
    particle = session("particle_waypoints")
    key = next(h.key for h in particle.handles.values() if set(h.knobs) == {"x2", "y2"})
    here = particle.points()[key]
    assert np.allclose(here[[0, 2]], [1.1, 0.5], atol=1e-9)
    particle.drag(key, here + [0.1, 0.3, -0.2])  # the particle cannot leave the plane
    particle.release()
    assert particle.wait()
    assert particle.solution.constants["x2"] == pytest.approx(1.2, abs=1e-4)
    assert particle.solution.constants["y2"] == pytest.approx(0.3, abs=1e-4)
    assert particle.solution["x"][30] == pytest.approx(1.2, abs=1e-4)


def test_what_fails_keeps_the_motion_and_says_why(session):
    poses = session("luxo_poses")
    shown = poses.solution
    poses.turn({"umax": 0.01})  # no motor could hold it
    poses.release()
    assert poses.wait()
    assert poses.message
    assert poses.solution.status == "optimal"
    assert poses.solution.constants["umax"] > 0.01
    poses.undo()
    assert poses.solution is shown
    assert poses.message == ""


def test_what_cannot_be_steered_is_told(session):
    poses = session("luxo_poses")
    with pytest.raises(UsageError, match="`B1` is computed"):
        poses.turn({"B1": 0.1})
    with pytest.raises(UsageError, match="needs a number"):
        poses.turn({"g": float("nan")})
    with pytest.raises(UsageError, match="no such handle"):
        poses.drag("head", [0.0, 0.0, 0.0])


def test_a_spec_that_does_not_solve(session):
    source = read_source("luxo_poses")
    with pytest.raises(UnsolvedError, match="has no motion to begin with"):
        session(Source("poses.stc", source.text.replace("umax = 15", "umax = 0.01"), source.path))


def test_writing_leaves_what_others_wrote_alone(session, tmp_path):
    file = tmp_path / "thrown.stc"
    text = read_source("particle_waypoints").text
    file.write_text(text)
    particle = session(str(file))
    particle.turn({"x1": 0.625})
    particle.release()
    assert particle.wait()
    assert "-  x1 = 0.5," in particle.changes()
    assert particle.write() == file
    assert file.read_text() == particle.text() != text
    assert Model(read_source(file)).problem().constants["x1"] == 0.625
    assert particle.changes() == ""
    assert particle.undo()
    particle.write()
    assert file.read_text() == text
    file.write_text(text + "# by hand\n")
    particle.turn({"x1": 0.75})
    assert particle.wait()
    with pytest.raises(UsageError, match="has changed on disk since it was read: nothing was written"):
        particle.write()
    assert file.read_text() == text + "# by hand\n"


def test_a_new_file_is_written_for_a_bundled_spec(session, tmp_path):
    file = tmp_path / "mine.stc"
    particle = session("particle_waypoints", target=file)
    assert particle.changes() == ""
    particle.turn({"x1": 0.625})
    assert particle.wait()
    particle.write()
    assert file.read_text() == read_source("particle_waypoints").text.replace("x1 = 0.5,", "x1 = 0.625,")


def test_a_drag_that_is_told_again_while_it_is_worked_on_goes_on(session):
    poses = session("luxo_poses")
    key = next(h.key for h in poses.handles.values() if h.frame == 60 and "A3" in h.knobs)
    target = poses.points()[key] + [0.05, 0.0, -0.06]  # several strides away
    for _ in range(5):
        poses.drag(key, target)
    poses.release()
    assert poses.wait()
    assert np.allclose(poses.points()[key], target, atol=3e-4)
    assert poses.undo()  # all of it is one gesture
    assert not poses.can_undo


@pytest.mark.nightly
def test_a_standing_quadruped_is_dragged_and_its_feet_stay(session):
    hop = session("quadruped_hop")
    keys = {h.label: h.key for h in hop.handles.values()}
    before = hop.points()
    hop.drag(keys["trunk at [n]"], before[keys["trunk at [n]"]] + [0.0, 0.0, -0.01])
    hop.release()
    assert hop.wait(300.0)
    after = hop.points()
    moved = {label: after[key] - before[key] for label, key in keys.items()}
    assert np.allclose(moved["trunk at [n]"], [0.0, 0.0, -0.01], atol=2e-4)
    for foot in ("FL", "FR", "RL", "RR"):
        assert np.allclose(moved[f"{foot} at [n]"], 0.0, atol=2e-4)
        assert np.allclose(moved[f"{foot} at [0]"], 0.0, atol=1e-6)
    hop.drag(keys["FL at [n]"], after[keys["FL at [n]"]] + [0.01, 0.005, 0.3])
    hop.release()
    assert hop.wait(300.0)
    found = {label: hop.points()[key] - after[key] for label, key in keys.items()}
    assert np.allclose(
        found["FL at [n]"], [0.01, 0.005, 0.0], atol=3e-4
    )  # a foot that stands stays on the floor
    assert np.allclose(found["trunk at [n]"], 0.0, atol=2e-4)
    text = hop.text()
    assert "[n]: stand_n + (D, 0, 0); rest;" in text
    assert "[0]: keyframe.stand; rest;" in text
    written = Model(Source("hop.stc", text)).solve(warm_start=hop.solution)
    assert written.status == "optimal"
    assert written.objective == pytest.approx(hop.solution.objective, rel=1e-5)
