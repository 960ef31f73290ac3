import pytest
from reading import c, i, messages_of, p, problem_of, v, warnings_of

from stc.symbolic.expr import Expr, num

NAMES = "constants: n = 10, w = 2; variables: a, b; parameters: T;"


def terms_of(text: str, extra: str = "") -> list[tuple[Expr, bool]]:
    problem = problem_of(f"{NAMES} {extra} objective: {text}")
    return [(term.body, term.integral) for term in problem.objective]


a, b, T, w = v("a"), v("b"), p("T"), c("w")


@pytest.mark.parametrize(
    ("text", "terms"),
    [
        ("a^2 + b;", [(a * a + b, False)]),
        ("integral(a);", [(a, True)]),
        ("-integral(a);", [(-a, True)]),
        ("w*integral(a) - integral(b)/2 + w*T;", [(w * a, True), (-(b / 2.0), True), (w * T, False)]),
        ("3 + integral(a) - b;", [(a, True), (num(3.0) - b, False)]),
        ("-(integral(a) - T*(integral(b) + a));", [(-a, True), (T * b, True), (T * a, False)]),
        ("integral(a)*w*T;", [(w * a * T, True)]),
        ("(T + w)^2*integral(a);", [((T + w) * (T + w) * a, True)]),
        ("integral(a*i);", [(a * i, True)]),
    ],
)
def test_terms(text: str, terms: list[tuple[Expr, bool]]) -> None:
    found = terms_of(f"[0]: {text}")
    assert [integral for _, integral in found] == [integral for _, integral in terms]
    for (body, _), (expected, _) in zip(found, terms):
        difference = body - expected
        # sums may be taken in another order: compare what they are, not how they are written
        from stc.symbolic.expr import evaluate, symbols

        for values in ({}, {"a": 0.7, "b": -1.3, "T": 2.5, "w": 0.3}):
            numbers = {k: values.get(getattr(k, "name", "i"), 1.0) for k in symbols(difference)}
            assert abs(evaluate(difference, numbers)) < 1e-14


def test_integrals_by_name() -> None:
    extra = "definitions: J = integral(a^2) + T; K = w*J - integral(b);"
    assert terms_of("[0]: J;", extra + "constraints: [0]: a = 1;")[0] == (a * a, True)
    found = terms_of("[0]: 2*K;", extra)
    assert [integral for _, integral in found] == [True, True, False]
    assert found[1][0] is num(-2.0) * b or found[1][0] is -(num(2.0) * b)


@pytest.mark.parametrize(
    "text",
    [
        "integral(a)*integral(b);",
        "1/integral(a);",
        "b*integral(a);",
        "i*integral(a);",
        "sin(integral(a));",
        "integral(a)^2;",
        "integral(integral(a));",
        "integral(a, b);",
        "integral(a)';",
        "a = b;",
        "a <= 3;",
        "integral(after(a));",
    ],
)
def test_what_is_no_objective(text: str) -> None:
    assert len(messages_of(f"{NAMES} objective: {text}")) == 1


def test_an_integral_elsewhere_is_refused_with_advice() -> None:
    text = f"{NAMES} definitions: J = integral(a); constraints: integral(a) <= 3; J = 2; guess: b = J;"
    messages = messages_of(text)
    assert len(messages) == 3
    assert all("may only stand as a term of the objective" in message for message in messages)


def test_a_sum_of_parameters_over_several_frames_is_warned_about() -> None:
    constraints = "constraints: a'' = b*w*T;"
    message = "this term is the same on every frame and counts 11 times"
    assert warnings_of(f"{NAMES} {constraints} objective: T^2;") == [message]
    assert warnings_of(f"{NAMES} {constraints} objective: [0, n]: integral(a) + w*T;") == [message]
    assert warnings_of(f"{NAMES} {constraints} objective: [0]: T^2; [n]: w*T;") == []
    assert warnings_of(f"{NAMES} {constraints} objective: T*a; integral(T); w;") == []


def test_an_objective_may_be_absent_or_constant() -> None:
    assert problem_of(f"{NAMES} constraints: a'' = b*w*T;").objective == []
    assert terms_of("w;") == [(w, False)]
