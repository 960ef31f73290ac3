"""What steers a terminal is spelled out before it gets there."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from stc.cli.main import run
from stc.errors import Source, Span
from stc.terminal_text import VisibleStream, visible

#: Changes the colour, the title and the direction of what follows.
STEERING = "\x1b[31mX\x1b]0;title\x07\u202e\x9b"


def test_what_steers_is_spelled_and_all_else_stays() -> None:
    assert visible(STEERING) == r"\x1b[31mX\x1b]0;title\x07\u202e\x9b"
    assert visible("αβ é 𝕏 'x'\n\tπ") == "αβ é 𝕏 'x'\n\tπ"
    assert visible(b"caf\xe9.stc".decode("utf-8", "surrogateescape")) == r"caf\udce9.stc"


def test_carets_stand_below_what_is_meant() -> None:
    source = Source("hop.stc", f"a\t{STEERING} wrong \x1b\n")
    at = source.text.index("wrong")
    line, carets = Span(source, at, at + 5).excerpt().splitlines()
    assert line[carets.index("^") :].startswith("wrong") and carets.count("^") == 5
    assert line.isprintable()


def test_an_excerpt_of_a_long_line_is_short() -> None:
    source = Source("hop.stc", "x + " * 500_000)
    excerpt = Span(source, 1_000_000, 1_000_001).excerpt()
    assert max(map(len, excerpt.splitlines())) < 200


def test_a_stream_tells_how_much_it_was_given() -> None:
    shown = io.StringIO()
    stream = VisibleStream(shown)
    assert stream.write("a\x1bb\n") == 4
    stream.writelines(["c\x07"])
    assert shown.getvalue() == "a\\x1bb\nc\\x07"
    assert not stream.isatty()


@pytest.mark.parametrize(
    "words",
    [
        ["check", "spec.stc"],
        ["show", "spec.stc", "--stage", STEERING],
        ["solve", STEERING],
        ["check", "hop.stc", "--set", f"{STEERING}=1"],
        ["solve", "hop.stc", "--method", STEERING],
        [STEERING],
    ],
)
def test_no_message_steers_the_terminal(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "hop"]) == 0
    whole = Path("hop.stc").read_text(encoding="utf-8")
    Path("spec.stc").write_text(whole.replace("width", STEERING), encoding="utf-8")
    streams = sys.stdout, sys.stderr
    assert run(words) == 2
    assert (sys.stdout, sys.stderr) == streams
    printed = capsys.readouterr()
    both = printed.out + printed.err
    assert visible(both) == both and r"\x1b" in both


def test_a_model_cannot_steer_the_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "hop"]) == 0
    text = Path("hop.stc").read_text(encoding="utf-8").replace('"particle.xml"', '"own.xml"')
    Path("hop.stc").write_text(text, encoding="utf-8")
    Path("own.xml").write_text(f"<mujoco><{STEERING}/></mujoco>", encoding="utf-8")
    assert run(["check", "hop.stc"]) == 2
    told = capsys.readouterr().err
    assert "own.xml" in told and visible(told) == told
