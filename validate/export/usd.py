"""The moving model as a USD stage: bodies as transforms with samples over time, their geoms as meshes below them.

USD keeps units and axes in the file: metres, z up as in MuJoCo, and so many time codes per second.  Every body is an
``Xform`` below its parent's, with a translation and an orientation where it moves against its parent, so that
programs find the joints where the model has them.  See the OpenUSD documentation of UsdGeom and UsdShade.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.atomic import replacing
from stc.validate.export.geometry import Look, body_names, local_poses, shown_geoms, surface
from stc.validate.export.proportion import USUAL_RATE, intervals, require_proportion
from stc.validate.metrics import FloatArray
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import trimesh

#: The path of everything in the stage, and of its materials.
_ROOT, _LOOKS = "/World", "/World/Looks"
#: What moves less than this, in m or as a component of a quaternion, stands still.
_STILL = 1e-9


def write(setup: Setup, path: Path, rate: float | None = None) -> None:
    """Write the solved motion.

    Args:
        setup: the motion and its model.
        path: of the file, ``.usda`` (text) or ``.usdc`` (binary).
        rate: time codes per second; None takes 60.  The last sample is at the end of the motion, at a time code that
            need not be a whole number.

    Raises:
        UsageError: with this rate the file is out of proportion.
        OSError: the file cannot be written.
    """
    from pxr import Usd, UsdGeom

    model, solution = setup.compiled, setup.solution
    rate = USUAL_RATE if rate is None else rate
    require_proportion(solution.duration * rate, 7 * model.nbody, f"a rate of {rate:g} Hz")
    codes = np.arange(intervals(solution.duration, rate) + 1, dtype=float)
    codes[-1] = solution.duration * rate
    times = np.minimum(solution.time[0] + codes / rate, solution.time[-1])
    translations, rotations = local_poses(model, solved_at(setup, times))

    stage = Usd.Stage.CreateInMemory(path.name)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.LinearUnits.meters)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(codes[-1])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, _ROOT).GetPrim())
    UsdGeom.Scope.Define(stage, _LOOKS)
    stage.SetMetadata("comment", f"{solution.name}, solved by stc and written from {setup.path.name}")

    places = {0: _ROOT}
    names = body_names(model, "World")
    for body in range(1, model.nbody):
        places[body] = _free_path(stage, f"{places[int(model.body_parentid[body])]}/", names[body])
        node = UsdGeom.Xform.Define(stage, places[body])
        node.GetPrim().SetDisplayName(names[body])
        _animate(node, codes, translations[:, body], rotations[:, body])
    looks: dict[Look, Any] = {}
    for geom, look in shown_geoms(model):
        shape = surface(model, geom)
        if shape is None:
            continue
        parent = places[int(model.geom_bodyid[geom])]
        at = _free_path(stage, f"{parent}/", model.geom(geom).name or f"geom{geom}")
        mesh = _mesh(stage, at, shape, look)
        _place(mesh, model.geom_pos[geom], model.geom_quat[geom])
        if look not in looks:
            looks[look] = _material(stage, look)
        _bind(mesh, looks[look])
    with replacing(path) as temporary:
        stage.GetRootLayer().Export(str(temporary))


def _free_path(stage: Any, parent: str, name: str) -> str:
    """A path below ``parent`` that nothing has yet; USD's names have letters, digits and underscores only."""
    from pxr import Tf

    wanted = parent + Tf.MakeValidIdentifier(name)
    path, count = wanted, 1
    while stage.GetPrimAtPath(path):
        count += 1
        path = f"{wanted}_{count}"
    return path


def _animate(node: Any, codes: FloatArray, translations: FloatArray, rotations: FloatArray) -> None:
    """Give a body its transforms (k, 3) and (k, 4), w first, over time codes (k,); one where it stands still."""
    from pxr import Gf, UsdGeom

    move = node.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
    turn = node.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    made = [Gf.Vec3d(*row) for row in translations.tolist()], [Gf.Quatd(*row) for row in rotations.tolist()]
    for operation, values, numbers in zip((move, turn), made, (translations, rotations), strict=True):
        if np.abs(numbers - numbers[0]).max() < _STILL:
            operation.Set(values[0])
            continue
        for code, value in zip(codes.tolist(), values, strict=True):
            operation.Set(value, code)


def _place(mesh: Any, position: FloatArray, quaternion: FloatArray) -> None:
    """Put a geom where it is in its body."""
    from pxr import Gf, UsdGeom

    mesh.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*np.asarray(position).tolist()))
    mesh.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(*np.asarray(quaternion).tolist()))


def _mesh(stage: Any, path: str, shape: trimesh.Trimesh, look: Look) -> Any:
    """The surface of a geom."""
    from pxr import Gf, UsdGeom, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(shape.vertices, dtype=np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(shape.faces), 3, dtype=np.int32)))
    faces = np.asarray(shape.faces, dtype=np.int32).reshape(-1)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(shape.vertex_normals, dtype=np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)  # a polygon mesh, whose normals count
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.asarray(shape.bounds, dtype=np.float32)))
    mesh.CreateDisplayColorAttr([Gf.Vec3f(*look.rgba[:3])])
    mesh.CreateDisplayOpacityAttr([look.rgba[3]])
    return mesh


def _material(stage: Any, look: Look) -> Any:
    """The preview material of a look."""
    from pxr import Gf, Sdf, UsdShade

    path = _free_path(stage, f"{_LOOKS}/", look.name)
    material, shader = UsdShade.Material.Define(stage, path), UsdShade.Shader.Define(stage, f"{path}/preview")
    shader.CreateIdAttr("UsdPreviewSurface")
    colour, kinds = Gf.Vec3f(*look.rgba[:3]), Sdf.ValueTypeNames
    for name, kind, value in (
        ("diffuseColor", kinds.Color3f, colour),
        ("emissiveColor", kinds.Color3f, colour * look.glow),
        ("opacity", kinds.Float, look.rgba[3]),
        ("metallic", kinds.Float, look.metal),
        ("roughness", kinds.Float, look.rough),
    ):
        shader.CreateInput(name, kind).Set(value)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def _bind(mesh: Any, material: Any) -> None:
    from pxr import UsdShade

    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
