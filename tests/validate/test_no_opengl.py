"""Where nothing can be rendered: what is said, and that it costs the pictures and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import stc
from stc.solution import Solution

#: A process in which no library of OpenGL can be loaded: as on a machine that has none.
WITHOUT_LIBRARIES = """
import ctypes, re
loading = ctypes.CDLL.__init__
def lacking(self, name=None, *arguments, **options):
    if re.match(r"lib(EGL|GL|GLX|GLESv|OpenGL|OSMesa)", str(name)):
        raise OSError(f"{name}: cannot open shared object file")
    loading(self, name, *arguments, **options)
ctypes.CDLL.__init__ = lacking
"""

#: A notebook's day: pictures are asked for again and again in one process, at last where OpenGL can be loaded.
COMMANDS = """
import contextlib, ctypes, io, json, sys
from stc.cli.main import run

def call(*words):
    with contextlib.redirect_stderr(io.StringIO()) as told:
        status = run([*words])
    return status, told.getvalue()

outcomes = [
    call("render", "motion.npz", "-o", "motion.png"),
    call("render", "motion.npz", "-o", "motion.gif"),
    call("validate", "motion.npz", "--report", "page.html"),
    call("plot", "motion.npz", "-o", "plot.png"),
    call("validate", "motion.npz", "--report", "again.html"),
]
if "loading" in globals():
    ctypes.CDLL.__init__ = loading
outcomes.append(call("render", "motion.npz", "-o", "motion.png"))
with open("outcomes.json", "w") as file:
    json.dump(outcomes, file)
"""


@pytest.fixture(scope="module")
def motion() -> Solution:
    return stc.load("particle_waypoints", n=20, T=0.5).solve()


@pytest.mark.daily_every(4)
@pytest.mark.parametrize(
    ("before", "asked", "told"),
    [
        (WITHOUT_LIBRARIES, None, "rendering needs OpenGL, which is not available (egl: libEGL.so.1"),
        (
            WITHOUT_LIBRARIES,
            "osmesa",
            "rendering needs OpenGL, which is not available (osmesa: libOSMesa.so.8",
        ),
        ("", "glfw", "rendering needs OpenGL, which is not available (glfw: no window can be opened"),
        ("", "off", "rendering is switched off: MUJOCO_GL says so"),
    ],
    ids=["nothing", "osmesa", "glfw", "off"],
)
def test_a_process_outlives_every_try_and_says_the_same_each_time(
    before: str, asked: str | None, told: str, motion: Solution, tmp_path: Path
) -> None:
    motion.save(tmp_path / "motion.npz")
    displays = ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL", "PYOPENGL_PLATFORM")
    environment = {key: value for key, value in os.environ.items() if key not in displays}
    done = subprocess.run(
        [sys.executable, "-c", before + COMMANDS],
        cwd=tmp_path,
        env=environment if asked is None else {**environment, "MUJOCO_GL": asked},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    strip, film, page, plot, again, last = json.loads((tmp_path / "outcomes.json").read_text())
    assert [outcome[0] for outcome in (strip, film, last)] == [2, 2, 2]
    assert strip[1].startswith(f"stc: {told}")
    assert strip == film == last
    assert ("libopengl0" in strip[1]) is (asked != "off")
    assert [page, plot, again] == [[0, ""]] * 3
    assert (tmp_path / "plot.png").stat().st_size > 5000
    for name in ("page.html", "again.html"):
        assert f"No pictures: {told}" in (tmp_path / name).read_text()
    assert not list(tmp_path.glob("motion.[pg]*"))


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("asked", ["nonsense", "osmesa"])
def test_a_graphics_library_that_is_not_there_costs_no_verdict(
    motion: Solution, tmp_path: Path, asked: str
) -> None:
    """MuJoCo itself cannot be imported where ``MUJOCO_GL`` asks for what it does not find."""
    motion.save(tmp_path / "motion.npz")
    done = subprocess.run(
        [sys.executable, "-m", "stc", "validate", "motion.npz"],
        cwd=tmp_path,
        env={**os.environ, "MUJOCO_GL": asked},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "open-loop drift" in done.stdout, done.stderr
    assert not done.stderr
