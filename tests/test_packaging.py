"""What an installation holds."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.core import compiling

ROOT = Path(__file__).parent.parent
FOLDERS = {"stc": "stc", "stc/validate": "validate", "stc/models": "models", "stc/specs": "specs"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """A wheel built from a copy of the repository, with the setuptools at hand."""
    if compiling.own_compiler() is None and importlib.util.find_spec("ziglang") is None:
        pytest.skip("there is no C compiler: an installation brings its own")
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "copy"
    copy.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", *FOLDERS.values()):
        (copy / name).symlink_to(ROOT / name)
    build = "import sys, setuptools.build_meta as b; print(b.build_wheel(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", build, str(folder)], cwd=copy, check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    return zipfile.ZipFile(file)


def test_one_top_level_name(wheel: zipfile.ZipFile) -> None:
    top = {name.split("/")[0] for name in wheel.namelist()}
    assert {name for name in top if not name.endswith(".dist-info")} == {"stc"}


@pytest.mark.parametrize("inside", FOLDERS)
def test_everything_ships(wheel: zipfile.ZipFile, inside: str) -> None:
    folder = ROOT / FOLDERS[inside]
    wanted = {
        f"{inside}/{path.relative_to(folder).as_posix()}"
        for path in folder.rglob("*")
        if path.is_file()
        and "__pycache__" not in path.parts
        and path.suffix not in (".c", ".h")
        and not path.name.startswith("libcore_")
    }
    assert wanted <= set(wheel.namelist())


def test_the_core_ships_compiled(wheel: zipfile.ZipFile) -> None:
    """For this kind of machine, and whatever Python: its sources stay at home."""
    for kind in compiling.instructions():
        assert f"stc/core/{compiling.file_of(kind)}" in wheel.namelist()
    assert Path(str(wheel.filename)).name.split("-")[2:4] == ["py3", "none"]


def test_a_first_solve_does_without_the_compiler_of_kernels(wheel: zipfile.ZipFile, tmp_path: Path) -> None:
    """Where it is short, on a machine that has not solved anything before."""
    wheel.extractall(tmp_path / "installed")
    code = """
import sys
from stc.cli.main import run
status = run(["solve", "cart_pole_swing_up", "--set", "n=20"])
assert not any(name.startswith("llvmlite") for name in sys.modules)
sys.exit(status)
"""
    paths = os.pathsep.join([str(tmp_path / "installed"), *filter(None, [os.environ.get("PYTHONPATH")])])
    env = {**os.environ, "PYTHONPATH": paths, "STC_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_one_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["version"] == stc.__version__


def test_public_names_exist() -> None:
    for name in stc.__all__:
        assert getattr(stc, name) is not None
    with pytest.raises(AttributeError, match="nosuch"):
        stc.nosuch  # noqa: B018


def test_subpackages_are_found_beside_the_package_in_a_checkout() -> None:
    """Even where Python picks up ``stc`` from the checkout and not from the installation."""
    code = "import stc.validate, stc.models, stc.specs; print(stc.specs.names())"
    libraries = str(Path(np.__file__).parent.parent)
    # -S: without the hooks by which an editable installation finds its folders.
    done = subprocess.run(
        [sys.executable, "-S", "-c", code],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": libraries},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "particle_waypoints" in done.stdout, done.stderr


@pytest.mark.parametrize(("name", "platform"), compiling.PLATFORMS.items())
def test_a_wheel_for_another_platform_is_compiled_for_its_processors(
    name: str, platform: compiling.Platform, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the headers of the libraries, as the loaders of these systems read them."""
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("the compiler for other platforms, ziglang, is not installed")
    monkeypatch.setenv(compiling.WANTED, name)
    compiling.compile_libraries(tmp_path / "made", tmp_path / "scratch", kinds=["baseline"])
    library = (tmp_path / "made" / compiling.file_of("baseline", platform)).read_bytes()
    if platform.suffix == "so":  # ELF: the machine, 62 for x86-64 and 183 for arm64
        assert library[:4] == b"\x7fELF"
        assert int.from_bytes(library[18:20], "little") == (62 if platform.x86 else 183)
    elif platform.suffix == "dylib":  # Mach-O, 64 bits: the processor, arm64
        assert library[:4] == b"\xcf\xfa\xed\xfe"
        assert int.from_bytes(library[4:8], "little") == 0x0100000C
    else:  # PE: its header's place is at 60, and the machine follows the signature
        place = int.from_bytes(library[60:64], "little")
        assert library[place : place + 4] == b"PE\0\0"
        assert int.from_bytes(library[place + 4 : place + 6], "little") == 0x8664


def test_a_wheel_for_an_unknown_platform_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(compiling.WANTED, "amiga")
    with pytest.raises(RuntimeError, match="'amiga'; known platforms: manylinux2014_x86_64"):
        compiling.wanted_platform()
