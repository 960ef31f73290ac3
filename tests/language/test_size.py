"""Specs that are deep, long or large are read in reasonable time or refused; each would hang or overflow otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest

from stc import pipeline
from stc.errors import Source, SpecError, UsageError
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.problem import Problem

HEAD = "constants: n = 4, T = 1, h = T/n;\nvariables: x, f;\n"
MOTION = "constraints:\n[0, n]: x'' = f;\n[0]: x; x';\n[n]: x = 1; x';\n"
DEEP = 20_000


def _problem(text: str) -> Problem:
    return elaborate(parse(Source("deep.stc", text)))


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("x" + "[" * DEEP + "0" + "]" * DEEP, "expected an expression"),
        ("[" * DEEP + "0", "expected an expression"),
        ("(" * DEEP + "x" + ")" * DEEP, "nested more than"),
        ("sin(" * DEEP + "x" + ")" * DEEP, "nested more than"),
        ("x" + "^2" * DEEP, "nested more than"),
        ("-" * DEEP + "x", "signs in a row"),
        ("x" + "'" * DEEP, "time derivatives go up to"),
        ("x" + " '" * DEEP, "too many primes"),
    ],
)
def test_what_is_nested_without_end_is_refused(statement: str, message: str) -> None:
    with pytest.raises(SpecError, match=message) as caught:
        _problem(f"{HEAD}{MOTION}[0]: {statement};\n")
    assert len(caught.value.diagnostics) == 1


@pytest.mark.daily_every(4)
@pytest.mark.parametrize(
    ("first", "following", "use"),
    [
        ("x", "{}+1", "constraints: [0]: {} <= 1e9;"),
        ("1", "{}+0", "constraints: [{}]: x <= 1e9;"),
        ("0", "{0}+{0}", "constraints: [{}]: x <= 1e9;"),  # 2^20000 additions by hand
        ("integral(f^2)", "{}+1", "objective: {};"),
    ],
)
def test_definitions_made_of_each_other_are_a_chain_of_any_length(
    first: str, following: str, use: str
) -> None:
    chain = "".join(f"d{k} = {following.format(f'd{k - 1}')};\n" for k in range(1, DEEP))
    text = f"{HEAD}definitions:\nd0 = {first};\n{chain}{MOTION}{use.format(f'd{DEEP - 1}')}\n"
    assert len(_problem(text).variables) == 2


def test_what_a_long_chain_comes_to_is_told_once() -> None:
    chain = "".join(f"d{k} = d{k - 1};\n" for k in range(1, DEEP))
    with pytest.raises(SpecError) as caught:
        _problem(f"{HEAD}definitions:\nd0 = x;\n{chain}{MOTION}[d{DEEP - 1}]: x;\n")
    (mistake,) = caught.value.diagnostics
    assert "a range cannot use the variable `x`" in mistake.message and len(mistake.message) < 200


def test_integrals_that_double_are_refused() -> None:
    chain = "".join(f"d{k} = d{k - 1} + d{k - 1};\n" for k in range(1, 64))
    with pytest.raises(SpecError, match=r"more than .* integrals"):
        _problem(f"{HEAD}definitions:\nd0 = integral(f^2);\n{chain}{MOTION}objective: d63;\n")


def test_a_long_circle_is_told_in_short() -> None:
    chain = "".join(f"d{k} = d{(k + 1) % DEEP};\n" for k in range(DEEP))
    with pytest.raises(SpecError, match="made of itself") as caught:
        _problem(f"{HEAD}definitions:\n{chain}{MOTION}")
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    ("name", "frame"), [("last", "[n]"), ("end", "[n]"), ("N", "[n]"), ("final", "[n]"), ("first", "[0]")]
)
def test_a_frame_called_as_elsewhere_is_told_as_it_is_here(name: str, frame: str) -> None:
    with pytest.raises(SpecError) as caught:
        _problem(f"{HEAD}{MOTION}[{name}]: x;\n")
    (mistake,) = caught.value.diagnostics
    assert mistake.message == f"`{name}` is not declared"
    assert mistake.hint.startswith(f"`{frame}` is the")


def test_a_constant_of_such_a_name_is_a_constant() -> None:
    assert _problem(f"{HEAD}constants: last = 2;\n{MOTION}[last]: x >= 0;\n")


def test_a_text_too_long_for_a_spec_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "long.stc"
    file.write_text(HEAD + "#" * pipeline.MOST_CHARACTERS, encoding="utf-8")
    with pytest.raises(UsageError, match="more than 2000000 characters"):
        pipeline.read_source(file)


def test_a_file_without_end_is_refused() -> None:
    with pytest.raises(UsageError):
        pipeline.read_source("/dev/zero")
