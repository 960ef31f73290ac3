"""Repetitions mean what the same statements mean when each is written out by hand."""

from pathlib import Path

import pytest

from stc.certification import statements_of
from stc.errors import Source, SpecError, UsageError
from stc.language import parse, read_problem
from stc.language.show import show_syntax
from stc.pipeline import Model
from stc.validate.certificate.listing import listing


def shown(text: str) -> str:
    return show_syntax(parse(Source("a.stc", text)))


def constraint(text: str) -> str:
    return shown(f"constraints: {text}")


@pytest.mark.parametrize(
    ("once", "by_hand"),
    [
        ("for k in 1..3: q{k}'' = u{k};", "q1'' = u1; q2'' = u2; q3'' = u3;"),
        ("for k in 1..3: [0]: q{k};", "[0]: q1; [0]: q2; [0]: q3;"),
        ("for leg in FL, RR: {leg}_fz >= 0;", "FL_fz >= 0; RR_fz >= 0;"),
        ("for leg in FL, RR: joint.{leg}_knee <= 1;", "joint.FL_knee <= 1; joint.RR_knee <= 1;"),
        (
            'for side in left, right: joint."{side}/hip" <= 1;',
            'joint."left/hip" <= 1; joint."right/hip" <= 1;',
        ),
        ("for j in joint.hip, joint.knee: {j}' <= 1;", "joint.hip' <= 1; joint.knee' <= 1;"),
        ("for k in 2..3: q{k} = q{k-1} + {k};", "q2 = q1 + 2; q3 = q2 + 3;"),
        ("for k in 1..2: q{2*k - 1}[{10*k}] = x{k}y;", "q1[10] = x1y; q3[20] = x2y;"),
        ("for k in 4, 7..8: q{k};", "q4; q7; q8;"),
        ("for s in -1, 1: x^{s} + {s}^2*y;", "x^(-1) + (-1)^2*y; x^1 + 1^2*y;"),
        (
            "for j in 1..2: for k in 1..2: a{j}{k} = b{k}_{j};",
            "a11 = b1_1; a12 = b2_1; a21 = b1_2; a22 = b2_2;",
        ),
        ("for j in 1..3: for k in 1..j-1: q{k} <= q{j};", "q1 <= q2; q1 <= q3; q2 <= q3;"),
        ("for k in 1..2: { [0]: q{k}; [n]: q{k} = 1; } ", "[0]: q1; [n]: q1 = 1; [0]: q2; [n]: q2 = 1;"),
        ("sum(k in 1..3: m{k}*q{k}'^2) = 1;", "(m1*q1'^2 + m2*q2'^2 + m3*q3'^2) = 1;"),
        ("2*sum(k in 1..2: (x - q{k})^2)';", "2*((x - q1)^2 + (x - q2)^2)';"),
        ("for k in 1..2: q{k} = sum(j in 1..k-1: w{j}{k});", "q1 = 0; q2 = w12;"),
        ("for k in 1..2: q{k}; # of {k}\n x;", "q1; q2; x;"),
        ("for k in 1..2: { q{k}; # of {k}; a ';\n p{k}; }", "q1; p1; q2; p2;"),
    ],
)
def test_what_is_repeated_is_what_would_be_written_by_hand(once: str, by_hand: str) -> None:
    assert constraint(once) == constraint(by_hand)


def test_lists_of_names_and_whole_sections_repeat() -> None:
    once = """constants: n = 4, for k in 1..2: m{k} = {k}/10;
    variables: for k in 1..2: q{k}, u{k};
    for k in 1..2: { constraints: [0]: q{k}; objective: [0, n]: u{k}^2; }"""
    by_hand = """constants: n = 4, m1 = 1/10; m2 = 2/10;
    variables: q1, u1; q2, u2;
    constraints: [0]: q1; objective: [0, n]: u1^2;
    constraints: [0]: q2; objective: [0, n]: u2^2;"""
    assert shown(once) == shown(by_hand)


RODS = """
constants: n = 6, h = 0.1;
variables: for k in 1..3: q{k}, u{k};
constraints:
  for k in 1..3: { [0, n]: q{k}'' = u{k}; [0]: q{k}; q{k}'; [n]: q{k} = {k}; }
objective: [0, n]: integral(sum(k in 1..3: u{k}^2));
"""


def test_statements_that_are_told_of_are_written_out_and_stand_where_they_were_written() -> None:
    problem = read_problem(Source("rods.stc", RODS))
    ends = [relation for relation in problem.relations if relation.text in ("q1 = 1", "q2 = 2", "q3 = 3")]
    assert [relation.text for relation in ends] == ["q1 = 1", "q2 = 2", "q3 = 3"]
    assert {relation.span.location for relation in ends} == {"rods.stc:5:66"}


def test_a_constant_may_count_and_then_stays_what_the_text_says() -> None:
    text = """constants: n = 2, N = 3, half = 1/2;
    variables: for k in 1..N: q{k}; p;
    constraints: for k in 1..N-1: q{k+1} = q{k} + half; q1 = 1; p = q{N};
    objective: sum(k in 1..N: q{k}^2);"""
    model = Model(Source("count.stc", text))
    assert not model.problem().warnings
    assert model.solve()["p"][0] == pytest.approx(2.0)
    assert model.solve(half=1.0, N=3)["p"][0] == pytest.approx(3.0)
    with pytest.raises(UsageError, match="`N` cannot be set from outside"):
        model.solve(N=4)


