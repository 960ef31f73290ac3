"""Arrows, arcs, lines, and their projection onto a picture."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stc.viewer.overlay import Eye, draw, packed
from stc.viewer.shapes import SOLVED, Shape, force_arrow, line_of_action, polyline, torque_arc

VECTOR = st.lists(st.floats(-3, 3), min_size=3, max_size=3).map(np.array)


def test_an_arrow_is_as_long_as_its_force_and_a_tiny_one_is_left_out():
    point, force = np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 50.0])
    (arrow,) = force_arrow(point, force, 0.01, 0.6, SOLVED)
    assert np.allclose(arrow.end - arrow.start, [0.0, 0.0, 0.5]) and np.array_equal(arrow.start, point)
    assert force_arrow(point, 1e-4 * force, 0.01, 0.6, SOLVED) == []
    assert force_arrow(point, 0.0 * force, 0.01, 0.6, SOLVED) == []


@given(VECTOR, VECTOR, VECTOR)
def test_about_its_line_of_action_a_wrench_has_no_torque_across_its_force(point, force, torque):
    if np.linalg.norm(force) < 1e-2:
        return
    arm = line_of_action(point, force, torque) - point
    left = torque - np.cross(arm, force)
    assert np.allclose(np.cross(left, force), 0.0, atol=1e-6)  # what is left turns about the force itself
    assert abs(arm @ force) < 1e-6


def test_the_centre_of_pressure_of_a_foot():
    # 100 N upwards and -5 N m about y at the middle of a sole: it presses 5 cm ahead.
    assert np.allclose(
        line_of_action(np.zeros(3), np.array([0.0, 0.0, 100.0]), np.array([0.0, -5.0, 0.0])), [0.05, 0, 0]
    )


@pytest.mark.parametrize("share", [1.0, 0.3, -0.3])
def test_an_arc_turns_the_way_its_torque_does(share):
    axis = np.array([0.0, 1.0, 0.0])
    arc = list(torque_arc(np.zeros(3), axis, share, 0.1, SOLVED))
    assert arc[-1].kind == "arrow"
    for piece in arc:
        turn = np.cross(piece.start, piece.end) @ axis
        assert np.sign(turn) == np.sign(share)
        assert np.linalg.norm(piece.start) == pytest.approx(0.1)
    assert list(torque_arc(np.zeros(3), axis, 0.0, 0.1, SOLVED)) == []


def test_a_path_has_gaps_where_nothing_is_known():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [np.nan, 0, 0], [2, 0, 0], [2, 0, 0], [3, 0, 0]])
    assert [(line.start[0], line.end[0]) for line in polyline(points, SOLVED, 0.01)] == [(0, 1), (2, 3)]


def test_projection_is_that_of_a_pinhole():
    eye = Eye(
        np.array([0.0, -2.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.5, 400.0, 200.0
    )
    pixels, scale = eye.project(
        np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [1.0, 0.0, 1.0], [0.0, -3.0, 1.0]])
    )
    # At a distance of 2 m half the picture's height, 100 pixels, is 1 m.
    assert np.allclose(pixels[:3], [[200, 100], [200, 0], [300, 100]])
    assert np.allclose(scale[:3], 100.0) and np.isnan(scale[3])


def test_projection_agrees_with_the_camera_of_mujoco():
    import mujoco

    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='.1'/></worldbody></mujoco>")
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (0.3, 0.2, 0.1), 2.0, 130.0, -20.0
    eye = Eye.of(mujoco.mjv_camera2GLCamera(model, data, camera), 640, 480)
    pixels, scale = eye.project(np.array([[0.3, 0.2, 0.1]]))
    assert np.allclose(pixels, [[320, 240]], atol=1e-3)
    assert scale[0] == pytest.approx(240 / (2.0 * np.tan(np.radians(model.vis.global_.fovy / 2))), rel=1e-5)


def test_colours_are_packed_with_red_lowest():
    assert packed((1.0, 0.0, 0.0, 1.0)) == 0xFF0000FF
    assert packed((0.0, 2.0, 0.0, 0.0)) == 0x0000FF00


def test_what_lies_behind_the_eye_is_not_drawn():
    drawn = []
    canvas = SimpleNamespace(
        AddLine=lambda *a: drawn.append("line"),
        AddCircleFilled=lambda *a: drawn.append("ball"),
        AddTriangleFilled=lambda *a: drawn.append("head"),
    )
    eye = Eye(np.zeros(3), np.array([1.0, 0, 0]), np.array([0.0, 0, 1]), 0.5, 400.0, 200.0)
    ahead, behind = np.array([2.0, 0, 0]), np.array([-2.0, 0, 0])
    shapes = [
        Shape("ball", ahead, ahead, 0.1, SOLVED),
        Shape("tube", ahead, behind, 0.1, SOLVED),
        Shape("arrow", ahead, ahead + [0, 0, 0.5], 0.01, SOLVED),
        Shape("tube", ahead, ahead + [0, 0, 0.5], 0.01, SOLVED),
    ]
    draw(canvas, lambda x, y: (x, y), eye, shapes)
    draw(canvas, lambda x, y: (x, y), eye, [])
    assert drawn == ["ball", "line", "head", "line"]
