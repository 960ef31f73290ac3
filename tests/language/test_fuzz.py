"""Whatever the text, reading it gives a problem or mistakes with places inside the text, never anything else."""

import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stc.errors import Source
from stc.language.diagnostics import Diagnostics
from stc.language.elaborate import elaborate_with_recovery
from stc.language.parser import parse_with_recovery
from stc.language.show import show_problem, show_tokens

FILES = sorted((Path(__file__).parents[1] / "problems").glob("traj/*.stc"))
_PLAIN = """
constants: variables: parameters: definitions: guess: constraints: objective: jumps: method: replay: n x
y i t pi inf k 0 1 2.5 1e400 ' '' + - * / ^ ( ) [ ] , ; : = <= >= < == integral( before( after( sin(
atan2( [0,n]: [n/2]: [i]: model joint . # ² foo lagrangian: ** 9999999999
"""
TOKENS = [
    *_PLAIN.split(),
    *("T\nh", "central\ntrapezoidal", '"quoted"', "\n"),
]


def read(text: str) -> None:
    source = Source("fuzz.stc", text)
    diagnostics = Diagnostics(source)
    tree = parse_with_recovery(source, diagnostics)
    problem = elaborate_with_recovery(tree, {}, None, diagnostics)
    assert (problem is None) <= bool(diagnostics.error_count)
    for diagnostic in diagnostics.items:
        assert diagnostic.span is not None
        assert 0 <= diagnostic.span.start <= len(text)
        assert diagnostic.render().startswith("fuzz.stc:")
    if problem is not None:
        assert show_problem(problem)


@settings(max_examples=200)
@given(st.text(max_size=80))
def test_any_characters(text: str) -> None:
    read(text)
    show_tokens(Source("fuzz.stc", text))


@settings(max_examples=300)
@given(st.lists(st.sampled_from(TOKENS), max_size=60))
def test_any_tokens(tokens: list[str]) -> None:
    read(" ".join(tokens))
    read("constants: n = 4, k = 2; variables: x, y; parameters: T; constraints: " + " ".join(tokens))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_mutated_files(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    chance = random.Random(path.stem)
    for _ in range(30):
        mutated = text
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(mutated))
            kind = chance.randrange(4)
            if kind == 0:
                mutated = mutated[:at] + mutated[at + chance.randint(1, 5) :]
            elif kind == 1:
                mutated = mutated[:at] + chance.choice(TOKENS) + mutated[at:]
            elif kind == 2:
                other = chance.randrange(len(mutated))
                mutated = mutated[:at] + mutated[other : other + chance.randint(1, 40)] + mutated[at:]
            else:
                mutated = mutated[:at]
            mutated = mutated or " "
        read(mutated)


@pytest.mark.parametrize(
    "text",
    [
        "constants: n = 4; variables: x; constraints: " + "(" * 5000 + "x" + ")" * 5000 + ";",
        "constants: n = 4; variables: x; constraints: " + "-" * 5000 + "x;",
        "constants: n = 4; variables: x; constraints: " + "x^" * 5000 + "x;",
        "constants: n = 4; variables: x; constraints: " + "sin(" * 90 + "x" + ")" * 90 + ";",
        "constants: n = 4; variables: x; constraints: " + "+".join(["x*sin(x)"] * 3000) + ";",
        "constants: n = 4; variables: x; constraints: " + "*".join(["x"] * 3000) + ";",
        "constants: n = 4; variables: x; constraints: " + "x <= " * 500 + "x;",
        "constants: n = " + "(" * 99 + "4" + ")" * 99 + "; variables: x; constraints: x = 1;",
        "constants: n = 4, " + ",".join(f"a{k} = a{k + 1}" for k in range(3000)) + "; variables: x;",
        "constants: n = 4; variables: x; definitions: "
        + "".join(f"d{k} = d{k + 1} + d{k + 1}*x;" for k in range(300))
        + "d300 = x; constraints: d0 = 1;",
        "constants: n = 4; variables: x; constraints: (sin(x)*cos(x))'''''''' = 0;",
    ],
    ids=lambda text: text[44:60],
)
def test_deep_and_long(text: str) -> None:
    read(text)
