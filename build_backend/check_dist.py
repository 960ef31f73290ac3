"""Tries the distributions of a folder in new environments, one for each Python that is on this machine.

    python build_backend/check_dist.py dist

The wheel is installed with what it depends on, from the index that pip is set up for, and has to solve and validate a
motion outside of the checkout; the source distribution likewise, with the newest Python.  For a Python that is not
here, pip is asked whether everything that is depended on has wheels for it.
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

VERSIONS = ("3.11", "3.12", "3.13", "3.14")
#: What has to end with status 0 after an installation.
COMMANDS = (
    ("stc", "--version"),
    ("stc", "check", "quadruped_hop"),
    ("stc", "run", "particle_waypoints", "-o", "motion.npz"),
    ("python", "-c", "import stc, stc.validate; print(stc.read('motion.npz').status)"),
)


def main(folder: Path) -> int:
    """Try everything; 0 if all went well."""
    (wheel,) = folder.resolve().glob(f"*linux*_{platform.machine()}.whl")
    (source,) = folder.resolve().glob("*.tar.gz")
    pythons = {version: python for version in VERSIONS if (python := _python(version))}
    failed = 0
    for version in VERSIONS:
        if version in pythons:
            failed += not _told(version, wheel, _installed(pythons[version], wheel))
        else:
            failed += not _told(
                f"{version} (not on this machine, wheels alone)", wheel, _resolved(version, wheel)
            )
    if pythons:
        newest = list(pythons)[-1]
        failed += not _told(newest, source, _installed(pythons[newest], source))
    return failed > 0


def _python(version: str) -> str | None:
    """The program of a version: on the path, or one that pyenv has."""
    kept = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
    for found in (shutil.which(f"python{version}"), *map(str, reversed(kept))):
        if found and _run([found, "--version"], Path.cwd()) == "":
            return found
    return None


def _installed(python: str, distribution: Path) -> str:
    """What goes wrong with a distribution in a new environment; empty if nothing does."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        programs = place / "new" / ("Scripts" if sys.platform == "win32" else "bin")
        install = ["python", "-m", "pip", "install", "--quiet", str(distribution)]
        wrong = _run([python, "-m", "venv", "new"], place)
        for words in (install, *COMMANDS):
            wrong = wrong or _run([str(programs / words[0]), *words[1:]], place)
        return wrong


def _resolved(version: str, wheel: Path) -> str:
    """What of a wheel and all that it depends on has no wheel for a version of Python."""
    asked = ["--python-version", version, "--only-binary", ":all:", "--target", "nowhere", "--dry-run"]
    return _run([sys.executable, "-m", "pip", "install", "--quiet", *asked, str(wheel)], Path.cwd())


def _run(words: Sequence[str], place: Path) -> str:
    done = subprocess.run(words, cwd=place, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else f"{' '.join(words)}\n{done.stdout}{done.stderr}"


def _told(version: str, distribution: Path, wrong: str) -> bool:
    print(f"Python {version}, {distribution.name}: {wrong or 'good'}", flush=True)
    return not wrong


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
