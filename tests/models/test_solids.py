"""Masses, centres and inertias against closed forms."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
import trimesh
from trimesh import creation

from stc.models.shapes import knob, lathe, rod
from stc.models.solids import Solid, inertia_of


def test_a_box() -> None:
    a, b, c, m = 0.3, 0.2, 0.1, 1.7
    found = inertia_of([Solid(creation.box((a, b, c)), m, (0.1, -0.2, 0.3))])
    assert found.centre == (0.1, -0.2, 0.3)
    assert found.mass == m
    expected = np.array([b * b + c * c, a * a + c * c, a * a + b * b]) * m / 12
    np.testing.assert_allclose(found.moments, expected, rtol=1e-14)


@pytest.mark.parametrize("sections", [5, 32])
def test_a_prism(sections: int) -> None:
    radius, length, m = 0.05, 0.4, 2.0
    found = inertia_of([Solid(rod(radius, (0, 0, 0), (0, 0, length), sections), m)])
    # Second moment of a regular polygon's area about any axis in its plane through its middle, per area.
    flat = radius**2 * (2 + cos(2 * pi / sections)) / 12
    across = m * (flat + length**2 / 12)
    np.testing.assert_allclose(found.moments, [across, across, 2 * m * flat], rtol=1e-13)
    np.testing.assert_allclose(found.centre, [0, 0, length / 2], atol=1e-16)


def test_a_cone_turned_on_the_lathe() -> None:
    radius, height, sections = 0.3, 0.8, 24
    found = inertia_of([Solid(lathe([(0, 0), (radius, 0), (0, height)], sections), 1.0)])
    flat = radius**2 * (2 + cos(2 * pi / sections)) / 12
    assert found.centre[2] == pytest.approx(height / 4, rel=1e-14)
    assert found.moments[2] == pytest.approx(2 * flat * 3 / 5, rel=1e-13)
    assert found.moments[0] == pytest.approx(flat * 3 / 5 + height**2 * 3 / 80, rel=1e-13)


def test_several_solids_obey_the_parallel_axis_theorem() -> None:
    cube = creation.box((0.2, 0.2, 0.2))
    found = inertia_of([Solid(cube, 1.0, (0.0, 0.0, 0.0)), Solid(cube, 3.0, (0.4, 0.0, 0.0))])
    own = 4.0 * 0.2**2 / 6
    about = 1.0 * 0.3**2 + 3.0 * 0.1**2
    np.testing.assert_allclose(found.centre, [0.3, 0, 0], rtol=1e-15)
    np.testing.assert_allclose(found.moments, [own, own + about, own + about], rtol=1e-14)


def test_a_solid_must_be_closed() -> None:
    box = creation.box((1, 1, 1))
    with pytest.raises(ValueError, match="closed surface"):
        inertia_of([Solid(trimesh.Trimesh(box.vertices, box.faces[1:]), 1.0)])


def test_principal_axes_must_be_parallel_to_the_frame() -> None:
    slanted = rod(0.01, (0, 0, 0), (sin(0.3), 0, cos(0.3)))
    with pytest.raises(ValueError, match="principal axes"):
        inertia_of([Solid(slanted, 1.0)])


def test_a_knob_lies_along_y() -> None:
    shape = knob(0.02, 0.06, (0.1, 0.0, 0.2), bevel=0.004)
    assert shape.is_volume
    np.testing.assert_allclose(shape.extents, [0.04, 0.06, 0.04], atol=1e-12)
    np.testing.assert_allclose(shape.center_mass, [0.1, 0.0, 0.2], atol=1e-12)
