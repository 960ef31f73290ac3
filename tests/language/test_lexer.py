import pytest

from stc.errors import Source
from stc.language.diagnostics import Diagnostics
from stc.language.lexer import tokenize


def lexed(text: str) -> list[tuple[str, str]]:
    source = Source("a.stc", text)
    diagnostics = Diagnostics(source)
    tokens = tokenize(source, diagnostics)
    assert not diagnostics.items
    return [(kind, tokens.text(index)) for index, kind in enumerate(tokens.kinds)][:-1]


def test_kinds_of_tokens() -> None:
    assert lexed("m*x'' >= -1.5e-3;  # rest\n[0, n]:") == [
        ("name", "m"),
        ("*", "*"),
        ("name", "x"),
        ("prime", "''"),
        (">=", ">="),
        ("-", "-"),
        ("number", "1.5e-3"),
        (";", ";"),
        ("[", "["),
        ("number", "0"),
        (",", ","),
        ("name", "n"),
        ("]", "]"),
        (":", ":"),
    ]


@pytest.mark.parametrize("number", ["0", "12", "1.", ".5", "1.5", "1e5", "1E+05", "1.5e-10", ".5e3", "007"])
def test_numbers(number: str) -> None:
    assert lexed(number) == [("number", number)]


@pytest.mark.parametrize("name", ["x", "I0", "x_dot", "_a", "θ", "α1", "été", "integral"])
def test_names(name: str) -> None:
    assert lexed(name) == [("name", name)]


def test_paths_of_models_and_quoted_names() -> None:
    assert lexed('set body."big ball".mass') == [
        ("name", "set"),
        ("name", "body"),
        (".", "."),
        ("string", '"big ball"'),
        (".", "."),
        ("name", "mass"),
    ]


def test_comments_and_white_space_are_free() -> None:
    assert lexed("a#b;c\n\t b \r\n #\n#") == [("name", "a"), ("name", "b")]
    assert lexed("") == []
    assert lexed("\ufeffa") == [("name", "a")]


def test_places_are_those_of_the_characters() -> None:
    source = Source("a.stc", "  xy\n= 3")
    tokens = tokenize(source, Diagnostics(source))
    assert list(zip(tokens.starts, tokens.ends)) == [(2, 4), (5, 6), (7, 8), (8, 8)]


@pytest.mark.parametrize(
    ("slip", "kind"),
    [("**", "^"), ("==", "="), ("<", "<="), (">", ">="), ("≤", "<="), ("−", "-"), ("’", "prime"), ("·", "*")],
)
def test_slips_are_reported_and_read_as_meant(slip: str, kind: str) -> None:
    source = Source("a.stc", f"x {slip} y")
    diagnostics = Diagnostics(source)
    assert tokenize(source, diagnostics).kinds == ["name", kind, "name", "end"]
    assert [d.message for d in diagnostics.items] == [f"`{slip}` is not part of the language"]


def test_unknown_characters_are_reported_once_per_run_and_skipped() -> None:
    source = Source("a.stc", "x ??? y ~\u0007")
    diagnostics = Diagnostics(source)
    assert tokenize(source, diagnostics).kinds == ["name", "name", "end"]
    assert [d.message for d in diagnostics.items] == [
        "unexpected character `?`",
        "unexpected character `~`",
        "unexpected character `U+0007`",
    ]
