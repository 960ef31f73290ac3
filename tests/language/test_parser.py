import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stc.errors import Source, SpecError
from stc.language import parse
from stc.language.parser import parse_expression
from stc.language.show import show_expression, show_syntax
from stc.language.syntax import (
    Assignment,
    Call,
    Channel,
    Declaration,
    Expression,
    Index,
    JumpList,
    MethodChoice,
    ModelFile,
    Name,
    Negate,
    Number,
    Power,
    Prime,
    Product,
    Relation,
    Sum,
    names,
)


def expression(text: str) -> Expression:
    return parse_expression(Source("a.stc", text))


def name(word: str) -> Name:
    return Name(0, 0, word)


def number(value: float) -> Number:
    return Number(0, 0, value)


a, b, x = name("a"), name("b"), name("x")


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        ("a + b - x", Sum(0, 0, [("+", a), ("+", b), ("-", x)])),
        ("a - (b - x)", Sum(0, 0, [("+", a), ("-", Sum(0, 0, [("+", b), ("-", x)]))])),
        ("a/b*x", Product(0, 0, [("*", a), ("/", b), ("*", x)])),
        ("-a*b", Product(0, 0, [("*", Negate(0, 0, a)), ("*", b)])),
        ("a*-b", Product(0, 0, [("*", a), ("*", Negate(0, 0, b))])),
        ("-x^2", Negate(0, 0, Power(0, 0, x, number(2)))),
        ("x^-2", Power(0, 0, x, Negate(0, 0, number(2)))),
        ("a^b^x", Power(0, 0, a, Power(0, 0, b, x))),
        ("(a^b)^x", Power(0, 0, Power(0, 0, a, b), x)),
        ("x^-a^b", Power(0, 0, x, Negate(0, 0, Power(0, 0, a, b)))),
        ("--x", Negate(0, 0, Negate(0, 0, x))),
        ("+x", x),
        ("a - -b", Sum(0, 0, [("+", a), ("-", Negate(0, 0, b))])),
        ("x'^2", Power(0, 0, Prime(0, 0, x, 1), number(2))),
        ("-x''", Negate(0, 0, Prime(0, 0, x, 2))),
        ("x' '", Prime(0, 0, x, 2)),
        ("(a*x)'", Prime(0, 0, Product(0, 0, [("*", a), ("*", x)]), 1)),
        ("(x')'", Prime(0, 0, x, 2)),
        ("sin(x)'", Prime(0, 0, Call(0, 0, "sin", [x]), 1)),
        ("x'[a]", Index(0, 0, Prime(0, 0, x, 1), a)),
        ("x[a]'", Prime(0, 0, Index(0, 0, x, a), 1)),
        ("x[a]^2", Power(0, 0, Index(0, 0, x, a), number(2))),
        ("atan2(a, b + x)", Call(0, 0, "atan2", [a, Sum(0, 0, [("+", b), ("+", x)])])),
        ("1e3", number(1000.0)),
    ],
)
def test_binding(text: str, tree: Expression) -> None:
    assert expression(text) == tree


def test_nodes_know_their_characters() -> None:
    text = "m*x''[k + 1] - sin(-q)"
    tree = expression(text)
    assert isinstance(tree, Sum)
    assert text[tree.start : tree.end] == text
    product, sine = tree.terms[0][1], tree.terms[1][1]
    assert text[product.start : product.end] == "m*x''[k + 1]"
    assert text[sine.start : sine.end] == "sin(-q)"
    assert isinstance(sine, Call)
    assert text[sine.arguments[0].start : sine.arguments[0].end] == "-q"


@pytest.mark.parametrize(
    "text",
    ["", "x +", "(x", "x)", "x y", "2 x", "sin(x", "x[1", "*x", "x''y", "f(,)", "x[]", "'x", "x;", "()"],
)
def test_what_is_no_expression_is_refused(text: str) -> None:
    with pytest.raises(SpecError):
        expression(text)


def test_a_sum_of_thousands_of_terms_is_flat_and_deep_nesting_is_refused() -> None:
    tree = expression("+".join(["x"] * 20_000))
    assert isinstance(tree, Sum)
    assert len(tree.terms) == 20_000
    assert expression("(" * 90 + "x" + ")" * 90) == x
    for text in (
        "(" * 20_000 + "x" + ")" * 20_000,
        "-" * 20_000 + "x",
        "x^" * 20_000 + "x",
        "x" + "[0]" * 20_000,
    ):
        with pytest.raises(SpecError):
            expression(text)


plain_names = st.sampled_from(["a", "b", "x", "tau1"]).map(name)
literals = st.floats(min_value=0, allow_nan=False, allow_infinity=False).map(number)


