"""The USD stage, opened again by USD's own library and held against MuJoCo's forward kinematics."""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from closed_form_motions import smooth_particle, waypoint_spline
from rigid_motions import tumbling_box

import stc
from stc.errors import UsageError
from stc.solution import Solution
from stc.validate.export import export
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import prepare

pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
from pxr import Usd, UsdGeom, UsdShade  # noqa: E402


def check_against_mujoco(solution: Solution, file: Path, rate: float, tolerance: float) -> int:
    """Every body at seven samples, and the corners of every mesh at the last one; how many bodies there are."""
    setup, stage = prepare(solution), Usd.Stage.Open(str(file))
    model, data = setup.compiled, mujoco.MjData(setup.compiled)
    prims = {prim.GetDisplayName(): prim for prim in stage.Traverse() if prim.GetDisplayName()}
    codes = np.append(np.floor(np.linspace(0, solution.duration * rate, 7))[:-1], solution.duration * rate)
    for code in codes:
        cache = UsdGeom.XformCache(Usd.TimeCode(code))
        data.qpos[:] = solved_at(setup, solution.time[:1] + code / rate)[0]
        mujoco.mj_kinematics(model, data)
        for name, prim in prims.items():
            found = np.array(cache.GetLocalToWorldTransform(prim)).T  # USD multiplies rows from the left
            np.testing.assert_allclose(found[:3, 3], data.body(name).xpos, atol=tolerance)
            np.testing.assert_allclose(found[:3, :3], data.body(name).xmat.reshape(3, 3), atol=tolerance)
    return len(prims)


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_the_lamp_moves_as_mujoco_has_it(suffix: str, tmp_path: Path) -> None:
    solution = stc.load("luxo_poses").solve()
    file = export(solution, "usd", tmp_path / f"lamp{suffix}", rate=50.0)
    assert check_against_mujoco(solution, file, 50.0, 1e-9) == 4
    stage = Usd.Stage.Open(str(file))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 50.0
    assert stage.GetStartTimeCode() == 0.0
    assert stage.GetEndTimeCode() == pytest.approx(50.0 * solution.duration)
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert all(UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0] for mesh in meshes)
    # A mesh in its body is MuJoCo's: corners in the world, at the start.
    setup = prepare(solution)
    model, data = setup.compiled, mujoco.MjData(setup.compiled)
    data.qpos[:] = solved_at(setup, solution.time[:1])[0]
    mujoco.mj_kinematics(model, data)
    cache, corners, wanted = UsdGeom.XformCache(Usd.TimeCode(0.0)), [], []
    for mesh in meshes:
        points = np.array(mesh.GetPointsAttr().Get(), dtype=float)
        if "floor" not in mesh.GetPath().name:
            matrix = np.array(cache.GetLocalToWorldTransform(mesh.GetPrim()))
            corners.append(points @ matrix[:3, :3] + matrix[3, :3])
    for geom in np.flatnonzero(model.geom_type == int(mujoco.mjtGeom.mjGEOM_MESH)):
        first, count = (
            getattr(model, name)[model.geom_dataid[geom]] for name in ("mesh_vertadr", "mesh_vertnum")
        )
        vertices = model.mesh_vert[first : first + count]
        wanted.append(vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    for side in (np.min, np.max):
        np.testing.assert_allclose(
            side(np.concatenate(corners), axis=0), side(np.concatenate(wanted), axis=0), atol=1e-6
        )


def test_a_body_that_tumbles(tmp_path: Path) -> None:
    solution = tumbling_box(tmp_path)
    file = export(solution, "usd", tmp_path / "box.usda")
    assert check_against_mujoco(solution, file, 60.0, 1e-9) == 1


def test_without_the_library_one_message_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.setattr("stc.validate.export.find_spec", lambda name: None)
    with pytest.raises(UsageError, match="need the library usd-core") as raised:
        export(
            smooth_particle("central", np.linspace(0, 2, 21), *waypoint_spline()), "usd", tmp_path / "a.usda"
        )
    assert "pip install usd-core" in str(raised.value)
    assert not list(tmp_path.iterdir())
