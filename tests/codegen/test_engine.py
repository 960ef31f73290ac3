"""The engine: what is compiled depends on nothing but the code and the machine."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable

import pytest

from stc.codegen import engine
from stc.codegen.machine import Machine
from stc.errors import UsageError

LOOP = """
define double @total(ptr %x, i64 %n) {
entry:
  br label %again
again:
  %k = phi i64 [ 0, %entry ], [ %next, %again ]
  %sum = phi double [ 0.0, %entry ], [ %more, %again ]
  %place = getelementptr inbounds double, ptr %x, i64 %k
  %value = load double, ptr %place
  %more = fadd reassoc double %sum, %value
  %next = add i64 %k, 1
  %go = icmp slt i64 %next, %n
  br i1 %go, label %again, label %done
done:
  ret double %more
}
"""


def test_object_code_does_not_depend_on_what_was_compiled_before() -> None:
    kinds: dict[str, Callable[[], bytes]] = {
        "loops": lambda: engine.compile_ir(LOOP, level=2, optimise=True),
        "kernels": lambda: engine.compile_ir(LOOP, level=1, optimise=False),
    }
    first = {name: make() for name, make in kinds.items()}
    for name in ("kernels", "kernels", "loops", "kernels", "loops", "loops"):
        assert kinds[name]() == first[name]


def test_malformed_code_is_an_error() -> None:
    with pytest.raises(RuntimeError):
        engine.compile_ir("define nonsense", level=1, optimise=False)
    with pytest.raises(RuntimeError):
        engine.load_object(b"not an object", ["f"])
    good = engine.compile_ir("define i64 @f() {\n ret i64 7\n}", level=1, optimise=False)
    with pytest.raises(RuntimeError):
        engine.load_object(good, ["missing"])


def test_objects_with_the_same_names_live_side_by_side() -> None:
    loaded = []
    for value in range(20):
        ir = f"define i64 @f() {{\n ret i64 {value}\n}}"
        loaded.append(engine.load_object(engine.compile_ir(ir, level=1, optimise=False), ["f"]))
    kept = loaded[::2]
    del loaded
    gc.collect()
    calls = [ctypes.CFUNCTYPE(ctypes.c_int64)(each.address("f")) for each in kept]
    assert [call() for call in calls] == list(range(0, 20, 2))


def test_math_library_is_reachable() -> None:
    ir = (
        "declare double @exp(double)\n"
        "define double @f(double %x) {\n  %y = call double @exp(double %x)\n  ret double %y\n}"
    )
    loaded = engine.load_object(engine.compile_ir(ir, level=1, optimise=False), ["f"])
    assert ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(loaded.address("f"))(0.0) == 1.0


@pytest.mark.parametrize(
    ("features", "architecture", "fma", "width", "registers"),
    [
        ("avx2 fma", "x86_64", True, 4, 16),
        ("sse2", "x86_64", False, 4, 16),
        ("fma avx512f avx512dq avx512vl", "x86_64", True, 8, 32),
        ("fma avx512f", "x86_64", True, 4, 16),
        ("neon", "aarch64", True, 4, 16),
    ],
)
def test_what_machines_can_do(
    features: str, architecture: str, fma: bool, width: int, registers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(architecture, frozenset(features.split()), "any")
    monkeypatch.setattr(engine, "this_machine", lambda: machine)
    host = engine.Host(architecture, "any", ",".join("+" + name for name in features.split()))
    assert engine.has_fma.__wrapped__() == fma
    monkeypatch.setattr(engine, "vector_width", engine.vector_width.__wrapped__)
    assert engine.vector_width() == engine._width_on(host) == width
    assert engine.vector_registers() == registers


def test_a_compiler_that_cannot_be_loaded_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "llvmlite.binding", None)
    with pytest.raises(UsageError, match=r"llvmlite is installed but cannot be loaded .*STC_BACKEND=python"):
        engine.compile_ir("define void @f() {\n ret void\n}", level=1, optimise=False)
