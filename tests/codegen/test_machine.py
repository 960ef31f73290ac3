"""What this machine can do, told without the compiler, beside what the compiler says."""

import llvmlite
import pytest

from stc.codegen import engine, machine

pytestmark = pytest.mark.skipif(machine.processor() is None, reason="Linux on x86-64 only")

OLDEST = (0, 45)


def test_features_are_those_that_llvm_finds() -> None:
    here = machine.known(OLDEST)
    assert here is not None
    assert here.architecture == engine.host().triple.split("-")[0]
    llvms = {name.removeprefix("+") for name in engine.host().features.split(",") if name.startswith("+")}
    asked = {"avx2", "fma", "bmi", "bmi2", "popcnt", "avx512f", "avx512dq", "avx512vl"}
    assert here.features & asked == llvms & asked


def test_features_are_read_from_the_first_processor_of_the_list() -> None:
    described = "vendor_id\t: x\nflags\t\t: fpu pni sse4_1 abm lahf_lm bmi1 bmi2 avx512_vnni"
    assert machine.features_of(described) == {
        *("fpu", "sse3", "sse4.1", "lzcnt", "sahf", "bmi", "bmi2", "avx512.vnni")
    }


def test_the_compilers_version_is_that_which_it_has_when_loaded() -> None:
    found = machine.compiler()
    assert found is not None
    text, version = found
    assert ".".join(map(str, version)) == ".".join(llvmlite.__version__.split(".")[:2])
    assert llvmlite.__version__ in text


def test_another_processor_or_compiler_is_another_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    here = machine.known(OLDEST)
    assert here is not None
    monkeypatch.setattr(machine, "processor", lambda: "flags: none")
    changed = machine.known(OLDEST)
    assert changed is not None
    assert changed.identity != here.identity
    monkeypatch.setattr(machine, "compiler", lambda: ("another", (0, 99)))
    assert machine.known(OLDEST) not in (None, changed)


def test_llvm_is_asked_where_it_must_be(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(machine, "compiler", lambda: ("too old", (0, 44)))
        assert machine.known(OLDEST) is None
        patch.setattr(machine, "compiler", lambda: None)
        assert machine.known(OLDEST) is None
    monkeypatch.setattr(machine, "processor", lambda: None)
    assert machine.known(OLDEST) is None
    asked = engine.this_machine.__wrapped__()
    assert asked.architecture == engine.host().triple.split("-")[0]
    assert {"+" + name for name in asked.features} <= set(engine.host().features.split(","))
    assert engine.host().cpu in asked.identity
    assert llvmlite.__version__ in asked.identity