def compound(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    def flat(kind: type[Sum] | type[Product], operators: tuple[str, str]) -> st.SearchStrategy[Expression]:
        others = st.lists(st.tuples(st.sampled_from(operators), inner), min_size=1, max_size=4)
        return st.tuples(inner, others).map(lambda made: kind(0, 0, [(operators[0], made[0]), *made[1]]))

    def primed(made: tuple[Expression, int]) -> Expression:
        operand, order = made
        return (
            Prime(0, 0, operand.operand, operand.order + order)
            if isinstance(operand, Prime)
            else Prime(0, 0, operand, order)
        )

    return st.one_of(
        flat(Sum, ("+", "-")),
        flat(Product, ("*", "/")),
        inner.map(lambda e: Negate(0, 0, e)),
        st.tuples(inner, inner).map(lambda made: Power(0, 0, *made)),
        st.tuples(inner, st.integers(1, 3)).map(primed),
        st.tuples(inner, inner).map(lambda made: Index(0, 0, *made)),
        st.tuples(st.sampled_from(["sin", "f"]), st.lists(inner, max_size=3)).map(lambda m: Call(0, 0, *m)),
    )


@settings(max_examples=300, deadline=None)
@given(st.recursive(st.one_of(plain_names, literals), compound, max_leaves=25))
def test_what_is_printed_reads_back_as_the_same_tree(tree: Expression) -> None:
    assert expression(show_expression(tree)) == tree


SPEC = """
# every kind of statement
constants: n = 60, h = 1/30, m;
constants: g = 9.8;
variables: x, y;
parameters: T;
definitions: e = x'^2/2; [0, n/2]: u = 3; [n/2, n]: u = -3;
guess: x = t; [0]: T = 3;
constraints:
  x - 1;
  [0, n]: m*x'' = u; 0 <= x <= 3; 3 >= y >= 0;
  [k]: x' = x'[0];
jumps: [20]: x', y;
lagrangian: m*x'^2/2 - m*g*y;
forces: x: u; [0, 5]: y: -2*y';
method: hermite-simpson;
replay:
  model = "cart.xml";
  joint slide = x;
  set body."big ball".mass = m;
objective:
  [0, n]: integral(x''^2);
"""


def test_sections_and_their_statements() -> None:
    tree = parse(Source("a.stc", SPEC))
    assert [section.kind for section in tree.sections] == [
        "constants",
        "constants",
        "variables",
        "parameters",
        "definitions",
        "guess",
        "constraints",
        "jumps",
        "lagrangian",
        "forces",
        "method",
        "replay",
        "objective",
    ]
    statements = {
        kind: [statement for block in tree.blocks(kind) for statement in block.statements]
        for kind in dict.fromkeys(section.kind for section in tree.sections)
    }
    assert [s.name.name for s in statements["constants"] if isinstance(s, Declaration)] == [
        "n",
        "h",
        "m",
        "g",
    ]
    assert statements["constants"][2] == Declaration(0, 0, name("m"), None)
    assert [s.name.name for s in statements["definitions"] if isinstance(s, Assignment)] == ["e", "u", "u"]
    chain = statements["constraints"][2]
    assert isinstance(chain, Relation) and chain.operators == ["<=", "<="] and len(chain.operands) == 3
    assert statements["jumps"] == [JumpList(0, 0, [Prime(0, 0, x, 1), name("y")])]
    assert statements["method"] == [MethodChoice(0, 0, "hermite-simpson")]
    assert statements["replay"] == [
        ModelFile(0, 0, "cart.xml"),
        Channel(0, 0, "joint", ("slide",), x),
        Channel(0, 0, "set", ("body", "big ball", "mass"), name("m")),
    ]


def test_headers_hold_up_to_the_next_one() -> None:
    tree = parse(Source("a.stc", SPEC))
    blocks = list(tree.blocks("constraints"))
    assert [None if block.header is None else block.header.last is None for block in blocks] == [
        None,
        False,
        True,
    ]
    assert [len(block.statements) for block in blocks] == [1, 3, 1]


def test_a_printed_spec_reads_back_as_the_same_tree() -> None:
    tree = parse(Source("a.stc", SPEC))
    assert parse(Source("b.stc", show_syntax(tree))).sections == tree.sections


def test_white_space_and_line_breaks_do_not_matter() -> None:
    squeezed = "constants:n=3;variables:x,y;constraints:[0,n]:x''=y;x'[0]\n=\n3;"
    spread = """constants :
    n
    =
    3 ; variables
    : x
    , y ; constraints : [ 0 , n ]
    : x ' ' = y ; x ' [ 0 ] = 3 ;"""
    assert parse(Source("a", squeezed)).sections == parse(Source("b", spread)).sections


def test_a_range_header_after_a_forgotten_semicolon_is_still_a_header() -> None:
    with pytest.raises(SpecError) as caught:
        parse(Source("a.stc", "constraints:\n [0]: x = 1\n [n]: x = 2;\n [0, n]: x <= 3\nobjective: x;"))
    assert [d.message for d in caught.value.diagnostics] == ["expected `;` after the constraint"] * 2
    assert [d.span.line for d in caught.value.diagnostics if d.span] == [2, 4]


def test_reading_goes_on_after_each_mistake() -> None:
    text = "constants: a = ;\nvariables: 3;\nconstraints: x + ; (x; [0]: y = = 2; x y; z;\nobjective: );"
    with pytest.raises(SpecError) as caught:
        parse(Source("a.stc", text))
    assert [d.span.line for d in caught.value.diagnostics if d.span] == [1, 2, 3, 3, 3, 3, 4]


def test_names_of_an_expression_in_the_order_of_the_text() -> None:
    assert names(expression("b*sin(a)[k] - x'/a^tau1")) == ["b", "a", "k", "x", "tau1"]


@pytest.mark.parametrize("nest", [lambda k: "(" * k + "x" + ")" * k, lambda k: "x^" * k + "x"])
def test_a_hundred_parentheses_or_powers_within_each_other_are_read(nest) -> None:
    parse_expression(Source("nested", nest(100)))
    with pytest.raises(SpecError, match="nested more than 100 deep"):
        parse_expression(Source("nested", nest(101)))
