from __future__ import annotations

import os
import subprocess
import sys

import pytest

import stc
from stc.codegen import cache
from stc.transcription import derive
from stc.transcription.derive import Group

SPEC = """
constants: n = 8, h = 0.1, m = 2;
variables: x, y, u, v;
method: trapezoidal;
constraints:
  [0, n]: m*x'' = u*cos(y) + i; y' = v*x + 0.5*sin(x)*v^2; u^2 + v^2 <= 400;
  [0]: x = 0; y = 1; x'; [n]: x = 1;
objective: [0, n]: integral(u^2 + 2.5*v^2);
"""


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """An empty cache, and a process that remembers nothing."""
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(derive, "_remembered", {})
    return tmp_path


def programs(text: str = SPEC, **constants: float):
    _, found = stc.load(text).transcription(**constants)
    return found, [group.programs for group in found.program.groups]


def refuse(*_args, **_kwargs):
    raise AssertionError("this was to be found on disk")


def forget(monkeypatch):
    monkeypatch.setattr(derive, "_remembered", {})


def test_what_is_kept_is_what_was_derived(kept, monkeypatch):
    found, first = programs()
    forget(monkeypatch)
    monkeypatch.setattr(Group, "differentiate", refuse)
    again, second = programs()
    assert len(first) == len(second) >= 2
    for one, other in zip(first, second, strict=True):
        for name in ("degrees", "objective_degree", "bent"):
            assert getattr(one, name) == getattr(other, name)
        assert one.varying == other.varying and one.constant == other.constant
        for name in ("values_tape", "derivatives_tape", "constants_tape"):
            a, b = getattr(one, name), getattr(other, name)
            assert a.digest() == b.digest()
            assert a.uniform_ops == b.uniform_ops
    a, b = found.bind(), again.bind()
    ones = [1.0] * a.m
    for mine, theirs in zip(a.derivatives(a.x0, ones, 1.0), b.derivatives(b.x0, ones, 1.0), strict=True):
        assert (mine == theirs).all()


def test_another_number_of_frames_and_other_numbers_are_found(kept, monkeypatch):
    programs()
    forget(monkeypatch)
    monkeypatch.setattr(Group, "differentiate", refuse)
    programs(n=31, m=3.0)


@pytest.mark.parametrize(
    ("old", "new"),
    [("2.5*v^2", "2*v^2"), ("+ i;", "- i;"), ("u^2 + v^2 <=", "u^2 + 2*v^2 <="), ("sin(x)", "sin(y)")],
)
def test_other_statements_are_not(kept, monkeypatch, old, new):
    programs()
    forget(monkeypatch)
    monkeypatch.setattr(Group, "differentiate", refuse)
    with pytest.raises(AssertionError, match="found on disk"):
        programs(SPEC.replace(old, new))


@pytest.mark.parametrize("damage", [b"", b"rubbish", None])
def test_what_is_damaged_is_derived_again(kept, monkeypatch, damage):
    _, first = programs()
    for file in kept.glob("*" + cache.SUFFIX):
        if damage is None:  # whole by its checksum, and yet not what it should be
            cache.store(file.name.removesuffix(cache.SUFFIX), b"N")
        else:
            file.write_bytes(damage)
    forget(monkeypatch)
    _, second = programs()
    assert [one.derivatives_tape.digest() for one in first] == [
        one.derivatives_tape.digest() for one in second
    ]


def test_other_code_does_not_find_it(kept, monkeypatch):
    programs()
    forget(monkeypatch)
    monkeypatch.setattr(derive, "_own_digest", lambda: "another version")
    monkeypatch.setattr(Group, "differentiate", refuse)
    with pytest.raises(AssertionError, match="found on disk"):
        programs()


def test_a_cache_that_cannot_be_written_costs_nothing_but_time(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("no folder")
    monkeypatch.setenv("STC_CACHE_DIR", str(file))
    monkeypatch.setattr(derive, "_remembered", {})
    assert programs()[1]


@pytest.mark.slow
def test_another_process_finds_derivatives_and_machine_code(kept):
    """Whatever the order in which memory is given out: the code of a larger spec is the same in all of them."""
    program = (
        "import stc\n"
        "model = stc.load('luxo_jump')\n"
        "_, found = model.transcription(k=1)\n"
        "found.compile()\n"
        "print([tape.digest() for tape in found.tapes], found.kernels.cached)\n"
    )
    told = [
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split("] ")
        for seed in (1, 2)
    ]
    assert len({digests for digests, _ in told}) == 1
    assert [cached.strip() for _, cached in told] == ["False", "True"]
