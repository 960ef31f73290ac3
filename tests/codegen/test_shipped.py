"""Machine code that comes with the package: found only where it is what would be compiled, and can run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stc.codegen import cache, engine, native, native_units, shipped
from stc.codegen.image import supported
from stc.codegen.machine import Machine
from stc.records import dataclass

pytestmark = pytest.mark.skipif(
    not supported() or not engine.llvm_wanted(), reason="machine code ships for Linux on x86-64 only"
)

TEXT = """
from stc.codegen.native import *
K = {factor}
@native
def f(n: i64, x: f64s) -> f64:
    total = 0.0
    for k in range(n):
        total += K * x[k]
    return total
"""


@dataclass(slots=True)
class Box:
    """A folder of shipped objects, and what was compiled at first use all the same."""

    folder: Path
    compiled: list[str]

    def function(self, factor: float = 2.0) -> Any:
        return native.native_source(TEXT.format(factor=factor), "shipped")["f"]

    def run(self, factor: float = 2.0) -> bool:
        """Use the function; whether it had to be compiled."""
        before = len(self.compiled)
        assert self.function(factor)(3, np.array([1.0, 2.0, 4.0])) == 7.0 * factor
        return len(self.compiled) > before

    def build(self) -> int:
        self.function()
        made = shipped.build(self.folder)
        self.compiled.clear()
        return made


@pytest.fixture
def box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Box:
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(shipped, "FOLDER", tmp_path / "shipped")
    empty: dict[str, Any] = {}
    for module in (native, native_units):
        monkeypatch.setattr(module, "registry", empty)
    made = Box(tmp_path / "shipped", [])
    original = engine.compile_ir

    def counting(ir: str, **options: Any) -> bytes:
        made.compiled.append(ir)
        return original(ir, **options)

    monkeypatch.setattr(engine, "compile_ir", counting)
    return made


def test_shipped_code_is_used_and_the_cache_left_alone(box: Box, tmp_path: Path) -> None:
    assert box.build() == len(shipped.LEVELS)
    if not any(level.runs_on(engine.this_machine()) for level in shipped.LEVELS):
        pytest.skip("nothing ships for this machine")
    assert not box.run()
    assert not list((tmp_path / "cache").glob("*"))


def test_changed_functions_and_generators_are_compiled(box: Box, monkeypatch: pytest.MonkeyPatch) -> None:
    box.build()
    assert box.run(factor=4.0)
    monkeypatch.setattr(engine, "own_digest", lambda: "another code generator")
    assert box.run()


def test_what_was_compiled_for_this_machine_comes_first(box: Box) -> None:
    assert box.run()
    box.build()
    for path in box.folder.glob("*"):
        path.write_bytes(b"never read")
    assert not box.run()


@pytest.mark.parametrize("damage", [b"", b"damaged"])
def test_damaged_objects_are_compiled_anew(box: Box, damage: bytes) -> None:
    box.build()
    for path in box.folder.glob("*"):
        path.write_bytes(damage)
    assert box.run()


def test_objects_with_other_contents_are_compiled_anew(box: Box) -> None:
    box.build()
    for path in box.folder.glob("*"):
        cache.store_in(box.folder, path.stem, b"whole by its checksum, and no machine code")
    assert box.run()


def test_code_runs_on_machines_of_its_level_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    v4, v3 = shipped.LEVELS
    unit = cache.key_of("a function")
    for level in shipped.LEVELS:
        cache_key = shipped._key(level, unit, "digest")
        tmp_path.joinpath("objects").mkdir(exist_ok=True)
        cache.store_in(tmp_path / "objects", cache_key, level.name.encode())
    monkeypatch.setattr(shipped, "FOLDER", tmp_path / "objects")

    def found(features: set[str], architecture: str = "x86_64") -> bytes | None:
        return shipped.find(unit, Machine(architecture, frozenset(features), ""), "digest")

    more = {"sse2"}
    assert found(set(v4.needs) | more) == b"x86-64-v4"
    assert found(set(v3.needs) | more) == b"x86-64-v3"
    for missing in v3.needs:
        assert found(set(v4.needs) - {missing} | more) is None
    for missing in v4.needs - v3.needs:
        assert found(set(v4.needs) - {missing}) == b"x86-64-v3"
    assert found(set(v4.needs), "aarch64") is None
    assert shipped.find(unit, Machine("x86_64", v4.needs, ""), "another digest") is None


def test_features_are_named_as_llvm_names_them() -> None:
    import llvmlite.binding as llvm

    known = set(llvm.get_host_cpu_features())
    for level in shipped.LEVELS:
        assert level.needs <= known
