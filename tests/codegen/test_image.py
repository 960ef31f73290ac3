"""Images of machine code: the same results as LLVM's own linker, and nothing loaded that is not understood."""

from __future__ import annotations

import ctypes
import gc
import struct
from collections.abc import Callable
from typing import Any

import pytest

from stc.codegen import engine, image

#: Constants, a call within the module, and three functions of the C library.
IR = """
@table = private unnamed_addr constant [4 x double] [double 1.0, double 2.5, double -3.0, double 7.0]
declare double @exp(double)
declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)
declare void @llvm.memmove.p0.p0.i64(ptr, ptr, i64, i1)

define internal double @inner(double %x) noinline nounwind {
  %y = fmul double %x, 3.25
  ret double %y
}
define double @f(i64 %k, double %x) nounwind {
  %place = getelementptr [4 x double], ptr @table, i64 0, i64 %k
  %value = load double, ptr %place
  %more = call double @inner(double %x)
  %e = call double @exp(double %more)
  %sum = fadd double %value, %e
  ret double %sum
}
define void @clear(ptr %to, i64 %bytes) nounwind {
  call void @llvm.memset.p0.i64(ptr %to, i8 0, i64 %bytes, i1 false)
  ret void
}
define void @move(ptr %to, ptr %from, i64 %bytes) nounwind {
  call void @llvm.memmove.p0.p0.i64(ptr %to, ptr %from, i64 %bytes, i1 false)
  ret void
}
"""
SYMBOLS = ["f", "clear", "move"]

pytestmark = pytest.mark.skipif(not image.supported(), reason="images are for Linux on x86-64")


def compiled(ir: str = IR) -> bytes:
    return engine.compile_ir(ir, level=1, optimise=False)


def function(loaded: Any, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    made: Callable[..., Any] = ctypes.CFUNCTYPE(result, *arguments)(loaded.address(name))
    return made


def test_an_image_computes_what_the_linked_object_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    code = compiled()
    made = image.image_of(code)
    assert made is not None
    mapped = engine.load_object(made, SYMBOLS)
    assert isinstance(mapped, image.MappedImage)
    monkeypatch.setattr(engine, "supported", lambda: False)
    linked = engine.load_object(code, SYMBOLS)
    assert isinstance(linked, engine.LinkedObject)
    kinds = (ctypes.c_double, ctypes.c_int64, ctypes.c_double)
    for k in range(4):
        assert function(mapped, "f", *kinds)(k, 0.1 * k) == function(linked, "f", *kinds)(k, 0.1 * k)
    buffer = ctypes.create_string_buffer(b"abcdefgh" * 100)
    function(mapped, "move", None, *[ctypes.c_void_p] * 2, ctypes.c_int64)(
        ctypes.addressof(buffer) + 3, ctypes.addressof(buffer), 500
    )
    assert buffer.raw[:16] == b"abcabcdefghabcde"
    function(mapped, "clear", None, ctypes.c_void_p, ctypes.c_int64)(ctypes.addressof(buffer), 700)
    assert buffer.raw[:700] == bytes(700)
    assert buffer.raw[700:] != bytes(101)


def test_memory_is_executable_or_writable_and_never_both() -> None:
    mapped = engine.load_object(compiled(), SYMBOLS)
    address = mapped.address("f")
    with open("/proc/self/maps", encoding="ascii") as file:  # noqa: PTH123 (shows this process as it is)
        for line in file:
            low, high = (int(text, 16) for text in line.split()[0].split("-"))
            if low <= address < high:
                assert line.split()[1].startswith("r-x")
                return
    pytest.fail("the code is mapped nowhere")


def test_memory_is_given_back() -> None:
    def mappings() -> int:
        with open("/proc/self/maps", encoding="ascii") as file:  # noqa: PTH123
            return sum(1 for line in file if "r-xp 00000000 00:00 0" in line and not line.split()[5:])

    made = image.image_of(compiled())
    assert made is not None
    before = mappings()
    held = [image.map_image(made, SYMBOLS, {}) for _ in range(3)]
    assert mappings() > before or len(held) == 3  # neighbours may be shown as one
    del held
    gc.collect()
    assert mappings() <= before


@pytest.mark.parametrize(
    "ir",
    [
        "@state = global double 1.0\ndefine ptr @f() {\n ret ptr @state\n}",
        "@outside = external global double\ndefine ptr @f() {\n ret ptr @outside\n}",
        "define i64 @g() {\n ret i64 1\n}\n@t = constant [1 x ptr] [ptr @g]\ndefine ptr @f() {\n ret ptr @t\n}",
    ],
    ids=["writable", "data from outside", "absolute address"],
)
def test_what_has_no_image_is_left_to_the_linker(ir: str) -> None:
    code = compiled(ir)
    assert image.image_of(code) is None
    if "external" not in ir:
        assert isinstance(engine.load_object(code, ["f"]), engine.LinkedObject)


def test_damaged_objects_have_no_image() -> None:
    code = compiled()
    assert image.image_of(b"") is None
    assert image.image_of(b"MZ" + code) is None
    for cut in range(0, len(code), 7):
        made = image.image_of(code[:cut])
        assert made is None


def test_damaged_images_are_errors() -> None:
    made = image.image_of(compiled())
    assert made is not None
    for cut in range(0, len(made), 5):
        with pytest.raises(RuntimeError):
            image.map_image(made[:cut], SYMBOLS, {})
    with pytest.raises(RuntimeError, match="missing"):
        image.map_image(made, ["f", "missing"], {})
    named, _ = struct.unpack_from("<II", made, len(image.MAGIC))
    assert named > 0
    other = made.replace(b"memmove", b"nomove!")
    with pytest.raises(RuntimeError, match="nomove!"):
        image.map_image(other, SYMBOLS, {})
