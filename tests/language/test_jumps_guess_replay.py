import pytest
from reading import c, i, messages_of, p, problem_of, t, v, warnings_of

from stc.errors import UsageError
from stc.symbolic.expr import num

JUMPS = "constants: n = 20, a = n/4; variables: x, u; method: {}; constraints: x'' = u; jumps: {}"


def jumps_of(text: str, method: str = "trapezoidal") -> list[tuple[int, str, int]]:
    return [(jump.frame, jump.name, jump.order) for jump in problem_of(JUMPS.format(method, text)).jumps]


def test_jumps_name_quantities_at_frames() -> None:
    assert jumps_of("[a]: x', u; [12]: u;") == [(5, "x", 1), (5, "u", 0), (12, "u", 0)]
    assert jumps_of("[3, 5]: u;") == [(3, "u", 0), (4, "u", 0), (5, "u", 0)]
    assert jumps_of("[0]: x'; [n]: x'; [0]: x';") == [(0, "x", 1), (20, "x", 1)]


@pytest.mark.parametrize(
    "text", ["u;", "[3]: u + x;", "[3]: n;", "[3]: u[3];", "[21]: u;", "[3]: (x*u)';", "[3]: 2;"]
)
def test_what_cannot_jump(text: str) -> None:
    assert len(messages_of(JUMPS.format("trapezoidal", text))) == 1


def test_central_differences_know_no_jumps() -> None:
    message = "the method `central` does not support jumps"
    assert messages_of(JUMPS.format("central", "[3]: u; [4]: u;")) == [message]
    assert messages_of(JUMPS.format("trapezoidal", "[3]: u;"), "central") == [message]
    assert messages_of(JUMPS.format("central", "[3]: u;"), "hermite-simpson") == []


def test_a_jump_of_what_is_never_used_is_warned_about() -> None:
    text = JUMPS.format("trapezoidal", "[a]: x''', u;")
    assert warnings_of(text) == ["`x'''` is used nowhere, so its jump changes nothing"]


# ------------------------------------------------------------------- methods

MOTION = "constants: n = 4; variables: x; constraints: x'' = 1;"


def test_the_method_of_the_file_and_from_outside() -> None:
    assert problem_of(MOTION).method == "central"
    assert problem_of(MOTION + "method: hermite-simpson;").method == "hermite-simpson"
    assert problem_of(MOTION + "method: hermite-simpson;", "trapezoidal").method == "trapezoidal"
    assert problem_of(MOTION + "method: central; method: central;").method == "central"


def test_unknown_methods() -> None:
    assert messages_of(MOTION + "method: simpson;") == ["there is no method `simpson`"]
    with pytest.raises(UsageError, match="did you mean `trapezoidal`"):
        problem_of(MOTION, "trapezodial")


def test_the_warning_about_uncoupled_frames() -> None:
    text = "constants: n = 8; variables: x, y; {} constraints: {}"
    message = "`x'` appears but `x''` never does: central differences leave the odd and even frames of `x` uncoupled"
    assert warnings_of(text.format("", "x' = y;")) == [message]
    assert warnings_of(text.format("", "x' = y; [0]: x'' = 1;")) == []
    assert warnings_of(text.format("", "x' = y;"), "trapezoidal") == []
    assert warnings_of(text.format("definitions: e = x*x;", "e' = y;")) == [message]
    assert warnings_of(text.format("definitions: [0, 3]: e = x; [4, n]: e = y;", "e' = y + x'';")) == [
        message.replace("x", "y")
    ]
    assert warnings_of(text.format("objective: x'^2;", "x = y;")) == [message]


# ------------------------------------------------------------------- guesses

GUESS = (
    "constants: n = 20, T = 2; variables: x, u; parameters: P; method: trapezoidal; constraints: x'' = u*P*T;"
)


def test_guesses_are_expressions_of_constants_time_and_index() -> None:
    problem = problem_of(f"{GUESS} guess: x = T*i/n; u = pi*t; [0, 4]: u = 3; P = 2*T;")
    assert [(guess.name, str(guess.range)) for guess in problem.guesses] == [
        ("x", "[0, 20]"),
        ("u", "[0, 20]"),
        ("u", "[0, 4]"),
        ("P", "[0, 4]"),
    ]
    assert problem.guesses[0].body is c("T") * i / c("n")
    assert set(map(type, problem.guesses[1].body.args)) == {type(t)}
    assert problem.guesses[3].body is num(2.0) * c("T")


def test_guesses_may_use_definitions_and_starting_values_of_parameters() -> None:
    extra = "definitions: mean = T/2; [0, 9]: ramp = i; [10, n]: ramp = 20 - i;"
    problem = problem_of(f"{GUESS} {extra} guess: [5, n]: x = mean*ramp; u = P;")
    assert [(str(guess.range), guess.body) for guess in problem.guesses] == [
        ("[5, 9]", (c("T") / 2.0) * i),
        ("[10, 20]", (c("T") / 2.0) * (num(20.0) - i)),
        ("[5, 20]", p("P")),
    ]


@pytest.mark.parametrize(
    "text", ["x = u;", "P = t;", "P = P;", "T = 3;", "zz = 3;", "n = 3;", "x = x';", "x = inf;"]
)
def test_what_cannot_be_guessed(text: str) -> None:
    assert len(messages_of(f"{GUESS} guess: {text}")) == 1


# -------------------------------------------------------------------- replay

REPLAY = "constants: n = 20, m = 2; variables: x, f; parameters: P; constraints: m*x'' = f*P; replay: {}"


def test_replay_ties_expressions_to_a_model() -> None:
    problem = problem_of(
        REPLAY.format(
            """model = "models/cart.xml";
            joint slide = x + 1;
            actuator "push motor" = 2*f;
            compare body.cart.x = x;
            set body.cart.mass = m;
            set geom."left wheel".size.x = m/2 + P;"""
        )
    )
    assert problem.model == "models/cart.xml"
    assert [(channel.kind, channel.path) for channel in problem.replay] == [
        ("joint", ("slide",)),
        ("actuator", ("push motor",)),
        ("compare", ("body", "cart", "x")),
        ("set", ("body", "cart", "mass")),
        ("set", ("geom", "left wheel", "size", "x")),
    ]
    assert problem.replay[1].body is num(2.0) * v("f")
    assert problem.replay[3].body is c("m")


@pytest.mark.parametrize(
    "text",
    [
        'model = "a.xml"; model = "b.xml";',
        'model = "a.xml"; joint q = x; joint q = f;',
        "joint q = x;",
        'model = "a.xml"; set body.cart.mass = x;',
        'model = "a.xml"; set mass = m;',
        'model = "a.xml"; joint q = x*i;',
        'model = "a.xml"; joints q = x;',
        'model = "a.xml"; joint = x;',
        "model = a;",
        'model = "a.xml"; joint q. = x;',
    ],
)
def test_mistakes_in_replay(text: str) -> None:
    assert len(messages_of(REPLAY.format(text))) == 1


def test_names_used_by_the_replay_alone_are_used() -> None:
    text = 'constants: n = 3, r = 1; variables: x; constraints: x = 1; replay: model = "a.xml"; set body.a.size = r;'
    assert warnings_of(text) == []
