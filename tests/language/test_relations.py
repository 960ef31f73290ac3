import pytest
from reading import c, i, messages_of, p, problem_of, t, v, warnings_of

from stc.problem import Relation
from stc.symbolic.expr import ZERO, Expr, num, sub

NAMES = "constants: n = 10, lo = -1, hi = 2; variables: x, y; parameters: T; method: trapezoidal;"


def relations_of(text: str, extra: str = "") -> list[Relation]:
    return list(problem_of(f"{NAMES} {extra} constraints: {text}").relations)


def bounded(text: str, extra: str = "") -> tuple[Expr | None, Expr, Expr | None]:
    (relation,) = relations_of(text, extra)
    return relation.lower, relation.body, relation.upper


x, y, T = v("x"), v("y"), p("T")


@pytest.mark.parametrize(
    ("text", "lower", "body", "upper"),
    [
        ("x;", ZERO, x, ZERO),
        ("x - hi;", ZERO, sub(x, c("hi")), ZERO),
        ("x = hi;", c("hi"), x, c("hi")),
        ("hi = x;", c("hi"), x, c("hi")),
        ("x <= hi;", None, x, c("hi")),
        ("x >= lo;", c("lo"), x, None),
        ("hi >= x;", None, x, c("hi")),
        ("lo <= x;", c("lo"), x, None),
        ("lo <= x <= hi;", c("lo"), x, c("hi")),
        ("hi >= x >= lo;", c("lo"), x, c("hi")),
        ("-inf <= x <= hi;", None, x, c("hi")),
        ("lo <= x <= inf;", c("lo"), x, None),
        ("inf >= x >= lo;", c("lo"), x, None),
        ("x + y <= hi/2;", None, x + y, c("hi") / 2.0),
        ("x <= i*t + hi;", None, x, i * t + c("hi")),
        ("x = y;", ZERO, sub(x, y), ZERO),
        ("x <= y;", None, sub(x, y), ZERO),
        ("x >= y;", ZERO, sub(x, y), None),
        ("x + 1 >= y + T;", ZERO, sub(x + 1.0, y + T), None),
        ("T >= 0.1;", num(0.1), T, None),
        ("x[0] = x[n];", ZERO, sub(v("x", 0, 0, 0), v("x", 0, 0, 10)), ZERO),
        ("2 <= T <= 2;", num(2.0), T, num(2.0)),
    ],
)
def test_relations(text: str, lower: Expr | None, body: Expr, upper: Expr | None) -> None:
    assert bounded(text) == (lower, body, upper)


def test_equalities_have_the_same_bound_on_both_sides() -> None:
    (relation,) = relations_of("x = hi;")
    assert relation.is_equality
    (relation,) = relations_of("lo <= x <= hi;")
    assert not relation.is_equality


def test_a_chain_with_moving_ends_becomes_two_relations() -> None:
    first, second = relations_of("-y <= x <= hi*y;")
    assert (first.lower, first.body, first.upper) == (None, sub(-y, x), ZERO)
    assert (second.lower, second.body, second.upper) == (None, sub(x, c("hi") * y), ZERO)
    assert first.text == second.text == "-y <= x <= hi*y"


def test_a_chain_with_one_fixed_end() -> None:
    first, second = relations_of("lo <= x <= y;")
    assert (first.lower, first.body, first.upper) == (c("lo"), x, None)
    assert (second.lower, second.body, second.upper) == (None, sub(x, y), ZERO)


def test_a_long_chain_orders_its_members() -> None:
    found = relations_of("0 <= x <= y <= T <= hi;")
    assert [(r.lower, r.body, r.upper) for r in found] == [
        (ZERO, x, None),
        (None, sub(x, y), ZERO),
        (None, sub(y, T), ZERO),
        (None, T, c("hi")),
    ]


def test_infinite_bounds_alone_say_nothing() -> None:
    assert relations_of("x <= inf; -inf <= y <= inf;") == []


def test_infinite_constants_are_bounds_like_others() -> None:
    assert bounded("-big <= x <= big;", "constants: big = inf;") == (-c("big"), x, c("big"))


def test_time_is_no_bound_while_the_steps_are_unknown() -> None:
    assert bounded("x = t;", "definitions: h = T/n;") == (ZERO, sub(x, t), ZERO)
    assert bounded("x = t;", "definitions: h = hi/n;") == (t, x, t)
    assert bounded("x = hi*h;", "definitions: h = T/n;") == (ZERO, sub(x, c("hi") * (T / c("n"))), ZERO)
    ranged = "definitions: [0, 4]: h = 1; [5, n]: h = {};"
    assert bounded("x = t;", ranged.format("hi")) == (t, x, t)
    assert bounded("x = t;", ranged.format("T")) == (ZERO, sub(x, t), ZERO)


@pytest.mark.parametrize(
    "text", ["0 <= x >= 3;", "x = y = 0;", "0 = x <= 1;", "x = inf;", "x >= inf;", "-inf >= x;", "inf + x;"]
)
def test_what_is_no_relation(text: str) -> None:
    assert len(messages_of(f"{NAMES} constraints: {text}")) == 1


def test_the_text_of_a_statement_is_one_line_without_comments() -> None:
    (relation,) = relations_of("x +   # first\n   y\n\n = hi;")
    assert relation.text == "x + y = hi"
    assert relation.span.text.startswith("x +   # first")


def test_contradictory_bounds_are_no_mistake() -> None:
    assert len(relations_of("x <= 1; x >= 3; 2 <= y <= 1;")) == 3


def test_a_constraint_without_an_unknown_is_kept_and_warned_about() -> None:
    text = f"{NAMES} constraints: x = y*T; hi >= 1; lo + 1;"
    assert warnings_of(text) == ["this constraint contains no unknown"] * 2
    assert [str(r.text) for r in problem_of(text).relations] == ["x = y*T", "hi >= 1", "lo + 1"]
