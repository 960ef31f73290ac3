"""Where a motion is and which forces act, physics that arrives while it is shown, the scene with its ghost."""

import threading

import numpy as np
import pytest
from viewer.motions import PUSH, jump, push

from stc.pipeline import load
from stc.viewer.geoms import MOST, Geoms
from stc.viewer.motion import Motion
from stc.viewer.physics import Recording
from stc.viewer.scene import make_scene
from stc.viewer.shapes import FOUND, SOLVED, TORQUE, Shape


@pytest.fixture(scope="module")
def lamp():
    return Motion(jump())


@pytest.fixture(scope="module")
def lamp_physics(lamp):
    recording = Recording(lamp.setup)
    recording.run()
    return recording


def test_the_solved_pose_is_the_solutions():
    motion = Motion(push())
    for instant in (0.0, 0.13, 0.5):
        state = motion.state(instant)
        at = motion.solution.at(instant)
        assert state.time == instant
        assert state.qpos[0] == pytest.approx(at["x"], abs=1e-12)
        assert state.qvel[0] == pytest.approx(at["x'"], abs=1e-12)
        assert state.ctrl[0] == pytest.approx(at["f"], abs=1e-9)


def test_physics_arrives_in_order_and_is_the_motion():
    motion = Motion(push())
    recording = Recording(motion.setup)
    assert recording.at(0.0) is None and recording.share == 0.0 and not recording.done
    recording.start()
    assert recording.wait(20.0) and not recording.error
    assert recording.share == pytest.approx(1.0)
    for instant in np.linspace(0.0, 0.5, 23):
        state = recording.at(instant)
        assert -1e-9 <= instant - state.time <= 1.1e-3
        assert state.qpos[0] == pytest.approx(motion.solution.at(state.time)["x"], abs=1e-6)


def test_physics_that_has_not_come_yet_is_told_from_physics_that_has():
    motion, urgent = Motion(push()), threading.Event()
    seen = []

    def busy():
        seen.append(1)
        return len(seen) > 200 and not urgent.is_set()

    recording = Recording(motion.setup, busy=busy)
    recording.start()
    while len(seen) < 210:
        urgent.wait(0.005)
    assert 0.0 < recording.share < 1.0 and not recording.done
    assert recording.at(0.0) is not None and recording.at(0.5) is None
    positions = recording.positions(np.array([0.0, 0.5]))
    assert np.isfinite(positions[0]).all() and np.isnan(positions[1]).all()
    urgent.set()
    assert recording.wait(20.0) and recording.at(0.5) is not None


def test_a_recording_can_be_cancelled():
    motion = Motion(push())
    recording = Recording(motion.setup, busy=lambda: True)
    recording.start()
    recording.cancel()
    assert recording.wait(20.0) and recording.share < 1.0


def test_a_tracked_recording_names_its_law():
    recording = Recording(Motion(push()).setup, tracked=True)
    recording.run()
    assert recording.law in ("LQR", "PD") and recording.share == pytest.approx(1.0)


def test_solved_and_found_ground_forces_are_drawn_alike(lamp, lamp_physics):
    none, errors, shifts = np.zeros(3), [], []
    for instant in np.linspace(0.02, 0.38, 25):
        solved = [s for s in lamp.solved_forces(instant, none) if s.colour == SOLVED]
        found = lamp.found_forces(lamp_physics.at(instant))
        # MuJoCo's contacts are soft: for an instant they may give nothing.
        if len(solved) == len(found) == 1:
            push, answer = solved[0].end - solved[0].start, found[0].end - found[0].start
            assert found[0].colour == FOUND
            errors.append(np.linalg.norm(answer - push) / np.linalg.norm(push))
            shifts.append(abs(found[0].start[0] - solved[0].start[0]))
    assert len(errors) > 15 and np.median(errors) < 0.02 and np.median(shifts) < 2e-3
    # Nothing presses in flight.
    assert not [s for s in lamp.solved_forces(0.6, none) if s.colour == SOLVED]
    assert lamp.found_forces(lamp_physics.at(0.6)) == []


def test_torques_are_arcs_around_their_hinges(lamp):
    import mujoco

    data = mujoco.MjData(lamp.setup.compiled)
    lamp.state(0.2).put(data)
    mujoco.mj_kinematics(lamp.setup.compiled, data)
    arcs = [s for s in lamp.solved_forces(0.2, np.zeros(3)) if s.colour == TORQUE]
    assert arcs
    for piece in arcs:
        distances = np.linalg.norm(data.xanchor - piece.start, axis=1)
        assert distances.min() < 0.2 * lamp.extent


