from itertools import pairwise

import pytest
from reading import body_of, c, d, messages_of, p, problem_of, v, warnings_of

from stc.language.definitions import runs
from stc.problem import DefinitionPiece, FrameRange
from stc.symbolic.expr import num

RANGED = "constants: n = 20; variables: x, y, u; method: trapezoidal; definitions:"


def test_an_unranged_definition_is_its_value() -> None:
    assert body_of("e*2", "definitions: e = x + s; s = sin(y);") is body_of("(x + sin(y))*2")
    problem = problem_of(f"{RANGED} e = x*x; constraints: e = u + y;")
    assert problem.definitions == {}
    assert problem.macros == {"e": v("x") * v("x")}


def test_one_formula_over_the_whole_motion_is_its_value_too() -> None:
    problem = problem_of(f"{RANGED} [0, n]: e = x*x; constraints: e = u + y;")
    assert problem.definitions == {} and "e" in problem.macros


def test_ranged_definitions_keep_their_name_and_pieces() -> None:
    problem = problem_of(f"{RANGED} [0, 9]: e = x; [10, n]: e = y; constraints: e'' + 2*before(e) = u;")
    assert [(str(piece.range), piece.body) for piece in problem.definitions["e"]] == [
        ("[0, 9]", v("x")),
        ("[10, 20]", v("y")),
    ]
    # nothing jumps, so `before` means the plain value
    assert problem.relations[0].body is (d("e", 2) + num(2.0) * d("e")) - v("u")


def test_a_formula_without_header_is_the_default_for_the_others() -> None:
    problem = problem_of(f"{RANGED} e = x; [5, 8]: e = y; constraints: e = u;")
    assert [str(piece.range) for piece in problem.definitions["e"]] == ["[0, 20]", "[5, 8]"]


def test_definitions_of_definitions() -> None:
    problem = problem_of(
        f"""{RANGED} f = 2*g; g = e2; [0, 9]: e = x; [10, n]: e = f;
        [0, n - 1]: e2 = y; [n]: e2 = x; constraints: e = u;"""
    )
    assert problem.definitions["e"][1].body is num(2.0) * d("e2")


@pytest.mark.parametrize(
    ("definitions", "message"),
    [
        ("a = a;", "the definition `a` is made of itself"),
        ("a = b; b = c + x; c = a';", "the definition `a` is made of itself"),
        ("[0]: a = x; [1, n]: a = a + 1;", "the definition `a` is made of itself"),
        ("a = 1; a = 2;", "`a` is defined already, on line 1"),
    ],
)
def test_circular_and_repeated_definitions(definitions: str, message: str) -> None:
    assert messages_of(f"{RANGED} {definitions} constraints: a = x + y + u;") == [message]


PIECES = [
    DefinitionPiece(num(k), FrameRange(*ends), None)
    for k, ends in enumerate([(2, 8), (5, 6), (12, 30), (6, 7)])
]  # type: ignore[arg-type]


@pytest.mark.parametrize("first", [0, 2, 5, 7, 9, 12])
@pytest.mark.parametrize("last", [0, 5, 6, 8, 13, 20])
def test_runs_are_the_latest_piece_frame_by_frame(first: int, last: int) -> None:
    expected = {}
    for frame in range(first, last + 1):
        holding = [piece for piece in PIECES if piece.range.first <= frame <= piece.range.last]
        expected[frame] = holding[-1] if holding else None
    found = runs(PIECES, first, last)
    assert {frame: run.piece for run in found for frame in range(run.first, run.last + 1)} == expected
    for before, after in pairwise(found):
        assert before.last + 1 == after.first and before.piece is not after.piece


GAPS = f"{RANGED} [3, 9]: e = x; [12, 15]: e = y; [0, n]: use = e; [5, 13]: f = 2*e;"


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("[0, n]: e = u;", "`e` is used on frames 0 to 2, where no definition of it holds"),
        ("[3, 12]: e = u;", "`e` is used on frames 10 to 11, where no definition of it holds"),
        ("[15, 16]: e' = u;", "`e` is used on frame 16, where no definition of it holds"),
        ("[4]: f = u;", "`f` is used on frame 4, where no definition of it holds"),
        ("[7, 10]: f = u;", "`e` is used on frame 10, where no definition of it holds"),
        ("[0]: use = u;", "`e` is used on frame 0, where no definition of it holds"),
        ("[3, 9]: e = u; f[3] = u;", "`f` has no definition on frame 3"),
    ],
)
def test_use_where_no_definition_holds(statement: str, message: str) -> None:
    assert messages_of(f"{GAPS} constraints: {statement}") == [message]


