"""No command writes over what it reads, whatever name leads there, and none ignores an option in silence."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stc
from stc import models

Stc = Callable[..., tuple[int, str, str]]

#: A square of two triangles, as MuJoCo reads meshes.
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def stc_(stc_: Stc) -> Stc:
    """Runs a command line in a folder with ``hop.stc``, its own model ``hop.xml`` and its solution ``hop.npz``."""
    text = stc.load("particle_waypoints").text
    assert "n = 60" in text
    assert '"particle.xml"' in text
    Path("hop.stc").write_text(text.replace("n = 60", "n = 8").replace("particle.xml", "hop.xml"))
    model = models.locate("particle.xml")
    assert model is not None
    asset = '<asset><mesh name="sign" file="sign.obj"/></asset>'
    body = '<worldbody><geom type="mesh" mesh="sign" pos="0 3 0"/></worldbody>'
    Path("hop.xml").write_text(model.read_text().replace("</mujoco>", f"{asset}{body}</mujoco>"))
    Path("sign.obj").write_text(OBJ)
    assert stc_("solve", "hop.stc")[0] == 0
    return stc_


def refused(call: Stc, *words: str, what: str) -> None:
    """A command ends with one message that names the file as ``what``, and no file has changed."""
    before = {path: path.read_bytes() for path in Path().iterdir() if path.is_file()}
    status, _, err = call(*words)
    assert status == 2, err
    assert f"this would overwrite {what}" in err
    assert "choose another file name" in err
    assert {path: path.read_bytes() for path in Path().iterdir() if path.is_file()} == before


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("suffix", ["npz", "csv"])
def test_a_table_does_not_take_the_place_of_its_solution(suffix: str, stc_: Stc) -> None:
    saved = f"saved.{suffix}"
    assert stc_("solve", "hop.stc", "-o", saved)[0] == 0
    Path("folder").mkdir()
    Path(f"link.{suffix}").symlink_to(saved)
    for name in (saved, f"folder/../{saved}", str(Path(saved).absolute()), f"link.{suffix}"):
        refused(stc_, "export", saved, "--format", suffix, "-o", name, what="the solution itself")
    if suffix == "npz":
        refused(stc_, "export", saved, "--format", "controls", "-o", saved, what="the solution itself")
    assert stc_("export", saved, "--format", suffix, "-o", f"other.{suffix}")[0] == 0
    assert stc_("validate", saved)[0] == 0


def test_a_solve_keeps_its_data(stc_: Stc) -> None:
    text = Path("hop.stc").read_text()
    declared = 'data: walk = "walk.npz"; other = "other.csv";\nconstraints:'
    Path("walk.stc").write_text(text.replace("constraints:", declared, 1))
    np.savez("walk.npz", time=np.arange(3.0), x=np.arange(3.0))
    Path("other.csv").write_text("a,b\n0,1\n")
    refused(stc_, "solve", "walk.stc", what="the data `walk` of the spec")
    refused(stc_, "solve", "walk.stc", "-o", "other.csv", what="the data `other` of the spec")
    assert stc_("solve", "walk.stc", "-o", "new.npz")[0] == 0


def test_an_export_does_not_take_the_place_of_its_model(stc_: Stc) -> None:
    refused(stc_, "export", "hop.npz", "--format", "keyframes", "-o", "hop.xml", what="the model hop.xml")
    assert stc_("export", "hop.npz", "--format", "keyframes")[0] == 0


def test_copies_of_meshes_do_not_take_the_place_of_others(stc_: Stc) -> None:
    """The folder of an export may be the one that the model's meshes lie in."""
    Path("new_assets").mkdir()
    other = OBJ.replace("v 1 0 0", "v 2 0 0")
    Path("new_assets/sign.obj").write_text(other)
    text = Path("hop.xml").read_text()
    second = '<mesh name="second" file="new_assets/sign.obj"/></asset>'
    Path("hop.xml").write_text(second.join(text.rsplit("</asset>", 1)))
    status, _, err = stc_("export", "hop.npz", "--format", "keyframes", "-o", "new.xml")
    assert status == 2
    assert "new_assets/sign.obj: this would overwrite a file of the model" in err
    assert Path("new_assets/sign.obj").read_text() == other
    # A folder that holds what would be copied there stays as it is.
    Path("hop.xml").write_text(text.replace("sign.obj", "new_assets/sign.obj"))
    assert stc_("export", "hop.npz", "--format", "keyframes", "-o", "new.xml")[0] == 0
    assert Path("new_assets/sign.obj").read_text() == other