def test_paths_follow_foot_and_head_and_move_with_the_ghost(lamp):
    here, aside = np.zeros(3), np.array([0.0, 0.3, 0.0])
    assert len(lamp.places) == 2
    shapes = lamp.paths(here)
    assert lamp.paths(here) is shapes
    moved = lamp.paths(aside)
    assert len(moved) == len(shapes) <= MOST // 2
    assert all(np.allclose(a.start + aside, b.start) for a, b in zip(shapes, moved))


def test_the_scene_has_a_ghost_that_weighs_on_nothing(lamp, lamp_physics):
    import mujoco

    scene = make_scene(lamp)
    plain = lamp.setup.compiled
    assert scene.has_ghost and scene.model.nq == 2 * plain.nq and scene.view is not None
    data, alone = mujoco.MjData(scene.model), mujoco.MjData(plain)
    body, ghost = lamp_physics.at(0.2), lamp.state(0.3)
    scene.put(data, body, ghost, np.array([0.0, 0.5, 0.0]))
    body.put(alone)
    mujoco.mj_forward(scene.model, data)
    mujoco.mj_forward(plain, alone)
    assert np.allclose(data.qacc[: plain.nv], alone.qacc, rtol=1e-3, atol=1e-2)
    assert data.ncon == alone.ncon > 0
    head, shade = data.body("head").xpos, data.body("ghost/head").xpos
    lamp.state(0.3).put(alone)
    mujoco.mj_kinematics(plain, alone)
    assert np.allclose(shade, alone.body("head").xpos + [0.0, 0.5, 0.0])
    assert not np.allclose(head, shade)
    colours = {
        tuple(scene.model.geom_rgba[k]) for k in range(scene.model.ngeom) if scene.model.geom_group[k] == 5
    }
    assert colours and all(colour[3] < 0.5 for colour in colours)


def test_a_model_without_light_is_lit(tmp_path):
    (tmp_path / "bare.xml").write_text("""
        <mujoco>
          <worldbody>
            <body name="particle"><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1"/></body>
          </worldbody>
          <actuator><motor name="fx" joint="x"/></actuator>
        </mujoco>""")
    (tmp_path / "bare.stc").write_text(PUSH.replace("particle.xml", "bare.xml"))
    motion = Motion(load(tmp_path / "bare.stc").solve())
    assert motion.setup.compiled.nlight == 0
    assert make_scene(motion).model.nlight == 1


@pytest.mark.parametrize("size", [(1280, 860), (1900, 700), (900, 900), (390, 844), (320, 568), (844, 390)])
def test_the_whole_motion_is_in_view_beside_or_above_the_panel(lamp, size):
    import mujoco

    from stc.viewer.layout import arrange
    from stc.viewer.overlay import Eye

    scene = make_scene(lamp)
    camera, data = mujoco.MjvCamera(), mujoco.MjData(scene.model)
    panel, free = arrange(*size)
    camera.lookat[:], camera.distance = scene.view.placed(*size, free)
    camera.azimuth, camera.elevation = scene.view.azimuth, scene.view.elevation
    eye = Eye.of(mujoco.mjv_camera2GLCamera(scene.model, data, camera), *size)
    low, high = (free.left, free.top), (free.left + free.width, free.top + free.height)
    assert 0 <= panel.left and panel.left + panel.width <= size[0]
    assert 0 <= panel.top and panel.top + panel.height <= size[1]
    assert panel.left + panel.width <= free.left or free.top + free.height <= panel.top
    for instant in np.linspace(lamp.start, lamp.end, 15):
        scene.put(data, lamp.state(instant), lamp.state(instant), np.zeros(3))
        mujoco.mj_kinematics(scene.model, data)
        pixels, _ = eye.project(data.xpos[1 : lamp.setup.compiled.nbody])
        assert np.all(pixels > low) and np.all(pixels < high)


def test_geoms_of_shapes_that_stay_are_kept():
    def line(k):
        return Shape("tube", np.zeros(3), np.array([float(k), 0.0, 1.0]), 0.1, SOLVED)

    stay, geoms = [line(k) for k in range(3)], Geoms()
    first = geoms.of([*stay, line(9)])
    second = geoms.of([*stay, line(10)])
    assert all(a is b for a, b in zip(first[:3], second[:3])) and first[3] is not second[3]
    assert len(geoms.of([line(k) for k in range(MOST + 5)])) == MOST