@pytest.mark.parametrize(
    "statement",
    ["[3, 9]: e = u;", "[12, 15]: e' = u;", "[5, 9]: f = u;", "[3]: use = u;", "e[12] + f[13] = u;"],
)
def test_use_where_a_definition_holds(statement: str) -> None:
    assert messages_of(f"{GAPS} constraints: {statement}") == []


def test_frames_that_a_statement_is_clipped_away_from_need_no_definition() -> None:
    text = "constants: n = 20; variables: x, u; definitions: [1, n - 1]: e = u; constraints: {}"
    assert messages_of(text.format("x'' = e;")) == []
    assert messages_of(text.format("x[i + 1] - x[i - 1] = e;")) == []
    assert messages_of(text.format("x[n - i - 1] + x[i - 1] = e;")) == []
    assert len(messages_of(text.format("x' = e;"))) == 1
    assert len(messages_of(text.format("x'' = e;"), "trapezoidal")) == 1


def test_a_definition_of_a_lost_range_says_nothing_more() -> None:
    text = f"{RANGED} [0, 99]: e = x; [3]: f = x; constraints: e = u; f[3] = y;"
    assert messages_of(text) == ["the range [0, 99] reaches outside the motion"]


# ------------------------------------------------------------------ the step

STEP = "constants: n = 20, T = 2; variables: x; parameters: P, Q; method: trapezoidal; definitions:"


@pytest.mark.parametrize(
    "definitions",
    ["h = T/n;", "h = P/n;", "h = d; d = 2*P;", "h = T*(1 + i)/n;", "[0, 9]: h = P; [10, n - 1]: h = Q;"],
)
def test_steps(definitions: str) -> None:
    problem = problem_of(f"{STEP} {definitions} constraints: x'' = P + Q + T;")
    assert problem.step is (d("h") if "[" in definitions else problem.macros["h"])


def test_a_step_made_of_ranged_definitions_is_written_out() -> None:
    problem = problem_of(f"{STEP} h = len/n; [0, 9]: len = P; [10, n - 1]: len = Q; constraints: x'' = 1;")
    assert problem.step is d("h")
    assert [(str(piece.range), piece.body) for piece in problem.definitions["h"]] == [
        ("[0, 9]", p("P") / c("n")),
        ("[10, 19]", p("Q") / c("n")),
    ]


@pytest.mark.parametrize(
    ("definitions", "message"),
    [
        ("h = x;", "the step `h` cannot depend on `x`"),
        ("h = T + x';", "the step `h` cannot depend on `x'`"),
        ("h = t;", "the step `h` cannot depend on `t`"),
        ("h = -T;", "the step `h` is -2"),
        ("h = T - 2;", "the step `h` is 0"),
        ("h = 1 - 0.1*i;", "the step `h` is 0 at frame 10"),
        ("[0, 9]: h = 1; [11, n]: h = P;", "`h` is not defined for the step after frame 10"),
        ("[5, n]: h = 1;", "`h` is not defined for the step after frames 0 to 4"),
    ],
)
def test_steps_that_cannot_be(definitions: str, message: str) -> None:
    assert messages_of(f"{STEP} {definitions} constraints: x'' = P + Q + T;") == [message]


def test_a_constant_step_is_checked_too() -> None:
    assert messages_of("constants: n = 3, h = 0; variables: x; constraints: x'' = 1;") == [
        "the step `h` is 0"
    ]
    assert messages_of("constants: n = 0, h = 1/n; variables: x; constraints: x = 1;") == ["division by zero"]


def test_a_step_after_the_last_frame_is_not_needed() -> None:
    assert messages_of(f"{STEP} [0, n - 1]: h = P; constraints: x*h = Q*T;") == []
    assert messages_of("constants: n = 0; variables: x; definitions: [0]: h = 3; constraints: x = 1;") == []


def test_unused_names_are_warned_about() -> None:
    text = """constants: n = 3, k = 1, l = k; variables: x, y; parameters: P; definitions: e = y; f = e;
    constraints: x = 1; guess: P = 3;"""
    assert warnings_of(text) == [
        "the constant `l` is not used",
        "the parameter `P` is not used",
        "the definition `f` is not used",
    ]
