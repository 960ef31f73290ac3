"""The core on its own: under sanitizers, with each instruction set, and what a checkout says of an old library."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from core.instruction_sets import INSTRUCTIONS, need
from solver.kkt.dense import DenseKKT
from solver.kkt.kkt_problems import STRUCTURES, generic

from stc.core import compiling
from stc.core import library as core
from stc.errors import StcError
from stc.solver.kkt.multifrontal import MultifrontalKKT

HERE = Path(__file__).parent
#: Whether numbers lie where their kind wants them is only told of: those in arrays of NumPy may lie anywhere.
SANITIZERS = [
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-fsanitize-recover=alignment",
    "-g",
    "-O0",  # to optimise what the sanitizers add takes four times as long as to compile and run it
]


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory):
    """The compiler, and a folder with the core under sanitizers; compiling it takes most of the time of these tests."""
    compiler = compiling.own_compiler()
    if compiler is None:
        pytest.skip("there is no C compiler")
    found = subprocess.run([*compiler, "-print-file-name=libasan.so"], capture_output=True, text=True)
    if not Path(found.stdout.strip()).is_absolute():
        pytest.skip("the C compiler has no sanitizers that can be loaded")
    folder = tmp_path_factory.mktemp("sanitized")
    compiling.compile_libraries(folder / "made", folder / "scratch", SANITIZERS, ["baseline"])
    return compiler, folder / "made", found.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize("systems", [10, pytest.param(1000, marks=pytest.mark.nightly)])
def test_fuzz_under_sanitizers(sanitized, tmp_path, systems):
    """Random systems: inertia against Jacobi's rotations, residuals, and no access or operation that is undefined."""
    compiler, made, _ = sanitized
    program = tmp_path / "fuzz"
    options = ["-Wno-unknown-pragmas", f"-I{compiling.FOLDER}", "-pthread", f"-Wl,-rpath,{made}"]
    library = str(made / compiling.file_of("baseline"))
    command = [*compiler, "-std=c11", *SANITIZERS, *options, str(HERE / "fuzz.c"), library]
    subprocess.run([*command, "-o", str(program), "-lm"], check=True)
    environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=1"}
    done = subprocess.run([str(program), "1", str(systems)], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "runtime error" not in done.stderr, done.stderr


@pytest.mark.slow
def test_solves_under_sanitizers(sanitized):
    """All families of systems, and a whole solve: no access outside an array, and nothing that is undefined."""
    _, made, loaded_first = sanitized
    environment = {
        **os.environ,
        "LD_PRELOAD": loaded_first,
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONMALLOC": "malloc",  # so that the ends of arrays are known
        "PYTHONPATH": str(HERE.parent),
        "STC_BACKEND": "python",
    }
    script = [sys.executable, str(HERE / "under_sanitizers.py"), str(made)]
    done = subprocess.run(script, capture_output=True, text=True, env=environment, cwd=HERE.parent)
    assert done.returncode == 0, done.stdout + done.stderr[-8000:]


@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_instruction_sets(monkeypatch, name):
    """Each one solves the same system as dense algebra does."""
    need(name)
    loaded = core.library(name)
    monkeypatch.setattr(core, "library", lambda: loaded)
    for seed, structure in enumerate(STRUCTURES.values()):
        rng = np.random.default_rng(seed)
        pattern = structure(rng, 12)
        values = generic(rng, pattern)
        one, judge = MultifrontalKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
        assert one.factorize(*values.arguments()) == judge.factorize(*values.arguments())
        rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
        found, expected = (np.concatenate(kkt.solve(*rhs)) for kkt in (one, judge))
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_long_horizons():
    """Twenty thousand frames: time and memory stay in proportion."""
    rng = np.random.default_rng(3)
    pattern = STRUCTURES["chain"](rng, 20_000)
    short = STRUCTURES["chain"](np.random.default_rng(3), 2000)
    entries = []
    for p in (short, pattern):
        kkt = MultifrontalKKT(*p.arguments())
        inertia = kkt.factorize(*generic(rng, p).arguments())
        assert sum(inertia) == p.n + p.m
        kkt.solve(rng.normal(size=p.n), rng.normal(size=p.m))
        assert kkt.last_residual < 1e-10
        entries.append(kkt.nnz_factor)
    assert entries[1] < 12 * entries[0]


def test_sources_are_looked_at_where_one_is_younger_than_the_library(tmp_path, monkeypatch):
    monkeypatch.setattr(core, "FOLDER", str(tmp_path))
    for number, name in enumerate(("kkt.c", "library.so", "other.py", "kkt.h")):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (number, number))
        assert name == "kkt.c" or core._may_be_stale(str(tmp_path / "library.so")) == (name == "kkt.h")


def test_old_library(monkeypatch):
    monkeypatch.setattr(compiling, "digest_of_sources", lambda: "another one")
    monkeypatch.setattr(core, "_may_be_stale", lambda _: True)
    core.library.cache_clear()
    with pytest.raises(StcError, match=r"older than its sources: .*compiling.py"):
        core.library()
    core.library.cache_clear()
