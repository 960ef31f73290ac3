"""The animation, read back by readers that know nothing of how it was written."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import trimesh

import stc
from stc.solution import Solution
from stc.validate.export import export
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import Setup, prepare

Matrix = np.ndarray


class Reader:
    """A glTF reader of its own: header, chunks, accessors, nodes, samplers, as the specification has them."""

    def __init__(self, content: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON"
        self.tree: dict[str, Any] = json.loads(content[20 : 20 + size])
        start = 20 + size
        size, kind = struct.unpack_from("<I4s", content, start)
        assert kind == b"BIN\0"
        assert start % 4 == 0
        self.data = content[start + 8 : start + 8 + size]
        self.parent = {
            child: k for k, node in enumerate(self.tree["nodes"]) for child in node.get("children", ())
        }

    def accessor(self, index: int) -> np.ndarray:
        found = self.tree["accessors"][index]
        view = self.tree["bufferViews"][found["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[found["type"]]
        kind = {5126: "<f4", 5125: "<u4"}[found["componentType"]]
        at = view.get("byteOffset", 0) + found.get("byteOffset", 0)
        values = np.frombuffer(self.data, kind, found["count"] * width, at).reshape(-1, width)
        assert np.allclose(found["min"], values.min(axis=0))
        assert np.allclose(found["max"], values.max(axis=0))
        return values

    def node(self, name: str) -> int:
        (found,) = (k for k, node in enumerate(self.tree["nodes"]) if node.get("name") == name)
        return found

    def world(self, index: int, time: float) -> Matrix:
        """(4, 4) where a node is at a time of the animation."""
        node = self.tree["nodes"][index]
        if "matrix" in node:
            local = np.array(node["matrix"]).reshape(4, 4).T
        else:
            parts = {
                "translation": node.get("translation", [0, 0, 0]),
                "rotation": node.get("rotation", [0, 0, 0, 1]),
            }
            for channel in self.tree["animations"][0]["channels"]:
                if channel["target"]["node"] == index:
                    sampler = self.tree["animations"][0]["samplers"][channel["sampler"]]
                    assert sampler["interpolation"] == "LINEAR"
                    parts[channel["target"]["path"]] = self.sample(sampler, time)
            x, y, z, w = np.array(parts["rotation"]) / np.linalg.norm(parts["rotation"])
            local = np.eye(4)
            local[:3, :3] = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
            local[:3, 3] = parts["translation"]
        return self.world(self.parent[index], time) @ local if index in self.parent else local

    def sample(self, sampler: dict[str, int], time: float) -> np.ndarray:
        times, values = self.accessor(sampler["input"])[:, 0], self.accessor(sampler["output"])
        assert np.all(np.diff(times) > 0)
        right = int(np.clip(np.searchsorted(times, time), 1, len(times) - 1))
        share = (time - times[right - 1]) / (times[right] - times[right - 1])
        return values[right - 1] * (1 - share) + values[right] * share


#: MuJoCo's axes in glTF's: x stays, z goes up to y, y goes back to -z.
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def check_against_mujoco(setup: Setup, reader: Reader, bodies: list[str], tolerance: float) -> None:
    data = mujoco.MjData(setup.compiled)
    start, end = setup.solution.time[[0, -1]]
    for time in np.linspace(start, end, 7):
        data.qpos[:] = solved_at(setup, np.array([time]))[0]
        mujoco.mj_kinematics(setup.compiled, data)
        for name in bodies:
            found = reader.world(reader.node(name), float(time - start))
            assert np.allclose(found[:3, 3], UPRIGHT @ data.body(name).xpos, atol=tolerance)
            assert np.allclose(found[:3, :3], UPRIGHT @ data.body(name).xmat.reshape(3, 3), atol=tolerance)


@pytest.fixture(scope="module")
def lamp() -> Solution:
    return stc.load("luxo_poses").solve()


def test_the_lamp_moves_as_it_was_solved(lamp: Solution, tmp_path: Path) -> None:
    setup = prepare(lamp)
    reader = Reader(export(lamp, "gltf", tmp_path / "lamp.glb", rate=10000).read_bytes())
    check_against_mujoco(setup, reader, ["base", "lower_arm", "upper_arm", "head"], 1e-5)
    animated = {
        reader.tree["nodes"][c["target"]["node"]]["name"] for c in reader.tree["animations"][0]["channels"]
    }
    assert animated == {"lower_arm", "upper_arm", "head"}


def test_its_geometry_is_the_models(lamp: Solution, tmp_path: Path) -> None:
    setup = prepare(lamp)
    scene = trimesh.load(export(lamp, "gltf", tmp_path / "lamp.glb"))
    model, data = setup.compiled, mujoco.MjData(setup.compiled)
    data.qpos[:] = solved_at(setup, lamp.time[:1])[0]
    mujoco.mj_kinematics(model, data)
    corners = []
    for geom in range(model.ngeom):
        if model.geom_type[geom] == int(mujoco.mjtGeom.mjGEOM_MESH):
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
            corners.append(vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    wanted = np.concatenate(corners) @ UPRIGHT.T
    meshes = [
        scene.geometry[scene.graph[node][1]].copy().apply_transform(scene.graph[node][0])
        for node in scene.graph.nodes_geometry
        if not node.startswith("floor")
    ]
    found = np.concatenate([mesh.vertices for mesh in meshes])
    assert np.allclose(
        [found.min(axis=0), found.max(axis=0)], [wanted.min(axis=0), wanted.max(axis=0)], atol=1e-6
    )
    assert all(np.allclose(np.linalg.norm(mesh.vertex_normals, axis=1), 1, atol=1e-5) for mesh in meshes)


SHAPES = """<mujoco><worldbody>
  <geom type="plane" size="1 2 1"/>
  <body name="box" pos="0 0.3 1">
    <joint name="slide" type="slide" axis="1 0 0"/>
    <geom name="b" type="box" size="0.1 0.2 0.3"/>
    <geom name="twin" type="box" size="0.1 0.2 0.3" pos="0 0 0.7"/>
    <geom name="hidden" type="sphere" size="9" group="3"/>
    <body name="world_" pos="0 0 0.5" quat="0.6 0 0.8 0">
      <joint name="turn" type="hinge" axis="0 0.6 0.8"/>
      <geom name="c" type="capsule" size="0.05 0.2" rgba="1 0 0 0.5"/>
      <geom name="y" type="cylinder" size="0.1 0.02" pos="0.3 0 0"/>
      <geom name="e" type="ellipsoid" size="0.1 0.05 0.2" pos="0 0.3 0"/>
      <geom name="s" type="sphere" size="0.07" pos="0 0 0.4"/>
    </body>
  </body></worldbody></mujoco>"""

SPEC = """
constants: n = 6, T = 1.5, h = T/n;
variables: a, b;
constraints:
  [0]: a; a'; b; b';
  [n]: a = 1; a'; b = 7; b';