def test_a_picture_does_not_take_the_place_of_a_texture(stc_: Stc) -> None:
    from PIL import Image

    Image.new("RGB", (8, 8), (200, 10, 10)).save("wall.png")
    text = Path("hop.xml").read_text()
    wall = '<texture name="wall" type="2d" file="wall.png"/></asset>'
    Path("hop.xml").write_text(text.replace("</asset>", wall, 1))
    for command in ("plot", "render"):
        refused(stc_, command, "hop.npz", "-o", "wall.png", what="a file of the model hop.xml")


def test_a_solve_keeps_the_table_that_it_starts_from(stc_: Stc) -> None:
    assert stc_("export", "hop.npz", "--format", "csv", "-o", "tab.csv")[0] == 0
    guess = ("solve", "hop.stc", "--guess-from")
    refused(stc_, *guess, "tab.csv", "-o", "tab.csv", what="the table of --guess-from")
    np.savez("hop.npz", time=[0.0, 2.0], x=[0.0, 1.0])  # a table by the name that a solution gets unasked
    refused(stc_, *guess, "hop.npz", what="the table of --guess-from")


def test_a_saved_solution_may_be_solved_on_from(stc_: Stc) -> None:
    for option in ("--guess-from", "--warm-start"):
        status, _, err = stc_("solve", "hop.stc", option, "hop.npz", "-o", "hop.npz")
        assert status == 0, err
        assert stc.read(Path("hop.npz")).status == "optimal"


def test_a_solve_keeps_its_spec(stc_: Stc) -> None:
    Path("motion.npz").symlink_to("hop.stc")
    refused(stc_, "solve", "hop.stc", "-o", "motion.npz", what="the spec itself")
    Path("page.html").symlink_to("hop.stc")
    refused(stc_, "run", "hop.stc", "--report", "page.html", what="the spec itself")
    refused(stc_, "validate", "hop.stc", "--report", "page.html", what="the solution to validate")


# ------------------------------------------------------------------ options of exports


@pytest.mark.parametrize(
    ("kind", "option"),
    [
        ("csv", "--time-step"),
        ("npz", "--time-step"),
        ("gltf", "--time-step"),
        ("controls", "--rate"),
        ("keyframes", "--rate"),
    ],
)
def test_an_option_that_a_format_has_no_use_for_is_refused(kind: str, option: str, stc_: Stc) -> None:
    status, _, err = stc_("export", "hop.npz", "--format", kind, option, "0.1")
    assert status == 2
    assert f"the format {kind} has no {option[2:].replace('-', ' ')}" in err
    assert "those that have one: " in err


def test_an_animation_has_the_rate_that_is_asked_for(stc_: Stc) -> None:
    def instants(*words: str) -> int:
        assert stc_("export", "hop.npz", "--format", "gltf", *words)[0] == 0
        data = Path("hop.glb").read_bytes()
        tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
        sampler = tree["animations"][0]["samplers"][0]
        return int(tree["accessors"][sampler["input"]]["count"])

    assert stc.read(Path("hop.npz")).duration == pytest.approx(2.0)
    assert instants("--rate", "2") == 5  # fewer than the 9 frames
    assert instants() == 121


def test_folders_that_are_made_are_told_of(stc_: Stc) -> None:
    for words in (
        ("solve", "hop.stc", "-o", "a/b/x.npz"),
        ("export", "hop.npz", "--format", "csv", "-o", "c/x.csv"),
    ):
        status, _, err = stc_(*words)
        assert status == 0
        assert err == f"note: made the folder {Path(words[-1]).parent}\n"
        assert stc_(*words)[2] == ""


# ------------------------------------------------------------------ names that the locale has no letters for


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes on Linux")
def test_a_model_is_found_whatever_the_locale(stc_: Stc, tmp_path: Path) -> None:
    folder = tmp_path / "ü"
    folder.mkdir()
    for name in ("hop.stc", "hop.xml", "sign.obj"):
        Path(name).rename(folder / name)
    environment = {**os.environ, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}
    for words in (
        ("run", "ü/hop.stc", "-o", "ü/hop.npz"),
        ("export", "ü/hop.npz", "--format", "keyframes", "-o", "ü/k.xml"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "stc", *words],
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert (done.returncode, done.stderr) == (0, ""), done.stdout
