import pytest
from hypothesis import given
from hypothesis import strategies as st

from stc.language.diagnostics import did_you_mean, edit_distance, nearest_name

words = st.text(alphabet="abc", max_size=6)


def slow_distance(a: str, b: str) -> int:
    """The recurrence of the optimal string alignment distance, word for word."""
    if not a or not b:
        return len(a) + len(b)
    best = min(
        slow_distance(a[:-1], b) + 1,
        slow_distance(a, b[:-1]) + 1,
        slow_distance(a[:-1], b[:-1]) + (a[-1] != b[-1]),
    )
    if len(a) > 1 and len(b) > 1 and a[-1] == b[-2] and a[-2] == b[-1]:
        best = min(best, slow_distance(a[:-2], b[:-2]) + 1)
    return best


@given(st.text(alphabet="abc", max_size=4), st.text(alphabet="abc", max_size=4))
def test_edit_distance_is_the_recurrence(a: str, b: str) -> None:
    assert edit_distance(a, b) == slow_distance(a, b)


@given(words, words)
def test_edit_distance_is_symmetric_and_zero_only_for_equals(a: str, b: str) -> None:
    assert edit_distance(a, b) == edit_distance(b, a)
    assert (edit_distance(a, b) == 0) == (a == b)


@pytest.mark.parametrize(
    ("written", "known", "meant"),
    [
        ("mas", ["m", "mass", "max_speed"], "mass"),
        ("Tau1", ["tau1", "tau2"], "tau1"),
        ("tau3", ["tau1", "x"], "tau1"),
        ("constrants", ["constants", "constraints"], "constraints"),
        ("cnostants", ["constants", "constraints"], "constants"),
        ("G", ["x", "g"], "g"),
        ("z", ["x", "y"], None),
        ("fx", ["x", "y"], None),
        ("xx", ["x", "y"], "x"),
        ("velocity", ["x", "mass"], None),
        ("x", [], None),
    ],
)
def test_nearest_name(written: str, known: list[str], meant: str | None) -> None:
    assert nearest_name(written, known) == meant


def test_did_you_mean_is_empty_without_a_candidate() -> None:
    assert did_you_mean("zeta", ["x"]) == ""
    assert did_you_mean("forse", ["force"]) == "did you mean `force`?"
