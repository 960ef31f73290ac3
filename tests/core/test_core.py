"""The core on its own: under sanitizers, with each instruction set, and what a checkout says of an old library."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path

import numpy as np
import pytest
from solver.kkt.kkt_problems import STRUCTURES, generic

from stc.core import compiling
from stc.core import library as core
from stc.errors import StcError
from stc.solver.kkt import DenseKKT
from stc.solver.kkt.multifrontal import MultifrontalKKT

HERE = Path(__file__).parent
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O1"]


def test_fuzz_under_sanitizers(tmp_path):
    """Random systems: inertia against Jacobi's rotations, residuals, and no access or operation that is undefined."""
    compiler = compiling.own_compiler()
    if compiler is None:
        pytest.skip("there is no C compiler")
    sources = [str(path) for path in sorted(compiling.FOLDER.glob("*.c"))]
    program = tmp_path / "fuzz"
    options = ["-DKIND=baseline", "-Wno-unknown-pragmas", f"-I{compiling.FOLDER}", "-pthread"]
    command = [*compiler, "-std=c11", *SANITIZERS, *options]
    made = subprocess.run(
        [*command, *sources, str(HERE / "fuzz.c"), "-o", str(program), "-lm"], capture_output=True, text=True
    )
    if made.returncode and ("sanitize" in made.stderr or "asan" in made.stderr):
        pytest.skip("the C compiler has no sanitizers")
    assert made.returncode == 0, made.stderr
    environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=1"}
    done = subprocess.run([str(program), "1", "300"], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", ["baseline", "avx2", "avx512"])
def test_instruction_sets(name):
    """Each one solves the same system as dense algebra does."""
    library = core.library()
    before = library.kkt_instructions()
    if library.kkt_use(name.encode()):
        pytest.skip(f"{platform.machine()} without {name}")
    try:
        for seed, structure in enumerate(STRUCTURES.values()):
            rng = np.random.default_rng(seed)
            pattern = structure(rng, 12)
            values = generic(rng, pattern)
            one, judge = MultifrontalKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
            assert one.factorize(*values.arguments()) == judge.factorize(*values.arguments())
            rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
            found, expected = (np.concatenate(kkt.solve(*rhs)) for kkt in (one, judge))
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    finally:
        assert library.kkt_use(before) == 0


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
    monkeypatch.setattr(core, "FOLDER", tmp_path)
    monkeypatch.setattr(core, "LIBRARY", tmp_path / "library")
    for number, name in enumerate(("kkt.c", "library", "other.py", "kkt.h")):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (number, number))
        assert name == "kkt.c" or core._may_be_stale() == (name == "kkt.h")


def test_old_library(monkeypatch):
    monkeypatch.setattr(compiling, "digest_of_sources", lambda: "another one")
    monkeypatch.setattr(core, "_may_be_stale", lambda: True)
    core.library.cache_clear()
    with pytest.raises(StcError, match=r"older than its sources: .*compiling.py"):
        core.library()
    core.library.cache_clear()