objective: [0, n]: integral(a''^2 + b''^2);
method: hermite-simpson;
replay: model = "shapes.xml"; joint slide = a; joint turn = b;
"""


def test_every_kind_of_shape_and_a_turn_by_more_than_one_revolution(tmp_path: Path) -> None:
    (tmp_path / "shapes.xml").write_text(SHAPES)
    (tmp_path / "shapes.stc").write_text(SPEC)
    solution = stc.load(tmp_path / "shapes.stc").solve()
    setup = prepare(solution)
    file = export(solution, "gltf", tmp_path / "shapes.glb", rate=400)
    reader = Reader(file.read_bytes())
    check_against_mujoco(setup, reader, ["box", "world_"], 5e-5)
    scene = trimesh.load(file)
    sizes = {
        "b": [0.2, 0.4, 0.6],
        "c": [0.1, 0.1, 0.5],
        "y": [0.2, 0.2, 0.04],
        "e": [0.2, 0.1, 0.4],
        "s": [0.14, 0.14, 0.14],
        "geom0": [2, 4, 0],
    }
    assert set(scene.geometry) == set(
        sizes
    )  # the twin shares its brother's geometry, the hidden one is not there
    for name, extents in sizes.items():
        assert np.allclose(scene.geometry[name].extents, extents, atol=1e-2), name
        assert np.allclose(scene.geometry[name].bounds.sum(axis=0), 0.0, atol=1e-6), name
    assert len([node for node in reader.tree["nodes"] if "mesh" in node]) == 7
    (red,) = (m for m in reader.tree["materials"] if m["alphaMode"] == "BLEND")
    assert np.allclose(red["pbrMetallicRoughness"]["baseColorFactor"], [1, 0, 0, 0.5], atol=3e-3)