def test_the_motion_is_that_of_the_text_written_out(tmp_path: Path) -> None:
    path = tmp_path / "rods.stc"
    path.write_text(RODS, encoding="utf-8")
    once = Model(Source("rods.stc", RODS, str(path))).solve()
    by_hand = Model(Source("rods.stc", shown(RODS))).solve()
    assert once.objective == pytest.approx(by_hand.objective, rel=1e-12)
    assert once.source == RODS  # what is saved is what was written
    assert list(once["q2"]) == pytest.approx(list(by_hand["q2"]), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "place", "parts"),
    [
        ("for k in 1..3: w{k} + q{k};", (4, 18), ("`w1` is not declared", "for k = 1", "did you mean `q1`")),
        ("for k in 1..3: q{k+1};", (4, 18), ("`q4` is not declared", "for k = 3")),
        ("for k in 1..2: k*q{k};", (4, 18), ("`k` is not declared", "write `{k}`")),
        ("for k in 1..N: q{k};", (4, 15), ("`N`", "write a whole number", "`constants: N = 10;`")),
        ("for k in 1..n: q{k};", (4, 15), ("`n`", "write a whole number")),
        ("for k = 1..3: q{k};", (4, 3), ("write `for k in 1..10",)),
        ("for (k in 1..3): q{k};", (4, 3), ("write `for k in 1..10",)),
        ("for k in 1..3 q{k};", (4, 17), ("expected `:`",)),
        ("for k in 3..1: q{k};", (4, 12), ("stands for nothing",)),
        ("for k in 1..3: q{j};", (4, 20), ("`j`", "may hold `k`")),
        ("for k in 1..3: q{k-2};", (4, 20), ("-1 for k = 1",)),
        ("for k in 2..3: q{k/2};", (4, 20), ("3/2", "for k = 3")),
        ("for k in 1..3: { q{k};", (4, 18), ("not closed",)),
        ("for k in 1..3: q{k}", (4, 21), ("expected `;`",)),
        ("for k in 1..3: for k in 1..2: q{k};", (4, 22), ("a name of its own",)),
        ("for k in 1..300000000: q{k};", (4, 15), ("2000000 characters",)),
        ("for j in 1..3000: for k in 1..3000: q{k};", (4, 3), ("2000000 characters",)),
        ("for k in 1..3: q{k}; }", (4, 24), ("closes nothing",)),
        ("sum(k in 1..3: q{k};", (4, 22), ("not closed",)),
        ("for leg in FL, FR: q{leg+1};", (4, 24), ("the word `FL`",)),
        ("for k in 1:3: q{k};", (4, 14), ("write `1..3`",)),
        ("for k in [1, 3]: q{k};", (4, 12), ("`1, 3`",)),
        ("for k in range(1, 4): q{k};", (4, 12), ("write `1..3`",)),
        ("q{1};", (4, 4), ("braces belong to repetitions",)),
    ],
)
def test_a_mistake_is_told_at_its_place_in_what_was_written_and_for_what(
    text: str, place: tuple[int, int], parts: tuple[str, ...]
) -> None:
    source = Source("a.stc", f"constants: n = 20;\nvariables: q1, q2, q3, x;\nconstraints:\n  {text}\n")
    with pytest.raises(SpecError) as caught:
        read_problem(source)
    first = caught.value.diagnostics[0]
    assert first.span is not None
    assert (first.span.line, first.span.column) == place
    assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_a_mistake_in_what_is_repeated_is_told_of_once() -> None:
    source = Source("a.stc", "constants: n = 2; variables: x; constraints: for k in 1..50: x = w{k};")
    with pytest.raises(SpecError) as caught:
        read_problem(source)
    assert len(caught.value.diagnostics) == 1


def test_carets_mark_the_braces_whole() -> None:
    source = Source("a.stc", "constants: n = 2;\nvariables: x;\nconstraints: for k in 10..12: x = wide{k}*x;")
    with pytest.raises(SpecError) as caught:
        read_problem(source)
    assert "\n      |                                   ^^^^^^^\n" in str(caught.value)


def test_names_that_are_no_repetitions_stay_names() -> None:
    assert constraint("for = 1; in*sum = k;") == "constraints:\n  for = 1;\n  in*sum = k;"


def test_multipliers_stand_on_the_line_that_the_statement_was_written_on() -> None:
    text = RODS.replace("[n]: q{k} = {k};", "[n]:\n  2*q{k} + q{k}' = {k};")
    solution = Model(Source("rods.stc", text)).solve()
    marked = {
        line.number: [mark.text for mark in line.marks] for line in listing(solution, statements_of(solution))
    }
    assert [text for text in marked[5] if "u" in text] == [f"q{k}'' = u{k}" for k in (1, 2, 3)]
    assert marked[6] == [f"2*q{k} + q{k}' = {k}" for k in (1, 2, 3)]


def test_a_name_that_got_into_a_repetition_is_told_so() -> None:
    source = Source("a.stc", "constants: n = 2;\nvariables: for k in 1..3: q{k}, x;")
    with pytest.raises(SpecError, match="end that with `;` before `x`"):
        read_problem(source)
