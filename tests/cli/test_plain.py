"""Command lines that are read without the parser mean what the parser says, and others are left to it."""

from __future__ import annotations

import inspect
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stc.cli import plain
from stc.cli.options import solve_options
from stc.cli.searches import search_options

WORDS = st.one_of(
    st.sampled_from([*plain.VALUES, *plain.FLAGS, plain.SETTING]),
    st.sampled_from(
        ["--set=n=3", "--method=central", "--method=", "-ox.npz", "-o=x.npz", "--help", "-h", "--", "-"]
    ),
    st.sampled_from(
        ["cart", "n=5", "3", "1e-6", " 7 ", "1_0", "nan", "-1", "x.npz", "", "--unknown", "--dir"]
    ),
)


@pytest.fixture(scope="module")
def parser() -> Any:
    """The parser's own command ``stc solve``."""
    import typer.main

    from stc.cli.app import app_for

    return typer.main.get_command(app_for(["solve"])).commands["solve"]  # type: ignore[attr-defined]


def by_parser(parser: Any, words: list[str]) -> dict[str, Any] | None:
    """What the parser makes of them; None where it refuses."""
    try:
        found = dict(parser.make_context("solve", list(words)).params)
    except (Exception, SystemExit):
        return None
    found["settings"] = list(found["settings"] or ()) or None
    return found


def meant(arguments: dict[str, Any]) -> dict[str, Any]:
    """All arguments of the command, with what is not given as it is by default."""
    known = {**inspect.signature(search_options).parameters, **inspect.signature(solve_options).parameters}
    defaults = {name: each.default for name, each in known.items() if each.kind != each.VAR_KEYWORD}
    assert (
        defaults.pop("until") is None and defaults.pop("until_passed") is False
    )  # which belong to `stc run`
    return {**defaults, "json": False, **arguments}


@given(words=st.lists(WORDS, max_size=6))
def test_what_is_read_is_what_the_parser_reads(parser: Any, words: list[str]) -> None:
    read = plain.read(["solve", *words])
    if read is not None:
        parsed = by_parser(parser, words)
        assert parsed is not None
        assert repr(meant(read)) == repr({name: parsed[name] for name in meant(read)})


def test_every_option_is_read(parser: Any) -> None:
    known = {text for option in parser.params for text in (*option.opts, *option.secondary_opts)}
    assert known - {"spec", "--help", "-h"} == {*plain.VALUES, *plain.FLAGS, plain.SETTING}
    assert {option.name for option in parser.params} - {"help"} == set(meant({"spec": "cart"}))


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["solve"],
        ["check", "cart"],
        ["solve", "cart", "other"],
        ["solve", "cart", "--method"],
        ["solve", "cart", "--starts", "many"],
        ["solve", "cart", "--set", "-o"],
        ["solve", "--help"],
        ["solve", "cart", "--unknown", "3"],
    ],
    ids=" ".join,
)
def test_what_is_not_plain_is_left_to_the_parser(words: list[str]) -> None:
    assert plain.read(words) is None


def test_a_plain_line() -> None:
    words = [
        "solve",
        "cart",
        "--set",
        "n=50",
        "--set",
        "h=1/30",
        "-o",
        "a.npz",
        "--tolerance=1e-9",
        "--direct",
    ]
    assert plain.read(words) == {
        "spec": "cart",
        "settings": ["n=50", "h=1/30"],
        "output": "a.npz",
        "tolerance": 1e-9,
        "direct": True,
    }
