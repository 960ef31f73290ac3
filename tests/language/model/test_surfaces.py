"""Surfaces against MuJoCo's own contacts."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

from stc.language import syntax
from stc.language.model.scope import ModelScope
from stc.language.model.surfaces import floor
from stc.mechanism.read import read_model


@pytest.mark.parametrize(("ours", "theirs"), [(0, 0), (1, 0), (0, 1), (2, 2)])
@pytest.mark.parametrize("friction", [0.3, 0.9])
def test_friction_of_two_geoms_is_combined_as_mujoco_does(
    tmp_path: Path, ours: int, theirs: int, friction: float
) -> None:
    path = tmp_path / "ball.xml"
    path.write_text(
        f"""<mujoco><worldbody><geom type="plane" size="1 1 1" friction="0.6" priority="{theirs}"/>
        <body pos="0 0 .1"><freejoint/><geom size=".101" friction="{friction}" priority="{ours}"/></body></worldbody>
        </mujoco>""",
        encoding="utf-8",
    )
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mechanism = read_model(path)
    surface = floor(ModelScope(syntax.ModelFile(0, 0, ""), path, mechanism))
    assert surface.friction_with(mechanism.geoms[1]) == pytest.approx(data.contact[0].friction[0])
