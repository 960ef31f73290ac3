"""The engine: machine code runs wherever it is copied to, and is never anything else than what was made."""

from __future__ import annotations

import ctypes
import gc
import subprocess
import sys
from pathlib import Path

import pytest

from stc.codegen import cache, engine
from stc.core import library
from stc.errors import UsageError

SEVEN = "define i64 @f() {\n ret i64 7\n}"
#: Needs a number in memory of its own.
HALF = "define double @f(double %x) {\n  %y = fmul double %x, 0.5\n  ret double %y\n}"


def test_malformed_code_is_an_error() -> None:
    with pytest.raises(RuntimeError):
        engine.compile_ir("define nonsense", level=1)
    with pytest.raises(RuntimeError):
        engine.load(b"not an object", "f")


def test_codes_with_the_same_names_live_side_by_side() -> None:
    loaded = []
    for value in range(20):
        loaded.append(
            engine.load(engine.compile_ir(f"define i64 @f() {{\n ret i64 {value}\n}}", level=1), "f")
        )
    kept = loaded[::2]
    del loaded
    gc.collect()
    calls = [ctypes.CFUNCTYPE(ctypes.c_int64)(each.address) for each in kept]
    assert [call() for call in calls] == list(range(0, 20, 2))


def test_code_that_refers_to_something_else_is_linked() -> None:
    function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)
    assert function(engine.load(engine.compile_ir(HALF, level=1), "f").address)(3.0) == 1.5
    outside = "define double @f(double %x) {\n  %y = call double @exp(double %x)\n  ret double %y\n}"
    code = engine.compile_ir("declare double @exp(double)\n" + outside, level=1)
    assert function(engine.load(code, "f").address)(0.0) == 1.0


@pytest.mark.skipif(sys.platform != "linux", reason="code is linked anew there")
def test_kept_code_runs_without_the_compiler() -> None:
    program = (
        "import sys, ctypes\n"
        "from stc.codegen import engine\n"
        "code = engine.load(bytes.fromhex(sys.argv[1]), 'f')\n"
        "print(ctypes.CFUNCTYPE(ctypes.c_int64)(code.address)(), 'llvmlite' in sys.modules)\n"
    )
    code = engine.compile_ir(SEVEN, level=1).hex()
    if library.instructions() == "baseline":
        pytest.skip("code is linked anew here")
    done = subprocess.run([sys.executable, "-c", program, code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["7", "False"]


@pytest.mark.parametrize(
    ("instructions", "width", "registers"),
    [
        ("avx2", 4, 16),
        ("baseline", 4, 16),
        ("avx512", 8, 32),
    ],
)
def test_what_instruction_sets_can_do(
    instructions: str, width: int, registers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(library, "instructions", lambda: instructions)
    assert (engine.vector_width(), engine.vector_registers()) == (width, registers)


def test_a_compiler_that_cannot_be_loaded_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    with pytest.raises(UsageError, match=r"llvmlite is installed but cannot be loaded .*STC_BACKEND=python"):
        engine.compile_ir("define void @f() {\n ret void\n}", level=1)


def test_fingerprint_tells_machines_and_versions_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    texts = {engine.fingerprint()}
    monkeypatch.setattr(library, "instructions", lambda: "another set")
    texts.add(engine.fingerprint())
    monkeypatch.setattr(engine, "own_digest", lambda: "other")
    texts.add(engine.fingerprint())
    assert len(texts) == 3


def test_what_cannot_be_loaded_is_not_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path))
    key = cache.key_of("any")
    assert engine.kept(key, "f") is None
    cache.store(key, b"this is whole but no machine code")
    assert engine.kept(key, "f") is None
    cache.store(key, engine.compile_ir(SEVEN, level=1))
    found = engine.kept(key, "f")
    assert found is not None
    assert ctypes.CFUNCTYPE(ctypes.c_int64)(found.address)() == 7
