from reading import problem_of

from stc.errors import Source
from stc.language import parse
from stc.language.show import show_problem, show_syntax, show_tokens

SPEC = """constants: n = 8, m = 2;  variables: x, f;  parameters: T;
definitions: h = T/n; [0, 3]: s = 1; [4, n]: s = -1;
method: trapezoidal;
jumps: [4]: f;
guess: T = 3;
constraints: m*(x'') = f*s; [0]: 0.1 <= T <= 5; x = 0; [4]: after(f) >= -1;
objective: integral(f^2); [0]: 3*T;
replay: model = "cart.xml"; joint "my slide" = x;
"""


def test_tokens_with_their_places() -> None:
    lines = show_tokens(Source("a.stc", "x'' =\n 2;")).splitlines()
    assert [line.split() for line in lines] == [
        ["1:1", "name", "x"],
        ["1:2", "prime", "''"],
        ["1:5", "symbol", "="],
        ["2:2", "number", "2"],
        ["2:3", "symbol", ";"],
        ["2:4", "end"],
    ]


def test_syntax_in_canonical_form() -> None:
    assert (
        show_syntax(parse(Source("a.stc", SPEC)))
        == """constants:
  n = 8,
  m = 2;
variables:
  x, f;
parameters:
  T;
definitions:
  h = T/n;
  [0, 3]:
    s = 1;
  [4, n]:
    s = -1;
method:
  trapezoidal;
jumps:
  [4]:
    f;
guess:
  T = 3;
constraints:
  m*x'' = f*s;
  [0]:
    0.1 <= T <= 5;
    x = 0;
  [4]:
    after(f) >= -1;
objective:
  integral(f^2);
  [0]:
    3*T;
replay:
  model = "cart.xml";
  joint "my slide" = x;"""
    )


def test_problem_with_names_looked_up() -> None:
    assert (
        show_problem(problem_of(SPEC))
        == """test: frames 0 to 8, step T/n, method trapezoidal
constants:
  n = 8  # shapes the problem
  m = 2
variables:
  x, f
parameters:
  T
definitions:
  h = T/n
  [0, 3]: s = 1
  [4, 8]: s = -1
jumps:
  [4]: f
guess:
  [0, 8]: T = 3
constraints:
  [0, 8]: m*x'' - f*s = 0
  [0]: 0.1 <= T <= 5
  [0]: x = 0
  [4]: after(f) >= -1
objective:
  [0, 8]: integral(f^2)
  [0]: 3*T
replay:
  model = "cart.xml"
  joint my slide = x"""
    )


def test_expressions_too_large_for_text_are_counted() -> None:
    chain = "".join(f"d{k} = d{k + 1}*sin(d{k + 1});" for k in range(40)) + "d40 = x;"
    text = show_problem(
        problem_of(f"constants: n = 3; variables: x; definitions: {chain} constraints: d0 = 1;")
    )
    assert "(an expression of" in text
    assert len(text) < 3_000_000
