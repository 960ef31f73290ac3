"""What an editor is told about texts that are not finished, and words and colours that are known to it."""

from __future__ import annotations

import json
import random
import re
import sys
from pathlib import Path

import pytest

from stc.editor import words
from stc.editor.answers import completions, hover, outline, targets
from stc.editor.last_solution import LastSolution
from stc.editor.names import names_of
from stc.editor.reading import read
from stc.errors import Source

ROOT = Path(__file__).parent.parent.parent
SPECS = [*sorted((ROOT / "specs").glob("*.stc")), *sorted((ROOT / "docs").glob("*.stc"))]
INSERTED = (
    "[",
    "(",
    "{",
    "}",
    "for k in ",
    '"',
    "'",
    ".",
    ";",
    ":",
    "sum(k in 1..",
    "joint.",
    "keyframe.",
    "𝒙",
    "#",
)


@pytest.mark.daily_every(3)
@pytest.mark.slow
@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_nothing_that_is_typed_is_too_much(path: Path) -> None:
    """Texts that end early, lack a piece or have one too many: mistakes within the text, never a failure."""
    whole = path.read_text(encoding="utf-8")
    draw = random.Random(path.stem)
    for number in range(12):
        at = draw.randrange(len(whole))
        text = [whole[:at], whole[:at] + whole[at + 20 :], whole[:at] + draw.choice(INSERTED) + whole[at:]][
            number % 3
        ]
        reading = read(Source(path.name, text, str(path)))
        names = names_of(reading)
        for offset in (min(at, len(text)), len(text) // 2):
            hover(reading, names, offset, LastSolution())
            completions(names, text, offset)
            targets(reading, names, offset)
        outline(reading, names)
        for one in reading.diagnostics:
            assert "itself failed" not in one.message
            assert one.span is not None
            start, end = one.span.source.place(one.span.start, one.span.end)
            assert 0 <= start <= end <= len(text) + 1


def test_a_number_is_not_completed_and_a_name_that_ends_in_one_is() -> None:
    text = "constants: n = 5, q1 = 2.5;"
    names = names_of(read(Source("text", text)))
    assert "q1" in {one.word for one in completions(names, text, text.index("q1") + 2)}
    assert completions(names, text, text.index("2.5") + 3) == []
    assert completions(names, "# q1", 4) == []


def test_every_word_of_the_language_has_a_meaning() -> None:
    assert words.KNOWN_ELSEWHERE <= words.WORDS.keys()


def test_every_word_of_the_language_has_a_colour() -> None:
    grammar = json.loads((ROOT / "docs/editor/vscode/stc.tmLanguage.json").read_text(encoding="utf-8"))
    rules = [
        re.compile(rule["match"]) for rule in grammar["patterns"][:-1]
    ]  # the last one is for all other names
    uses = ("{}:", "{}(x)", " {};", ", {} = 1", "{} body.x", "{}")
    for word in words.WORDS:
        found = [
            m for use in uses for rule in rules if (m := rule.search(use.format(word))) and word in m.group()
        ]
        assert found, word
    assert not [rule.pattern for rule in rules if rule.fullmatch("speedy") or rule.fullmatch("sinus")]


def test_without_pygls_the_command_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from stc.cli.main import run

    monkeypatch.delitem(sys.modules, "stc.editor.server", raising=False)
    monkeypatch.setitem(sys.modules, "lsprotocol", None)
    assert run(["language-server"]) == 2
    assert "needs pygls, which is not installed\n  pip install pygls" in capsys.readouterr().err
